//! RecursiveOptions of recursive equations.

use super::increments::Increments;
use super::innovation_gate::InnovationGate;
use crate::model::sparse::{Equations, EquationsError};

/// How to adapt.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct RecursiveOptions {
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
    pub gate: InnovationGate,
}

/// Samples of a window or a horizon at the most.
pub(super) const MOST_SAMPLES: usize = 1_000_000;

/// Paces of a blend at the most.
pub(super) const MOST_EXPERTS: usize = 16;

/// Rows that a prior is worth at the most, and at the least one over it: squares and inverses stay numbers.
const MOST_INFORMATION: f64 = 1e30;

/// Forgetting times that pass until a prior is restored in all directions, at the most: the covariance grows by `e` to
/// this power meanwhile.
const MOST_FORGOTTEN: f64 = 300.0;

/// Why equations cannot be adapted.
#[derive(Clone, Debug, PartialEq)]
pub enum RecursiveOptionsError {
    /// A time is not positive.
    Time(&'static str),
    /// A window without samples, or one that no log fills.
    Window,
    /// A time that is out of all proportion to the span of a row: numbers would overflow.
    Extreme(&'static str),
    /// Limits that do not ascend from a positive number.
    Gate,
    /// There is not one range for each output and input, or one is not finite.
    Ranges,
    /// No equation has a term.
    Nothing,
    /// The prior is not a regular upper triangle over all terms.
    RFactor,
    /// Several paces need at least one, not too many, and a horizon to compare them by.
    Experts,
    /// The terms do not compile.
    Equations(EquationsError),
}

impl core::fmt::Display for RecursiveOptionsError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Time(what) => write!(f, "{what} must be a positive number of seconds"),
            Self::Window => write!(f, "a window needs at least one sample, and at most {MOST_SAMPLES}"),
            Self::Extreme(what) => {
                write!(f, "{what} is out of all proportion to the span of a row and the number of terms")
            }
            Self::Gate => write!(f, "the limits of the gate must be positive, and reject not below inflate"),
            Self::Ranges => {
                write!(f, "one finite range is needed for each output and input of the equations")
            }
            Self::RFactor => write!(f, "the prior must be a regular triangle, and all terms be adapted"),
            Self::Experts => {
                write!(
                    f,
                    "an expert mixture needs 1 to {MOST_EXPERTS} experts, and a horizon of 1 to {MOST_SAMPLES} samples that fits the memory"
                )
            }
            Self::Nothing => write!(f, "the equations have no term to adapt"),
            Self::Equations(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for RecursiveOptionsError {}

impl RecursiveOptions {
    /// Whether they make sense for some equations and the ranges of their outputs and inputs.
    pub(super) fn check(
        &self,
        equations: &Equations,
        ranges: &[(f64, f64)],
    ) -> Result<(), RecursiveOptionsError> {
        if self.forgetting_s.is_nan() || self.forgetting_s <= 0.0 {
            return Err(RecursiveOptionsError::Time("the forgetting time"));
        }
        if !(self.prior_s > 0.0 && self.prior_s.is_finite()) {
            return Err(RecursiveOptionsError::Time("the time that the prior is worth"));
        }
        if !(1..=MOST_SAMPLES).contains(&self.window) {
            return Err(RecursiveOptionsError::Window);
        }
        let finite = ranges.iter().all(|(low, high)| low.is_finite() && high.is_finite());
        if ranges.len() != equations.outputs() + equations.inputs() || !finite {
            return Err(RecursiveOptionsError::Ranges);
        }
        if !(self.gate.inflate > 0.0 && self.gate.inflate <= self.gate.reject) {
            return Err(RecursiveOptionsError::Gate);
        }
        Ok(())
    }

    /// The rows that the prior is worth, and the forgetting factor of a row, for regressions of so many terms.
    pub(super) fn prior_and_forgetting(
        &self,
        rows: &Increments,
        dt: f64,
        terms: usize,
    ) -> Result<(f64, f64), RecursiveOptionsError> {
        let information = self.prior_s / (rows.samples() as f64 * dt);
        if !(1.0 / MOST_INFORMATION..=MOST_INFORMATION).contains(&information) {
            return Err(RecursiveOptionsError::Extreme("the time that the prior is worth"));
        }
        let row = rows.stride() as f64 * dt / self.forgetting_s;
        // A direction is given its prior back once in so many rows; until then its covariance grows.
        let turn = row * terms as f64;
        if turn.is_nan() || turn > MOST_FORGOTTEN {
            return Err(RecursiveOptionsError::Extreme("the forgetting time"));
        }
        Ok((information, num_traits::Float::exp(-row)))
    }
}
