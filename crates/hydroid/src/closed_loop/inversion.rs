//! Laws that invert a model, which may learn.

use std::sync::Arc;

use hydroid_core::actuator::Channel;
use hydroid_core::adapt::kalman::LearnablePlant;
use hydroid_core::control::{
    AdaptiveAugmentation, Affine, AffineEquations, AffineNetwork, AffinePlant, Backstepping, ControlError,
    Controller, Estimate, FeedbackLinearization, Motion, Status,
};
use hydroid_core::model::PlantModel;
use hydroid_core::model::sparse::Equations;
use hydroid_core::vessel::{Numbers, VesselParams};

use super::channel_map::ChannelMap;
use super::controller::{ClosedLoopController, Observation};
use super::error::ClosedLoopError;
use super::reference::Timing;
use super::session_model::SessionModel;
use crate::model::{Body, Model};

/// A model that a law can invert.
#[derive(Debug)]
pub(super) enum InvertibleModel {
    Equations(Box<AffineEquations>),
    Plant(Box<AffinePlant>),
    Network(Box<AffineNetwork>),
}

impl Clone for InvertibleModel {
    fn clone(&self) -> Self {
        match self {
            Self::Equations(equations) => Self::Equations(equations.clone()),
            Self::Plant(plant) => Self::Plant(plant.clone()),
            Self::Network(network) => Self::Network(network.clone()),
        }
    }

    /// Into the memory of one of the same kind: a law keeps the model from before an update, in each sample of a model that
    /// learns.
    fn clone_from(&mut self, from: &Self) {
        match (self, from) {
            (Self::Equations(into), Self::Equations(from)) => into.clone_from(from),
            (Self::Plant(into), Self::Plant(from)) => into.clone_from(from),
            (Self::Network(into), Self::Network(from)) => into.clone_from(from),
            (into, from) => *into = from.clone(),
        }
    }
}

impl InvertibleModel {
    /// Of a model whose `u`, `v`, `r` are these outputs.
    pub(super) fn of(model: &Model, motion: [usize; 3], law: &'static str) -> Result<Self, ClosedLoopError> {
        match &model.body {
            Body::Equations(equations) => {
                let description = &model.description;
                let ports = description.outputs.iter().chain(&description.inputs);
                let mut names: Vec<String> = ports.map(|port| port.channel.name.clone()).collect();
                let signals: Vec<String> =
                    equations.signals().iter().map(|s| s.name(&names, description.dt)).collect();
                names.extend(signals);
                match AffineEquations::new(equations, motion) {
                    Ok(affine) => Ok(Self::Equations(Box::new(affine))),
                    Err(why) => Err(ClosedLoopError::NotAffine {
                        law,
                        why: why.with_names(&names),
                        remedy: ", or identify with terms that have one function of each command (--for-control, or --term for each)",
                    }),
                }
            }
            Body::Plant(vessel) => Ok(Self::Plant(Box::new(AffinePlant::new(vessel.params())?))),
            Body::Affine(network) => Ok(Self::Network(Box::new(AffineNetwork::new(Arc::clone(network))?))),
            Body::Recurrent(_) | Body::Direct(_) => Err(ClosedLoopError::NotAffine {
                law,
                why: format!("a model of kind '{}' says nothing of how a command enters", model.kind()),
                remedy: "",
            }),
        }
    }

    /// Measured actuators, of a model that has them as outputs.
    fn actuators_of(&self, y: &[f64], into: &mut [f64; 2]) {
        match self {
            Self::Equations(equations) => equations.actuators_of(y, into),
            Self::Plant(_) | Self::Network(_) => into.fill(f64::NAN),
        }
    }
}

impl Affine for InvertibleModel {
    fn channels(&self) -> &[Channel] {
        match self {
            Self::Equations(equations) => equations.channels(),
            Self::Plant(plant) => plant.channels(),
            Self::Network(network) => network.channels(),
        }
    }

    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion) {
        match self {
            Self::Equations(equations) => equations.evaluate(nu, into),
            Self::Plant(plant) => plant.evaluate(nu, into),
            Self::Network(network) => network.evaluate(nu, into),
        }
    }
}

/// A law whose model can change.
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

/// Where learned weights belong.
enum WeightMap {
    Equations { coefficients: Vec<f64>, places: Vec<usize> },
    Plant { params: Box<VesselParams>, numbers: Box<Numbers>, places: Vec<usize> },
}

impl WeightMap {
    fn of(model: &Model) -> Option<Self> {
        match &model.body {
            Body::Equations(equations) => Some(Self::equations(equations)),
            Body::Plant(plant) => Some(Self::plant(plant)),
            Body::Recurrent(_) | Body::Direct(_) | Body::Affine(_) => None,
        }
    }

    fn equations(equations: &Arc<Equations>) -> Self {
        let coefficients = equations.coefficients().to_vec();
        let places = (0..coefficients.len()).filter(|&place| coefficients[place] != 0.0).collect();
        Self::Equations { coefficients, places }
    }

    fn plant(plant: &Arc<PlantModel>) -> Self {
        let (params, numbers) = (Box::new(plant.params().clone()), Box::new(*plant.numbers()));
        Self::Plant { params, numbers, places: LearnablePlant::new(plant).places().to_vec() }
    }

    /// Numbers that there are places for.
    const fn len(&self) -> usize {
        match self {
            Self::Equations { places, .. } | Self::Plant { places, .. } => places.len(),
        }
    }

    /// Puts weights into a model, one for each place; those that make no vessel leave it as it is.
    fn put(&mut self, weights: &[f64], into: &mut InvertibleModel) {
        match (self, into) {
            (Self::Equations { coefficients, places }, InvertibleModel::Equations(affine)) => {
                for (&place, weight) in places.iter().zip(weights) {
                    coefficients[place] = *weight;
                }
                affine.set_coefficients(coefficients);
            }
            (Self::Plant { params, numbers, places }, InvertibleModel::Plant(affine)) => {
                for (&place, weight) in places.iter().zip(weights) {
                    numbers[place] = *weight;
                }
                params.set_numbers(numbers);
                if let Ok(learned) = AffinePlant::new(params) {
                    **affine = learned;
                }
            }
            _ => {}
        }
    }
}

/// What learns beside a law, and what the law has taken over from it.
struct Learning {
    session: SessionModel,
    places: WeightMap,
    taken: Vec<f64>,
}

/// A law that inverts a model.
pub(super) struct InvertingController<L> {
    law: L,
    lead: f64,
    channels: ChannelMap,
    learning: Option<Learning>,
    y: Vec<f64>,
}

impl<L: InvertingLaw> InvertingController<L> {
    /// A law of `model`; with a mind, what that learns is taken over from sample to sample.
    ///
    /// # Errors
    /// If the mind learns other numbers than the law takes over.
    pub(super) fn new(
        law: L,
        lead: f64,
        channels: ChannelMap,
        model: &Model,
        session: Option<SessionModel>,
    ) -> Result<Self, ClosedLoopError> {
        let learning = session.zip(WeightMap::of(model)).map(|(session, places)| Learning {
            session,
            places,
            taken: Vec::new(),
        });
        if let Some(Learning { session, places, .. }) = &learning
            && let Some(weights) = session.weights()
            && weights.len() != places.len()
        {
            return Err(ClosedLoopError::WeightCount { weights: weights.len(), coefficients: places.len() });
        }
        let y = vec![f64::NAN; channels.len()];
        Ok(Self { law, lead, channels, learning, y })
    }

    fn learn(&mut self) {
        let Some(Learning { session, places, taken }) = &mut self.learning else { return };
        session.observe(&self.y);
        if let Some(weights) = session.weights()
            && weights != taken.as_slice()
            && weights.iter().all(|w| w.is_finite())
        {
            taken.clear();
            taken.extend_from_slice(weights);
            // A lag that cannot be inverted any more: the law keeps the one before, and says nothing worth stopping for.
            let _ = self.law.change(&mut |model| places.put(taken, model));
        }
    }
}

impl<L: InvertingLaw> ClosedLoopController for InvertingController<L> {
    fn lead(&self) -> f64 {
        self.lead
    }

    fn timing(&self) -> Timing {
        Timing::Clock
    }

    fn reset(&mut self) {
        self.law.reset();
        if let Some(learning) = &mut self.learning {
            learning.session.reset();
        }
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64; 2]) -> Status {
        self.channels.fill(observation, &mut self.y);
        self.learn();
        let mut actuators = [f64::NAN; 2];
        self.law.model().actuators_of(&self.y, &mut actuators);
        let estimate = Estimate { eta: observation.eta, nu: observation.nu, actuators: &actuators };
        let status = self.law.command(&estimate, observation.reference, command);
        if let Some(learning) = &mut self.learning {
            learning.session.advance(command);
        }
        status
    }
}
