//! Open-loop multi-step errors of a model on runs, the same for every kind of model.
//!
//! From every origin `k` past the warm-up, the session has seen the outputs up to `k` and the commands up
//! to `k - 1`; it is rolled out under the true commands `c_k ..` and compared at horizons `1..=H`. Beside
//! it stands persistence: every output keeps its value of the origin.
//!
//! A rollout is *diverged* when it is not finite or leaves ten times the design range; it is counted, left
//! out of the means of the model and of persistence, and its place is told.

mod band;
mod sums;
mod windows;

use serde::{Deserialize, Serialize};

use crate::log::Channel;

pub(crate) use band::quantile;
pub use band::{BAND, Band, BandCoverage, band_coverage, bands};
pub use windows::evaluate;

/// What the session sees on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The measurements: what the user has.
    #[default]
    Measured,
    /// The true outputs of a simulated log: isolates the model from the noise of its start.
    True,
}

/// What the predictions are compared with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// The measurements.
    #[default]
    Measurement,
    /// The true outputs of a simulated log.
    Truth,
}

/// Interval in which an output is expected; the scale by which divergence is judged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignRange {
    /// Lowest value expected.
    pub low: f64,
    /// Highest value expected.
    pub high: f64,
}

impl DesignRange {
    /// Whether a value has left ten times the range: farther from its centre than ten half-widths, or not
    /// a number at all.
    pub fn diverged(self, value: f64) -> bool {
        let centre = 0.5 * (self.low + self.high);
        let half = 0.5 * (self.high - self.low);
        value.is_nan() || (value - centre).abs() > 10.0 * half
    }
}

/// How to evaluate.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Longest horizon \[samples\].
    pub horizon: usize,
    /// Samples between two origins.
    pub origin_stride: usize,
    /// What the session sees.
    pub origin: Origin,
    /// What the predictions are compared with.
    pub against: Against,
    /// Samples seen before the first origin; a model that needs more gets more.
    pub warm_up: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            horizon: 100,
            origin_stride: 1,
            origin: Origin::Measured,
            against: Against::Measurement,
            warm_up: 1,
        }
    }
}

/// Where a rollout left ten times the design range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Divergence {
    /// Name of the run.
    pub run: String,
    /// Time of the origin \[s\].
    pub origin_s: f64,
    /// Horizon at which it happened \[samples\].
    pub horizon: usize,
    /// Output that left its range first.
    pub channel: String,
}

/// How many of the runs were judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunCount {
    /// Runs that gave at least one window.
    pub used: usize,
    /// Runs that gave none: shorter than warm-up and horizon, or with an output that is missing until
    /// near their end.
    pub unused: usize,
    /// Samples of the unused runs.
    pub unused_samples: usize,
}

/// Errors of persistence on the same windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    /// Mean absolute error, per horizon and channel.
    #[serde(deserialize_with = "null_is_nan")]
    pub mae: Vec<Vec<f64>>,
    /// Root of the mean square error.
    #[serde(deserialize_with = "null_is_nan")]
    pub rmse: Vec<Vec<f64>>,
    /// RMSE over the standard deviation of the compared channel.
    #[serde(deserialize_with = "null_is_nan")]
    pub nrmse: Vec<Vec<f64>>,
}

/// Errors by horizon and channel: `mae[h][c]` is that of channel `c` at horizon `horizons[h]`, in the
/// channel's unit. A figure that does not exist (no window, no variation) is NaN, `null` in JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Name of the model.
    pub model: String,
    /// What the session saw: `measured` or `true`.
    pub origin: Origin,
    /// What was compared with: `measurement` or `truth`.
    pub against: Against,
    /// Sample time \[s\].
    pub dt: f64,
    /// Names of the outputs.
    pub channels: Vec<String>,
    /// Units of the outputs.
    pub units: Vec<String>,
    /// Horizons \[samples\].
    pub horizons: Vec<usize>,
    /// Windows rolled out, diverged ones included.
    pub windows: usize,
    /// Runs that gave windows, and those that did not.
    pub runs: RunCount,
    /// Windows that diverged.
    pub diverged: usize,
    /// The first few places where that happened.
    pub divergences: Vec<Divergence>,
    /// Mean absolute error.
    #[serde(deserialize_with = "null_is_nan")]
    pub mae: Vec<Vec<f64>>,
    /// Largest absolute error.
    #[serde(deserialize_with = "null_is_nan")]
    pub max: Vec<Vec<f64>>,
    /// Root of the mean square error.
    #[serde(deserialize_with = "null_is_nan")]
    pub rmse: Vec<Vec<f64>>,
    /// RMSE over the standard deviation of the compared channel over the same points.
    #[serde(deserialize_with = "null_is_nan")]
    pub nrmse: Vec<Vec<f64>>,
    /// Coefficient of determination, `1 - nrmse^2`.
    #[serde(deserialize_with = "null_is_nan")]
    pub r2: Vec<Vec<f64>>,
    /// "Nothing changes", on the same windows.
    pub persistence: Baseline,
    /// Mean square error over the variance of the channel, in the mean over channels and horizons, for up to
    /// [`BLOCKS`] consecutive parts of the windows: how much a comparison of two models on the same windows
    /// is worth. Infinite where a rollout diverged.
    #[serde(skip)]
    pub blocks: Vec<f64>,
}

/// Parts of the windows at the most in [`Evaluation::blocks`].
pub const BLOCKS: usize = 16;

impl Evaluation {
    /// Mean over channels and horizons of the NRMSE: one figure to choose by. Channels or horizons without
    /// a figure do not count; infinite where any rollout diverged or nothing could be compared.
    pub fn score(&self) -> f64 {
        if self.diverged > 0 {
            return f64::INFINITY;
        }
        mean_finite(self.nrmse.iter().flatten().copied()).unwrap_or(f64::INFINITY)
    }

    /// Position of a horizon in the tables.
    pub fn at(&self, horizon: usize) -> Option<usize> {
        self.horizons.iter().position(|&h| h == horizon)
    }
}

/// JSON has no NaN: a figure that does not exist is written as null.
fn null_is_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<Vec<f64>>, D::Error> {
    let table: Vec<Vec<Option<f64>>> = Deserialize::deserialize(deserializer)?;
    Ok(table.into_iter().map(|row| row.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect()).collect())
}

/// Mean of the numbers that are finite.
pub fn mean_finite(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) =
        values.filter(|v| v.is_finite()).fold((0.0, 0usize), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// Why an evaluation could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluateError {
    /// No run is long enough.
    #[error(
        "no run is long enough: an origin needs {needed} samples ({warm_up} of warm-up and {horizon} of horizon), the longest run has {longest}. Ask for a shorter horizon or give longer runs"
    )]
    TooShort {
        /// Samples needed.
        needed: usize,
        /// Warm-up samples among them.
        warm_up: usize,
        /// Horizon among them.
        horizon: usize,
        /// Samples of the longest run.
        longest: usize,
    },
    /// Truth was asked for and a run has none.
    #[error(
        "run '{run}' has no true outputs: only simulated logs do (columns like u_true). Use --origin measured and --against measurement"
    )]
    NoTruth {
        /// The run without truth.
        run: String,
    },
    /// The run's channels are not the model's.
    #[error("the model has {expected} {what}, run '{run}' has {given}")]
    Channels {
        /// The run.
        run: String,
        /// `outputs` or `inputs`.
        what: &'static str,
        /// Of the model.
        expected: usize,
        /// Of the run.
        given: usize,
    },
    /// No window can start in any run.
    #[error(
        "output '{channel}' is nowhere measured early enough to start a prediction from. Leave it out, or give a run where it is measured"
    )]
    NoOrigin {
        /// The output that is missing.
        channel: String,
    },
    /// Runs with different sample times.
    #[error(
        "run '{run}' has a sample time of {given} s, the others {expected} s: resample them to one step (--dt)"
    )]
    SampleTime {
        /// The run.
        run: String,
        /// Of the first run \[s\].
        expected: f64,
        /// Of this run \[s\].
        given: f64,
    },
    /// Nothing to evaluate.
    #[error("the horizon and the stride between origins must be at least 1 sample")]
    NoHorizon,
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] crate::progress::Cancelled),
}

/// Names and units for the tables.
fn describe(channels: &[Channel]) -> (Vec<String>, Vec<String>) {
    channels.iter().map(|c| (c.name.clone(), c.unit.clone())).unzip()
}
