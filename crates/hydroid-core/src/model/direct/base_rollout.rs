//! Rollouts of the base equations of a direct predictor.

use alloc::sync::Arc;

use super::model::Direct;
use crate::model::recurrent::BaseModel;
use crate::model::sparse::Equations;

impl Direct {
    /// The base equations; `None` for other base models.
    pub fn equations(&self) -> Option<&Arc<Equations>> {
        match &self.base {
            BaseModel::Equations(equations) => Some(equations),
            BaseModel::Nothing | BaseModel::Hold => None,
        }
    }

    pub(crate) fn below(&self) -> usize {
        self.equations().map_or(0, |equations| equations.state_len())
    }
}

/// State and scratch of a rollout of the base equations; empty without equations.
pub(super) struct BaseRollout<'a> {
    equations: Option<&'a Equations>,
    start: &'a mut [f64],
    state: &'a mut [f64],
    scratch: &'a mut [f64],
}

impl<'a> BaseRollout<'a> {
    pub(super) fn scratch(model: &Direct) -> usize {
        2 * model.below() + model.equations().map_or(0, |equations| equations.scratch())
    }

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

    /// Writes `e_{k+1} ..` into the rows of `y`; without equations `y` is unchanged.
    pub(super) fn roll(&mut self, commands: &[f64], y: &mut [f64]) {
        let Some(equations) = self.equations else { return };
        let (n, m) = (equations.outputs(), equations.inputs());
        self.state.copy_from_slice(self.start);
        for (k, y) in y.chunks_exact_mut(n).enumerate() {
            equations.step(self.state, &commands[k * m..(k + 1) * m], self.scratch);
            y.copy_from_slice(&self.state[..n]);
        }
    }

    /// Advances the memory of the equations along the predicted outputs instead of their own rollout.
    pub(super) fn advance(&mut self, commands: &[f64], y: &[f64]) {
        let Some(equations) = self.equations else { return };
        let (n, m) = (equations.outputs(), equations.inputs());
        for (k, y) in y.chunks_exact(n).enumerate() {
            equations.wait(self.start, &commands[k * m..(k + 1) * m], self.scratch);
            self.start[..n].copy_from_slice(y);
        }
    }
}
