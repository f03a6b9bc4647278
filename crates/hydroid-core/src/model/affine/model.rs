//! Structure of a control-affine network.

use crate::actuator::Map;
use crate::model::direct::Perceptron;
use crate::model::recurrent::{NetworkError, Part, RecurrentError, Scaling};
use alloc::vec::Vec;

/// Lag and map of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Effector {
    /// Map `phi`.
    pub map: Map,
    /// Time constant `T` \[s\].
    pub time_constant_s: f64,
    /// `w`: typical size of `phi(a)`.
    pub unit: f64,
}

/// A control-affine network.
///
/// With `n` outputs `y`, scaled `z = (y - output_mean) / output_scale`, and `m` commands `c`:
///
/// ```text
/// dy_j/dt = s_j ( f_j(z) + sum_i g_ij(z) phi_i(a_i) / w_i ),     s = correction_scale, per second
/// T_i da_i/dt = c_i - a_i
/// [f g_1 .. g_m] = N(z),     a perceptron from n to n (1 + m) numbers
/// ```
///
/// A sample `dt` is one step of RK4 with held commands and exact lags; the first stage weighs the actuators by
/// [`rk4_first_stage`](crate::actuator::rk4_first_stage). The model is affine in the efforts `phi_i(a_i)` for any
/// weights.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlAffine {
    /// The network `N`.
    pub network: Perceptron,
    /// Weights in the order of [`Perceptron::tensors`].
    pub weights: Vec<f64>,
    /// Scaling of the outputs; mean and scale of the inputs describe their ranges.
    pub scaling: Scaling,
    /// Lag and map of each command.
    pub effectors: Vec<Effector>,
    /// Sample time \[s\].
    pub dt: f64,
    /// Number of samples after which the initial lags have no effect.
    pub wash_out: usize,
}

/// Reasons why a control-affine network is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ControlAffineError {
    #[error(transparent)]
    Network(NetworkError),
    #[error("the network {what} {network} numbers, and outputs and inputs need {model}")]
    Length {
        /// `reads` (input) or `gives` (output).
        what: &'static str,
        network: usize,
        model: usize,
    },
    #[error(transparent)]
    Numbers(RecurrentError),
    #[error("{what} is {value}: a positive number is needed")]
    Positive { what: &'static str, value: f64 },
}

impl ControlAffine {
    /// Number of outputs: `n`.
    pub fn outputs(&self) -> usize {
        self.scaling.output_mean.len()
    }

    /// Number of commands: `m`.
    pub fn inputs(&self) -> usize {
        self.effectors.len()
    }

    /// Checks sizes and numbers.
    ///
    /// # Errors
    /// If sizes contradict one another, a number is not finite, or a time or a scale is not positive.
    pub fn check(&self) -> Result<(), ControlAffineError> {
        self.network.check().map_err(ControlAffineError::Network)?;
        let (n, m, scaling) = (self.outputs(), self.inputs(), &self.scaling);
        for (what, network, model) in
            [("reads", self.network.inputs, n), ("gives", self.network.outputs, n * (1 + m))]
        {
            if network != model {
                return Err(ControlAffineError::Length { what, network, model });
            }
        }
        for (part, numbers, expected) in [
            (Part::Weights, &self.weights, self.network.weights()),
            (Part::OutputMean, &scaling.output_mean, n),
            (Part::OutputScale, &scaling.output_scale, n),
            (Part::InputMean, &scaling.input_mean, m),
            (Part::InputScale, &scaling.input_scale, m),
            (Part::CorrectionScale, &scaling.correction_scale, n),
        ] {
            part.check(numbers, expected).map_err(ControlAffineError::Numbers)?;
        }
        let times = self.effectors.iter().flat_map(|effector| {
            [("a time constant", effector.time_constant_s), ("the unit of an effort", effector.unit)]
        });
        for (what, value) in times.chain([("the sample time", self.dt)]) {
            if !(value.is_finite() && value > 0.0) {
                return Err(ControlAffineError::Positive { what, value });
            }
        }
        Ok(())
    }
}
