//! The equations that a direct predictor adds to: their rollouts from a measured sample, and what they remember.

use alloc::sync::Arc;

use super::model::Direct;
use crate::model::recurrent::BaseModel;
use crate::model::sparse::Equations;

impl Direct {
    /// The equations that it adds to; none over another base.
    pub fn equations(&self) -> Option<&Arc<Equations>> {
        match &self.base {
            BaseModel::Equations(equations) => Some(equations),
            BaseModel::Nothing | BaseModel::Hold => None,
        }
    }

    /// Numbers of the equations' state: the outputs, then what they remember. Nothing without equations.
    pub(crate) fn below(&self) -> usize {
        self.equations().map_or(0, |equations| equations.state_len())
    }
}

/// What a rollout on equations works with: two states and their scratch, all empty without equations.
pub(super) struct BaseRollout<'a> {
    equations: Option<&'a Equations>,
    /// At the end of the window: the present outputs, then what the equations remember.
    start: &'a mut [f64],
    /// On its way through the horizon.
    state: &'a mut [f64],
    scratch: &'a mut [f64],
}

impl<'a> BaseRollout<'a> {
    /// Numbers that it needs.
    pub(super) fn scratch(model: &Direct) -> usize {
        2 * model.below() + model.equations().map_or(0, |equations| equations.scratch())
    }

    /// From these outputs, and what the equations remember of the samples before.
    pub(super) fn begin(model: &'a Direct, present: &[f64], memory: &[f64], scratch: &'a mut [f64]) -> Self {
        let equations = model.equations().map(Arc::as_ref);
        let (start, rest) = scratch.split_at_mut(model.below());
        let (state, scratch) = rest.split_at_mut(model.below());
        if equations.is_some() {
            let (outputs, own) = start.split_at_mut(present.len());
            outputs.copy_from_slice(present);
            own.copy_from_slice(memory);
        }
        Self { equations, start, state, scratch }
    }

    /// `e_{k+1} ..` into `y`, a step for each of its rows; without equations `y` stays as it is.
    pub(super) fn roll(&mut self, commands: &[f64], y: &mut [f64]) {
        let Some(equations) = self.equations else { return };
        let (n, m) = (equations.outputs(), equations.inputs());
        self.state.copy_from_slice(self.start);
        for (k, y) in y.chunks_exact_mut(n).enumerate() {
            equations.step(self.state, &commands[k * m..(k + 1) * m], self.scratch);
            y.copy_from_slice(&self.state[..n]);
        }
    }

    /// Moves on along outputs that were predicted: what the equations remember is of these, and not of their own rollout.
    pub(super) fn pass(&mut self, commands: &[f64], y: &[f64]) {
        let Some(equations) = self.equations else { return };
        let (n, m) = (equations.outputs(), equations.inputs());
        for (k, y) in y.chunks_exact(n).enumerate() {
            equations.wait(self.start, &commands[k * m..(k + 1) * m], self.scratch);
            self.start[..n].copy_from_slice(y);
        }
    }
}
