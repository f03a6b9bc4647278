//! A loss that spikes in a log hardly move.
//!
//! Least squares with row weights that follow the residuals (HuberWeights, Ann. Math. Statist. 35 (1964) 73;
//! iteratively reweighted as in Holland and Welsch, Comm. Statist. A6 (1977) 813): a row whose largest
//! standardised residual over the outputs is `z` counts `min(1, k/|z|)`. The runs are streamed once a round,
//! and the scale of the residuals is their median size, which spikes do not move.

use std::collections::BTreeMap;

use hydroid_core::model::sparse::Program;
use serde::{Deserialize, Serialize};

use super::assemble::{Assembled, AssemblyOptions, assemble_with};
use super::qr::{BLOCK_ROWS, QrFactor};
use super::regression_form::RegressionForm;
use super::stepwise::independent_columns;
use crate::log::Trajectory;

/// What residuals cost.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Loss {
    /// Their squares.
    #[default]
    Squares,
    /// Their squares up to this many robust standard deviations, and from there in proportion. With 1.345
    /// nothing is lost but 5 % of the efficiency on Gaussian noise.
    Huber(f64),
}

/// Weights of rows by how far they are from some equations.
#[derive(Clone, Debug)]
pub struct HuberWeights {
    /// Coefficients, `outputs x terms`.
    pub coefficients: Vec<f64>,
    /// Standard deviation of each output's residuals.
    pub scale: Vec<f64>,
    /// Standard deviations from which on a row loses weight.
    pub k: f64,
}

impl HuberWeights {
    /// Multiplies the rows of a block, column by column, by the square roots of their weights, and counts
    /// the sizes of their residuals as they were. Rows of zeros are no rows.
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

/// How many numbers had which size, to one part in 32 of an octave: a median of any number of residuals in
/// little memory, the same whatever the order in which they came.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResidualHistogram {
    counts: BTreeMap<u64, u64>,
}

/// Bits of a double below the five leading ones of its mantissa.
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

    /// The standard deviation of a Gaussian with this median size; zero of nothing.
    fn deviation(&self) -> f64 {
        let half = self.counts.values().sum::<u64>().div_ceil(2);
        let mut seen = 0;
        let middle = self.counts.iter().find(|(_, count)| {
            seen += **count;
            seen >= half
        });
        // The middle of the bin.
        middle.map_or(0.0, |(bin, _)| {
            f64::from_bits((bin << DROPPED_BITS) + (1 << (DROPPED_BITS - 1))) / 0.6745
        })
    }
}

/// Rounds at the most. The weights settle by a factor of three a round or faster.
const MAX_ROUNDS: usize = 12;

/// Settled, when no output's fitted derivative moves by more than this share of its residual.
const TOLERANCE: f64 = 1e-2;

/// Below this share of the right-hand side residuals are rounding, and no row is better than another.
const ROUNDING_FLOOR: f64 = 1e-9;

/// Streams the runs until the weights of the rows fit the residuals of the equations that they give.
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
        // The sizes are those of the former coefficients: the scale follows a round behind.
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
    let (support, _) = independent_columns(qr, terms, terms);
    let mut coefficients = vec![0.0; terms * (qr.width() - terms)];
    let mut residuals = Vec::new();
    for (row, target) in coefficients.chunks_exact_mut(terms.max(1)).zip(terms..) {
        let solution = qr.solve(&support, target);
        support.iter().zip(&solution.coefficients).for_each(|(&j, x)| row[j] = *x);
        residuals.push(solution.residual);
    }
    (coefficients, residuals)
}

/// RMS over the rows of what changes in each output's fitted derivative.
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
