//! `out = A a + B b + bias` for all lanes, its transpose, and the gradient of its weights.

use alloc::vec;
use alloc::vec::Vec;

use super::LANES;
use crate::math::Scalar;

/// Where the weights of an affine map stand in the flat weights of a network.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    /// Number of rows.
    pub(super) rows: usize,
    /// Begin and number of columns of `A`.
    pub(super) a: (usize, usize),
    /// Begin and number of columns of `B`; no columns where there is no `b`.
    pub(super) b: (usize, usize),
    /// Begins of the vectors whose sum is the bias.
    pub(super) bias: [Option<usize>; 2],
}

/// An affine map of the lanes, with its gradient.
#[derive(Clone, Debug)]
pub(super) struct Affine<T> {
    place: Place,
    /// `[A B bias]`, row by row.
    matrix: Vec<T>,
    /// Of `[A B bias]`, row by row, [`LANES`] partial sums each.
    gradient: Vec<T>,
}

impl<T: Scalar> Affine<T> {
    pub(super) fn new(place: Place) -> Self {
        let len = place.rows * (place.a.1 + place.b.1 + 1);
        Self { place, matrix: vec![T::zero(); len], gradient: vec![T::zero(); len * LANES] }
    }

    fn columns(&self) -> usize {
        self.place.a.1 + self.place.b.1 + 1
    }

    /// Takes its weights out of the flat ones.
    pub(super) fn load(&mut self, weights: &[T]) {
        let (Place { a, b, bias, .. }, columns) = (self.place, self.columns());
        for (i, row) in self.matrix.chunks_exact_mut(columns).enumerate() {
            row[..a.1].copy_from_slice(&weights[a.0 + i * a.1..][..a.1]);
            row[a.1..a.1 + b.1].copy_from_slice(&weights[b.0 + i * b.1..][..b.1]);
            row[columns - 1] = bias.iter().flatten().fold(T::zero(), |sum, &at| sum + weights[at + i]);
        }
    }

    /// `out = A a + B b + bias`.
    pub(super) fn apply(&self, a: &[T], b: &[T], out: &mut [T], lanes: usize) {
        let columns = self.columns();
        for (row, out) in self.matrix.chunks_exact(columns).zip(out.chunks_exact_mut(lanes)) {
            out.fill(row[columns - 1]);
            for (&w, x) in row.iter().zip(a.chunks_exact(lanes).chain(b.chunks_exact(lanes))) {
                for (out, &x) in out.iter_mut().zip(x) {
                    *out = w.mul_add(x, *out);
                }
            }
        }
    }

    /// `a += A' d`, `b += B' d`.
    pub(super) fn transpose(&self, d: &[T], a: &mut [T], b: &mut [T], lanes: usize) {
        for (row, d) in self.matrix.chunks_exact(self.columns()).zip(d.chunks_exact(lanes)) {
            for (&w, x) in row.iter().zip(a.chunks_exact_mut(lanes).chain(b.chunks_exact_mut(lanes))) {
                for (x, &d) in x.iter_mut().zip(d) {
                    *x = w.mul_add(d, *x);
                }
            }
        }
    }

    /// Forgets the gradient.
    pub(super) fn clear(&mut self) {
        self.gradient.fill(T::zero());
    }

    /// Adds `d [a b 1]'` to the gradient.
    pub(super) fn accumulate(&mut self, d: &[T], a: &[T], b: &[T], lanes: usize) {
        let columns = self.columns();
        for (sums, d) in self.gradient.chunks_exact_mut(columns * LANES).zip(d.chunks_exact(lanes)) {
            let (sums, last) = sums.split_at_mut((columns - 1) * LANES);
            for (sum, x) in
                sums.chunks_exact_mut(LANES).zip(a.chunks_exact(lanes).chain(b.chunks_exact(lanes)))
            {
                for (d, x) in d.chunks_exact(LANES).zip(x.chunks_exact(LANES)) {
                    for l in 0..LANES {
                        sum[l] = d[l].mul_add(x[l], sum[l]);
                    }
                }
            }
            for d in d.chunks_exact(LANES) {
                for l in 0..LANES {
                    last[l] += d[l];
                }
            }
        }
    }

    /// Writes the gradient to its place in the flat one.
    pub(super) fn gradient(&self, into: &mut [T]) {
        let (Place { a, b, bias, .. }, columns) = (self.place, self.columns());
        let sum = |i: usize, j: usize| {
            let at = (i * columns + j) * LANES;
            self.gradient[at..at + LANES].iter().fold(T::zero(), |sum, &x| sum + x)
        };
        for i in 0..self.place.rows {
            for j in 0..a.1 {
                into[a.0 + i * a.1 + j] = sum(i, j);
            }
            for j in 0..b.1 {
                into[b.0 + i * b.1 + j] = sum(i, a.1 + j);
            }
            for &at in bias.iter().flatten() {
                into[at + i] = sum(i, columns - 1);
            }
        }
    }
}
