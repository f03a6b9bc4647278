//! A feed-forward network as a model of a vessel: what it sees, what it gives, scaling.

use alloc::vec::Vec;

use super::perceptron::Perceptron;
use crate::model::recurrent::{BaseModel, Scaling};

/// A direct predictor: all outputs of a horizon of `H` samples at once, from a history of `p` samples and the commands of
/// both.
///
/// With `n` scaled outputs `z = (y - output_mean) / output_scale` and `m` scaled commands
/// `m = (c - input_mean) / input_scale`, at the sample `k` that was measured last:
///
/// ```text
/// x       = [z_{k-p+1} .. z_k   m_{k-p+1} .. m_{k-1}   m_k .. m_{k+H-1}]       p n + (p - 1 + H) m numbers
/// g       = f(x)                                                               H n numbers, step by step
/// y_{k+j} = b_j + correction_scale . g_j, j = 1 .. H
/// b_j     = output_mean (nothing), y_k (hold), or e_{k+j} (equations)
/// ```
///
/// where `e_{k+1} .. e_{k+H}` is the rollout of the equations from `y_k` under `m_k ..`, with what they remember (lags, past
/// values) walked along all samples before.
///
/// (Thesis, eq. 13-17: `p = 4`, `H = 20`, `n = 3`, `m = 2`, layers 58-256-256-256-60.) Every step has weights of its own and
/// none is made from the one before it: an error of the first step does not grow into the last.
///
/// Longer rollouts are chained: what was predicted becomes the history of the next `H` steps. In shorter ones, and in the
/// last part of a chain, the command that was given last stands for those that were not given.
#[derive(Clone, Debug, PartialEq)]
pub struct Direct {
    /// The network.
    pub network: Perceptron,
    /// Its weights, as [`Perceptron::tensors`] has them.
    pub weights: Vec<f64>,
    /// How channels are scaled.
    pub scaling: Scaling,
    /// Samples of outputs that it sees, the present one among them: `p`.
    pub history: usize,
    /// Samples that it predicts at once: `H`.
    pub horizon: usize,
    /// What it adds to: nothing (it gives the outputs themselves), the present outputs, or a rollout of equations.
    pub base: BaseModel,
}

impl Direct {
    /// The longest history or horizon.
    pub const LONGEST: usize = Perceptron::MOST;

    /// Number of outputs: `n`.
    pub fn outputs(&self) -> usize {
        self.scaling.output_mean.len()
    }

    /// A scaled output.
    pub(super) fn scaled_output(&self, output: usize, y: f64) -> f64 {
        (y - self.scaling.output_mean[output]) / self.scaling.output_scale[output]
    }

    /// A scaled command.
    pub(super) fn scaled_command(&self, input: usize, c: f64) -> f64 {
        (c - self.scaling.input_mean[input]) / self.scaling.input_scale[input]
    }

    /// An output from what the network gives, from the present output, scaled, and from what equations say of it.
    pub(super) fn output_of(&self, output: usize, present: f64, of_equations: f64, g: f64) -> f64 {
        let s = &self.scaling;
        let base = match self.base {
            BaseModel::Nothing => s.output_mean[output],
            BaseModel::Hold => s.output_mean[output] + present * s.output_scale[output],
            BaseModel::Equations(_) => of_equations,
        };
        base + s.correction_scale[output] * g
    }

    /// Number of inputs: `m`.
    pub fn inputs(&self) -> usize {
        self.scaling.input_mean.len()
    }

    /// Length of what the network reads and of what it gives, for a history, a horizon, outputs and inputs.
    pub fn lengths(history: usize, horizon: usize, outputs: usize, inputs: usize) -> (usize, usize) {
        let commands = (history + horizon).saturating_sub(1);
        (history * outputs + commands * inputs, horizon * outputs)
    }
}
