//! Why nothing was identified.

use super::Method;
use crate::evaluate::EvaluateError;
use crate::sindy::expression::ExpressionError;
use crate::sindy::{SearchError, UnknownLibrary};
use crate::train::TrainError;

/// Why nothing was identified.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// A library that there is not.
    #[error(transparent)]
    Library(UnknownLibrary),
    /// A text that is no term or constraint.
    #[error("{key}: {error}")]
    Expression {
        /// The setting.
        key: &'static str,
        /// What is wrong, and where.
        error: ExpressionError,
    },
    /// A term or constraint that cannot be used.
    #[error("'{text}' cannot be used: {why}")]
    Constraint {
        /// As given.
        text: String,
        /// Why, and what would do.
        why: String,
    },
    /// A setting is of a channel that there is not.
    #[error("{key}: there is no {what} '{name}'{hint} There are {known}")]
    NoChannel {
        /// The setting.
        key: &'static str,
        /// Output or input.
        what: &'static str,
        /// As given.
        name: String,
        /// The nearest name.
        hint: String,
        /// The names that there are.
        known: String,
    },
    /// A gate that is given splits nothing.
    #[error(
        "gate {gate}: only {:.1} % of the training samples are {side} it, too few for equations of that mode. Move the gate, give runs that visit both modes, or let it be found (--gate auto)",
        100.0 * share
    )]
    ModeNotVisited {
        /// As given.
        gate: String,
        /// The mode.
        side: &'static str,
        /// Its share of the samples.
        share: f64,
    },
    /// A part of the split has no runs.
    #[error("there are no {0} runs: give more logs, or name some with --{0}")]
    NoRuns(&'static str),
    /// The same samples would be learned from and judged on.
    #[error(
        "'{first}' and '{second}' hold the same measurements, in whole or in part: a model judged on what it was fitted to or chosen on is judged by nobody. Name each log once"
    )]
    SameRun {
        /// One run.
        first: String,
        /// The other.
        second: String,
    },
    /// A setting that makes no sense.
    #[error("the {what} of {value} cannot be used: it must be {needed}")]
    Setting {
        /// Which.
        what: &'static str,
        /// As given.
        value: String,
        /// What would do.
        needed: &'static str,
    },
    /// A design range that cannot be used.
    #[error("the range of '{channel}' cannot be used: {why}")]
    Range {
        /// The channel.
        channel: String,
        /// Why.
        why: String,
    },
    /// A network is to stand on equations, and there are none.
    #[error(
        "{} is to correct equations (base = \"equations\"), and there are none: add sindy or lagged to the methods, or choose base = \"hold\" or \"nothing\"",
        method.name()
    )]
    NoBase {
        /// The method.
        method: Method,
    },
    /// No network.
    #[error("{}: {error}", method.name())]
    Train {
        /// The method.
        method: Method,
        /// Why.
        error: TrainError,
    },
    /// No equations.
    #[error(transparent)]
    Sindy(#[from] SearchError),
    /// The runs cannot be evaluated.
    #[error("the {part} runs cannot be evaluated: {error}")]
    Evaluate {
        /// Validation or test.
        part: &'static str,
        /// Why.
        error: EvaluateError,
    },
}

impl IdentifyError {
    /// Whether a method came to nothing on these logs, of which another may make something; wrong input, a file that
    /// cannot be used and an interruption are not of this kind.
    pub(super) fn is_of_a_method(&self) -> bool {
        match self {
            Self::Sindy(SearchError::AllDiverged(_)) | Self::NoBase { .. } => true,
            Self::Train { error, .. } => matches!(
                error,
                TrainError::Diverged { .. }
                    | TrainError::TooShort { .. }
                    | TrainError::NoWindow { .. }
                    | TrainError::Constant { .. }
                    | TrainError::Equations { .. }
                    | TrainError::NoTime { .. }
            ),
            _ => false,
        }
    }
}
