//! Open-loop multi-step errors of any model.
//!
//! At every origin `k` after the warm-up, the session has observed the outputs up to `k` and the commands up to `k -
//! 1`. It is rolled out with the true commands `c_k ..` and compared at horizons `1..=H`, beside persistence (each
//! output keeps its value at the origin).
//!
//! A rollout has *diverged* if it is not finite or leaves ten times the range of its output: the design range, widened to
//! the range of the run on which the model is evaluated. Diverged rollouts are counted. Their predictions are limited to
//! ten times the range and stay in every error, so that the errors of model and persistence cover all windows.

mod band;
mod prediction_bands;
mod sums;
mod windows;

use serde::{Deserialize, Serialize};

use crate::key::key;
use crate::log::Channel;

#[doc(hidden)]
pub use band::BAND;
pub(crate) use band::quantile;
pub use band::{Band, BandCoverage, band_coverage, bands};
#[doc(hidden)]
pub use prediction_bands::BAND_80;
pub use prediction_bands::{PredictionBands, PredictionCoverage};
pub(crate) use windows::{TASK as WINDOWS, blocks as loss_blocks, latest};
pub use windows::{evaluate, evaluate_each};

/// Outputs that the session observes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Measurements.
    #[default]
    Measured,
    /// True outputs of a simulated log, which excludes the noise of the initial state.
    True,
}

/// Target of the comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// Measurements.
    #[default]
    Measurement,
    /// True outputs of a simulated log.
    Truth,
}

/// Design range of an output: the scale of divergence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DesignRange {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl DesignRange {
    /// Whether a value is farther than ten half-widths from the centre of the range, or NaN.
    pub fn diverged(self, value: f64) -> bool {
        let (low, high) = self.limits();
        !(low..=high).contains(&value)
    }

    /// Limits of predictions: ten half-widths below and above the centre of the range.
    pub fn limits(self) -> (f64, f64) {
        let centre = 0.5 * (self.low + self.high);
        let half = 0.5 * (self.high - self.low);
        (centre - 10.0 * half, centre + 10.0 * half)
    }

    /// The smallest range that contains this one and all values.
    #[must_use]
    pub(crate) fn including(self, values: impl Iterator<Item = f64>) -> Self {
        values.fold(self, |range, y| Self { low: range.low.min(y), high: range.high.max(y) })
    }
}

/// Options of an evaluation.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Longest horizon \[samples\].
    pub horizon: usize,
    /// Samples between two origins.
    pub origin_stride: usize,
    /// Observed outputs.
    pub origin: Origin,
    /// Target of the comparison.
    pub against: Against,
    /// Least warm-up \[samples\]; the model's own warm-up may be longer.
    pub warm_up: usize,
    /// Horizons \[samples\] at which the errors of single windows are kept, for [prediction bands](PredictionBands).
    pub errors_at: Vec<usize>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            horizon: 100,
            origin_stride: 1,
            origin: Origin::Measured,
            against: Against::Measurement,
            warm_up: 1,
            errors_at: Vec::new(),
        }
    }
}

/// A diverged rollout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Divergence {
    /// Name of the run.
    pub run: String,
    /// Time of the origin \[s\].
    pub origin_s: f64,
    /// Horizon of the divergence \[samples\].
    pub horizon: usize,
    /// Output that left its range first.
    pub channel: String,
}

/// Number of evaluated runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunCount {
    /// Runs with at least one window.
    pub used: usize,
    /// Runs without a window: shorter than warm-up and horizon, or with a missing output.
    pub unused: usize,
    /// Samples of the runs without a window.
    pub unused_samples: usize,
}

/// Errors of persistence on the same windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    /// Mean absolute error, per horizon and channel.
    #[serde(deserialize_with = "null_is_nan")]
    pub mae: Vec<Vec<f64>>,
    /// Root mean square error.
    #[serde(deserialize_with = "null_is_nan")]
    pub rmse: Vec<Vec<f64>>,
    /// RMSE over the standard deviation of the compared channel.
    #[serde(deserialize_with = "null_is_nan")]
    pub nrmse: Vec<Vec<f64>>,
}

/// Errors by horizon and channel: `mae[h][c]` is for horizon `horizons[h]` and channel `c`, in its unit. Undefined
/// values (no window, constant output) are NaN, `null` in JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Name of the model.
    pub model: String,
    /// Observed outputs: `measured` or `true`.
    pub origin: Origin,
    /// Target: `measurement` or `truth`.
    pub against: Against,
    /// Sample time \[s\].
    pub dt: f64,
    /// Names of the outputs.
    pub channels: Vec<String>,
    /// Units of the outputs.
    pub units: Vec<String>,
    /// Horizons \[samples\].
    pub horizons: Vec<usize>,
    /// Windows, diverged ones included.
    pub windows: usize,
    /// Windows of which no two overlap; see [`MIN_WINDOWS`].
    #[serde(default)]
    pub independent: usize,
    /// Evaluated runs.
    pub runs: RunCount,
    /// Diverged windows; their limited predictions are part of all errors.
    pub diverged: usize,
    /// First diverged windows.
    pub divergences: Vec<Divergence>,
    /// Mean absolute error.
    #[serde(deserialize_with = "null_is_nan")]
    pub mae: Vec<Vec<f64>>,
    /// Largest absolute error.
    #[serde(deserialize_with = "null_is_nan")]
    pub max: Vec<Vec<f64>>,
    /// Root mean square error.
    #[serde(deserialize_with = "null_is_nan")]
    pub rmse: Vec<Vec<f64>>,
    /// RMSE over the standard deviation of the compared channel over the same points.
    #[serde(deserialize_with = "null_is_nan")]
    pub nrmse: Vec<Vec<f64>>,
    /// Coefficient of determination, `1 - nrmse^2`.
    #[serde(deserialize_with = "null_is_nan")]
    pub r2: Vec<Vec<f64>>,
    /// Persistence on the same windows.
    pub persistence: Baseline,
    /// Mean over channels and horizons of the square error over the variance of the channel, for up to [`BLOCKS`]
    /// consecutive blocks of windows. The spread of the blocks gives the uncertainty of a comparison of two models.
    /// Infinite if a rollout diverged.
    #[serde(skip)]
    pub blocks: Vec<f64>,
    /// Errors on each run with a window.
    #[serde(default)]
    pub by_run: Vec<RunErrors>,
    /// Horizons of [`errors`](Self::errors) \[samples\].
    #[serde(skip)]
    pub errors_at: Vec<usize>,
    /// Absolute errors of windows spread over all runs, for each horizon of [`errors_at`](Self::errors_at) and each
    /// output; NaN without a measurement.
    #[serde(skip)]
    pub errors: Vec<Vec<f32>>,
    /// Number of these windows in each run, in the order of the errors.
    #[serde(skip)]
    pub windows_of_runs: Vec<usize>,
}

/// Errors on one run at the longest horizon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunErrors {
    /// Name of the run.
    pub run: String,
    /// Windows, diverged ones included.
    pub windows: usize,
    /// Diverged windows.
    pub diverged: usize,
    /// RMSE of each output over its standard deviation over all evaluated runs, so that the runs can be compared.
    #[serde(deserialize_with = "null_row_is_nan")]
    pub nrmse: Vec<f64>,
    /// The same of persistence.
    #[serde(deserialize_with = "null_row_is_nan")]
    pub persistence: Vec<f64>,
}

/// Fewest windows without overlap that judge a model. The relative standard error of an RMSE over n independent Gaussian errors
/// is `1 / sqrt(2 n)` (Ahn and Fessler, Standard errors of mean, variance, and standard deviation estimators, University of
/// Michigan, 2003): a third for 5, so that a model as good as persistence is graded good, at half of its error, only by a deviation
/// of one and a half standard errors.
pub const MIN_WINDOWS: usize = 5;

/// Largest number of blocks in [`Evaluation::blocks`].
#[doc(hidden)]
pub const BLOCKS: usize = 16;

impl Evaluation {
    /// Score: mean of the defined NRMSE; infinite if a rollout diverged or nothing was compared.
    pub fn score(&self) -> f64 {
        if self.diverged > 0 {
            return f64::INFINITY;
        }
        mean_finite(self.nrmse.iter().flatten().copied()).unwrap_or(f64::INFINITY)
    }

    /// Index of a horizon.
    pub fn at(&self, horizon: usize) -> Option<usize> {
        self.horizons.iter().position(|&h| h == horizon)
    }
}

/// JSON has no NaN: undefined values are null.
fn null_is_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<Vec<f64>>, D::Error> {
    let table: Vec<Vec<Option<f64>>> = Deserialize::deserialize(deserializer)?;
    Ok(table.into_iter().map(|row| row.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect()).collect())
}

fn null_row_is_nan<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let row: Vec<Option<f64>> = Deserialize::deserialize(deserializer)?;
    Ok(row.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
}

/// Mean of the finite values.
#[doc(hidden)]
pub fn mean_finite(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) =
        values.filter(|v| v.is_finite()).fold((0.0, 0usize), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// Error of an evaluation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum EvaluateError {
    #[error(
        "no run is long enough: an origin needs {needed} samples ({warm_up} of warm-up and {horizon} of horizon), the longest run has {longest}. Ask for a shorter horizon or give longer runs"
    )]
    TooShort { needed: usize, warm_up: usize, horizon: usize, longest: usize },
    #[error(
        "run '{run}' has no true outputs: only simulated logs do (columns like u_true). Use {} and {}",
        key("origin").is("measured"),
        key("against").is("measurement")
    )]
    NoTruth { run: String },
    #[error("the model has {expected} {what}, run '{run}' has {given}")]
    Channels {
        run: String,
        /// `outputs` or `inputs`.
        what: &'static str,
        expected: usize,
        given: usize,
    },
    #[error(
        "output '{channel}' is nowhere measured early enough to start a prediction from. Leave it out, or give a run where it is measured"
    )]
    NoOrigin { channel: String },
    #[error(
        "run '{run}' has a sample time of {given} s, the others {expected} s: resample them to one step ({})",
        key("dt")
    )]
    SampleTime { run: String, expected: f64, given: f64 },
    #[error("the horizon and the stride between origins must be at least 1 sample")]
    NoHorizon,
    #[error(transparent)]
    Cancelled(#[from] crate::progress::Cancelled),
}

fn describe(channels: &[Channel]) -> (Vec<String>, Vec<String>) {
    channels.iter().map(|c| (c.name.clone(), c.unit.clone())).unzip()
}
