//! Gradients of predictions with respect to state, weights and initial outputs.

use alloc::vec;
use alloc::vec::Vec;

use crate::model::recurrent::{BaseModel, Gradient, Linearization, Recurrent, RecurrentSession};
use crate::predict::Predictor;

/// Gradients of predictions by back-propagation through a rollout.
///
/// `y_{k+n}` depends on the hidden state `h_k`, on the weights and, for a network with feedback or a base, on the
/// initial outputs `y_k`. The adjoints `l_h`, `l_theta` and `l_y` have one column for each output; from the horizon
/// backwards,
///
/// ```text
/// y_j = b(y_{j-1}) + scale . g(h_j):   l_h += (dg/dh)' scale l_y,    l_theta += (dg/dtheta)' scale l_y,
///                                      l_y stays if b(y) = y, and becomes zero otherwise
/// h_j = f(h_{j-1}, x_{j-1}):           l_h <- (df/dh)' l_h, l_theta += (df/dtheta)' l_h, l_y += (df/dz)' l_h / scale_y
/// ```
#[derive(Clone, Debug)]
pub(super) struct RolloutGradient {
    steps: Vec<Linearization>,
    x: Vec<f64>,
    y: Vec<f64>,
    hidden: Vec<f64>,
    scratch: Vec<f64>,
    adjoint: Vec<f64>,
    by_input: Vec<f64>,
    step_state: Vec<f64>,
    step_weights: Vec<f64>,
    /// The adjoints: `state x outputs`, `weights x outputs`, `outputs x outputs`.
    pub(super) state: Vec<f64>,
    pub(super) weights: Vec<f64>,
    pub(super) outputs: Vec<f64>,
}

impl RolloutGradient {
    pub(super) fn new(model: &Recurrent) -> Self {
        let (n, m, q, x) =
            (model.network.state_len(), model.weights.len(), model.outputs(), model.network.inputs);
        Self {
            steps: Vec::new(),
            x: vec![0.0; x],
            y: vec![0.0; q],
            hidden: vec![0.0; n],
            scratch: Vec::new(),
            adjoint: vec![0.0; q * q],
            by_input: vec![0.0; x * q],
            step_state: vec![0.0; n * q],
            step_weights: vec![0.0; m * q],
            state: vec![0.0; n * q],
            weights: vec![0.0; m * q],
            outputs: vec![0.0; q * q],
        }
    }

    /// Rolls out the network under the commands; the session does not advance. Returns false for a network on
    /// equations, whose gradients are not available.
    pub(super) fn roll_out(&mut self, session: &RecurrentSession, commands: &[f64]) -> bool {
        let (model, packed) = (session.model(), session.packed());
        if matches!(model.base, BaseModel::Equations(_)) {
            return false;
        }
        let count = commands.len() / model.inputs().max(1);
        while self.steps.len() < count {
            self.steps.push(Linearization::new(packed));
            self.scratch.resize(self.steps[0].scratch(model.outputs()), 0.0);
        }
        session.output(&mut self.y);
        self.hidden.copy_from_slice(session.hidden());
        for (step, c) in self.steps.iter_mut().zip(commands.chunks_exact(model.inputs().max(1))) {
            model.scale(&self.y, c, &mut self.x);
            step.step(packed, &mut self.hidden, &self.x);
            packed.output(&self.hidden, &mut self.adjoint[..self.y.len()]);
            for (i, y) in self.y.iter_mut().enumerate() {
                let base =
                    if matches!(model.base, BaseModel::Hold) { *y } else { model.scaling.output_mean[i] };
                *y = base + model.scaling.correction_scale[i] * self.adjoint[i];
            }
        }
        true
    }

    pub(super) fn back_propagate(&mut self, session: &RecurrentSession, horizon: usize) {
        let (model, packed) = (session.model(), session.packed());
        let (q, m) = (model.outputs(), model.inputs());
        self.state.fill(0.0);
        self.weights.fill(0.0);
        self.outputs.fill(0.0);
        (0..q).for_each(|i| self.outputs[i * (q + 1)] = 1.0);
        for step in self.steps[..horizon].iter().rev() {
            for (i, adjoint) in self.adjoint.chunks_exact_mut(q).enumerate() {
                let scale = model.scaling.correction_scale[i];
                adjoint.iter_mut().zip(&self.outputs[i * q..]).for_each(|(into, l)| *into = scale * l);
            }
            let into = Gradient {
                state: Some(&mut self.step_state),
                weights: Some(&mut self.step_weights),
                input: None,
            };
            step.output_transposed_times(packed, &self.adjoint, q, into);
            add(&mut self.state, &self.step_state);
            add(&mut self.weights, &self.step_weights);
            if !matches!(model.base, BaseModel::Hold) {
                self.outputs.fill(0.0);
            }
            let into = Gradient {
                state: Some(&mut self.step_state),
                weights: Some(&mut self.step_weights),
                input: Some(&mut self.by_input),
            };
            step.transposed_times(packed, &self.state, q, into, &mut self.scratch);
            self.state.copy_from_slice(&self.step_state);
            add(&mut self.weights, &self.step_weights);
            for (i, z) in self.by_input[m * q..].chunks_exact(q).enumerate() {
                let scale = model.scaling.output_scale[i];
                self.outputs[i * q..].iter_mut().zip(z).for_each(|(into, z)| *into += z / scale);
            }
        }
    }
}

fn add(into: &mut [f64], more: &[f64]) {
    into.iter_mut().zip(more).for_each(|(into, more)| *into += more);
}
