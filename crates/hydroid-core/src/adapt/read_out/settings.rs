//! How a read-out learns.

use crate::model::direct::DirectError;

/// How a [`DirectReadOut`](super::DirectReadOut) learns. One window is completed in each sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOutSettings {
    /// `lambda`: a window counts `lambda^n` when it is `n` samples old; 1 to forget nothing.
    pub forgetting: f64,
    /// `r0`: what the weights from shore are worth, in windows with regressors of 1 in each direction.
    pub information: f64,
    /// Whether weights of which the run has long said nothing return to those from shore.
    pub leak: bool,
    /// Share of a window in the variances that bands are made of.
    pub noise_rate: f64,
}

/// Why a read-out cannot learn so.
#[derive(Clone, Debug, PartialEq)]
pub enum ReadOutError {
    /// The model makes no sense.
    Model(DirectError),
    /// A number that is none, or not one that it can be.
    Number(&'static str),
}

impl core::fmt::Display for ReadOutError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Model(error) => error.fmt(f),
            Self::Number(what) => write!(f, "{what} is not a number that it can be"),
        }
    }
}

impl core::error::Error for ReadOutError {}

/// Windows that a prior is worth at the most, and at the least one over it: squares and inverses stay numbers.
const MOST_INFORMATION: f64 = 1e30;

/// What is forgotten in one sample at the most: until the prior has been restored in all directions the covariance grows by its
/// inverse in each.
const LEAST_FORGETTING: f64 = 0.9;

impl ReadOutSettings {
    pub(super) fn check(&self) -> Result<(), ReadOutError> {
        let sound = [
            ("the forgetting time", (LEAST_FORGETTING..=1.0).contains(&self.forgetting)),
            (
                "what the model from shore is worth",
                (1.0 / MOST_INFORMATION..=MOST_INFORMATION).contains(&self.information),
            ),
            ("the rate of the noise", (0.0..=1.0).contains(&self.noise_rate)),
        ];
        match sound.into_iter().find(|(_, sound)| !sound) {
            Some((what, _)) => Err(ReadOutError::Number(what)),
            None => Ok(()),
        }
    }
}
