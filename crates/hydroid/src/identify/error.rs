//! Errors of an identification.

use std::path::PathBuf;

use super::Method;
use crate::committee::ChooseError;
use crate::evaluate::EvaluateError;
use crate::grey_box::GreyBoxError;
use crate::sindy::expression::ExpressionError;
use crate::sindy::{SearchError, UnknownLibrary};
use crate::train::TrainError;

/// Error of an identification.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// Unknown library.
    #[error(transparent)]
    Library(UnknownLibrary),
    /// Invalid term or constraint.
    #[error("{key}: {error}")]
    Expression {
        /// The setting.
        key: &'static str,
        /// Cause and position.
        error: ExpressionError,
    },
    /// A term or constraint that cannot be used.
    #[error("'{text}' cannot be used: {why}")]
    Constraint {
        /// As given.
        text: String,
        /// Cause and remedy.
        why: String,
    },
    /// Unknown channel in a setting.
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
        /// The known names.
        known: String,
    },
    /// The method grey-box has no vessel.
    #[error("the method grey-box needs a vessel file: name it, as in --vessel boat.toml")]
    NoVessel,
    /// The numbers of a vessel file cannot be estimated.
    #[error(transparent)]
    GreyBox(#[from] GreyBoxError),
    /// Models of the motion through the water need a cross-validation.
    #[error(
        "models of the motion through the water are cross-validated: leave out --validate, and give only --methods sindy, committee"
    )]
    ThroughWater,
    /// No regression shows the currents.
    #[error(
        "the currents of the runs cannot be estimated: the runs are too short for predictions over a quarter of the horizon, or such predictions diverge. Give longer runs or a shorter --horizon, or identify with --motion over-ground"
    )]
    NoCurrents,
    /// An output is missing for the current.
    #[error(
        "there is no output '{name}', and the current needs surge u, sway v and yaw rate r: name their columns, as in --outputs u=SOG,v=SWAY,r=GYRO"
    )]
    NoMotion {
        /// The output.
        name: &'static str,
    },
    /// A run has no heading.
    #[error(
        "{run}: no column is known to be the heading, which the current needs: name it, as in --heading 'psi [deg]'"
    )]
    NoHeading {
        /// The run.
        run: String,
    },
    /// A mode of a given gate has too few samples.
    #[error(
        "gate {gate}: only {:.1} % of the training samples are {side} it, too few for equations of that mode. Move the gate, add runs in both modes, or use the search for gates (--gate auto)",
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
        "'{first}' and '{second}' share measurements: training, validation and test must be disjoint for a valid evaluation. Name each log once"
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
        /// The option.
        what: &'static str,
        /// As given.
        value: String,
        /// Valid values.
        needed: &'static str,
    },
    /// A stated rate limit that cannot be used.
    #[error(
        "the rate limit of '{channel}' cannot be used: {why}. Write it per second, as in --rate-limit 'delta=4 [deg]'"
    )]
    RateLimit {
        /// The input.
        channel: String,
        /// Why.
        why: String,
    },
    /// A design range that cannot be used.
    #[error("the range of '{channel}' cannot be used: {why}")]
    Range {
        /// The channel.
        channel: String,
        /// Why.
        why: String,
    },
    /// The base model of a network is missing.
    #[error(
        "{} requires equations as its base model (base = \"equations\"), but no equations were found: add sindy or lagged to the methods, or set base = \"hold\" or \"nothing\"",
        method.name()
    )]
    NoBase {
        /// The method.
        method: Method,
    },
    /// A network without output feedback on runs without inputs.
    #[error(
        "the logs have no inputs, and a network without output feedback has no other variables: select inputs (--inputs), or set feedback = true under [{}]",
        method.name()
    )]
    NoInputs {
        /// The method.
        method: Method,
    },
    /// A horizon longer than all runs.
    #[error(
        "a horizon of {horizon} samples ({horizon_s} s) cannot be used: the longest of the {part} runs has {longest} samples, one of which is the origin. Set a horizon of at most {} samples, or longer runs",
        longest.saturating_sub(1)
    )]
    Horizon {
        /// `validation`, `test`, or `left-out` in a cross-validation.
        part: &'static str,
        /// As given \[samples\].
        horizon: usize,
        /// Horizon \[s\].
        horizon_s: f64,
        /// Samples of the longest run.
        longest: usize,
    },
    /// The warm-up of a model leaves no origin in the runs of a part.
    #[error(
        "it cannot be evaluated: the warm-up requires {warm_up} samples and a measurement of each output, the horizon {horizon} samples; all {part} runs are shorter than both together (the longest has {longest} samples). Use longer runs, a shorter --horizon, or a shorter wash_out_s of the network"
    )]
    NotEvaluable {
        /// `validation`, `test`, or `left-out` in a cross-validation.
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
        "there is no interrupted training in {} to resume: remove --resume, or give the folder of the training with -o",
        folder.display()
    )]
    NoCheckpoint {
        /// Folder of the checkpoints.
        folder: PathBuf,
    },
    /// The training of a network failed.
    #[error("{}: {error}", method.name())]
    Train {
        /// The method.
        method: Method,
        /// Why.
        error: TrainError,
    },
    /// The search for equations failed.
    #[error(transparent)]
    Sindy(#[from] SearchError),
    /// There is no committee.
    #[error(transparent)]
    Committee(#[from] ChooseError),
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
    pub(super) fn without_method(&self) -> String {
        match self {
            Self::Train { error, .. } => error.to_string(),
            other => other.to_string(),
        }
    }

    /// Whether another method may succeed on the same logs; false for wrong input, files and interruptions.
    pub(super) fn is_method_specific(&self) -> bool {
        match self {
            Self::Sindy(SearchError::AllDiverged(_))
            | Self::Committee(ChooseError::TooShort { .. } | ChooseError::Singular)
            | Self::GreyBox(GreyBoxError::NoStart)
            | Self::NoBase { .. }
            | Self::NoInputs { .. }
            | Self::NoCurrents
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
