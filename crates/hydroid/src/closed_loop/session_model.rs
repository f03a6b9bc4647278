//! The model that a controller predicts with: a frozen session or an adapter.

use hydroid_core::adapt::Adapter;
use hydroid_core::predict::Predictor;

use super::error::ClosedLoopError;
use crate::adapt;
use crate::log::Trajectory;
use crate::model::Model;

pub(super) enum SessionModel {
    Frozen(Box<dyn Predictor>),
    /// Adapter. It predicts with the weights that its guard has selected.
    Adaptive(Box<dyn Adapter>),
}

impl SessionModel {
    /// Session with constant weights. An inputs-only network gets a state filter, as in adaptation.
    pub(super) fn frozen(model: &Model) -> Self {
        Self::Frozen(adapt::state_filtered(model).unwrap_or_else(|| model.session()))
    }

    /// Session that adapts; `rehearsal` fills its rehearsal store first ([`adapt::replay_training_runs`]).
    pub(super) fn learning(
        model: &Model,
        options: &adapt::Options,
        rehearsal: &[Trajectory],
    ) -> Result<Self, ClosedLoopError> {
        let (mut adapter, _) = adapt::adapter(model, options, &[])?;
        let rehearsal: Vec<&Trajectory> = rehearsal.iter().collect();
        adapt::replay_training_runs(adapter.as_mut(), &rehearsal);
        Ok(Self::Adaptive(adapter))
    }

    fn session(&mut self) -> &mut dyn Predictor {
        match self {
            Self::Frozen(session) => session.as_mut(),
            Self::Adaptive(adapter) => adapter.as_mut(),
        }
    }

    pub(super) fn reset(&mut self) {
        self.session().reset();
    }

    pub(super) fn observe(&mut self, heading: f64, y: &[f64]) {
        self.session().observe_heading(heading);
        self.session().observe(y);
    }

    pub(super) fn advance(&mut self, c: &[f64]) {
        self.session().advance(c);
    }

    pub(super) fn predictor(&self) -> &dyn Predictor {
        match self {
            Self::Frozen(session) => session.as_ref(),
            Self::Adaptive(adapter) => adapter.as_ref(),
        }
    }

    /// Estimate of the current, north and east \[m/s\]; `None` for a model of the motion over ground.
    pub(super) fn current(&self) -> Option<[f64; 2]> {
        self.predictor().current().map(|current| current.velocity)
    }

    /// Weights of the model that predicts now: of the adapter, or of its guard's selection. `None` for a frozen model.
    pub(super) fn weights(&self) -> Option<&[f64]> {
        match self {
            Self::Adaptive(adapter) => {
                Some(adapter.guard().map_or_else(|| adapter.weights(), |guard| guard.active_weights()))
            }
            Self::Frozen(..) => None,
        }
    }
}
