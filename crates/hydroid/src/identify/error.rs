//! Errors of an identification.

use std::path::PathBuf;

use super::Method;
use crate::committee::ChooseError;
use crate::evaluate::EvaluateError;
use crate::grey_box::GreyBoxError;
use crate::key::key;
use crate::sindy::expression::ExpressionError;
use crate::sindy::{SearchError, UnknownLibrary};
use crate::train::TrainError;

/// Error of an identification.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum IdentifyError {
    #[error(transparent)]
    Library(UnknownLibrary),
    /// Invalid term or constraint.
    #[error("{key}: {error}")]
    Expression {
        key: &'static str,
        /// Cause and position.
        error: ExpressionError,
    },
    #[error("'{text}' cannot be used: {why}")]
    Constraint { text: String, why: String },
    #[error("{key}: there is no {what} '{name}'{hint} There are {known}")]
    NoChannel {
        key: &'static str,
        /// Output or input.
        what: &'static str,
        name: String,
        hint: String,
        known: String,
    },
    #[error("the method grey-box needs a vessel file: name it, as in {}", key("vessel").is("boat.toml"))]
    NoVessel,
    #[error(transparent)]
    GreyBox(#[from] GreyBoxError),
    #[error(
        "models of the motion through the water are cross-validated: leave out {}, and give only {}",
        key("validate"),
        key("methods").is("sindy,committee")
    )]
    ThroughWater,
    #[error(
        "the currents of the runs cannot be estimated: the runs are too short for predictions over a quarter of the horizon, or such predictions diverge. Give longer runs or a shorter {}, or identify with {}",
        key("horizon"),
        key("motion").is("over-ground")
    )]
    NoCurrents,
    #[error(
        "there is no output '{name}', and the current needs surge u, sway v and yaw rate r: name their columns, as in {}",
        key("outputs").is("u=SOG,v=SWAY,r=GYRO")
    )]
    NoMotion { name: &'static str },
    #[error(
        "{run}: no column is known to be the heading, which the current needs: name it, as in {}",
        key("heading").is("psi [deg]")
    )]
    NoHeading { run: String },
    #[error(
        "gate {gate}: only {:.1} % of the training samples are {side} it, too few for equations of that mode. Move the gate, add runs in both modes, or use the search for gates ({})",
        100.0 * share,
        key("gate").is("auto")
    )]
    ModeNotVisited { gate: String, side: &'static str, share: f64 },
    #[error("there are no {what} runs: give more logs, or name some with {}", key(what))]
    NoRuns {
        /// `train`, `validate` or `test`.
        what: &'static str,
    },
    #[error(
        "'{first}' and '{second}' share measurements: training, validation and test must be disjoint for a valid evaluation. Name each log once"
    )]
    DataLeakage { first: String, second: String },
    #[error(
        "input '{input}' is {form}output '{output}' in disguise: {form}'{output}', {delay_s:.4} s before, explains {percent:.1} % of it, and {leads_percent:.1} % where the input leads. A model would read its predictions from such an input. Leave it out of {}, or allow it, if it is a command that follows the motion, by {}",
        key("inputs"),
        key("allow_feedback").is(input)
    )]
    Disguise {
        input: String,
        /// What of the output it is: empty for the output itself.
        form: &'static str,
        output: String,
        percent: f64,
        delay_s: f64,
        leads_percent: f64,
    },
    #[error("the {what} of {value} cannot be used: it must be {needed}")]
    InvalidOption { what: &'static str, value: String, needed: &'static str },
    #[error(
        "the rate limit of '{channel}' cannot be used: {why}. Write it per second, as in {}",
        key("rate_limit").is("delta=4 [deg]")
    )]
    RateLimit { channel: String, why: String },
    #[error("the range of '{channel}' cannot be used: {why}")]
    Range { channel: String, why: String },
    #[error(
        "{} requires equations as its base model (base = \"equations\"), but no equations were found: add sindy or lagged to the methods, or set base = \"hold\" or \"nothing\"",
        method.name()
    )]
    NoBase { method: Method },
    #[error(
        "the logs have no inputs, and a network without output feedback has no other variables: select {}, or set feedback = true under [{}]",
        key("inputs"),
        method.name()
    )]
    NoInputs { method: Method },
    #[error(
        "a horizon of {horizon} samples ({horizon_s} s) cannot be used: the longest of the {part} runs has {longest} samples, one of which is the origin. Set a horizon of at most {} samples, or longer runs",
        longest.saturating_sub(1)
    )]
    Horizon {
        /// `validation`, `test`, or `left-out` in a cross-validation.
        part: &'static str,
        horizon: usize,
        horizon_s: f64,
        longest: usize,
    },
    #[error(
        "it cannot be evaluated: the warm-up requires {warm_up} samples and a measurement of each output, the horizon {horizon} samples; all {part} runs are shorter than both together (the longest has {longest} samples). Use longer runs, a shorter {}, or a shorter wash_out_s of the network",
        key("horizon")
    )]
    NotEvaluable {
        /// `validation`, `test`, or `left-out` in a cross-validation.
        part: &'static str,
        warm_up: usize,
        horizon: usize,
        longest: usize,
    },
    #[error(
        "there is no interrupted training in {} to resume: remove {}, or give the folder of the training as {}",
        folder.display(),
        key("resume"),
        key("output")
    )]
    NoCheckpoint { folder: PathBuf },
    /// The training of a network failed.
    #[error("{}: {error}", method.name())]
    Train { method: Method, error: TrainError },
    #[error(transparent)]
    Sindy(#[from] SearchError),
    #[error(transparent)]
    Committee(#[from] ChooseError),
    #[error("the {part} runs cannot be evaluated: {error}")]
    Evaluate {
        /// Validation or test.
        part: &'static str,
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
