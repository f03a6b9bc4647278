//! Why there is no path, or no speed along it.

/// Why a path or a speed profile cannot be made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathError {
    /// A number that must be greater than zero (and finite, where it is a length) is not.
    NotPositive {
        /// Which.
        what: &'static str,
        /// What was given.
        value: f64,
    },
    /// A coordinate or a course is not a finite number.
    NotFinite {
        /// Which.
        what: &'static str,
    },
    /// There are not enough points, legs or pieces.
    TooFew {
        /// Of what.
        what: &'static str,
        /// How many are needed.
        needed: usize,
    },
    /// Two way-points that follow each other are the same.
    Coincide {
        /// The second of them, from 0.
        point: usize,
    },
    /// Around a way-point the turning circle does not fit between its neighbours.
    CornerTooSharp {
        /// The way-point, from 0.
        point: usize,
        /// The largest radius that fits there \[m\]; 0 where the path turns right back.
        fits: f64,
    },
    /// The legs of a lawn-mower are closer than two turning circles.
    LegsTooClose {
        /// Distance of the legs \[m\].
        spacing: f64,
        /// Turning radius \[m\].
        radius: f64,
    },
    /// Two pieces that follow each other do not meet.
    Gap {
        /// The second of them, from 0.
        piece: usize,
        /// How far its start is from the end of the first \[m\].
        distance: f64,
    },
}

impl core::fmt::Display for PathError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotPositive { what, value } => write!(f, "{what} must be greater than 0, and is {value}"),
            Self::NotFinite { what } => write!(f, "{what} must be a finite number"),
            Self::TooFew { what, needed } => write!(f, "at least {needed} {what} are needed"),
            Self::Coincide { point } => {
                write!(f, "way-point {point} is where the one before it is: leave one of them out")
            }
            Self::CornerTooSharp { point, fits } => write!(
                f,
                "the turning circle does not fit at way-point {point}: the largest radius that does is {fits:.3} m"
            ),
            Self::LegsTooClose { spacing, radius } => write!(
                f,
                "legs {spacing} m apart leave no room for turns of {radius} m: the radius can be half of the distance at most"
            ),
            Self::Gap { piece, distance } => {
                write!(f, "piece {piece} of the path starts {distance} m from where the one before it ends")
            }
        }
    }
}

impl core::error::Error for PathError {}

/// `value`, if it is a positive finite number.
pub(super) fn positive(what: &'static str, value: f64) -> Result<f64, PathError> {
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(PathError::NotPositive { what, value }) }
}

/// `values`, if they are finite numbers.
pub(super) fn finite<const N: usize>(what: &'static str, values: [f64; N]) -> Result<[f64; N], PathError> {
    if values.iter().all(|value| value.is_finite()) { Ok(values) } else { Err(PathError::NotFinite { what }) }
}
