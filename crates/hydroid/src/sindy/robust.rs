//! Robust regression by iteratively reweighted least squares.
//!
//! A row with the largest standardised residual `z` over the outputs has the weight `min(1, k/|z|)` (Huber, Ann. Math.
//! Statist. 35 (1964) 73; iteration: Holland and Welsch, Comm. Statist. A6 (1977) 813). The runs are streamed once per
//! iteration. The scale of the residuals is their median absolute value.

use std::collections::BTreeMap;

use hydroid_core::model::sparse::Program;
use serde::{Deserialize, Serialize};

use super::assemble::{Assembled, AssemblyOptions, assemble_with};
use super::qr::{BLOCK_ROWS, QrFactor};
use super::regression_form::RegressionForm;
use super::stepwise::independent_columns;
use crate::log::Trajectory;

/// Loss of the residuals.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// Squared residuals.
    #[default]
    Squares,
    /// Huber loss with this threshold in standard deviations; 1.345 has an efficiency of 95 % on Gaussian noise.
    Huber(f64),
}

/// Weights of rows by their residuals in given equations.
#[derive(Clone, Debug)]
pub struct HuberWeights {
    /// Coefficients, `outputs x terms`.
    pub coefficients: Vec<f64>,
    /// Standard deviation of the residuals of each output.
    pub scale: Vec<f64>,
    /// Huber threshold \[standard deviations\].
    pub k: f64,
}

impl HuberWeights {
    /// Multiplies rows by the square roots of their weights and adds their unweighted residuals to the histograms.
    pub(super) fn apply(&self, block: &mut [f64], terms: usize, sizes: &mut [ResidualHistogram]) {
        let mut worst = [0.0f64; BLOCK_ROWS];
        for ((output, coefficients), (scale, sizes)) in
            self.coefficients.chunks_exact(terms).enumerate().zip(self.scale.iter().zip(sizes))
        {
            let mut residual = [0.0; BLOCK_ROWS];
            residual.copy_from_slice(&block[(terms + output) * BLOCK_ROWS..][..BLOCK_ROWS]);
            for (column, x) in block.chunks_exact(BLOCK_ROWS).zip(coefficients) {
                if *x != 0.0 {
                    residual.iter_mut().zip(column).for_each(|(r, theta)| *r -= x * theta);
                }
            }
            for (worst, residual) in worst.iter_mut().zip(residual) {
                sizes.add(residual);
                *worst = worst.max(residual.abs() / scale);
            }
        }
        let factors = worst.map(|z| if z > self.k { (self.k / z).sqrt() } else { 1.0 });
        for column in block.chunks_exact_mut(BLOCK_ROWS) {
            column.iter_mut().zip(&factors).for_each(|(value, factor)| *value *= factor);
        }
    }
}

/// Histogram of absolute values, 32 bins per octave, for a median in bounded memory and in any order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResidualHistogram {
    counts: BTreeMap<u64, u64>,
}

/// Bits of a double below the five leading bits of its mantissa.
const DROPPED_BITS: u32 = 47;

impl ResidualHistogram {
    fn add(&mut self, value: f64) {
        if value != 0.0 && value.is_finite() {
            *self.counts.entry(value.abs().to_bits() >> DROPPED_BITS).or_default() += 1;
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (bin, count) in &other.counts {
            *self.counts.entry(*bin).or_default() += count;
        }
    }

    /// Standard deviation of a Gaussian with this median absolute value; zero without values.
    fn deviation(&self) -> f64 {
        let half = self.counts.values().sum::<u64>().div_ceil(2);
        let mut seen = 0;
        let middle = self.counts.iter().find(|(_, count)| {
            seen += **count;
            seen >= half
        });
        middle.map_or(0.0, |(bin, _)| {
            f64::from_bits((bin << DROPPED_BITS) + (1 << (DROPPED_BITS - 1))) / 0.6745
        })
    }
}

const MAX_ROUNDS: usize = 12;

/// Converged if the fitted derivative of every output changes by less than this share of its residual.
const TOLERANCE: f64 = 1e-2;

/// Residuals below this share of the right-hand side are rounding errors; all rows then have the same weight.
const ROUNDING_FLOOR: f64 = 1e-9;

pub(super) fn assemble_huber(
    program: &Program,
    runs: &[&Trajectory],
    regression: RegressionForm,
    options: &AssemblyOptions<'_>,
    k: f64,
) -> Assembled {
    let mut assembled = assemble_with(program, runs, regression, options);
    let rows = (assembled.qr.rows() as f64).sqrt();
    let (mut coefficients, residuals) = least_squares(&assembled.qr, program.len());
    let outputs = residuals.len();
    let floor: Vec<f64> =
        (0..outputs).map(|i| ROUNDING_FLOOR * assembled.qr.column_norm(program.len() + i) / rows).collect();
    let at_least = |scale: f64, floor: f64| scale.max(floor).max(f64::MIN_POSITIVE);
    let mut scale: Vec<f64> =
        residuals.iter().zip(&floor).map(|(r, floor)| at_least(r / rows, *floor)).collect();
    for _ in 0..MAX_ROUNDS {
        let robust = Some(HuberWeights { coefficients: coefficients.clone(), scale: scale.clone(), k });
        assembled = assemble_with(program, runs, regression, &AssemblyOptions { robust, ..options.clone() });
        let (next, _) = least_squares(&assembled.qr, program.len());
        // The histograms belong to the previous coefficients: the scale lags by one iteration.
        let narrower: Vec<f64> = assembled
            .residuals
            .iter()
            .zip(&floor)
            .map(|(sizes, floor)| at_least(sizes.deviation(), *floor))
            .collect();
        let moved = fitted_change(&assembled.qr, program.len(), &coefficients, &next);
        let settled = moved.iter().zip(&narrower).all(|(moved, scale)| *moved <= TOLERANCE * scale)
            && scale.iter().zip(&narrower).all(|(old, new)| (old / new - 1.0).abs() < 0.05);
        (coefficients, scale) = (next, narrower);
        if settled {
            break;
        }
    }
    assembled
}

/// Coefficients of all identifiable terms, `outputs x terms`, and the norm of each output's residual.
fn least_squares(qr: &QrFactor, terms: usize) -> (Vec<f64>, Vec<f64>) {
    let support = independent_columns(qr, terms, terms);
    let mut coefficients = vec![0.0; terms * (qr.width() - terms)];
    let mut residuals = Vec::new();
    for (row, target) in coefficients.chunks_exact_mut(terms.max(1)).zip(terms..) {
        let solution = qr.solve(&support, target);
        support.iter().zip(&solution.coefficients).for_each(|(&j, x)| row[j] = *x);
        residuals.push(solution.residual);
    }
    (coefficients, residuals)
}

fn fitted_change(qr: &QrFactor, terms: usize, old: &[f64], new: &[f64]) -> Vec<f64> {
    let rows = (qr.rows() as f64).sqrt();
    old.chunks_exact(terms)
        .zip(new.chunks_exact(terms))
        .map(|(old, new)| {
            let change = |i: usize| (i..terms).map(|j| qr.get(i, j) * (new[j] - old[j])).sum::<f64>();
            (0..terms).map(|i| change(i).powi(2)).sum::<f64>().sqrt() / rows
        })
        .collect()
}
