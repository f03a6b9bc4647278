//! Persistence, the baseline of all models: outputs keep their last value.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use crate::predict::{Predictor, Workspace, plain, rollout_steps};

/// Predicts that every output keeps its last measured value.
#[derive(Clone, Debug)]
pub struct Persistence {
    last: Vec<f64>,
    inputs: usize,
}

impl Persistence {
    /// A session for runs of `outputs` outputs and `inputs` inputs.
    pub fn new(outputs: usize, inputs: usize) -> Self {
        Self { last: vec![f64::NAN; outputs], inputs }
    }
}

impl Predictor for Persistence {
    plain!(warm_up over_ground advance_observe rollout_batch rollout_snapshots);

    fn outputs(&self) -> usize {
        self.last.len()
    }

    fn inputs(&self) -> usize {
        self.inputs
    }

    fn reset(&mut self) {
        self.last.fill(f64::NAN);
    }

    fn observe(&mut self, y: &[f64]) {
        take_measured(&mut self.last, y);
    }

    fn advance(&mut self, _c: &[f64]) {}

    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(&self.last);
    }

    fn rollout(&self, commands: &[f64], _work: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, self.inputs, y, self.last.len());
        for row in y.chunks_exact_mut(self.last.len().max(1)) {
            row.copy_from_slice(&self.last);
        }
    }

    fn snapshot_len(&self) -> usize {
        self.last.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        into.copy_from_slice(&self.last);
    }

    fn restore(&mut self, from: &[f64]) {
        self.last.copy_from_slice(from);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}

/// Overwrites the state with measurements; a missing value (NaN) keeps the prediction.
pub(crate) fn take_measured(state: &mut [f64], y: &[f64]) {
    for (state, &y) in state.iter_mut().zip(y) {
        if !y.is_nan() {
            *state = y;
        }
    }
}
