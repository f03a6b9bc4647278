//! Control laws that invert a model.

use hydroid_core::control::{
    AdaptiveAugmentation, Backstepping, ControlError, Controller, Estimate, FeedbackLinearization, Status,
};
use hydroid_core::memory::Memory;

use super::channel_map::ChannelMap;
use super::controller::{ClosedLoopController, Observation};
use super::error::ClosedLoopError;
use super::reference::Timing;
use crate::model::{InvertibleModel, Model, WeightMap};

/// A control law whose model can be updated.
pub(super) trait InvertingLaw: Controller {
    fn model(&self) -> &InvertibleModel;

    fn change(&mut self, change: &mut dyn FnMut(&mut InvertibleModel)) -> Result<(), ControlError>;
}

impl InvertingLaw for FeedbackLinearization<InvertibleModel> {
    fn model(&self) -> &InvertibleModel {
        self.model()
    }

    fn change(&mut self, change: &mut dyn FnMut(&mut InvertibleModel)) -> Result<(), ControlError> {
        self.update(change)
    }
}

impl InvertingLaw for AdaptiveAugmentation<InvertibleModel> {
    fn model(&self) -> &InvertibleModel {
        self.base().model()
    }

    fn change(&mut self, change: &mut dyn FnMut(&mut InvertibleModel)) -> Result<(), ControlError> {
        self.update(change)
    }
}

impl InvertingLaw for Backstepping<InvertibleModel> {
    fn model(&self) -> &InvertibleModel {
        self.model()
    }

    fn change(&mut self, change: &mut dyn FnMut(&mut InvertibleModel)) -> Result<(), ControlError> {
        self.update(change)
    }
}

/// Weights of the law that follow those of an adapter.
struct AdaptedWeights {
    map: WeightMap,
    applied: Vec<f64>,
}

pub(super) struct InvertingController<L> {
    law: L,
    lead: f64,
    channels: ChannelMap,
    adapted: Option<AdaptedWeights>,
    y: Vec<f64>,
    actuators: Vec<f64>,
}

impl<L: InvertingLaw> InvertingController<L> {
    /// A control law for `model`, which follows `weights` of an adapter; an error if they are not those of the model.
    pub(super) fn new(
        law: L,
        lead: f64,
        channels: ChannelMap,
        model: &Model,
        weights: Option<usize>,
    ) -> Result<Self, ClosedLoopError> {
        let adapted = match weights.zip(model.weight_map()) {
            Some((weights, map)) if weights != map.len() => {
                return Err(ClosedLoopError::WeightCount { weights, coefficients: map.len() });
            }
            Some((_, map)) => Some(AdaptedWeights { map, applied: Vec::new() }),
            None => None,
        };
        let y = vec![f64::NAN; channels.len()];
        let actuators = vec![f64::NAN; law.inputs()];
        Ok(Self { law, lead, channels, adapted, y, actuators })
    }

    fn update_model(&mut self, weights: Option<&[f64]>) {
        if let Some(AdaptedWeights { map, applied }) = &mut self.adapted
            && let Some(weights) = weights
            && weights != applied.as_slice()
            && weights.iter().all(|w| w.is_finite())
        {
            applied.clear();
            applied.extend_from_slice(weights);
            // If the new model cannot be inverted, the law keeps the previous one.
            let _ = self.law.change(&mut |model| map.apply(applied, model));
        }
    }
}

impl<L: InvertingLaw + Send + Sync> ClosedLoopController for InvertingController<L> {
    fn lead(&self) -> f64 {
        self.lead
    }

    fn timing(&self) -> Timing {
        Timing::Clock
    }

    fn reset(&mut self) {
        self.law.reset();
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.law.visit_state(memory);
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64]) -> Status {
        self.channels.fill(observation.outputs, &mut self.y);
        self.update_model(observation.session.and_then(|session| session.weights));
        self.law.model().actuators_of(&self.y, &mut self.actuators);
        let current = observation.session.and_then(|session| session.predictor.current());
        let current = current.map_or([0.0; 2], |current| current.velocity);
        let estimate =
            Estimate { eta: observation.eta, nu: observation.nu, current, actuators: &self.actuators };
        self.law.command(&estimate, observation.reference, command)
    }
}
