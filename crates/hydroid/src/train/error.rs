//! Errors of a training.

use std::path::PathBuf;

use crate::atomic::WriteError;
use crate::key::key;
use crate::progress::Cancelled;

/// Error of a training.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum TrainError {
    #[error("{what} = {value} is invalid; expected: {needed}")]
    InvalidOption { what: &'static str, value: String, needed: &'static str },
    /// Invalid network.
    #[error("{error}")]
    Network { error: String },
    #[error("there are no {what} runs: give at least one")]
    NoRuns {
        /// `training` or `validation`.
        what: &'static str,
    },
    #[error("run '{run}' has {given} {what} where {expected} are expected: give runs with the same channels")]
    Channels {
        run: String,
        /// `outputs` or `inputs`.
        what: &'static str,
        expected: usize,
        given: usize,
    },
    #[error(
        "run '{run}' has a sample time of {given} s, the first {expected} s: resample them to one step ({})",
        key("dt")
    )]
    SampleTime { run: String, expected: f64, given: f64 },
    #[error("the design range of {what} {index} is {low}..{high}: give two finite numbers, the lower first")]
    Range {
        /// `output` or `input`.
        what: &'static str,
        /// Index from 0.
        index: usize,
        low: f64,
        high: f64,
    },
    #[error(
        "input '{channel}' is to act by its sine, and its design range is {low}..{high} rad, beyond a quarter of a turn (1.5708), where a sine cannot be inverted: give a narrower range ({}), or set maps = [{maps}] in [affine]",
        key("ranges")
    )]
    Sine { channel: String, low: f64, high: f64, maps: String },
    #[error(
        "no {what} run is long enough: a window needs {needed} samples ({wash_out} of wash-out, {length} compared, and the first), the longest run has {longest}. Give longer runs, or a shorter wash_out_s or {} (a direct predictor has history_s in place of wash_out_s)",
        if *what == "validation" { key("horizon").to_string() } else { String::from("window_s") }
    )]
    TooShort {
        /// `training` or `validation`.
        what: &'static str,
        needed: usize,
        wash_out: usize,
        length: usize,
        longest: usize,
    },
    #[error(
        "no window of the {what} runs can be used: in each an input is missing, or an output has no measurement before the predictions, or no measurement to compare with. Fill the gaps, or leave out the channel that is missing"
    )]
    NoWindow {
        /// `training` or `validation`.
        what: &'static str,
    },
    #[error(
        "the validation runs hold {origins} origins with a wash-out before and {horizon} samples to compare after them, and no output varies over the origins, so that the NRMSE is undefined: give longer validation runs, runs in which the outputs vary, or a shorter {}",
        key("horizon")
    )]
    NoScore { origins: usize, horizon: usize },
    #[error(
        "output '{channel}' does not move by a millionth of its design range in the training runs and cannot be learned: leave it out, or give runs where it moves"
    )]
    Constant { channel: String },
    #[error("the base cannot be equations: {reason}")]
    Equations { reason: String },
    #[error(
        "the training diverged: after every epoch of all restarts ({restarts}) some rollout on the validation runs left ten times the design range. Give a smaller learning_rate (it was {learning_rate}), or wider design ranges if the vessel does leave them"
    )]
    Diverged { restarts: usize, learning_rate: f64 },
    #[error(
        "{budget_s} s are not enough for one epoch, which takes about {epoch_s:.2} s: give a larger budget, or a smaller network"
    )]
    NoTime { budget_s: f64, epoch_s: f64 },
    #[error("cannot use checkpoint {}: {reason}", path.display())]
    Checkpoint { path: PathBuf, reason: String },
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Cancelled. With a checkpoint the training can be resumed from the last epoch.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
