//! Sums of rows in blocks that stay in registers. A sum has the same order in every column, with fused multiply-add:
//! results do not depend on the vector width.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::{Simd, WithSimd};

use crate::math::vectors::{Pack, Vectors};

/// ```text
/// out_i = begin_i + own_i + sum_k a_ik rows_k + sum_k b_ik more_k
/// ```
///
/// Matrices have `columns` columns, row by row; empty ones are left out.
#[derive(Clone, Copy)]
pub(super) struct Sums<'a> {
    pub(super) columns: usize,
    /// A matrix, its row at which the first sum begins, and the distance to the row of the next sum.
    pub(super) begin: (&'a [f64], usize, usize),
    /// A factor for each sum, and a matrix with one row for each.
    pub(super) own: (&'a [f64], &'a [f64]),
    /// Coefficients, row by row, and the matrix that they multiply.
    pub(super) parts: [(&'a [f64], &'a [f64]); 2],
}

struct Into<'a, 'b> {
    sums: Sums<'a>,
    out: &'b mut [f64],
}

impl WithSimd for Into<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.sums.add_up(simd, self.out);
    }
}

impl Sums<'_> {
    #[inline(always)]
    pub(super) fn of<S: Simd>(self, simd: S, out: &mut [f64]) {
        // Compiled once instead of at each call.
        simd.vectorize(Into { sums: self, out });
    }

    #[inline(always)]
    fn add_up<S: Simd>(&self, simd: S, out: &mut [f64]) {
        let (columns, lanes) = (self.columns, size_of::<<f64 as Vectors>::V<S>>() / size_of::<f64>());
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
        out: &mut [f64],
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
        out: &mut [f64],
    ) {
        let (columns, lanes) = (self.columns, size_of::<<f64 as Vectors>::V<S>>() / size_of::<f64>());
        let here = at..if REST { columns } else { at + VECTORS * lanes };
        let mut sums = [[Pack::<S, f64>::splat(simd, 0.0); VECTORS]; ROWS];
        let (matrix, first, step) = self.begin;
        if !matrix.is_empty() {
            for r in 0..ROWS {
                let row = &matrix[(first + (i + r) * step) * columns..][..columns];
                sums[r] = load::<S, VECTORS, REST>(simd, &row[here.clone()]);
            }
        }
        let (factors, matrix) = self.own;
        if !matrix.is_empty() {
            for r in 0..ROWS {
                let row = &matrix[(i + r) * columns..][..columns];
                let (row, by) =
                    (load::<S, VECTORS, REST>(simd, &row[here.clone()]), Pack::splat(simd, factors[i + r]));
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
            let mut of_rows: [&[f64]; ROWS] = [&[]; ROWS];
            for r in 0..ROWS {
                of_rows[r] = &coefficients[(i + r) * len..][..len];
            }
            for (k, row) in matrix.chunks_exact(columns).take(len).enumerate() {
                let row = load::<S, VECTORS, REST>(simd, &row[here.clone()]);
                for r in 0..ROWS {
                    let by = Pack::splat(simd, of_rows[r][k]);
                    for v in 0..VECTORS {
                        sums[r][v] = by.mul_add(row[v], sums[r][v]);
                    }
                }
            }
        }
        for r in 0..ROWS {
            let row = &mut out[(i + r) * columns..][..columns][here.clone()];
            if REST {
                f64::store_part::<S>(simd, row, sums[r][0].v);
            } else {
                let row = &mut f64::whole_mut::<S>(row).0[..VECTORS];
                for v in 0..VECTORS {
                    row[v] = sums[r][v].v;
                }
            }
        }
    }
}

#[inline(always)]
fn load<S: Simd, const VECTORS: usize, const REST: bool>(simd: S, row: &[f64]) -> [Pack<S, f64>; VECTORS] {
    let mut vectors = [Pack::splat(simd, 0.0); VECTORS];
    if REST {
        vectors[0] = Pack::new(simd, f64::load_part::<S>(simd, row));
        return vectors;
    }
    let row = &f64::whole::<S>(row).0[..VECTORS];
    for v in 0..VECTORS {
        vectors[v] = Pack::new(simd, row[v]);
    }
    vectors
}
