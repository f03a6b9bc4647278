//! The model under way: a session that walks along, and may learn.

use std::sync::Arc;

use hydroid_core::adapt::Adapter;
use hydroid_core::control::cem::{Abreast, Each, Rollouts};
use hydroid_core::model::sparse::{EquationsSession, SideBySide};
use hydroid_core::predict::{Predictor, Workspace};

use super::error::SteerError;
use crate::adapt;
use crate::log::Trajectory;
use crate::model::{Body, Model};

/// Candidates of equations that are tried side by side: as many as a planner asks for at once.
const ABREAST: usize = 50;

/// A model's session in a loop.
pub(super) enum Mind {
    /// Any session; one candidate after the other.
    Session(Box<dyn Predictor>, Workspace),
    /// Equations as they stand; candidates side by side.
    Equations(EquationsSession, Box<SideBySide>),
    /// One that learns; plans are made with what it has learned so far, and its guard trusts.
    Learner(Box<dyn Adapter>, Workspace),
}

impl Mind {
    /// A model as it stands. Of a network of inputs alone the state is filtered, as it is of one that learns.
    pub(super) fn frozen(model: &Model) -> Self {
        if let (Body::Equations(equations), None) = (&model.body, &model.learning)
            && let Some(room) = SideBySide::new(equations, ABREAST)
        {
            return Self::Equations(EquationsSession::new(Arc::clone(equations)), Box::new(room));
        }
        let filtered = adapt::state_filtered(model);
        Self::Session(filtered.as_ref().unwrap_or(model).session(), Workspace::new())
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
        Ok(Self::Learner(adapter, Workspace::new()))
    }

    fn session(&mut self) -> &mut dyn Predictor {
        match self {
            Self::Session(session, _) => session.as_mut(),
            Self::Equations(session, _) => session,
            Self::Learner(adapter, _) => adapter.as_mut(),
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

    /// Predictions from this moment: the one place that knows which way is the fastest for a model.
    pub(super) fn rollouts<T>(&mut self, plan: impl FnOnce(&mut dyn Rollouts) -> T) -> T {
        match self {
            Self::Session(session, work) => plan(&mut Each::new(session.as_ref(), work)),
            Self::Equations(session, room) => plan(&mut Abreast::new(session, room)),
            Self::Learner(adapter, work) => plan(&mut Each::new(adapter.as_ref(), work)),
        }
    }

    /// The weights of the model that predicts at this moment: the learner's, or what its guard falls back to.
    pub(super) fn weights(&self) -> Option<&[f64]> {
        match self {
            Self::Learner(adapter, _) => {
                Some(adapter.guard().map_or_else(|| adapter.weights(), |guard| guard.active_weights()))
            }
            Self::Session(..) | Self::Equations(..) => None,
        }
    }
}
