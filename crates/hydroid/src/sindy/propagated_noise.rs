//! Noise of the outputs in the rows of a regression: weights of the rows, and the noise that equations leave in them.
//!
//! Noise acts on both sides of a row. With white noise of standard deviation `sigma_l` on output `l`, the residual of row
//! `r` of output `i` has the variance (to first order; Bortz, Messenger and Dukic, Bull. Math. Biol. 85 (2023) 110)
//!
//! ```text
//! sum_l sigma_l^2 sum_j (g_j [i = l] - v_j df_i/dy_l(y_{r+j}, c_{r+j}))^2,    v_j = (w_{j-1} + w_j)/2
//! ```
//!
//! for rows with the weights `g` and `w` at midpoints ([`RegressionForm::Weak`]). The mean ratio of squared residuals to these
//! variances is 1 for true equations.

use hydroid_core::model::sparse::{Equations, Jacobian};

use super::error::FitError;
use super::regression_form::RegressionForm;
use crate::key::key;
use crate::log::Trajectory;

/// Weights of the rows of one equation.
pub(super) struct PropagatedNoise {
    /// Weight of each row of each run, with mean 1 over all rows with a variance.
    pub(super) weights: Vec<Vec<f64>>,
    /// Mean of the inverse variances.
    pub(super) mean_inverse: f64,
}

/// Inverse variances of the rows of each equation, without signals, at midpoints.
///
/// # Errors
/// If no noise reaches an equation, or the Jacobian of the equations cannot be compiled.
pub(super) fn propagated_noise(
    runs: &[&Trajectory],
    regression: RegressionForm,
    deviations: &[f64],
    equations: &Equations,
) -> Result<Vec<PropagatedNoise>, FitError> {
    let jacobian = Jacobian::new(equations)?;
    let slopes: Vec<Vec<[f64; 2]>> =
        runs.iter().map(|run| slopes(run, equations, &jacobian, deviations)).collect();
    let of = |output: usize| {
        let rows = |(run, slopes): (&&Trajectory, &Vec<[f64; 2]>)| {
            inverse_variances(run, regression, deviations[output], slopes, (output, deviations.len()))
        };
        let mut weights: Vec<Vec<f64>> = runs.iter().zip(&slopes).map(rows).collect();
        let used = || weights.iter().flatten().filter(|w| **w > 0.0);
        let mean_inverse = used().sum::<f64>() / used().count() as f64;
        if !mean_inverse.is_finite() {
            return Err(FitError::Setting(format!(
                "no noise reaches the equation of output {}: set {} for equations that are selected by rollouts",
                output + 1,
                key("ridge")
            )));
        }
        weights.iter_mut().flatten().for_each(|w| *w /= mean_inverse);
        Ok(PropagatedNoise { weights, mean_inverse })
    };
    (0..deviations.len()).map(of).collect()
}

/// `df_i/dy_i` and `sum_l (sigma_l df_i/dy_l)^2` at each sample for each output `i`.
fn slopes(run: &Trajectory, equations: &Equations, jacobian: &Jacobian, deviations: &[f64]) -> Vec<[f64; 2]> {
    let variables = equations.variables();
    let mut slots = vec![0.0; jacobian.slots().max(equations.slots())];
    let mut matrix = vec![0.0; deviations.len() * variables];
    let mut slopes = Vec::with_capacity(run.len() * deviations.len());
    for sample in 0..run.len() {
        equations.load(run.outputs.row(sample), run.inputs.row(sample), &mut slots);
        jacobian.evaluate(&mut slots, &mut matrix);
        for (output, row) in matrix.chunks_exact(variables).enumerate() {
            let square = row.iter().zip(deviations).map(|(slope, sigma)| (slope * sigma).powi(2)).sum();
            slopes.push([row[output], square]);
        }
    }
    slopes
}

/// Inverse variances of the rows of one equation; zero where there is none.
fn inverse_variances(
    run: &Trajectory,
    regression: RegressionForm,
    deviation: f64,
    slopes: &[[f64; 2]],
    (output, outputs): (usize, usize),
) -> Vec<f64> {
    let mut inverse = Vec::new();
    for rows in regression.rows(run.len(), run.dt) {
        let (left, library) = (&rows.kernel.outputs, &rows.kernel.library);
        let before = |j: usize| j.checked_sub(1).map_or(0.0, |k| library[k]);
        let at = |j: usize| library.get(j).copied().unwrap_or(0.0);
        let right: Vec<f64> = (0..left.len()).map(|j| 0.5 * (before(j) + at(j))).collect();
        let own = deviation * deviation;
        let constant = own * left.iter().map(|g| g * g).sum::<f64>();
        for row in 0..rows.count {
            let first = rows.first + row * rows.stride;
            let samples = slopes[first * outputs..].chunks_exact(outputs).zip(left.iter().zip(&right));
            let variance = samples.fold(constant, |sum, (sample, (g, v))| {
                let [slope, square] = sample[output];
                sum + v * (v * square - 2.0 * own * g * slope)
            });
            inverse.push(if variance > 0.0 && variance.is_finite() { 1.0 / variance } else { 0.0 });
        }
    }
    inverse
}
