//! Errors of a fit.

use hydroid_core::model::sparse::{EquationsError, ProgramError};

use super::constraints::ConstraintError;
use crate::key::key;

/// Error of a fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum FitError {
    #[error(
        "{rows} usable regression rows for {terms} terms: too few{}",
        if *skipped > *rows {
            format!(
                " ({skipped} more touch a missing value). Put sensors of different rates on one clock with {}, the step of the slowest; or shorten the window",
                key("dt")
            )
        } else {
            String::from(". Give longer logs, a shorter window, or a smaller library (degree)")
        }
    )]
    TooFewRows { rows: u64, skipped: u64, terms: usize },
    #[error("runs '{first}' and '{second}' differ in sample time or channels: prepare them together")]
    DifferentRuns { first: String, second: String },
    #[error(
        "products of the channels leave the range of floating-point numbers: bring the channels to sensible units, or choose a smaller degree"
    )]
    Overflow,
    #[error(
        "term '{term}' has no value in run '{run}' at {time_s} s, where '{channel}' is zero or below, or passes zero: leave the term out, or leave such samples out of the training runs"
    )]
    Undefined { term: String, channel: String, run: String, time_s: f64 },
    #[error("output '{0}' does not vary in the training runs: there is nothing to identify. Leave it out")]
    Constant(String),
    #[error(
        "the channel '{0}' has the name of a number or of a term, so that equations with it cannot be read: give it another one, as in {example}",
        example = key("outputs").is(format!("x={}", .0))
    )]
    Name(String),
    #[error("the sample weights of run '{0}' are not one number, 0 or more, for each of its samples")]
    Weights(String),
    /// A setting out of its range.
    #[error("{0}")]
    Setting(String),
    #[error(transparent)]
    Constraints(#[from] ConstraintError),
    #[error(transparent)]
    Program(#[from] ProgramError),
    #[error("the fit gave unusable equations: {0}")]
    Equations(#[from] EquationsError),
}
