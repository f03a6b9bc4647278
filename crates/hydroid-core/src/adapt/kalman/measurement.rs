//! One measurement: innovation, its covariance, and its Cholesky factor.
#![expect(
    clippy::inline_always,
    reason = "the parts of a kernel must be inlined into the function that is compiled for the processor's vectors"
)]

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::cholesky::{Cholesky, gather};

/// The measurement update of one sample: innovation, innovation covariance `S = L L'` (`measured x measured`), and the
/// normalized innovation squared (NIS).
#[derive(Clone, Debug)]
pub(super) struct MeasurementUpdate {
    outputs: usize,
    /// `H P H'` of all outputs, row by row: `S` without the noise.
    pub(super) covariance: Vec<f64>,
    pub(super) predicted: Vec<f64>,
    /// `e = z - y` of all outputs; NaN if missing.
    pub(super) innovation: Vec<f64>,
    /// Diagonals of `S` and of the scaled `R`.
    pub(super) variance: Vec<f64>,
    pub(super) noise: Vec<f64>,
    pub(super) measured: Vec<usize>,
    /// `L`.
    pub(super) cholesky: Cholesky,
    /// `L^-1 e`.
    pub(super) whitened: Vec<f64>,
}

impl MeasurementUpdate {
    pub(super) fn new(outputs: usize) -> Self {
        Self {
            outputs,
            covariance: vec![0.0; outputs * outputs],
            predicted: vec![0.0; outputs],
            innovation: vec![f64::NAN; outputs],
            variance: vec![f64::NAN; outputs],
            noise: vec![0.0; outputs],
            measured: Vec::with_capacity(outputs),
            cholesky: Cholesky::new(outputs),
            whitened: vec![0.0; outputs],
        }
    }

    /// Sets a measurement `z` and its noise, after `predicted` and `covariance`. Returns the largest innovation
    /// \[standard deviations\].
    pub(super) fn set(&mut self, z: &[f64], noise: &[f64]) -> f64 {
        self.measured.clear();
        self.noise.copy_from_slice(noise);
        let mut largest = 0.0;
        for (i, &z) in z.iter().enumerate() {
            self.innovation[i] = z - self.predicted[i];
            self.variance[i] = self.covariance[i * (self.outputs + 1)] + noise[i];
            if z.is_nan() {
                self.variance[i] = f64::NAN;
            } else {
                self.measured.push(i);
                let deviations = self.innovation[i].abs() / Float::sqrt(self.variance[i]);
                // NaN stays NaN.
                if deviations > largest || deviations.is_nan() {
                    largest = deviations;
                }
            }
        }
        largest
    }

    pub(super) fn scale_noise(&mut self, factor: f64) {
        for &i in &self.measured {
            let more = self.noise[i] * (factor - 1.0);
            self.noise[i] += more;
            self.variance[i] += more;
        }
    }

    /// The smallest `S_ii / R_ii` of the measured outputs; infinite for no outputs.
    pub(super) fn min_s_over_r(&self) -> f64 {
        let of = |&i: &usize| self.variance[i] / self.noise[i];
        self.measured.iter().map(of).fold(f64::INFINITY, |least, x| if x >= least { least } else { x })
    }

    /// Huber's loss on the innovations: additional noise gives an output beyond `limit` standard deviations `S_ii / w`
    /// in place of `S_ii`, with the weight `w = limit / deviations`. Returns the smallest weight.
    pub(super) fn downweight(&mut self, limit: f64) -> f64 {
        let mut least = 1.0_f64;
        for &i in &self.measured {
            let deviations = self.innovation[i].abs() / Float::sqrt(self.variance[i]);
            if deviations > limit {
                let more = self.variance[i] * (deviations / limit - 1.0);
                self.noise[i] += more;
                self.variance[i] += more;
                least = least.min(limit / deviations);
            }
        }
        least
    }

    /// Factors `S = L L'` and computes `L^-1 e`. Returns false if the filter has diverged: `S` is not positive
    /// definite, or a number is not finite.
    pub(super) fn factor(&mut self) -> bool {
        let Self { outputs, covariance, noise, measured, cholesky, whitened, innovation, .. } = self;
        let entry = |i: usize, j: usize| {
            let (row, column) = (measured[i], measured[j]);
            let covariance = covariance[row * *outputs + column];
            if i == j { covariance + noise[row] } else { covariance }
        };
        if !cholesky.factor(measured.len(), entry) {
            return false;
        }
        for (whitened, &i) in whitened.iter_mut().zip(&*measured) {
            *whitened = innovation[i];
        }
        let whitened = &mut whitened[..measured.len()];
        cholesky.forward(whitened, 1);
        whitened.iter().all(|e| e.is_finite())
    }

    /// `W' = L^-1 H P` in place: moves the rows of the measured outputs to the front of `rows` (`outputs x columns`),
    /// then solves.
    #[inline(always)]
    pub(super) fn whiten(&self, rows: &mut [f64], columns: usize) {
        gather(&self.measured, rows, columns);
        self.cholesky.forward(rows, columns);
    }

    pub(super) fn nis(&self) -> f64 {
        self.whitened[..self.measured.len()].iter().map(|&e| e * e).sum()
    }
}
