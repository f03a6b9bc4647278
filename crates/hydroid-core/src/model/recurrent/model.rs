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
    /// Equations of motion: the network gives their residual (a grey-box model), over one sample or, for a direct predictor, over each sample of
    /// the horizon.
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
    /// Scale of the output of the network: of the outputs without base, else of their increments or of the residual of the equations.
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
/// `y_k` is measured along a run, and predicted in a rollout. A run starts with
/// `h = 0`.
#[derive(Clone, Debug, PartialEq)]
pub struct Recurrent {
    /// The network; its inputs are the inputs of the model, then with feedback the outputs.
    pub network: Network,
    /// Weights in the order of [`Network::tensors`].
    pub weights: Vec<f64>,
    /// Scaling of the channels.
    pub scaling: Scaling,
    /// Base model.
    pub base: BaseModel,
    /// Whether the outputs are inputs of the network.
    pub feedback: bool,
    /// Number of samples before an origin in which the hidden state settles (wash-out).
    pub wash_out: usize,
    /// Kalman filter on the hidden state; without it measurements enter by feedback and base alone.
    pub state_filter: Option<StateFilter>,
}

/// An extended Kalman filter on the hidden state of a network with constant weights: a warm-up for
/// networks that do not see their outputs. With `A = df/dh`, `C = dg/dh`, everything in scaled units:
///
/// ```text
/// advance:  h <- f(h, x),            P <- A P A' + process I
/// observe:  S = C P C' + diag(noise) = L L',   W = P C' L'^-1
///           h <- h + W L^-1 (z - g(h)),        P <- P - W W'
/// ```
///
/// A run starts with `h = 0`, `P = initial I`. `W W'` keeps `P` symmetric; with `P - K S K'` and an inverse of `S` that is
/// not symmetric to the last bit it would not stay so. Channels that were not measured are left out of `C` and
/// `S`.
///
/// Measurements before the first step of a run are not used, because the network was not trained to be read out at the initial state.
///
/// For networks that give the outputs themselves ([`BaseModel::Nothing`]) from inputs alone. Where a measurement also enters
/// by feedback or by the base, its noise also enters the prediction,
/// and this filter does not apply: [`Recurrent::check`] rejects the combination.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct StateFilter {
    /// Variance that each number of the hidden state gains over a sample.
    pub process: f64,
    /// Variance of each number of the hidden state at the start of a run.
    pub initial: f64,
    /// Variance of each output's measurement noise, in units of `correction_scale` squared.
    pub noise: Vec<f64>,
}

impl StateFilter {
    /// The longest state, and the most outputs, of a network with a filter: its memory and its time grow with the square
    /// and the cube, and a file must not ask for all there is.
    pub const MOST: usize = 512;
}
