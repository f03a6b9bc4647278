//! Coefficients, lags and gates that `nelder_mead` the errors of predictions over many steps.
//!
//! A regression asks how well the equations explain derivatives. That is neither the most likely answer under noise of
//! measurement, nor what a model is judged by. With the terms chosen, [`refine`] minimises instead
//!
//! ```text
//! sum over windows of  sum_i ((y_i(0) - x_i) / n_i)^2 + sum_{k = 1..H, i} ((y_i(k) - x_i(k)) / s_i)^2
//!   + strength sum_j d_j^2 (p_j - p0_j)^2
//! ```
//!
//! over the parameters `p` (coefficients, time constants of lags, centres and slopes of gates) and over the outputs
//! `x(0)` at the start of every window, from which `x(k)` is rolled out under the logged commands: output-error
//! identification (Ljung, *System Identification*, 1999, section 7.5) by multiple shooting (Bock, in *Modelling of
//! Chemical Reaction Systems*, 1981) without conditions of continuity between windows, since a vessel has forces that
//! no log has. `s_i` is what the predictions from the regression's estimate miss the measurements by (RMS), and `n_i`
//! the noise of the sensor: where the model is worse than the sensor, `x(0)` stays at the measurement, as it does when
//! the model is used; on data that have noise alone all errors weigh the same, and the estimate is the most likely. The
//! last sum holds on to the regression's estimate `p0` where the windows say little, `d_j` being the norm of the column
//! of `p_j`.

mod levenberg_marquardt;
mod outcome;
mod parameters;
mod shooting;

use hydroid_core::model::sparse::Equations;

use self::levenberg_marquardt::{LinearConstraints, Prior, levenberg_marquardt};
pub(super) use self::outcome::Attempt;
pub use self::outcome::{Outcome, Refinement};
use self::parameters::Parameters;
use self::shooting::Windows;
use super::constraints::Constraints;
use super::noise::noise_std;
use super::structure::{GateSpec, Lag};
use crate::evaluate::DesignRange;
use crate::log::Trajectory;
use crate::progress::{self, Cancelled, Progress};

/// How far a window's start is from that of the one before, in lengths of a window: each sample is then in the first
/// half of one window and in the second half of another.
const STRIDE: f64 = 0.5;

/// Standard deviations in a design range, as a first guess of an output's size.
const DEVIATIONS: f64 = 5.0;

/// Residuals smaller than this share of the outputs are rounding.
const ROUNDING_FLOOR: f64 = 1e-6;

/// Data and options of a refinement.
#[derive(Clone, Debug)]
pub struct RefineOptions<'a> {
    /// Runs to learn from.
    pub runs: &'a [&'a Trajectory],
    /// Design ranges of the outputs: a rollout that leaves ten times these has diverged.
    pub ranges: &'a [DesignRange],
    /// Length of a window \[samples\].
    pub horizon: usize,
    /// Strengths of the prior at the initial estimate, in decreasing order; each descent starts from the previous
    /// result.
    pub strengths: &'a [f64],
    /// Huber threshold of the errors \[standard deviations\].
    pub huber: Option<f64>,
    /// Lags whose time constants are refined.
    pub lags: &'a [Lag],
    /// Gates whose centres and slopes are refined.
    pub gates: &'a [GateSpec],
    /// Constraints on the coefficients.
    pub constraints: &'a Constraints,
}

/// `RefinedEquations` equations.
#[derive(Clone, Debug)]
pub struct RefinedEquations {
    /// The equations.
    pub equations: Equations,
    /// Strength of the prior.
    pub strength: f64,
    /// Number of iterations.
    pub steps: usize,
    /// Mean loss of an error, in units of the start's mean square.
    pub cost: f64,
}

/// Refines equations, once for each strength of the prior. The list is empty if the initial rollouts diverge or no run
/// is longer than a window.
///
/// # Errors
/// If the work was interrupted.
pub fn refine(
    options: &RefineOptions<'_>,
    equations: &Equations,
    progress: Progress<'_>,
) -> Result<Vec<RefinedEquations>, Cancelled> {
    let parameters = Parameters::new(equations, options.lags, options.gates);
    let start = parameters.start();
    let Some(windows) = windows(options, equations) else { return Ok(Vec::new()) };
    let Some(first) = windows.linearise(&parameters, &start) else { return Ok(Vec::new()) };
    let Some(merged) = first.merged() else { return Ok(Vec::new()) };
    let unit = |norm: f64| if norm > 0.0 { norm } else { 1.0 };
    let norms = (0..parameters.len()).map(|j| unit(merged.column_norm(j))).collect();
    let mut prior = Prior { centre: start.clone(), norms, strength: 1.0 };
    let constraints = LinearConstraints::new(options.constraints, &parameters);
    let mut refined = Vec::new();
    let mut from = (start, first);
    for (index, &strength) in options.strengths.iter().enumerate() {
        prior.strength = strength;
        let share = |f: f64| (index as f64 + f) / options.strengths.len() as f64;
        let end = levenberg_marquardt(&windows, &parameters, from, &prior, &constraints, &mut |f| {
            progress(share(f))
        })?;
        if let Ok(equations) = parameters.equations(&end.values) {
            refined.push(RefinedEquations {
                equations,
                strength,
                steps: end.steps,
                cost: end.linear.cost / end.linear.errors as f64,
            });
        }
        from = (end.values, end.linear);
    }
    progress::report(progress, 1.0)?;
    Ok(refined)
}

/// RMS prediction errors over the windows relative to the sensor noise, for each output. `None` if the rollouts diverge
/// or no run is longer than a window.
pub fn noise_excess(options: &RefineOptions<'_>, equations: &Equations) -> Option<Vec<f64>> {
    let windows = windows(options, equations)?;
    let share = |(start, weight): (&f64, &f64)| start / weight;
    Some(windows.start.iter().zip(&windows.weights).map(share).collect())
}

/// Windows whose errors weigh what the errors of some equations are; none where their rollouts diverge.
fn windows<'a>(options: &RefineOptions<'a>, equations: &Equations) -> Option<Windows<'a>> {
    // A positive number far below 2^53.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let stride = (STRIDE * options.horizon as f64).ceil().max(1.0) as usize;
    let sizes: Vec<f64> = options.ranges.iter().map(|r| (r.high - r.low) / DEVIATIONS).collect();
    let floor = |value: f64, size: &f64| value.max(ROUNDING_FLOOR * size).max(f64::MIN_POSITIVE);
    let sensors = noise_std(options.runs);
    let start_weights = sensors.iter().zip(&sizes).map(|(noise, size)| 1.0 / floor(*noise, size));
    let mut windows = Windows {
        runs: options.runs,
        horizon: options.horizon,
        stride,
        weights: sizes.iter().map(|size| 1.0 / floor(*size, size)).collect(),
        start: start_weights.collect(),
        ranges: options.ranges,
        huber: None,
    };
    let first = windows.linearise(&Parameters::fixed(equations), &[])?;
    for (i, (sum, count)) in first.squares.into_iter().enumerate() {
        windows.weights[i] = 1.0 / floor((sum / count.max(1) as f64).sqrt(), &sizes[i]);
        windows.start[i] = windows.start[i].max(windows.weights[i]);
    }
    windows.huber = options.huber;
    Some(windows)
}
