//! Cholesky factors of small matrices, and operations on their rows.
#![expect(
    clippy::inline_always,
    reason = "the parts of a kernel must be inlined into the function that is compiled for the processor's vectors"
)]

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use num_traits::Float;

use crate::math::rows::add_rows;

#[derive(Clone, Debug)]
pub(super) struct Cholesky {
    count: usize,
    lower: Vec<f64>,
}

impl Cholesky {
    pub(super) fn new(most: usize) -> Self {
        Self { count: 0, lower: vec![0.0; most * most] }
    }

    /// Factors the matrix of the entries (row, column up to the row). Returns false if it is not positive definite.
    #[inline(always)]
    pub(super) fn factor(&mut self, count: usize, entry: impl Fn(usize, usize) -> f64) -> bool {
        self.count = count;
        for i in 0..count {
            for j in 0..=i {
                let mut rest = entry(i, j);
                for k in 0..j {
                    rest -= self.lower[i * count + k] * self.lower[j * count + k];
                }
                self.lower[i * count + j] = if i > j {
                    rest / self.lower[j * count + j]
                } else if rest > 0.0 && rest.is_finite() {
                    Float::sqrt(rest)
                } else {
                    return false;
                };
            }
        }
        true
    }

    /// `L_ij`.
    #[inline(always)]
    pub(super) fn at(&self, i: usize, j: usize) -> f64 {
        if i < j { 0.0 } else { self.lower[i * self.count + j] }
    }

    #[inline(always)]
    pub(super) fn forward(&self, rows: &mut [f64], columns: usize) {
        for i in 0..self.count {
            let (above, row) = rows.split_at_mut(i * columns);
            let row = &mut row[..columns];
            for (k, above) in above.chunks_exact(columns).enumerate() {
                let factor = self.at(i, k);
                for (row, &above) in row.iter_mut().zip(above) {
                    *row -= factor * above;
                }
            }
            let inverse = 1.0 / self.at(i, i);
            for x in row.iter_mut() {
                *x *= inverse;
            }
        }
    }
}

/// Moves the rows `which`, in ascending order, to the front.
#[inline(always)]
pub(super) fn gather(which: &[usize], rows: &mut [f64], columns: usize) {
    for (i, &from) in which.iter().enumerate() {
        rows.copy_within(from * columns..(from + 1) * columns, i * columns);
    }
}

/// `row -= sum_k w[k][i] rows[k]` with `w` of `n` columns: row `i` of `w' rows`.
#[inline(always)]
pub(super) fn subtract_outer(row: &mut [f64], rows: &[f64], w: &[f64], i: usize, n: usize) {
    // Three rows at a time: the number of outputs of a vessel.
    for (k, some) in rows.chunks(3 * row.len()).enumerate() {
        let minus = |m: usize| w.get((3 * k + m) * n + i).map_or(0.0, |&w| -w);
        let minus = [minus(0), minus(1), minus(2)];
        add_rows(row, some, &minus[..some.len() / row.len()]);
    }
}

pub(super) fn transpose(rows: usize, columns: usize, matrix: &[f64], into: &mut [f64]) {
    for i in 0..rows {
        for j in 0..columns {
            into[j * rows + i] = matrix[i * columns + j];
        }
    }
}

pub(super) fn reset_rows(matrix: &mut [f64], part: Range<usize>, diagonal: f64) {
    let n = matrix.len().isqrt();
    for i in part {
        matrix[i * n..(i + 1) * n].fill(0.0);
        matrix.iter_mut().skip(i).step_by(n).for_each(|p| *p = 0.0);
        matrix[i * (n + 1)] = diagonal;
    }
}
