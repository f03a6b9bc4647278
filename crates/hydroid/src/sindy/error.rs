//! Errors of a fit.

use hydroid_core::model::sparse::{EquationsError, ProgramError};

use super::constraints::ConstraintError;

/// Error of a fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// Fewer rows than unknowns.
    #[error(
        "{rows} usable regression rows for {terms} terms: too few{}",
        if *skipped > *rows {
            format!(
                " ({skipped} more touch a missing value). Put sensors of different rates on one clock with --dt, the step of the slowest; or shorten the window"
            )
        } else {
            String::from(". Give longer logs, a shorter window, or a smaller library (degree)")
        }
    )]
    TooFewRows {
        /// Rows without a missing sample.
        rows: u64,
        /// Rows with a missing sample.
        skipped: u64,
        /// Terms of the library.
        terms: usize,
    },
    /// Runs with different channels or sample times.
    #[error("runs '{first}' and '{second}' differ in sample time or channels: prepare them together")]
    DifferentRuns {
        /// The first run.
        first: String,
        /// The run that differs from it.
        second: String,
    },
    /// Numbers outside the range of floating point.
    #[error(
        "products of the channels leave the range of floating-point numbers: bring the channels to sensible units, or choose a smaller degree"
    )]
    Overflow,
    /// A term has no value at a sample.
    #[error(
        "term '{term}' has no value in run '{run}' at {time_s} s, where '{channel}' is zero or below, or passes zero: leave the term out, or leave such samples out of the training runs"
    )]
    Undefined {
        /// The term.
        term: String,
        /// The variable on which it is not defined.
        channel: String,
        /// The run.
        run: String,
        /// Time of the sample \[s\].
        time_s: f64,
    },
    /// An output that does not vary has no equation.
    #[error("output '{0}' does not vary in the training runs: there is nothing to identify. Leave it out")]
    Constant(String),
    /// Sample weights that do not match the runs.
    #[error("the sample weights of run '{0}' are not one number, 0 or more, for each of its samples")]
    Weights(String),
    /// A setting out of its range.
    #[error("{0}")]
    Setting(String),
    /// Invalid or infeasible constraints.
    #[error(transparent)]
    Constraints(#[from] ConstraintError),
    /// The library is too large.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// The fit gave no usable equations.
    #[error("the fit gave unusable equations: {0}")]
    Equations(#[from] EquationsError),
}
