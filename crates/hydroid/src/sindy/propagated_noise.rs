//! Noise of the outputs in the rows of a regression: weights of the rows, and the test whether equations explain the data.
//!
//! Noise acts on both sides of a row. With white noise of standard deviation `sigma_l` on output `l`, the residual of row
//! `r` of output `i` has the variance (to first order; Bortz, Messenger and Dukic, Bull. Math. Biol. 85 (2023) 110)
//!
//! ```text
//! sum_l sigma_l^2 sum_j (g_j [i = l] - (w_{j-1} + w_j)/2 df_i/dy_l(y_{r+j}, c_{r+j}))^2
//! ```
//!
//! for rows with the weights `g` and `w` ([`RegressionForm`]) at midpoints. The mean ratio of squared residuals to these
//! variances is 1 for true equations.

use hydroid_core::model::sparse::{Equations, Jacobian};

use super::error::FitError;
use super::regression_form::RegressionForm;
use crate::log::Trajectory;

/// Weights of the rows of one equation.
pub(super) struct PropagatedNoise {
    /// Weight of each row of each run, with mean 1.
    pub(super) weights: Vec<Vec<f64>>,
    /// Mean of the inverse variances.
    pub(super) mean_inverse: f64,
}

/// Inverse variances of the rows of each equation. Equations have no signals.
///
/// # Errors
/// If the Jacobian of the equations cannot be compiled.
pub(super) fn propagated_noise(
    runs: &[&Trajectory],
    regression: RegressionForm,
    deviations: &[f64],
    equations: &Equations,
) -> Result<Vec<PropagatedNoise>, FitError> {
    let jacobian = Jacobian::new(equations)?;
    let outputs = equations.outputs();
    let mut all: Vec<Vec<Vec<f64>>> = vec![Vec::with_capacity(runs.len()); outputs];
    for run in runs {
        let slopes = slopes(run, equations, &jacobian);
        for (output, all) in all.iter_mut().enumerate() {
            all.push(inverse_variances(run, regression, deviations, output, &slopes));
        }
    }
    Ok(all
        .into_iter()
        .map(|mut weights| {
            let used = || weights.iter().flatten().filter(|w| **w > 0.0);
            let mean_inverse = used().sum::<f64>() / (used().count() as f64).max(1.0);
            weights.iter_mut().flatten().for_each(|w| *w /= mean_inverse);
            PropagatedNoise { weights, mean_inverse }
        })
        .collect())
}

/// `df/dy` at each sample, `outputs x outputs`.
fn slopes(run: &Trajectory, equations: &Equations, jacobian: &Jacobian) -> Vec<f64> {
    let (n, variables) = (equations.outputs(), equations.variables());
    let mut slots = vec![0.0; jacobian.slots().max(equations.slots())];
    let mut matrix = vec![0.0; n * variables];
    let mut slopes = Vec::with_capacity(run.len() * n * n);
    for sample in 0..run.len() {
        equations.load(run.outputs.row(sample), run.inputs.row(sample), &mut slots);
        jacobian.evaluate(&mut slots, &mut matrix);
        for row in matrix.chunks_exact(variables) {
            slopes.extend_from_slice(&row[..n]);
        }
    }
    slopes
}

/// Inverse variances of the rows of one equation; zero for a row with a missing sample.
fn inverse_variances(
    run: &Trajectory,
    regression: RegressionForm,
    deviations: &[f64],
    output: usize,
    slopes: &[f64],
) -> Vec<f64> {
    let n = deviations.len();
    let mut inverse = Vec::new();
    for rows in regression.rows(run.len(), run.dt) {
        let (left, library) = (&rows.kernel.outputs, &rows.kernel.library);
        let before = |j: usize| j.checked_sub(1).map_or(0.0, |k| library[k]);
        let at = |j: usize| library.get(j).copied().unwrap_or(0.0);
        let right: Vec<f64> = (0..left.len()).map(|j| 0.5 * (before(j) + at(j))).collect();
        for row in 0..rows.count {
            let first = rows.first + row * rows.stride;
            let samples = slopes[first * n * n..].chunks_exact(n * n).zip(left.iter().zip(&right));
            let variance: f64 = samples
                .map(|(slope, (g, w))| {
                    let of = |l: usize| if l == output { *g } else { 0.0 } - w * slope[output * n + l];
                    (0..n).map(|l| (deviations[l] * of(l)).powi(2)).sum::<f64>()
                })
                .sum();
            inverse.push(if variance > 0.0 && variance.is_finite() { 1.0 / variance } else { 0.0 });
        }
    }
    inverse
}
