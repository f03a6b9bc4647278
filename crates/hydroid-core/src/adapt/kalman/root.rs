//! Cholesky roots of small matrices.
#![expect(
    clippy::inline_always,
    reason = "what a correction is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use crate::math::Scalar;
use crate::math::rows::add_rows;

/// The lower triangle `L` of `L L'`, row by row.
#[derive(Clone, Debug)]
pub(super) struct Root<T> {
    count: usize,
    lower: Vec<T>,
}

impl<T: Scalar> Root<T> {
    /// Room for a matrix of so many rows at most; at first of none.
    pub(super) fn new(most: usize) -> Self {
        Self { count: 0, lower: vec![T::zero(); most * most] }
    }

    /// Of the matrix that has these entries (`row`, `column` up to the row's number); false where that is not positive, which
    /// it can be for numbers alone that have left all bounds.
    #[inline(always)]
    pub(super) fn factor(&mut self, count: usize, entry: impl Fn(usize, usize) -> T) -> bool {
        self.count = count;
        for i in 0..count {
            for j in 0..=i {
                let mut rest = entry(i, j);
                for k in 0..j {
                    rest -= self.lower[i * count + k] * self.lower[j * count + k];
                }
                self.lower[i * count + j] = if i > j {
                    rest / self.lower[j * count + j]
                } else if rest > T::zero() && rest.is_finite() {
                    rest.sqrt()
                } else {
                    return false;
                };
            }
        }
        true
    }

    /// `L_ij`.
    #[inline(always)]
    pub(super) fn at(&self, i: usize, j: usize) -> T {
        if i < j { T::zero() } else { self.lower[i * self.count + j] }
    }

    /// `rows <- L^-1 rows`, as many as the matrix has.
    #[inline(always)]
    pub(super) fn forward(&self, rows: &mut [T], columns: usize) {
        for i in 0..self.count {
            let (above, row) = rows.split_at_mut(i * columns);
            let row = &mut row[..columns];
            for (k, above) in above.chunks_exact(columns).enumerate() {
                take(row, above, self.at(i, k));
            }
            let inverse = T::one() / self.at(i, i);
            for x in row.iter_mut() {
                *x *= inverse;
            }
        }
    }

    /// `rows <- L'^-1 rows`.
    #[inline(always)]
    pub(super) fn backward(&self, rows: &mut [T], columns: usize) {
        for i in (0..self.count).rev() {
            let (row, below) = rows[i * columns..self.count * columns].split_at_mut(columns);
            for (k, below) in below.chunks_exact(columns).enumerate() {
                take(row, below, self.at(i + 1 + k, i));
            }
            let inverse = T::one() / self.at(i, i);
            for x in row.iter_mut() {
                *x *= inverse;
            }
        }
    }
}

/// `row -= factor other`.
#[inline(always)]
pub(super) fn take<T: Scalar>(row: &mut [T], other: &[T], factor: T) {
    for (row, &other) in row.iter_mut().zip(other) {
        *row -= factor * other;
    }
}

/// Moves some rows, which come in their order, to the front.
#[inline(always)]
pub(super) fn gather<T: Scalar>(which: &[usize], rows: &mut [T], columns: usize) {
    for (i, &from) in which.iter().enumerate() {
        rows.copy_within(from * columns..(from + 1) * columns, i * columns);
    }
}

/// `row -= sum_k w[k][i] rows[k]`, with `w` of `n` columns.
#[inline(always)]
pub(super) fn take_column<T: Scalar>(row: &mut [T], rows: &[T], w: &[T], i: usize, n: usize) {
    // As many as vessels have outputs at a time.
    for (k, some) in rows.chunks(3 * row.len()).enumerate() {
        let minus = |m: usize| w.get((3 * k + m) * n + i).map_or(T::zero(), |&w| -w);
        let minus = [minus(0), minus(1), minus(2)];
        add_rows(row, some, &minus[..some.len() / row.len()]);
    }
}

/// The transpose of a matrix of so many rows and columns.
pub(super) fn transpose<T: Copy>(rows: usize, columns: usize, matrix: &[T], into: &mut [T]) {
    for i in 0..rows {
        for j in 0..columns {
            into[j * rows + i] = matrix[i * columns + j];
        }
    }
}

/// A symmetric matrix's rows and columns of a part become zero, but for the diagonal.
pub(super) fn set_part<T: Scalar>(matrix: &mut [T], part: Range<usize>, diagonal: T) {
    let n = matrix.len().isqrt();
    for i in part {
        matrix[i * n..(i + 1) * n].fill(T::zero());
        matrix.iter_mut().skip(i).step_by(n).for_each(|p| *p = T::zero());
        matrix[i * (n + 1)] = diagonal;
    }
}
