//! The model that a controller predicts with: a frozen session or an adapter.

use hydroid_core::adapt::Adapter;
use hydroid_core::control::Status;
use hydroid_core::memory::Memory;
use hydroid_core::predict::Predictor;

use super::channel_map::ChannelMap;
use super::controller::{ClosedLoopController, ModelSession, Observation};
use super::error::ClosedLoopError;
use super::reference::Timing;
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

    fn view(&self) -> ModelSession<'_> {
        match self {
            Self::Frozen(session) => ModelSession { predictor: session.as_ref(), weights: None },
            Self::Adaptive(adapter) => ModelSession {
                predictor: adapter.as_ref(),
                // Of the adapter, or of its guard's selection.
                weights: Some(
                    adapter.guard().map_or_else(|| adapter.weights(), |guard| guard.active_weights()),
                ),
            },
        }
    }

    pub(super) fn weights(&self) -> Option<usize> {
        self.view().weights.map(<[f64]>::len)
    }
}

/// A controller that owns the session of its model.
pub(super) struct WithSession {
    pub(super) law: Box<dyn ClosedLoopController>,
    pub(super) session: SessionModel,
    pub(super) channels: ChannelMap,
    pub(super) y: Vec<f64>,
}

impl ClosedLoopController for WithSession {
    fn lead(&self) -> f64 {
        self.law.lead()
    }

    fn timing(&self) -> Timing {
        self.law.timing()
    }

    fn horizon(&self) -> usize {
        self.law.horizon()
    }

    fn preview_step(&self) -> usize {
        self.law.preview_step()
    }

    fn reset(&mut self) {
        self.law.reset();
        self.session.session().reset();
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.law.visit_state(memory);
    }

    fn planned(&self, later: usize) -> Option<&[f64]> {
        self.law.planned(later)
    }

    fn command(&mut self, observation: &Observation<'_>, command: &mut [f64]) -> Status {
        let Self { law, session, channels, y } = self;
        channels.fill(observation.outputs, y);
        session.session().observe_heading(observation.eta[2]);
        session.session().observe(y);
        let observation = Observation { session: Some(session.view()), ..*observation };
        let status = law.command(&observation, command);
        session.session().advance(command);
        status
    }
}
