//! Sums of rows in blocks that stay in registers. A sum has the same order in every column, with fused multiply-add:
//! results do not depend on the vector width.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use core::array::from_fn;

use pulp::{Simd, WithSimd};

use crate::math::Scalar;
use crate::math::vectors::Pack;

/// ```text
/// out_i = begin_i + own_i + sum_k a_ik rows_k + sum_k b_ik more_k
/// ```
///
/// Matrices have `columns` columns, row by row; empty ones are left out.
#[derive(Clone, Copy)]
pub(super) struct Sums<'a, T> {
    pub(super) columns: usize,
    /// A matrix, its row at which the first sum begins, and the distance to the row of the next sum.
    pub(super) begin: (&'a [T], usize, usize),
    /// A factor for each sum, and a matrix with one row for each.
    pub(super) own: (&'a [T], &'a [T]),
    /// Coefficients, row by row, and the matrix that they multiply.
    pub(super) parts: [(&'a [T], &'a [T]); 2],
}

struct Into<'a, 'b, T> {
    sums: Sums<'a, T>,
    out: &'b mut [T],
}

impl<T: Scalar> WithSimd for Into<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.sums.add_up(simd, self.out);
    }
}

impl<T: Scalar> Sums<'_, T> {
    #[inline(always)]
    pub(super) fn of<S: Simd>(self, simd: S, out: &mut [T]) {
        // Compiled once instead of at each call.
        simd.vectorize(Into { sums: self, out });
    }

    #[inline(always)]
    fn add_up<S: Simd>(&self, simd: S, out: &mut [T]) {
        let (columns, lanes) = (self.columns, size_of::<T::V<S>>() / size_of::<T>());
        let count = out.len() / columns;
        let whole = columns / lanes;
        let mut vector = 0;
        while vector < whole {
            // Three vectors keep the adders busy; four are two and two.
            let (at, width) = (vector * lanes, [0, 1, 2, 3, 2][(whole - vector).min(4)]);
            let width = if whole - vector > 4 { 3 } else { width };
            match width {
                3 => self.rows::<S, 3, false>(simd, count, at, out),
                2 => self.rows::<S, 2, false>(simd, count, at, out),
                _ => self.rows::<S, 1, false>(simd, count, at, out),
            }
            vector += width;
        }
        if whole * lanes < columns {
            self.rows::<S, 1, true>(simd, count, whole * lanes, out);
        }
    }

    #[inline(always)]
    fn rows<S: Simd, const VECTORS: usize, const REST: bool>(
        &self,
        simd: S,
        count: usize,
        at: usize,
        out: &mut [T],
    ) {
        let mut i = 0;
        while i + 4 <= count {
            self.block::<S, 4, VECTORS, REST>(simd, i, at, out);
            i += 4;
        }
        if i + 2 <= count {
            self.block::<S, 2, VECTORS, REST>(simd, i, at, out);
            i += 2;
        }
        if i < count {
            self.block::<S, 1, VECTORS, REST>(simd, i, at, out);
        }
    }

    #[inline(always)]
    fn block<S: Simd, const ROWS: usize, const VECTORS: usize, const REST: bool>(
        &self,
        simd: S,
        i: usize,
        at: usize,
        out: &mut [T],
    ) {
        let (columns, lanes) = (self.columns, size_of::<T::V<S>>() / size_of::<T>());
        let here = at..if REST { columns } else { at + VECTORS * lanes };
        let mut sums = [[Pack::<S, T>::splat(simd, T::zero()); VECTORS]; ROWS];
        let (matrix, first, step) = self.begin;
        if !matrix.is_empty() {
            for r in 0..ROWS {
                let row = &matrix[(first + (i + r) * step) * columns..][..columns];
                sums[r] = load::<S, T, VECTORS, REST>(simd, &row[here.clone()]);
            }
        }
        let (factors, matrix) = self.own;
        if !matrix.is_empty() {
            for r in 0..ROWS {
                let row = &matrix[(i + r) * columns..][..columns];
                let (row, by) = (
                    load::<S, T, VECTORS, REST>(simd, &row[here.clone()]),
                    Pack::splat(simd, factors[i + r]),
                );
                for v in 0..VECTORS {
                    sums[r][v] = by.mul_add(row[v], sums[r][v]);
                }
            }
        }
        for (coefficients, matrix) in self.parts {
            let len = matrix.len() / columns;
            if matrix.is_empty() {
                continue;
            }
            let coefficients: [&[T]; ROWS] = from_fn(|r| &coefficients[(i + r) * len..][..len]);
            for (k, row) in matrix.chunks_exact(columns).take(len).enumerate() {
                let row = load::<S, T, VECTORS, REST>(simd, &row[here.clone()]);
                for r in 0..ROWS {
                    let by = Pack::splat(simd, coefficients[r][k]);
                    for v in 0..VECTORS {
                        sums[r][v] = by.mul_add(row[v], sums[r][v]);
                    }
                }
            }
        }
        for r in 0..ROWS {
            let row = &mut out[(i + r) * columns..][..columns][here.clone()];
            if REST {
                T::store_part::<S>(simd, row, sums[r][0].v);
            } else {
                let row = &mut T::whole_mut::<S>(row).0[..VECTORS];
                for v in 0..VECTORS {
                    row[v] = sums[r][v].v;
                }
            }
        }
    }
}

#[inline(always)]
fn load<S: Simd, T: Scalar, const VECTORS: usize, const REST: bool>(
    simd: S,
    row: &[T],
) -> [Pack<S, T>; VECTORS] {
    let mut vectors = [Pack::splat(simd, T::zero()); VECTORS];
    if REST {
        vectors[0] = Pack::new(simd, T::load_part::<S>(simd, row));
        return vectors;
    }
    let row = &T::whole::<S>(row).0[..VECTORS];
    for v in 0..VECTORS {
        vectors[v] = Pack::new(simd, row[v]);
    }
    vectors
}
