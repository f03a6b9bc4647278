//! The session of a recurrent model: present outputs, hidden state, and memory of the base model.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::batch_rollout::BatchRollout;
use super::check::RecurrentError;
use super::model::{BaseModel, Recurrent, Scaling};
use super::single::Packed;
use crate::model::persistence::take_measured;
use crate::predict::{Predictor, Workspace, delegate, plain, rollout_each, rollout_steps};

/// A run of a [`Recurrent`] model. Measurements replace the outputs; missing ones are predicted.
///
/// The hidden state is zero at the start of a run. A network of inputs alone without base predicts from there. All
/// other models predict once each output has been measured; until then, measured values are held, the equations of the
/// base advance their lags ([`Equations::wait`](crate::model::sparse::Equations::wait)), and a network with feedback
/// keeps its state.
///
/// The snapshot is `[present outputs, memory of the equations, hidden state]`.
#[derive(Clone, Debug)]
pub struct RecurrentSession {
    model: Arc<Recurrent>,
    weights: Arc<Packed>,
    /// Outputs, then the memory of the base, then the state of the network.
    state: Vec<f64>,
    scratch: Vec<f64>,
    /// Whether the weights travel with the snapshots.
    own_weights: bool,
}

impl RecurrentSession {
    /// A session at the start of a run.
    ///
    /// # Errors
    /// As [`Recurrent::check`].
    pub fn new(model: Arc<Recurrent>) -> Result<Self, RecurrentError> {
        model.check()?;
        let weights = Arc::new(Packed::new(model.network, &model.weights));
        let len = front_len(&model) + model.network.state_len();
        let scratch = vec![0.0; scratch_len(&model, &weights)];
        let mut session = Self { model, weights, state: vec![0.0; len], scratch, own_weights: false };
        session.reset();
        Ok(session)
    }

    /// A session with its own weights, which adaptation changes.
    ///
    /// # Errors
    /// As [`Recurrent::check`].
    pub fn with_own_weights(model: Arc<Recurrent>) -> Result<Self, RecurrentError> {
        Ok(Self { own_weights: true, ..Self::new(model)? })
    }

    /// Present weights in the order of [`Network::tensors`](super::Network::tensors).
    pub fn weights(&self) -> &[f64] {
        self.weights.weights()
    }

    pub(crate) fn packed(&self) -> &Packed {
        &self.weights
    }

    /// Replaces the weights. Allocates when the session first changes shared weights.
    pub(crate) fn set_weights(&mut self, weights: &[f64]) {
        Arc::make_mut(&mut self.weights).set_weights(weights);
    }

    pub(crate) fn hidden_mut(&mut self) -> &mut [f64] {
        &mut self.state[front_len(&self.model)..]
    }

    /// Scaled input of the network under a command.
    pub(crate) fn inputs_of_network(&self, c: &[f64], x: &mut [f64]) {
        self.model.scale(&self.state, c, x);
    }

    /// Sets the outputs to the read-out of the state, for networks without base.
    pub(crate) fn read_out(&mut self) {
        let (outputs, hidden) = self.state.split_at_mut(front_len(&self.model));
        let scratch = &mut self.scratch[..self.model.outputs()];
        read_out(&self.model, &self.weights, hidden, outputs, scratch);
    }

    /// Correction of the base by the network at its present state.
    pub(crate) fn correction(&self, into: &mut [f64]) {
        self.weights.output(self.hidden(), into);
        for (into, scale) in into.iter_mut().zip(&self.model.scaling.correction_scale) {
            *into *= scale;
        }
    }

    pub(crate) fn is_waiting(&self) -> bool {
        let needs_outputs = self.model.feedback || !matches!(self.model.base, BaseModel::Nothing);
        needs_outputs && self.state[..self.model.outputs()].iter().any(|y| y.is_nan())
    }

    /// The model.
    pub fn model(&self) -> &Recurrent {
        &self.model
    }

    pub(crate) fn shared_model(&self) -> &Arc<Recurrent> {
        &self.model
    }

    pub(super) fn state(&self) -> &[f64] {
        &self.state
    }

    /// The state of the network in the layout of its [`Cell`](super::Cell).
    pub fn hidden(&self) -> &[f64] {
        &self.state[front_len(&self.model)..]
    }

    /// Resets a hidden state that is not finite, because no measurement would correct it.
    fn reset_if_diverged(&mut self) {
        let hidden = &mut self.state[front_len(&self.model)..];
        if !hidden.iter().all(|h| h.is_finite()) {
            hidden.fill(0.0);
        }
    }
}

fn front_len(model: &Recurrent) -> usize {
    if let BaseModel::Equations(equations) = &model.base { equations.state_len() } else { model.outputs() }
}

/// Length of the scratch: input and output of the network, then a step of network or equations or a row of outputs.
fn scratch_len(model: &Recurrent, weights: &Packed) -> usize {
    let base = if let BaseModel::Equations(equations) = &model.base { equations.scratch() } else { 0 };
    model.network.inputs + model.outputs() + base.max(weights.scratch()).max(model.outputs())
}

impl Recurrent {
    pub(crate) fn scale(&self, y: &[f64], c: &[f64], x: &mut [f64]) {
        let scaling = &self.scaling;
        let (m, z) = x.split_at_mut(self.inputs());
        for i in 0..m.len() {
            m[i] = (c[i] - scaling.input_mean[i]) / scaling.input_scale[i];
        }
        for i in 0..z.len() {
            z[i] = (y[i] - scaling.output_mean[i]) / scaling.output_scale[i];
        }
    }
}

fn read_out(model: &Recurrent, weights: &Packed, hidden: &[f64], y: &mut [f64], scratch: &mut [f64]) {
    weights.output(hidden, scratch);
    let Scaling { output_mean, correction_scale, .. } = &model.scaling;
    for i in 0..y.len() {
        y[i] = output_mean[i] + correction_scale[i] * scratch[i];
    }
}

fn step(model: &Recurrent, weights: &Packed, state: &mut [f64], c: &[f64], scratch: &mut [f64]) {
    let outputs = model.outputs();
    let (front, hidden) = state.split_at_mut(front_len(model));
    let (x, rest) = scratch.split_at_mut(model.network.inputs);
    let (correction, rest) = rest.split_at_mut(outputs);
    model.scale(front, c, x);
    weights.step(hidden, x, rest);
    weights.output(hidden, correction);
    match &model.base {
        BaseModel::Nothing => front.copy_from_slice(&model.scaling.output_mean),
        BaseModel::Hold => {}
        BaseModel::Equations(equations) => equations.step(front, c, rest),
    }
    for i in 0..outputs {
        front[i] += model.scaling.correction_scale[i] * correction[i];
    }
}

fn wait(model: &Recurrent, weights: &Packed, state: &mut [f64], c: &[f64], scratch: &mut [f64]) {
    let (front, hidden) = state.split_at_mut(front_len(model));
    if !model.feedback {
        let (x, rest) = scratch.split_at_mut(model.network.inputs);
        model.scale(front, c, x);
        weights.step(hidden, x, rest);
    }
    if let BaseModel::Equations(equations) = &model.base {
        equations.wait(front, c, scratch);
    }
}

impl Predictor for RecurrentSession {
    plain!(over_ground advance_observe rollout_snapshots);
    delegate!(model: outputs inputs);

    fn warm_up(&self) -> usize {
        let base =
            if let BaseModel::Equations(equations) = &self.model.base { equations.warm_up() } else { 1 };
        // The origin comes on top of the wash-out.
        self.model.wash_out.saturating_add(1).max(base)
    }

    fn reset(&mut self) {
        let (front, hidden) = self.state.split_at_mut(front_len(&self.model));
        front.fill(f64::NAN);
        hidden.fill(0.0);
    }

    fn observe(&mut self, y: &[f64]) {
        take_measured(&mut self.state[..self.model.outputs()], y);
    }

    fn advance(&mut self, c: &[f64]) {
        let (model, weights) = (&*self.model, &*self.weights);
        if self.is_waiting() {
            wait(model, weights, &mut self.state, c, &mut self.scratch);
        } else {
            step(model, weights, &mut self.state, c, &mut self.scratch);
        }
        self.reset_if_diverged();
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
            step(&self.model, &self.weights, state, &commands[k * m..(k + 1) * m], scratch);
            y[k * n..(k + 1) * n].copy_from_slice(&state[..n]);
        }
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let fits = |memory: &BatchRollout| memory.fits(self, count);
        match work.batch(fits, || BatchRollout::new(self, count)) {
            Some(memory) => memory.rollout(self, count, commands, y),
            None => rollout_each(self, count, commands, work, y),
        }
    }

    fn snapshot_len(&self) -> usize {
        self.state.len() + if self.own_weights { self.weights().len() } else { 0 }
    }

    fn snapshot(&self, into: &mut [f64]) {
        let (state, weights) = into.split_at_mut(self.state.len());
        state.copy_from_slice(&self.state);
        if self.own_weights {
            weights.copy_from_slice(self.weights());
        }
    }

    fn restore(&mut self, from: &[f64]) {
        let (state, weights) = from.split_at(self.state.len());
        self.state.copy_from_slice(state);
        if self.own_weights {
            self.set_weights(weights);
        }
    }

    fn fork(&self) -> Box<dyn Predictor> {
        let mut fork = self.clone();
        if self.own_weights {
            // Restoring must not allocate.
            let _ = Arc::make_mut(&mut fork.weights);
        }
        Box::new(fork)
    }
}
