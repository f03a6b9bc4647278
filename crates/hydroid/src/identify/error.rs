//! Errors of an identification.

use std::path::PathBuf;

use super::Method;
use crate::evaluate::EvaluateError;
use crate::sindy::expression::ExpressionError;
use crate::sindy::{SearchError, UnknownLibrary};
use crate::train::TrainError;

/// Error of an identification.
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
    /// Two parts of the split share samples.
    #[error(
        "'{first}' and '{second}' hold the same measurements, in whole or in part: a model judged on what it was fitted to or chosen on is judged by nobody. Name each log once"
    )]
    DataLeakage {
        /// One run.
        first: String,
        /// The other.
        second: String,
    },
    /// An option is outside its range.
    #[error("the {what} of {value} cannot be used: it must be {needed}")]
    InvalidOption {
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
    /// A network that reads inputs alone, on runs without any.
    #[error(
        "the logs have no inputs, and a network that does not see its outputs reads nothing else: name inputs (--inputs), or set feedback = true under [{}]",
        method.name()
    )]
    NoInputs {
        /// The method.
        method: Method,
    },
    /// A horizon that no run can be judged at.
    #[error(
        "a horizon of {horizon} samples ({horizon_s} s) cannot be used: the longest of the {part} runs has {longest} samples, and a prediction needs one to start from. Give a horizon of at most {} samples, or longer runs",
        longest.saturating_sub(1)
    )]
    Horizon {
        /// `validation` or `test`.
        part: &'static str,
        /// As given \[samples\].
        horizon: usize,
        /// The same \[s\].
        horizon_s: f64,
        /// Samples of the longest run.
        longest: usize,
    },
    /// The warm-up of a model leaves no origin in the runs of a part.
    #[error(
        "it cannot be judged: before its predictions count it must have seen {warm_up} samples of a run and each output once, and the horizon has {horizon} samples; none of the {part} runs has both (the longest has {longest} samples). Give longer runs, a shorter --horizon, or a network a shorter wash_out_s"
    )]
    NotEvaluable {
        /// `validation` or `test`.
        part: &'static str,
        /// Samples of warm-up.
        warm_up: usize,
        /// Longest horizon \[samples\].
        horizon: usize,
        /// Samples of the longest run.
        longest: usize,
    },
    /// There is no checkpoint to resume.
    #[error(
        "there is no interrupted training in {} to go on with (--resume): leave out --resume, or name its folder with -o",
        folder.display()
    )]
    NoCheckpoint {
        /// Where trainings are kept.
        folder: PathBuf,
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
    /// The message without the name of the method.
    pub(super) fn without_method(&self) -> String {
        match self {
            Self::Train { error, .. } => error.to_string(),
            other => other.to_string(),
        }
    }

    /// Whether another method may succeed on the same logs; wrong input, unusable files and interruptions are
    /// not specific to a method.
    pub(super) fn is_method_specific(&self) -> bool {
        match self {
            Self::Sindy(SearchError::AllDiverged(_))
            | Self::NoBase { .. }
            | Self::NoInputs { .. }
            | Self::NotEvaluable { .. } => true,
            Self::Train { error, .. } => matches!(
                error,
                TrainError::Diverged { .. }
                    | TrainError::TooShort { .. }
                    | TrainError::NoWindow { .. }
                    | TrainError::Constant { .. }
                    | TrainError::Equations { .. }
                    | TrainError::NoTime { .. }
                    | TrainError::NoScore { .. }
            ),
            _ => false,
        }
    }
}
