//! What a measurement tells: innovations, their covariance, and its factor.
#![expect(
    clippy::inline_always,
    reason = "what a correction is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;

use super::root::{Root, gather};
use crate::math::Scalar;

/// Of the outputs of one sample. `S = L L'` are `measured x measured`.
#[derive(Clone, Debug)]
pub(super) struct Gain<T> {
    outputs: usize,
    /// `S` without the noise, of all outputs, row by row.
    pub(super) spread: Vec<T>,
    /// `y`, as predicted before the measurement.
    pub(super) predicted: Vec<T>,
    /// `e = z - y` of all outputs; NaN where nothing was measured.
    pub(super) innovation: Vec<T>,
    /// Diagonal of `S` with noise.
    pub(super) variance: Vec<T>,
    /// `R` as it was used.
    pub(super) noise: Vec<T>,
    /// Outputs that were measured.
    pub(super) measured: Vec<usize>,
    /// `L`.
    pub(super) root: Root<T>,
    /// `L^-1 e`.
    pub(super) whitened: Vec<T>,
    column: Vec<T>,
}

impl<T: Scalar> Gain<T> {
    pub(super) fn new(outputs: usize) -> Self {
        Self {
            outputs,
            spread: vec![T::zero(); outputs * outputs],
            predicted: vec![T::zero(); outputs],
            innovation: vec![T::nan(); outputs],
            variance: vec![T::nan(); outputs],
            noise: vec![T::zero(); outputs],
            measured: Vec::with_capacity(outputs),
            root: Root::new(outputs),
            whitened: vec![T::zero(); outputs],
            column: vec![T::zero(); outputs],
        }
    }

    /// Takes a measurement of which `predicted` and `spread` are known, and the noise it is expected to have. Gives
    /// the largest innovation in standard deviations, of those that were measured.
    pub(super) fn take(&mut self, z: &[T], noise: &[T]) -> T {
        self.measured.clear();
        self.noise.copy_from_slice(noise);
        let mut largest = T::zero();
        for (i, &z) in z.iter().enumerate() {
            self.innovation[i] = z - self.predicted[i];
            self.variance[i] = self.spread[i * (self.outputs + 1)] + noise[i];
            if z.is_nan() {
                self.variance[i] = T::nan();
            } else {
                self.measured.push(i);
                let deviations = self.innovation[i].abs() / self.variance[i].sqrt();
                // Not `max`: what is no number must not pass for a small one.
                if deviations > largest || deviations.is_nan() {
                    largest = deviations;
                }
            }
        }
        largest
    }

    /// What was measured is so many times as noisy.
    pub(super) fn inflate(&mut self, factor: T) {
        for &i in &self.measured {
            let more = self.noise[i] * (factor - T::one());
            self.noise[i] += more;
            self.variance[i] += more;
        }
    }

    /// The smallest `S_ii / R_ii` of what was measured; infinite where nothing was.
    pub(super) fn sureness(&self) -> T {
        let of = |&i: &usize| self.variance[i] / self.noise[i];
        self.measured.iter().map(of).fold(T::infinity(), |least, x| if x >= least { least } else { x })
    }

    /// A channel that is farther off than `limit` standard deviations counts as one with so much more noise that it pulls
    /// as hard as one at the limit: the weight `w = limit / deviations` of Huber's loss on the innovation, `S_ii / w` in
    /// the place of `S_ii`. Gives the least weight.
    pub(super) fn soften(&mut self, limit: T) -> T {
        let mut least = T::one();
        for &i in &self.measured {
            let deviations = self.innovation[i].abs() / self.variance[i].sqrt();
            if deviations > limit {
                let more = self.variance[i] * (deviations / limit - T::one());
                self.noise[i] += more;
                self.variance[i] += more;
                least = least.min(limit / deviations);
            }
        }
        least
    }

    /// `S = L L'` and `L^-1 e`; false where `S` is not positive, which it can be for numbers alone that have left all
    /// bounds.
    pub(super) fn factor(&mut self) -> bool {
        let Self { outputs, spread, noise, measured, root, whitened, innovation, .. } = self;
        let entry = |i: usize, j: usize| {
            let (row, column) = (measured[i], measured[j]);
            let spread = spread[row * *outputs + column];
            if i == j { spread + noise[row] } else { spread }
        };
        if !root.factor(measured.len(), entry) {
            return false;
        }
        for (whitened, &i) in whitened.iter_mut().zip(&*measured) {
            *whitened = innovation[i];
        }
        let whitened = &mut whitened[..measured.len()];
        root.forward(whitened, 1);
        whitened.iter().all(|e| e.is_finite())
    }

    /// `W' = L^-1 G'` in place: of the rows of `G'` (`outputs x columns`) those that were measured, moved to the front.
    #[inline(always)]
    pub(super) fn whiten(&self, rows: &mut [T], columns: usize) {
        gather(&self.measured, rows, columns);
        self.root.forward(rows, columns);
    }

    /// Normalised innovation squared, `e' S^-1 e`.
    pub(super) fn nis(&self) -> T {
        self.whitened[..self.measured.len()].iter().map(|&e| e * e).sum()
    }

    /// `R` follows the residual: what is left of the innovation after the update is `R S^-1 e`, its own uncertainty
    /// `R - R S^-1 R`; the noise is the mean of the square of the one and the other (covariance matching: Mehra, 1972,
    /// IEEE Transactions on Automatic Control 17(5)). A channel whose measurement was softened says nothing of it.
    pub(super) fn follow(&mut self, noise: &mut [T], rate: T) {
        let count = self.measured.len();
        for i in 0..count {
            let at = self.measured[i];
            let r = noise[at];
            if self.noise[at] > r {
                continue;
            }
            // L^-1 of the unit vector i: its square is (S^-1)_ii, its product with L^-1 e is (S^-1 e)_i.
            let (mut square, mut product) = (T::zero(), T::zero());
            for k in i..count {
                let mut x = if k == i { T::one() } else { T::zero() };
                for l in i..k {
                    x -= self.root.at(k, l) * self.column[l];
                }
                x = x / self.root.at(k, k);
                self.column[k] = x;
                square += x * x;
                product += x * self.whitened[k];
            }
            let evidence = (r * product) * (r * product) + (r - r * square * r).max(T::zero());
            noise[at] = r + (evidence - r) * rate;
        }
    }
}
