//! Structure of a direct predictor.

use alloc::vec::Vec;

use super::perceptron::Perceptron;
use crate::model::recurrent::{BaseModel, Scaling};

/// A direct predictor: all outputs of a horizon of `H` samples at once, from a history of `p` samples and the commands
/// of both.
///
/// With `n` scaled outputs `z = (y - output_mean) / output_scale` and `m` scaled commands
/// `m = (c - input_mean) / input_scale`, at the last measured sample `k`:
///
/// ```text
/// x       = [z_{k-p+1} .. z_k   m_{k-p+1} .. m_{k-1}   m_k .. m_{k+H-1}]       p n + (p - 1 + H) m numbers
/// g       = f(x)                                                               H n numbers, step by step
/// y_{k+j} = b_j + correction_scale . g_j, j = 1 .. H
/// b_j     = output_mean (nothing), y_k (hold), or e_{k+j} (equations)
/// ```
///
/// where `e_{k+1} .. e_{k+H}` is the rollout of the equations from `y_k` under `m_k ..`, with lags and past values from
/// all earlier samples. (Thesis, eq. 13-17: `p = 4`, `H = 20`, `n = 3`, `m = 2`, layers 58-256-256-256-60.) Each step
/// has its own weights and does not depend on the previous prediction: errors do not accumulate within the horizon.
///
/// Longer rollouts are chained: predictions become the history of the next `H` steps. In shorter rollouts, and in the
/// last part of a chain, the last given command is held.
#[derive(Clone, Debug, PartialEq)]
pub struct Direct {
    /// The network.
    pub network: Perceptron,
    /// Weights in the order of [`Perceptron::tensors`].
    pub weights: Vec<f64>,
    /// Scaling of the channels.
    pub scaling: Scaling,
    /// Number of output samples in the history, the present one included: `p`.
    pub history: usize,
    /// Horizon \[samples\]: `H`.
    pub horizon: usize,
    /// Base model.
    pub base: BaseModel,
}

impl Direct {
    /// The longest history or horizon.
    pub const LONGEST: usize = Perceptron::MOST;

    /// Number of outputs: `n`.
    pub fn outputs(&self) -> usize {
        self.scaling.output_mean.len()
    }

    pub(super) fn scaled_output(&self, output: usize, y: f64) -> f64 {
        (y - self.scaling.output_mean[output]) / self.scaling.output_scale[output]
    }

    pub(super) fn scaled_command(&self, input: usize, c: f64) -> f64 {
        (c - self.scaling.input_mean[input]) / self.scaling.input_scale[input]
    }

    /// An output from the output of the network, the scaled present output, and the prediction of the equations.
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

    /// Lengths of input and output of the network.
    pub fn lengths(history: usize, horizon: usize, outputs: usize, inputs: usize) -> (usize, usize) {
        let commands = (history + horizon).saturating_sub(1);
        (history * outputs + commands * inputs, horizon * outputs)
    }
}
