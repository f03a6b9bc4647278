//! Why a training could not be done.

use std::path::PathBuf;

use crate::atomic::WriteError;
use crate::progress::Cancelled;

/// Why a training could not be done.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A setting cannot be.
    #[error("{what} = {value} cannot be: give {needed}")]
    Setting {
        /// Its name.
        what: &'static str,
        /// What was given.
        value: String,
        /// What is needed.
        needed: &'static str,
    },
    /// The network cannot be.
    #[error("{error}")]
    Network {
        /// What is wrong with it.
        error: String,
    },
    /// There are no runs for a part.
    #[error("there are no {what} runs: give at least one")]
    NoRuns {
        /// `training` or `validation`.
        what: &'static str,
    },
    /// A run has other channels than the design ranges or the first run.
    #[error("run '{run}' has {given} {what} where {expected} are expected: give runs with the same channels")]
    Channels {
        /// The run.
        run: String,
        /// `outputs` or `inputs`.
        what: &'static str,
        /// How many there should be.
        expected: usize,
        /// How many there are.
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
        /// Which, from 0.
        index: usize,
        /// As given.
        low: f64,
        /// As given.
        high: f64,
    },
    /// A sine of more than a quarter of a turn.
    #[error(
        "input '{channel}' is to act by its sine, and its design range is {low}..{high} rad, beyond a quarter of a turn (1.5708), where a sine cannot be inverted: give a narrower --range, or say that it acts as it is, maps = [{maps}] in [affine]"
    )]
    Sine {
        /// The input.
        channel: String,
        /// Lowest \[rad\].
        low: f64,
        /// Highest \[rad\].
        high: f64,
        /// Maps that would do.
        maps: String,
    },
    /// No run holds a whole window.
    #[error(
        "no {what} run is long enough: a window needs {needed} samples ({wash_out} of wash-out, {length} compared, and the first), the longest run has {longest}. Give longer runs, or a shorter wash_out_s or {} (a direct predictor has history_s in place of wash_out_s)",
        if *what == "validation" { "horizon (--horizon)" } else { "window_s" }
    )]
    TooShort {
        /// `training` or `validation`.
        what: &'static str,
        /// Samples of a window.
        needed: usize,
        /// Wash-out among them.
        wash_out: usize,
        /// Compared among them.
        length: usize,
        /// Samples of the longest run.
        longest: usize,
    },
    /// Runs are long enough, but values are missing in every window.
    #[error(
        "no window of the {what} runs can be used: in each an input is missing, or an output is not measured before its predictions begin, or nothing is measured to compare with. Fill the gaps, or leave out the channel that is missing"
    )]
    NoWindow {
        /// `training` or `validation`.
        what: &'static str,
    },
    /// Nothing varies over the origins of the validation runs, so that errors have no measure.
    #[error(
        "the validation runs hold {origins} origins with a wash-out before and {horizon} samples to compare after them, and no output differs from one to the other, so that errors have no measure: give longer validation runs or some that move, or a shorter horizon (--horizon)"
    )]
    NoScore {
        /// How many origins there are.
        origins: usize,
        /// Longest horizon \[samples\].
        horizon: usize,
    },
    /// An output does not vary in the training runs.
    #[error(
        "output '{channel}' does not move by a millionth of its design range in the training runs, so that nothing can be learned of it: leave it out, or give runs where it moves"
    )]
    Constant {
        /// The output.
        channel: String,
    },
    /// Equations were asked for as base, or given, and do not fit.
    #[error("the base cannot be equations: {reason}")]
    Equations {
        /// What is wrong.
        reason: String,
    },
    /// No restart had weights that were worth keeping after any epoch.
    #[error(
        "the training diverged: after every epoch of all restarts ({restarts}) some rollout on the validation runs left ten times the design range. Give a smaller learning_rate (it was {learning_rate}), or wider design ranges if the vessel does leave them"
    )]
    Diverged {
        /// How many there were.
        restarts: usize,
        /// Peak step size.
        learning_rate: f64,
    },
    /// The time was over before the first epoch was.
    #[error(
        "{budget_s} s are not enough for one epoch, which takes about {epoch_s:.2} s: give a larger budget, or a smaller network"
    )]
    NoTime {
        /// What was given \[s\].
        budget_s: f64,
        /// What an epoch would have taken \[s\].
        epoch_s: f64,
    },
    /// The checkpoint cannot be used.
    #[error("cannot use checkpoint {}: {reason}", path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// The checkpoint cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The caller asked to stop. With a checkpoint the training can go on from the last epoch.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
