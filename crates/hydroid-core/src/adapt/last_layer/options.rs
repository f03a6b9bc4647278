//! How a read-out learns.

use crate::model::direct::DirectError;

/// How a [`DirectLastLayer`](super::DirectLastLayer) learns. One window is completed in each sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastLayerOptions {
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
pub enum LastLayerError {
    /// The model makes no sense.
    Model(DirectError),
    /// A number that is none, or not one that it can be.
    Number {
        /// Which.
        what: &'static str,
        /// What was given.
        value: f64,
        /// What is needed.
        needed: &'static str,
    },
}

impl core::fmt::Display for LastLayerError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Model(error) => error.fmt(f),
            Self::Number { what, value, needed } => write!(f, "{what} is {value}: {needed}"),
        }
    }
}

impl core::error::Error for LastLayerError {}

/// Windows that a prior is worth at the most, and at the least one over it: squares and inverses stay numbers.
const MOST_INFORMATION: f64 = 1e30;

/// What is forgotten in one sample at the most: until the prior has been restored in all directions the covariance grows by its
/// inverse in each.
const LEAST_FORGETTING: f64 = 0.9;

/// The shortest forgetting time \[samples\]: `exp(-1 / 9.5)` is just above what may be kept at the least.
pub const SHORTEST_FORGETTING: f64 = 9.5;

impl LastLayerOptions {
    pub(super) fn check(&self) -> Result<(), LastLayerError> {
        let Self { forgetting, information, leak: _, noise_rate } = *self;
        let sound = [
            (
                "the share of what was learned that is kept from sample to sample",
                forgetting,
                (LEAST_FORGETTING..=1.0).contains(&forgetting),
                "between 0.9 and 1 are needed, which is a forgetting time of 9.5 samples or more",
            ),
            (
                "what the model from shore is worth, in samples,",
                information,
                (1.0 / MOST_INFORMATION..=MOST_INFORMATION).contains(&information),
                "more than 0 and no more than 1e30 are needed: give a prior of some milliseconds to some minutes",
            ),
            (
                "the rate of the noise",
                noise_rate,
                (0.0..=1.0).contains(&noise_rate),
                "between 0 and 1 is needed",
            ),
        ];
        match sound.into_iter().find(|(_, _, sound, _)| !sound) {
            Some((what, value, _, needed)) => Err(LastLayerError::Number { what, value, needed }),
            None => Ok(()),
        }
    }
}
