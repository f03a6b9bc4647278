//! The inner loops: blocks of a matrix product that stay in registers.
//!
//! In each lane a sum over columns runs in their order. A sum over lanes has [`LANES`] partial sums, each in the order
//! of the blocks of lanes. Results do not depend on the vector width.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::Simd;

use super::LANES;
use crate::math::Scalar;
use crate::math::vectors::Pack;

pub(super) const ROWS: usize = 4;
const COLUMNS: usize = 4;

/// Rows of two matrices, one above the other.
#[derive(Clone, Copy)]
pub(super) struct Rows<'a, T> {
    parts: [&'a [T]; 2],
    lanes: usize,
}

impl<'a, T: Scalar> Rows<'a, T> {
    #[inline(always)]
    pub(super) fn new(a: &'a [T], b: &'a [T], lanes: usize) -> Self {
        Self { parts: [a, b], lanes }
    }

    #[inline(always)]
    fn len(&self) -> usize {
        (self.parts[0].len() + self.parts[1].len()) / self.lanes
    }

    #[inline(always)]
    fn row<S: Simd>(&self, i: usize) -> &'a [T::V<S>] {
        let (at, above) = (i * self.lanes, self.parts[0].len());
        let row = if at < above { &self.parts[0][at..] } else { &self.parts[1][at - above..] };
        T::whole::<S>(&row[..self.lanes]).0
    }
}

pub(super) struct RowsMut<'a, T> {
    parts: [&'a mut [T]; 2],
    lanes: usize,
}

impl<'a, T: Scalar> RowsMut<'a, T> {
    #[inline(always)]
    pub(super) fn new(a: &'a mut [T], b: &'a mut [T], lanes: usize) -> Self {
        Self { parts: [a, b], lanes }
    }

    #[inline(always)]
    fn len(&self) -> usize {
        (self.parts[0].len() + self.parts[1].len()) / self.lanes
    }

    #[inline(always)]
    fn row<S: Simd>(&mut self, i: usize) -> &mut [T::V<S>] {
        let (at, above) = (i * self.lanes, self.parts[0].len());
        let [a, b] = &mut self.parts;
        let row = if at < above { &mut a[at..] } else { &mut b[at - above..] };
        T::whole_mut::<S>(&mut row[..self.lanes]).0
    }
}

/// Rows `first` to `first + ROWS` of `out = bias + W x`, or of `out += W x` with `ADD`, up to the last row of `out`.
/// Weights: the bias of each row, then column by column.
#[inline(always)]
pub(super) fn product<S: Simd, T: Scalar, const ADD: bool>(
    simd: S,
    weights: &[T],
    x: Rows<'_, T>,
    out: &mut RowsMut<'_, T>,
    first: usize,
) {
    let vectors = x.lanes * size_of::<T>() / size_of::<T::V<S>>();
    let mut v = 0;
    // Sixteen sums only fit 32 registers.
    while S::REGISTER_COUNT > 16 && v + 4 <= vectors {
        tile::<S, T, ADD, 4>(simd, weights, x, out, first, v);
        v += 4;
    }
    while v + 2 <= vectors {
        tile::<S, T, ADD, 2>(simd, weights, x, out, first, v);
        v += 2;
    }
    while v < vectors {
        tile::<S, T, ADD, 1>(simd, weights, x, out, first, v);
        v += 1;
    }
}

#[inline(always)]
fn tile<S: Simd, T: Scalar, const ADD: bool, const N: usize>(
    simd: S,
    weights: &[T],
    x: Rows<'_, T>,
    out: &mut RowsMut<'_, T>,
    first: usize,
    v: usize,
) {
    let rows = ROWS.min(out.len() - first);
    let (columns, _) = weights.as_chunks::<ROWS>();
    let Some((bias, columns)) = columns.split_first() else { return };
    let mut sums = [[Pack::<S, T>::splat(simd, T::zero()); N]; ROWS];
    for i in 0..ROWS {
        sums[i] = [Pack::splat(simd, bias[i]); N];
        if ADD && i < rows {
            let row = &out.row::<S>(first + i)[v..v + N];
            for n in 0..N {
                sums[i][n] = Pack::new(simd, row[n]);
            }
        }
    }
    let width = x.lanes * size_of::<T>() / size_of::<T::V<S>>();
    let mut columns = columns.iter();
    for part in x.parts {
        for (row, weights) in T::whole::<S>(part).0.chunks_exact(width).zip(&mut columns) {
            let x = &row[v..v + N];
            for i in 0..ROWS {
                let w = Pack::splat(simd, weights[i]);
                for n in 0..N {
                    sums[i][n] = w.mul_add(Pack::new(simd, x[n]), sums[i][n]);
                }
            }
        }
    }
    for i in 0..ROWS {
        if i < rows {
            let row = &mut out.row::<S>(first + i)[v..v + N];
            for n in 0..N {
                row[n] = sums[i][n].v;
            }
        }
    }
}

/// Adds `d [x 1]'` to the partial sums of a gradient for the rows of `d` from `first` on.
#[inline(always)]
pub(super) fn outer<S: Simd, T: Scalar>(
    simd: S,
    d: Rows<'_, T>,
    first: usize,
    x: Rows<'_, T>,
    sums: &mut [T],
) {
    // The last row is repeated as padding, whose sums are not used.
    let mut rows: [&[T::V<S>]; ROWS] = [&[]; ROWS];
    for i in 0..ROWS {
        rows[i] = d.row::<S>((first + i).min(d.len() - 1));
    }
    let columns = x.len();
    let sums = T::whole_mut::<S>(sums).0;
    let parts = LANES * size_of::<T>() / size_of::<T::V<S>>();
    for part in 0..parts {
        let mut j = 0;
        while j + COLUMNS <= columns {
            let mut some: [&[T::V<S>]; COLUMNS] = [&[]; COLUMNS];
            for c in 0..COLUMNS {
                some[c] = x.row::<S>(j + c);
            }
            patch::<S, T, COLUMNS>(
                simd,
                rows,
                some,
                &mut sums[j * parts..],
                (columns + 1) * parts,
                part,
                parts,
            );
            j += COLUMNS;
        }
        while j < columns {
            patch::<S, T, 1>(
                simd,
                rows,
                [x.row::<S>(j)],
                &mut sums[j * parts..],
                (columns + 1) * parts,
                part,
                parts,
            );
            j += 1;
        }
        for i in 0..ROWS {
            let sum = &mut sums[(i * (columns + 1) + columns) * parts + part];
            let mut total = Pack::<S, T>::new(simd, *sum);
            let mut k = part;
            while k < rows[i].len() {
                total = total + Pack::new(simd, rows[i][k]);
                k += parts;
            }
            *sum = total.v;
        }
    }
}

#[inline(always)]
fn patch<S: Simd, T: Scalar, const C: usize>(
    simd: S,
    mut d: [&[T::V<S>]; ROWS],
    mut x: [&[T::V<S>]; C],
    sums: &mut [T::V<S>],
    row: usize,
    part: usize,
    parts: usize,
) {
    let len = d[0].len();
    for i in 0..ROWS {
        d[i] = &d[i][..len];
    }
    for c in 0..C {
        x[c] = &x[c][..len];
    }
    let zero = Pack::<S, T>::splat(simd, T::zero());
    let mut total = [[zero; C]; ROWS];
    for i in 0..ROWS {
        for c in 0..C {
            total[i][c] = Pack::new(simd, sums[i * row + c * parts + part]);
        }
    }
    let mut v = part;
    while v < len {
        let mut at = [zero; C];
        for c in 0..C {
            at[c] = Pack::new(simd, x[c][v]);
        }
        for i in 0..ROWS {
            let d = Pack::new(simd, d[i][v]);
            for c in 0..C {
                total[i][c] = d.mul_add(at[c], total[i][c]);
            }
        }
        v += parts;
    }
    for i in 0..ROWS {
        for c in 0..C {
            sums[i * row + c * parts + part] = total[i][c].v;
        }
    }
}
