//! The model under way: a session that walks along, and may learn.

use hydroid_core::adapt::Adapter;
use hydroid_core::predict::Predictor;

use super::error::SteerError;
use crate::adapt;
use crate::log::Trajectory;
use crate::model::Model;

/// A model's session in a loop.
pub(super) enum Mind {
    /// One that stays as it is.
    Session(Box<dyn Predictor>),
    /// One that learns; plans are made with what it has learned so far, and its guard trusts.
    Learner(Box<dyn Adapter>),
}

impl Mind {
    /// A model as it stands. Of a network of inputs alone the state is filtered, as it is of one that learns.
    pub(super) fn frozen(model: &Model) -> Self {
        let filtered = adapt::state_filtered(model);
        let session = filtered.as_ref().unwrap_or(model).session();
        Self::Session(session)
    }

    /// A model that learns; before the start it walks through `shore` ([`adapt::remember_shore`]).
    pub(super) fn learning(
        model: &Model,
        options: &adapt::Options,
        shore: &[Trajectory],
    ) -> Result<Self, SteerError> {
        let (mut adapter, _) = adapt::adapter(model, options, &[])?;
        let shore: Vec<&Trajectory> = shore.iter().collect();
        adapt::remember_shore(adapter.as_mut(), &shore);
        Ok(Self::Learner(adapter))
    }

    fn session(&mut self) -> &mut dyn Predictor {
        match self {
            Self::Session(session) => session.as_mut(),
            Self::Learner(adapter) => adapter.as_mut(),
        }
    }

    pub(super) fn reset(&mut self) {
        self.session().reset();
    }

    pub(super) fn observe(&mut self, y: &[f64]) {
        self.session().observe(y);
    }

    pub(super) fn advance(&mut self, c: &[f64]) {
        self.session().advance(c);
    }

    /// The session, with its present state and weights.
    pub(super) fn predictor(&self) -> &dyn Predictor {
        match self {
            Self::Session(session) => session.as_ref(),
            Self::Learner(adapter) => adapter.as_ref(),
        }
    }

    /// The weights of the model that predicts at this moment: the learner's, or what its guard falls back to.
    pub(super) fn weights(&self) -> Option<&[f64]> {
        match self {
            Self::Learner(adapter) => {
                Some(adapter.guard().map_or_else(|| adapter.weights(), |guard| guard.active_weights()))
            }
            Self::Session(..) => None,
        }
    }
}
