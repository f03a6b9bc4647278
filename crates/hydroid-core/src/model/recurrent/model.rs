//! A recurrent network as a model of a vessel: scaling, what it corrects, what it sees.

use alloc::sync::Arc;
use alloc::vec::Vec;

use super::network::Network;
use crate::model::sparse::Equations;

/// What the network corrects.
#[derive(Clone, Debug, PartialEq)]
pub enum Base {
    /// Nothing: it gives the next outputs themselves.
    Nothing,
    /// The present outputs: it gives their increments.
    Hold,
    /// Equations of motion: it gives what they miss over one sample (a grey box).
    Equations(Arc<Equations>),
}

/// Numbers that bring channels to the size that networks work with: `(value - mean) / scale`.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaling {
    /// Of the outputs.
    pub output_mean: Vec<f64>,
    /// Of the outputs.
    pub output_scale: Vec<f64>,
    /// Of the inputs.
    pub input_mean: Vec<f64>,
    /// Of the inputs.
    pub input_scale: Vec<f64>,
    /// Size of what the network gives: that of the outputs where it corrects nothing, else that of increments or of
    /// what the equations miss.
    pub correction_scale: Vec<f64>,
}

/// A recurrent model.
///
/// With scaled commands `m = (c - input_mean) / input_scale` and scaled outputs `z = (y - output_mean) /
/// output_scale`:
///
/// ```text
/// x_k     = [m_k]  or  [m_k z_k] with feedback
/// h_{k+1} = f(h_k, x_k)
/// y_{k+1} = b(y_k, c_k) + correction_scale . g(h_{k+1})
/// b       = output_mean (nothing), y_k (hold), or one sample of the equations
/// ```
///
/// `y_k` is measured while the model walks along a run, and its own prediction in a rollout.
#[derive(Clone, Debug, PartialEq)]
pub struct Recurrent {
    /// The network; its inputs are the model's inputs, then with feedback its outputs.
    pub network: Network,
    /// Its weights, as [`Network::tensors`] has them.
    pub weights: Vec<f64>,
    /// How channels are scaled.
    pub scaling: Scaling,
    /// What it corrects.
    pub base: Base,
    /// Whether it sees its outputs.
    pub feedback: bool,
    /// Samples that it must have walked before its hidden state is worth something.
    pub wash_out: usize,
}
