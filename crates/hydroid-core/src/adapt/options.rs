//! Options of recursive least squares for equations.

use super::increments::Increments;
use super::innovation_gate::InnovationGate;
use crate::model::sparse::{Equations, EquationsError};

/// Options of [`RecursiveEquations`](super::RecursiveEquations).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct RecursiveOptions {
    /// Time constant of the forgetting \[s\]: a row of this age counts `1/e`; infinite for none.
    pub forgetting_s: f64,
    /// Length `m` of an increment \[samples\], at least 1.
    pub window: usize,
    /// Weight of the reference coefficients, as seconds of data that use the whole design range.
    pub prior_s: f64,
    /// Whether coefficients without excitation return to the reference (leak).
    pub leak: bool,
    /// Whether terms with zero coefficients are adapted as well.
    pub all_terms: bool,
    /// Innovation gate of the rows.
    pub gate: InnovationGate,
}

/// Maximum length of a window or horizon \[samples\].
pub(super) const MOST_SAMPLES: usize = 1_000_000;

pub(super) const MOST_EXPERTS: usize = 16;

/// Maximum weight of a prior \[rows\] and of its inverse, with finite squares.
const MOST_INFORMATION: f64 = 1e30;

/// Maximum number of forgetting times between two restorations of one direction of the prior: the covariance grows by
/// `e` to this power in between.
const MOST_FORGOTTEN: f64 = 300.0;

/// Error of the options of an adapter of equations.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum RecursiveOptionsError {
    #[error("{0} must be a positive number of seconds")]
    Time(&'static str),
    #[error("a window needs at least one sample, and at most {MOST_SAMPLES}")]
    Window,
    /// A time is too short or too long relative to the span of a row: numbers would overflow.
    #[error("{0} is too short or too long for the span of a row and the number of terms")]
    Extreme(&'static str),
    #[error("the limits of the gate must be positive, with reject at least inflate")]
    Gate,
    #[error("one finite range is needed for each output and input of the equations")]
    Ranges,
    #[error("the equations have no term to adapt")]
    Nothing,
    #[error("the prior must be a regular triangle, and all terms be adapted")]
    RFactor,
    #[error(
        "an expert mixture needs 1 to {MOST_EXPERTS} experts, and a horizon of 1 to {MOST_SAMPLES} samples that fits the memory"
    )]
    Experts,
    #[error(transparent)]
    Equations(EquationsError),
}

impl RecursiveOptions {
    pub(super) fn check(
        &self,
        equations: &Equations,
        ranges: &[(f64, f64)],
    ) -> Result<(), RecursiveOptionsError> {
        if self.forgetting_s.is_nan() || self.forgetting_s <= 0.0 {
            return Err(RecursiveOptionsError::Time("the forgetting time"));
        }
        if !(self.prior_s > 0.0 && self.prior_s.is_finite()) {
            return Err(RecursiveOptionsError::Time("the weight of the prior"));
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

    /// Weight `r0` of the prior \[rows\] and forgetting factor `lambda` of a row, for equations of `terms`
    /// coefficients.
    pub(super) fn prior_and_forgetting(
        &self,
        rows: &Increments,
        dt: f64,
        terms: usize,
    ) -> Result<(f64, f64), RecursiveOptionsError> {
        let information = self.prior_s / (rows.samples() as f64 * dt);
        if !(1.0 / MOST_INFORMATION..=MOST_INFORMATION).contains(&information) {
            return Err(RecursiveOptionsError::Extreme("the weight of the prior"));
        }
        let row = rows.stride() as f64 * dt / self.forgetting_s;
        let turn = row * terms as f64;
        if turn.is_nan() || turn > MOST_FORGOTTEN {
            return Err(RecursiveOptionsError::Extreme("the forgetting time"));
        }
        Ok((information, num_traits::Float::exp(-row)))
    }
}
