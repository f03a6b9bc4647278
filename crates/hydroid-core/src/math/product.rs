//! Matrix products in blocks that stay in registers.
//!
//! ```text
//! out = start + left right        left: rows x depth,  right: depth x columns,  out: rows x columns
//! ```
//!
//! Sums run over the depth in its order with fused multiply-add: results depend neither on vector width nor on blocks.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::Simd;

use super::slices::{Write, vectors};
use super::vectors::Pack;
use crate::math::Scalar;

/// Rows of a block. With four vectors each (two where there are 16 registers) sums hide the latency of an addition.
const ROWS: usize = 6;

pub(crate) trait Left<T> {
    type Band<'a, const M: usize>: Band<T, M>
    where
        Self: 'a,
        T: 'a;

    fn rows(&self) -> usize;
    fn depth(&self) -> usize;
    /// Rows `first .. first + M`; `scratch` holds them where they are copied.
    fn band<'a, const M: usize>(&'a self, first: usize, scratch: &'a mut [T]) -> Self::Band<'a, M>
    where
        T: 'a;
}

pub(crate) trait Band<T, const M: usize>: Copy {
    /// Column `k`. The compiler must see that it is in bounds, or each sum would leave its register.
    fn column(self, k: usize) -> [T; M];
    fn depth(self) -> usize;
}

#[derive(Clone, Copy)]
pub(crate) struct InPlace<'a, T, const M: usize> {
    rows: [&'a [T]; M],
    depth: usize,
}

impl<T: Scalar, const M: usize> Band<T, M> for InPlace<'_, T, M> {
    #[inline(always)]
    fn column(self, k: usize) -> [T; M] {
        let mut column = [T::zero(); M];
        for i in 0..M {
            column[i] = self.rows[i][..self.depth][k];
        }
        column
    }

    #[inline(always)]
    fn depth(self) -> usize {
        self.depth
    }
}

impl<T: Scalar, const M: usize> Band<T, M> for &[[T; M]] {
    #[inline(always)]
    fn column(self, k: usize) -> [T; M] {
        self[k]
    }

    #[inline(always)]
    fn depth(self) -> usize {
        self.len()
    }
}

#[derive(Clone, Copy)]
pub(crate) struct Matrix<'a, T> {
    numbers: &'a [T],
    columns: usize,
}

impl<'a, T> Matrix<'a, T> {
    #[inline(always)]
    pub(crate) fn new(numbers: &'a [T], columns: usize) -> Self {
        Self { numbers, columns }
    }
}

impl<T: Scalar> Left<T> for Matrix<'_, T> {
    type Band<'a, const M: usize>
        = InPlace<'a, T, M>
    where
        Self: 'a;

    #[inline(always)]
    fn rows(&self) -> usize {
        self.numbers.len() / self.columns
    }

    #[inline(always)]
    fn depth(&self) -> usize {
        self.columns
    }

    #[inline(always)]
    fn band<'a, const M: usize>(&'a self, first: usize, _: &'a mut [T]) -> InPlace<'a, T, M>
    where
        T: 'a,
    {
        let depth = self.columns;
        let mut rows: [&[T]; M] = [&[]; M];
        for i in 0..M {
            rows[i] = &self.numbers[(first + i) * depth..][..depth];
        }
        InPlace { rows, depth }
    }
}

#[derive(Clone, Copy)]
pub(crate) struct Transposed<'a, T>(pub(crate) Matrix<'a, T>);

impl<T: Scalar> Left<T> for Transposed<'_, T> {
    type Band<'a, const M: usize>
        = &'a [[T; M]]
    where
        Self: 'a;

    #[inline(always)]
    fn rows(&self) -> usize {
        self.0.columns
    }

    #[inline(always)]
    fn depth(&self) -> usize {
        self.0.numbers.len() / self.0.columns
    }

    /// Copies the columns: each row of the matrix, another cache line, is visited once instead of once for each block.
    #[inline(always)]
    fn band<'a, const M: usize>(&'a self, first: usize, scratch: &'a mut [T]) -> &'a [[T; M]]
    where
        T: 'a,
    {
        let (columns, _) = scratch[..self.depth() * M].as_chunks_mut::<M>();
        for (column, row) in columns.iter_mut().zip(self.0.numbers.chunks_exact(self.0.columns)) {
            column.copy_from_slice(&row[first..first + M]);
        }
        columns
    }
}

pub(crate) fn scratch(depth: usize) -> usize {
    ROWS * depth
}

/// `out = start + left right`: `start` holds one number for each row, none for zero. Rows of `right` are `stride`
/// apart, a multiple of [`LINE`](super::vectors::Vectors::LINE) that is at least the `columns` of `out`.
#[inline(always)]
pub(crate) fn product<S: Simd, T: Scalar, L: Left<T>>(
    simd: S,
    left: &L,
    right: (&[T], usize),
    start: Option<&[T]>,
    (out, columns): (&mut [T], usize),
    scratch: &mut [T],
) {
    let rows = left.rows();
    let mut first = 0;
    while first + ROWS <= rows {
        let out = (&mut out[first * columns..(first + ROWS) * columns], columns);
        band::<S, T, _, ROWS>(simd, left.band(first, scratch), right, part(start, first), out);
        first += ROWS;
    }
    while first + 2 <= rows {
        let out = (&mut out[first * columns..(first + 2) * columns], columns);
        band::<S, T, _, 2>(simd, left.band(first, scratch), right, part(start, first), out);
        first += 2;
    }
    if first < rows {
        let out = (&mut out[first * columns..(first + 1) * columns], columns);
        band::<S, T, _, 1>(simd, left.band(first, scratch), right, part(start, first), out);
    }
}

#[inline(always)]
fn part<T>(start: Option<&[T]>, first: usize) -> Option<&[T]> {
    match start {
        Some(start) => Some(&start[first..]),
        None => None,
    }
}

#[inline(always)]
fn band<S: Simd, T: Scalar, B: Band<T, M>, const M: usize>(
    simd: S,
    left: B,
    right: (&[T], usize),
    start: Option<&[T]>,
    (out, columns): (&mut [T], usize),
) {
    let count = vectors::<S, T>(columns).end;
    let mut v = 0;
    while S::REGISTER_COUNT > 16 && v + 4 <= count {
        tile::<S, T, B, M, 4>(simd, left, right, start, (&mut *out, columns), v);
        v += 4;
    }
    while v + 2 <= count {
        tile::<S, T, B, M, 2>(simd, left, right, start, (&mut *out, columns), v);
        v += 2;
    }
    if v < count {
        tile::<S, T, B, M, 1>(simd, left, right, start, (&mut *out, columns), v);
    }
}

#[inline(always)]
fn tile<S: Simd, T: Scalar, B: Band<T, M>, const M: usize, const N: usize>(
    simd: S,
    left: B,
    (right, stride): (&[T], usize),
    start: Option<&[T]>,
    (out, columns): (&mut [T], usize),
    v: usize,
) {
    let mut sums = [[Pack::<S, T>::splat(simd, T::zero()); N]; M];
    if let Some(start) = start {
        for i in 0..M {
            sums[i] = [Pack::splat(simd, start[i]); N];
        }
    }
    let width = stride * size_of::<T>() / size_of::<T::V<S>>();
    let right = T::whole::<S>(right).0;
    for (k, row) in (0..left.depth()).zip(right.chunks_exact(width)) {
        let x = &row[v..v + N];
        let column = left.column(k);
        for i in 0..M {
            let w = Pack::splat(simd, column[i]);
            for n in 0..N {
                sums[i][n] = w.mul_add(Pack::new(simd, x[n]), sums[i][n]);
            }
        }
    }
    for i in 0..M {
        let mut row = Write::new(simd, &mut out[i * columns..(i + 1) * columns]);
        for n in 0..N {
            row.set(v + n, sums[i][n]);
        }
    }
}

/// `into = from'`: `from` has rows of `columns` numbers, `into` rows that are `stride` apart.
#[inline(always)]
pub(crate) fn transpose<T: Scalar>(from: &[T], columns: usize, into: &mut [T], stride: usize) {
    /// Side of a block; its lines of both matrices fit the first-level cache.
    const BLOCK: usize = 16;
    let rows = from.len() / columns;
    for i in (0..rows).step_by(BLOCK) {
        for j in (0..columns).step_by(BLOCK) {
            if i + BLOCK <= rows && j + BLOCK <= columns {
                let mut block = [[T::zero(); BLOCK]; BLOCK];
                for (a, line) in block.iter_mut().enumerate() {
                    line.copy_from_slice(&from[(i + a) * columns + j..][..BLOCK]);
                }
                for b in 0..BLOCK {
                    let to = &mut into[(j + b) * stride + i..][..BLOCK];
                    for a in 0..BLOCK {
                        to[a] = block[a][b];
                    }
                }
                continue;
            }
            for a in i..rows.min(i + BLOCK) {
                for b in j..columns.min(j + BLOCK) {
                    into[b * stride + a] = from[a * columns + b];
                }
            }
        }
    }
}

/// `y = start + W x`, `W` row by row. Sixteen sums for each of four rows hide the latency of the additions.
#[inline(always)]
pub(crate) fn affine<T: Scalar>(weights: &[T], start: &[T], x: &[T], y: &mut [T]) {
    const ROWS: usize = 4;
    let len = x.len();
    let mut bands = y.chunks_exact_mut(ROWS);
    let mut row = 0;
    for y in &mut bands {
        let sums = dots::<T, ROWS>(&weights[row * len..(row + ROWS) * len], x);
        for i in 0..ROWS {
            y[i] = start[row + i] + sums[i];
        }
        row += ROWS;
    }
    for y in bands.into_remainder() {
        *y = start[row] + dots::<T, 1>(&weights[row * len..(row + 1) * len], x)[0];
        row += 1;
    }
}

#[inline(always)]
fn dots<T: Scalar, const ROWS: usize>(weights: &[T], x: &[T]) -> [T; ROWS] {
    const LANES: usize = 16;
    let len = x.len();
    let mut sums = [[T::zero(); LANES]; ROWS];
    let whole = len - len % LANES;
    for k in (0..whole).step_by(LANES) {
        let x = &x[k..k + LANES];
        for i in 0..ROWS {
            let w = &weights[i * len + k..][..LANES];
            for lane in 0..LANES {
                sums[i][lane] += w[lane] * x[lane];
            }
        }
    }
    for i in 0..ROWS {
        for k in whole..len {
            sums[i][k - whole] += weights[i * len + k] * x[k];
        }
    }
    let mut all = [T::zero(); ROWS];
    for i in 0..ROWS {
        // Arrays of their own, which stay in registers.
        const { assert!(LANES == 16) };
        let eight: [T; 8] = halved(&sums[i]);
        let four: [T; 4] = halved(&eight);
        let two: [T; 2] = halved(&four);
        all[i] = two[0] + two[1];
    }
    all
}

/// The sums of the first half and the second.
#[inline(always)]
fn halved<T: Scalar, const N: usize>(sums: &[T]) -> [T; N] {
    let mut half = [T::zero(); N];
    for lane in 0..N {
        half[lane] = sums[lane] + sums[lane + N];
    }
    half
}
