//! The session of a control-affine network.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::field::Field;
use super::model::{ControlAffine, ControlAffineError};
use crate::model::persistence::take_measured;
use crate::predict::{Predictor, Workspace, delegate, plain, rollout_steps};

/// A run of a [`ControlAffine`] network. Measurements replace outputs; missing ones are predicted. Until each output
/// has been measured, measured values are held. The snapshot is `[present outputs, actuators]`.
#[derive(Clone, Debug)]
pub struct ControlAffineSession {
    model: Arc<ControlAffine>,
    field: Field,
    state: Vec<f64>,
    scratch: Vec<f64>,
}

impl ControlAffineSession {
    /// A session at the start of a run.
    ///
    /// # Errors
    /// As [`ControlAffine::check`].
    pub fn new(model: Arc<ControlAffine>) -> Result<Self, ControlAffineError> {
        model.check()?;
        let field = Field::new(&model);
        let (state, scratch) = (vec![f64::NAN; model.outputs() + model.inputs()], vec![0.0; field.scratch()]);
        Ok(Self { model, field, state, scratch })
    }

    /// The model.
    pub fn model(&self) -> &ControlAffine {
        &self.model
    }
}

impl Predictor for ControlAffineSession {
    plain!(over_ground advance_observe rollout_batch rollout_snapshots);
    delegate!(model: outputs inputs);

    fn warm_up(&self) -> usize {
        self.model.wash_out.saturating_add(1)
    }

    fn reset(&mut self) {
        self.state.fill(f64::NAN);
    }

    fn observe(&mut self, y: &[f64]) {
        let outputs = self.model.outputs();
        take_measured(&mut self.state[..outputs], y);
    }

    fn advance(&mut self, c: &[f64]) {
        if self.state[..self.model.outputs()].iter().any(|y| y.is_nan()) {
            self.field.wait(&mut self.state, c);
        } else {
            self.field.step(&self.model, &mut self.state, c, &mut self.scratch);
        }
    }

    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(&self.state[..self.model.outputs()]);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (n, m) = (self.outputs(), self.inputs());
        let steps = rollout_steps(commands, m, y, n);
        let len = self.state.len();
        let (state, scratch) = work.take(len + self.scratch.len()).split_at_mut(len);
        state.copy_from_slice(&self.state);
        for k in 0..steps {
            self.field.step(&self.model, state, &commands[k * m..(k + 1) * m], scratch);
            y[k * n..(k + 1) * n].copy_from_slice(&state[..n]);
        }
    }

    fn snapshot_len(&self) -> usize {
        self.state.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        into.copy_from_slice(&self.state);
    }

    fn restore(&mut self, from: &[f64]) {
        self.state.copy_from_slice(from);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}
