//! A recurrent network as a model of a vessel: scaling, base model, feedback.

use alloc::sync::Arc;
use alloc::vec::Vec;

use super::network::Network;
use crate::model::sparse::Equations;

/// The base model, which the network corrects.
#[derive(Clone, Debug, PartialEq)]
pub enum BaseModel {
    /// No base: the network gives the next outputs.
    Nothing,
    /// The present outputs: the network gives their increments.
    Hold,
    /// Equations of motion: the network gives their residual (a grey-box model) over each sample.
    Equations(Arc<Equations>),
}

/// Scaling of the channels: `(value - mean) / scale`.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaling {
    /// Mean of the outputs.
    pub output_mean: Vec<f64>,
    /// Scale of the outputs.
    pub output_scale: Vec<f64>,
    /// Mean of the inputs.
    pub input_mean: Vec<f64>,
    /// Scale of the inputs.
    pub input_scale: Vec<f64>,
    /// Scale of the output of the network: outputs without base, else increments or residuals.
    pub correction_scale: Vec<f64>,
}

/// A recurrent model.
///
/// With scaled commands `m = (c - input_mean) / input_scale` and scaled outputs `z = (y - output_mean) / output_scale`:
///
/// ```text
/// x_k     = [m_k]  or  [m_k z_k] with feedback
/// h_{k+1} = f(h_k, x_k)
/// y_{k+1} = b(y_k, c_k) + correction_scale . g(h_{k+1})
/// b       = output_mean (nothing), y_k (hold), or one sample of the equations
/// ```
///
/// `y_k` is measured along a run, and predicted in a rollout. A run starts with `h = 0`.
#[derive(Clone, Debug, PartialEq)]
pub struct Recurrent {
    /// The network; its inputs are the inputs of the model and, with feedback, the outputs.
    pub network: Network,
    /// Weights in the order of [`Network::tensors`].
    pub weights: Vec<f64>,
    /// Scaling of the channels.
    pub scaling: Scaling,
    /// Base model.
    pub base: BaseModel,
    /// Whether the outputs are inputs of the network (output feedback).
    pub feedback: bool,
    /// Number of samples before an origin in which the hidden state settles (wash-out).
    pub wash_out: usize,
}
