//! Errors of paths and speed profiles.

/// Reasons why a path or a speed profile is invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum PathError {
    /// A number that must be positive (and finite, where it is a length) is not.
    #[error("{what} must be greater than 0, and is {value}")]
    NotPositive { what: &'static str, value: f64 },
    #[error("{what} must be a finite number")]
    NotFinite { what: &'static str },
    #[error("at least {needed} {what} are needed")]
    TooFew { what: &'static str, needed: usize },
    #[error("way-point {point} coincides with the one before it: leave one of them out")]
    Coincide {
        /// The second of them, from 0.
        point: usize,
    },
    #[error(
        "the turning circle does not fit at way-point {point}: the largest radius that does is {fits:.3} m"
    )]
    CornerTooSharp {
        /// The way-point, from 0.
        point: usize,
        /// The largest radius that fits \[m\]; 0 where the path reverses.
        fits: f64,
    },
    #[error(
        "legs {spacing} m apart leave no room for turns of {radius} m: the radius can be half of the distance at most"
    )]
    LegsTooClose { spacing: f64, radius: f64 },
    #[error("piece {piece} of the path starts {distance} m from where the one before it ends")]
    Gap {
        /// The second of them, from 0.
        piece: usize,
        distance: f64,
    },
}

pub(super) fn positive(what: &'static str, value: f64) -> Result<f64, PathError> {
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(PathError::NotPositive { what, value }) }
}

pub(super) fn finite<const N: usize>(what: &'static str, values: [f64; N]) -> Result<[f64; N], PathError> {
    if values.iter().all(|value| value.is_finite()) { Ok(values) } else { Err(PathError::NotFinite { what }) }
}
