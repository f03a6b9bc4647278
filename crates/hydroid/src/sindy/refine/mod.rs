//! Refinement of coefficients, lags and gates by multi-step prediction errors.
//!
//! A regression minimises errors of derivatives. With the selected terms, [`refine`] minimises instead
//!
//! ```text
//! sum over windows of  sum_i ((y_i(0) - x_i) / n_i)^2 + sum_{k = 1..H, i} ((y_i(k) - x_i(k)) / s_i)^2
//!   + strength sum_j d_j^2 (p_j - p0_j)^2
//! ```
//!
//! over the parameters `p` (coefficients, time constants of lags, centres and slopes of gates) and the initial outputs
//! `x(0)` of every window, from which `x(k)` is rolled out under the logged commands: output-error identification
//! (Ljung, *System Identification*, 1999, section 7.5) by multiple shooting (Bock, in *Modelling of Chemical Reaction
//! Systems*, 1981), without continuity between windows because unlogged forces act on a vessel. `s_i` is the RMS
//! prediction error of the regression estimate and `n_i` the sensor noise: where model error dominates, `x(0)` stays at
//! the measurement; with noise alone all errors have equal weight, and the estimate has the maximum likelihood. The
//! last sum is a prior at the regression estimate `p0`, with the norm `d_j` of the column of `p_j`.

mod equations;
mod levenberg_marquardt;
mod outcome;
mod parameters;
mod shooting;

use hydroid_core::model::sparse::Equations;

pub(crate) use self::levenberg_marquardt::{LinearConstraints, Prior, levenberg_marquardt};
pub(super) use self::outcome::Attempt;
pub use self::outcome::{Outcome, Refinement};
use self::parameters::Parameters;
pub(crate) use self::shooting::{Linearization, Parametric, ShootingModel, Windows};
use super::constraints::Constraints;
use super::noise::noise_std;
use super::structure::{GateSpec, Lag};
use crate::evaluate::DesignRange;
use crate::log::Trajectory;
use crate::progress::{self, Cancelled, Progress};

/// Distance between the starts of consecutive windows, in window lengths.
const STRIDE: f64 = 0.5;

/// Standard deviations in a design range, for a first estimate of the size of an output.
const DEVIATIONS: f64 = 5.0;

/// Residuals smaller than this share of the outputs are rounding.
const ROUNDING_FLOOR: f64 = 1e-6;

/// Data and options of a refinement.
#[derive(Clone, Debug)]
pub struct RefineOptions<'a> {
    /// Training runs.
    pub runs: &'a [&'a Trajectory],
    /// Design ranges of the outputs: a rollout that leaves ten times these has diverged.
    pub ranges: &'a [DesignRange],
    /// Length of a window \[samples\].
    pub horizon: usize,
    /// Decreasing strengths of the prior; each minimisation starts from the previous result.
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

/// Refined equations.
#[derive(Clone, Debug)]
pub struct RefinedEquations {
    /// The equations.
    pub equations: Equations,
    /// Strength of the prior.
    pub strength: f64,
    /// Number of iterations.
    pub steps: usize,
    /// Mean loss per error, relative to the initial mean square.
    pub cost: f64,
}

/// Refines equations for each strength of the prior; empty if the rollouts diverge or all runs are too short.
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

/// RMS prediction error of each output relative to the sensor noise. `None` if the rollouts diverge or all runs are too
/// short.
pub fn noise_excess(options: &RefineOptions<'_>, equations: &Equations) -> Option<Vec<f64>> {
    let windows = windows(options, equations)?;
    let share = |(start, weight): (&f64, &f64)| start / weight;
    Some(windows.start.iter().zip(&windows.weights).map(share).collect())
}

/// Windows with weights from the errors of given equations; none if their rollouts diverge.
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
