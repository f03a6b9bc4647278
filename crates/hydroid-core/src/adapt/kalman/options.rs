//! Options of the filter: process noise, measurement noise, initial covariance, forgetting factor.

use alloc::vec;
use alloc::vec::Vec;

/// Form in which the covariance of the weights is stored.
///
/// | form | stored | numbers, for `m` weights |
/// | --- | --- | --- |
/// | `Full` | all covariances | `m^2 / 2` |
/// | `Blocks` | covariances of weights in the same group of blocks | `m` times half the size of a group |
///
/// `Blocks` also stores the dependence of the state on the weights, `m` times the length of the state. Blocks without
/// learned weights take no memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CovarianceForm {
    /// All covariances.
    #[default]
    Full,
    /// Covariances of weights in the same group of neighbouring [`Learnable::blocks`](super::Learnable::blocks). One
    /// block in a group gives the node-decoupled filter (Puskorius and Feldkamp, "Decoupled extended Kalman filter
    /// training of feedforward layered networks", IJCNN 1991), one group of all blocks the full filter.
    Blocks {
        /// Blocks in a group.
        group: usize,
    },
}

impl core::fmt::Display for CovarianceForm {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Full => write!(f, "full"),
            Self::Blocks { group } => write!(f, "blocks:{group}"),
        }
    }
}

impl core::str::FromStr for CovarianceForm {
    type Err = &'static str;

    /// Parses the displayed text.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let group = |group: &str| group.parse::<usize>().ok().filter(|&group| group > 0);
        match text.split_once(':') {
            None if text == "full" => Some(Self::Full),
            Some(("blocks", number)) => group(number).map(|group| Self::Blocks { group }),
            _ => None,
        }
        .ok_or("the form of the covariance is full or blocks:GROUP, as in blocks:7")
    }
}

/// Options of a [`Filter`](super::Filter), in the scaled units of its model.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterOptions {
    /// `P0_h`: variance of each state at the start of a run.
    pub initial_state: f64,
    /// `Q_h`: variance that each state gains in a sample.
    pub state_noise: f64,
    /// `P0_theta` of each weight. A weight with neither this nor [`weight_noise`](Self::weight_noise) is not learned.
    pub initial_weights: Vec<f64>,
    /// `Q_theta` of each weight: variance that it gains in a sample.
    pub weight_noise: Vec<f64>,
    /// `R` of each output: variance of the measurement noise.
    pub noise: Vec<f64>,
    /// Fraction of its distance from the initial weight that a weight loses in a sample.
    pub leak: f64,
    /// Forgetting factor `lambda`: a sample of age `n` has the weight `lambda^n`.
    pub forgetting: f64,
    /// Threshold of Huber's loss \[standard deviations\]: larger innovations have a larger noise variance. Infinite for
    /// the quadratic loss.
    pub huber: f64,
    /// Form of the covariance of the weights.
    pub covariance: CovarianceForm,
}

/// Reasons to refuse [`FilterOptions`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum FilterOptionsError {
    #[error("the {0} is outside its range")]
    Number(&'static str),
    #[error("one {0} is needed for each weight, or output")]
    Length(&'static str),
    #[error("the variance of the measurement noise must be positive")]
    Noise,
    #[error("nothing is learned: give the weights an initial variance or a noise")]
    Nothing,
    #[error("the rehearsal needs positive numbers, and has at most 1000000 samples in all of its windows")]
    Rehearsal,
}

impl FilterOptions {
    /// Equal variance and noise for all weights, without leak, forgetting and Huber's loss, with the full covariance.
    /// `state` is `(P0_h, Q_h)`, `measurement` is `R` of each output.
    pub fn uniform(weights: usize, initial: f64, noise: f64, state: (f64, f64), measurement: &[f64]) -> Self {
        Self {
            initial_state: state.0,
            state_noise: state.1,
            initial_weights: vec![initial; weights],
            weight_noise: vec![noise; weights],
            noise: measurement.to_vec(),
            leak: 0.0,
            forgetting: 1.0,
            huber: f64::INFINITY,
            covariance: CovarianceForm::Full,
        }
    }

    pub(super) fn check(&self, weights: usize, outputs: usize) -> Result<(), FilterOptionsError> {
        let variance = |x: f64| x >= 0.0 && x.is_finite();
        let fraction = |x: f64| (0.0..1.0).contains(&x);
        for (name, values, len) in [
            ("initial variance", &self.initial_weights, weights),
            ("noise of a weight", &self.weight_noise, weights),
            ("measurement noise", &self.noise, outputs),
        ] {
            if values.len() != len {
                return Err(FilterOptionsError::Length(name));
            }
            if !values.iter().copied().all(variance) {
                return Err(FilterOptionsError::Number(name));
            }
        }
        let numbers = [
            ("initial variance of the state", variance(self.initial_state)),
            ("noise of the state", variance(self.state_noise)),
            ("leak", fraction(self.leak)),
            ("forgetting factor", fraction(1.0 - self.forgetting)),
            ("threshold of Huber's loss", self.huber > 0.0),
            ("size of a group of blocks", self.covariance != CovarianceForm::Blocks { group: 0 }),
        ];
        if let Some((name, _)) = numbers.into_iter().find(|(_, valid)| !valid) {
            return Err(FilterOptionsError::Number(name));
        }
        if self.noise.contains(&0.0) {
            return Err(FilterOptionsError::Noise);
        }
        Ok(())
    }

    pub(super) fn learns(&self, weight: usize) -> bool {
        self.initial_weights[weight] > 0.0 || self.weight_noise[weight] > 0.0
    }
}
