//! Settings of recursive equations.

use super::gate::Gate;
use crate::model::sparse::{Equations, EquationsError};

/// How to adapt.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Settings {
    /// Time \[s\] after which a row counts `1/e`; infinite to forget nothing.
    pub forgetting_s: f64,
    /// Intervals that an increment spans \[samples\], at least 1.
    pub window: usize,
    /// Seconds of lively sailing that the coefficients given are worth: with the design ranges fully used, so
    /// long takes the log to count as much as they do.
    pub prior_s: f64,
    /// Whether coefficients about which the log has long said nothing return to those given.
    pub leak: bool,
    /// Whether terms that are not in an equation may enter it.
    pub all_terms: bool,
    /// What happens to rows that are far off.
    pub gate: Gate,
}

/// Why equations cannot be adapted.
#[derive(Clone, Debug, PartialEq)]
pub enum SettingsError {
    /// A time is not positive.
    Time(&'static str),
    /// A window without samples.
    Window,
    /// There is not one range for each output and input, or one is not finite.
    Ranges,
    /// No equation has a term.
    Nothing,
    /// The prior is not a regular upper triangle over all terms.
    Root,
    /// Several paces need at least one, and a horizon to compare them by.
    Paces,
    /// The terms do not compile.
    Equations(EquationsError),
}

impl core::fmt::Display for SettingsError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Time(what) => write!(f, "{what} must be a positive number of seconds"),
            Self::Window => write!(f, "a window needs at least one sample"),
            Self::Ranges => {
                write!(f, "one finite range is needed for each output and input of the equations")
            }
            Self::Root => write!(f, "the prior must be a regular triangle, and all terms be adapted"),
            Self::Paces => write!(f, "a blend needs at least one pace, and a horizon"),
            Self::Nothing => write!(f, "the equations have no term to adapt"),
            Self::Equations(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for SettingsError {}

impl Settings {
    /// Whether they make sense for some equations and the ranges of their outputs and inputs.
    pub(super) fn check(&self, equations: &Equations, ranges: &[(f64, f64)]) -> Result<(), SettingsError> {
        if self.forgetting_s.is_nan() || self.forgetting_s <= 0.0 {
            return Err(SettingsError::Time("the forgetting time"));
        }
        if !(self.prior_s > 0.0 && self.prior_s.is_finite()) {
            return Err(SettingsError::Time("the time that the prior is worth"));
        }
        if self.window == 0 {
            return Err(SettingsError::Window);
        }
        let finite = ranges.iter().all(|(low, high)| low.is_finite() && high.is_finite());
        if ranges.len() != equations.outputs() + equations.inputs() || !finite {
            return Err(SettingsError::Ranges);
        }
        Ok(())
    }
}
