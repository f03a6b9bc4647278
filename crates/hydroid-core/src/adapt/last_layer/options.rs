//! Options of the adaptation of a last layer.

use crate::model::direct::DirectError;

/// Options of a [`DirectLastLayer`](super::DirectLastLayer). Each sample completes one window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LastLayerOptions {
    /// Forgetting factor `lambda` per sample; 1 for none.
    pub forgetting: f64,
    /// Weight `r0` of the reference weights, in windows with unit regressors in each direction.
    pub information: f64,
    /// Whether weights without excitation return to the reference (leak).
    pub leak: bool,
    /// Rate of the error variances.
    pub noise_rate: f64,
}

/// Error of the options or the model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum LastLayerError {
    #[error(transparent)]
    Model(DirectError),
    /// A number is not finite or out of range.
    #[error("{what} is {value}: {needed}")]
    Number { what: &'static str, value: f64, needed: &'static str },
}

/// Maximum weight of the prior \[windows\] and of its inverse, with finite squares.
const MOST_INFORMATION: f64 = 1e30;

/// Minimum forgetting factor: the covariance grows by its inverse in each sample until the prior has been restored in
/// all directions.
const LEAST_FORGETTING: f64 = 0.9;

/// Minimum forgetting time \[samples\]: `exp(-1 / 9.5)` is just above the minimum forgetting factor.
pub const SHORTEST_FORGETTING: f64 = 9.5;

impl LastLayerOptions {
    pub(super) fn check(&self) -> Result<(), LastLayerError> {
        let Self { forgetting, information, leak: _, noise_rate } = *self;
        let sound = [
            (
                "the forgetting factor per sample",
                forgetting,
                (LEAST_FORGETTING..=1.0).contains(&forgetting),
                "between 0.9 and 1 are needed, which is a forgetting time of 9.5 samples or more",
            ),
            (
                "the weight of the reference model in samples",
                information,
                (1.0 / MOST_INFORMATION..=MOST_INFORMATION).contains(&information),
                "more than 0 and no more than 1e30 are needed: give a prior of some milliseconds to some minutes",
            ),
            (
                "the rate of the noise estimate",
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
