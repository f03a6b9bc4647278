//! `out = A a + B b + bias` for all lanes, its transpose, and the gradient of its weights.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::Simd;

use super::LANES;
use super::kernel::{self, ROWS, Rows, RowsMut};
use crate::math::Scalar;
use crate::math::aligned::Aligned;

/// Offsets of an affine map in the flat weights of a network.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    pub(super) rows: usize,
    /// Offset and number of columns of `A`.
    pub(super) a: (usize, usize),
    /// Offset and number of columns of `B`; no columns without `b`.
    pub(super) b: (usize, usize),
    /// Offsets of the vectors whose sum is the bias.
    pub(super) bias: [Option<usize>; 2],
}

impl Place {
    fn at(&self, i: usize, j: usize) -> usize {
        let (a, b) = (self.a, self.b);
        if j < a.1 { a.0 + i * a.1 + j } else { b.0 + i * b.1 + j - a.1 }
    }

    fn columns(&self) -> usize {
        self.a.1 + self.b.1
    }
}

/// An affine map of the lanes, with its gradient. Matrices are stored in blocks of [`ROWS`] rows, padded with zeros and
/// column by column in each block, so that the kernels read one stream.
#[derive(Clone, Debug)]
pub(super) struct Affine<T> {
    place: Place,
    /// `[bias A B]`.
    matrix: Aligned<T>,
    /// `[0 [A B]']`.
    transposed: Aligned<T>,
    /// Gradient of `[A B bias]`, row by row, [`LANES`] partial sums each; padded to whole blocks of rows.
    gradient: Aligned<T>,
}

impl<T: Scalar> Affine<T> {
    pub(super) fn new(place: Place) -> Self {
        let (rows, columns) = (place.rows, place.columns());
        Self {
            place,
            matrix: Aligned::zeros(rows.next_multiple_of(ROWS) * (columns + 1)),
            transposed: Aligned::zeros(columns.next_multiple_of(ROWS) * (rows + 1)),
            gradient: Aligned::zeros(rows.next_multiple_of(ROWS) * (columns + 1) * LANES),
        }
    }

    pub(super) fn load(&mut self, weights: &[T]) {
        let (rows, columns) = (self.place.rows, self.place.columns());
        for i in 0..rows {
            let bias = self.place.bias.iter().flatten().fold(T::zero(), |sum, &at| sum + weights[at + i]);
            self.matrix[(i - i % ROWS) * (columns + 1) + i % ROWS] = bias;
            for j in 0..columns {
                let w = weights[self.place.at(i, j)];
                self.matrix[(i - i % ROWS) * (columns + 1) + (j + 1) * ROWS + i % ROWS] = w;
                self.transposed[(j - j % ROWS) * (rows + 1) + (i + 1) * ROWS + j % ROWS] = w;
            }
        }
    }

    /// `out = A a + B b + bias`.
    #[inline(always)]
    pub(super) fn apply<S: Simd>(&self, simd: S, a: &[T], b: &[T], out: &mut [T], lanes: usize) {
        let (x, mut out) = (Rows::new(a, b, lanes), RowsMut::new(out, &mut [], lanes));
        for (block, weights) in self.matrix.chunks_exact(ROWS * (self.place.columns() + 1)).enumerate() {
            kernel::product::<S, T, false>(simd, weights, x, &mut out, block * ROWS);
        }
    }

    /// `a += A' d`, `b += B' d`.
    #[inline(always)]
    pub(super) fn transpose<S: Simd>(&self, simd: S, d: &[T], a: &mut [T], b: &mut [T], lanes: usize) {
        let (d, mut out) = (Rows::new(d, &[], lanes), RowsMut::new(a, b, lanes));
        for (block, weights) in self.transposed.chunks_exact(ROWS * (self.place.rows + 1)).enumerate() {
            kernel::product::<S, T, true>(simd, weights, d, &mut out, block * ROWS);
        }
    }

    pub(super) fn clear(&mut self) {
        self.gradient.fill(T::zero());
    }

    /// Adds `d [a b 1]'` to the gradient.
    #[inline(always)]
    pub(super) fn accumulate<S: Simd>(&mut self, simd: S, d: &[T], a: &[T], b: &[T], lanes: usize) {
        let columns = self.place.columns() + 1;
        let (d, x) = (Rows::new(d, &[], lanes), Rows::new(a, b, lanes));
        for (block, sums) in self.gradient.chunks_exact_mut(ROWS * columns * LANES).enumerate() {
            kernel::outer(simd, d, block * ROWS, x, sums);
        }
    }

    pub(super) fn gradient(&self, into: &mut [T]) {
        let (rows, columns) = (self.place.rows, self.place.columns());
        let sum = |i: usize, j: usize| {
            let at = (i * (columns + 1) + j) * LANES;
            self.gradient[at..at + LANES].iter().fold(T::zero(), |sum, &x| sum + x)
        };
        for i in 0..rows {
            for j in 0..columns {
                into[self.place.at(i, j)] = sum(i, j);
            }
            for &at in self.place.bias.iter().flatten() {
                into[at + i] = sum(i, columns);
            }
        }
    }
}
