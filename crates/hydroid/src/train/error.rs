//! Errors of a training.

use std::path::PathBuf;

use crate::atomic::WriteError;
use crate::progress::Cancelled;

/// Error of a training.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// Invalid option.
    #[error("{what} = {value} is invalid; expected: {needed}")]
    InvalidOption {
        /// Name.
        what: &'static str,
        /// Given value.
        value: String,
        /// Permitted values.
        needed: &'static str,
    },
    /// Invalid network.
    #[error("{error}")]
    Network {
        /// Reason.
        error: String,
    },
    /// No runs.
    #[error("there are no {what} runs: give at least one")]
    NoRuns {
        /// `training` or `validation`.
        what: &'static str,
    },
    /// Channels of a run differ from the design ranges or the first run.
    #[error("run '{run}' has {given} {what} where {expected} are expected: give runs with the same channels")]
    Channels {
        /// The run.
        run: String,
        /// `outputs` or `inputs`.
        what: &'static str,
        /// Expected number.
        expected: usize,
        /// Given number.
        given: usize,
    },
    /// Runs have different sample times.
    #[error(
        "run '{run}' has a sample time of {given} s, the first {expected} s: resample them to one step (--dt)"
    )]
    SampleTime {
        /// The run.
        run: String,
        /// Of the first run \[s\].
        expected: f64,
        /// Of this run \[s\].
        given: f64,
    },
    /// A design range is empty or not finite.
    #[error("the design range of {what} {index} is {low}..{high}: give two finite numbers, the lower first")]
    Range {
        /// `output` or `input`.
        what: &'static str,
        /// Index from 0.
        index: usize,
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Range of an input with a sine map beyond +-90 degrees.
    #[error(
        "input '{channel}' is to act by its sine, and its design range is {low}..{high} rad, beyond a quarter of a turn (1.5708), where a sine cannot be inverted: give a narrower --range, or set maps = [{maps}] in [affine]"
    )]
    Sine {
        /// The input.
        channel: String,
        /// Lowest \[rad\].
        low: f64,
        /// Highest \[rad\].
        high: f64,
        /// Valid maps.
        maps: String,
    },
    /// No run is long enough for a window.
    #[error(
        "no {what} run is long enough: a window needs {needed} samples ({wash_out} of wash-out, {length} compared, and the first), the longest run has {longest}. Give longer runs, or a shorter wash_out_s or {} (a direct predictor has history_s in place of wash_out_s)",
        if *what == "validation" { "horizon (--horizon)" } else { "window_s" }
    )]
    TooShort {
        /// `training` or `validation`.
        what: &'static str,
        /// Samples of a window.
        needed: usize,
        /// Samples of wash-out.
        wash_out: usize,
        /// Compared samples.
        length: usize,
        /// Samples of the longest run.
        longest: usize,
    },
    /// Every window has missing values.
    #[error(
        "no window of the {what} runs can be used: in each an input is missing, or an output has no measurement before the predictions, or no measurement to compare with. Fill the gaps, or leave out the channel that is missing"
    )]
    NoWindow {
        /// `training` or `validation`.
        what: &'static str,
    },
    /// No output varies over the validation origins, so that the NRMSE is undefined.
    #[error(
        "the validation runs hold {origins} origins with a wash-out before and {horizon} samples to compare after them, and no output varies over the origins, so that the NRMSE is undefined: give longer validation runs, runs in which the outputs vary, or a shorter horizon (--horizon)"
    )]
    NoScore {
        /// Number of origins.
        origins: usize,
        /// Longest horizon \[samples\].
        horizon: usize,
    },
    /// Constant output in the training runs.
    #[error(
        "output '{channel}' does not move by a millionth of its design range in the training runs and cannot be learned: leave it out, or give runs where it moves"
    )]
    Constant {
        /// The output.
        channel: String,
    },
    /// Base equations are missing or do not fit.
    #[error("the base cannot be equations: {reason}")]
    Equations {
        /// Reason.
        reason: String,
    },
    /// All restarts diverged.
    #[error(
        "the training diverged: after every epoch of all restarts ({restarts}) some rollout on the validation runs left ten times the design range. Give a smaller learning_rate (it was {learning_rate}), or wider design ranges if the vessel does leave them"
    )]
    Diverged {
        /// Number of restarts.
        restarts: usize,
        /// Peak step size.
        learning_rate: f64,
    },
    /// The budget is smaller than one epoch.
    #[error(
        "{budget_s} s are not enough for one epoch, which takes about {epoch_s:.2} s: give a larger budget, or a smaller network"
    )]
    NoTime {
        /// Budget \[s\].
        budget_s: f64,
        /// Estimated time of an epoch \[s\].
        epoch_s: f64,
    },
    /// Unusable checkpoint.
    #[error("cannot use checkpoint {}: {reason}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// Reason and remedy.
        reason: String,
    },
    /// The checkpoint cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Cancelled. With a checkpoint the training can be resumed from the last epoch.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
