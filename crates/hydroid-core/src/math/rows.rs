//! Sums of rows and products with rows, for matrices of any width.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::{Arch, Simd, WithSimd};

use crate::math::Scalar;

/// `sum += x_0 row_0 + x_1 row_1 + ..` with consecutive rows of the length of `sum`, whose blocks stay in registers.
#[inline(always)]
pub(crate) fn add_rows<T: Scalar>(sum: &mut [T], rows: &[T], x: &[T]) {
    let len = sum.len();
    add_parts(sum, rows, len, x);
}

/// [`add_rows`] for rows that begin `stride` numbers apart and may be longer than the sum.
#[inline(always)]
pub(crate) fn add_parts<T: Scalar>(sum: &mut [T], rows: &[T], stride: usize, x: &[T]) {
    let done = blocks::<32, T>(sum, rows, stride, x, 0);
    let done = blocks::<8, T>(sum, rows, stride, x, done);
    let done = blocks::<4, T>(sum, rows, stride, x, done);
    blocks::<1, T>(sum, rows, stride, x, done);
}

/// `out += A X`, matrices row by row; `out` and `X` have `columns` columns.
pub(crate) fn add_product(out: &mut [f64], a: &[f64], x: &[f64], columns: usize) {
    Arch::new().dispatch(AddProduct { out, a, x, columns });
}

struct AddProduct<'a> {
    out: &'a mut [f64],
    a: &'a [f64],
    x: &'a [f64],
    columns: usize,
}

impl WithSimd for AddProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { out, a, x, columns } = self;
        for (out, a) in out.chunks_exact_mut(columns).zip(a.chunks_exact(x.len() / columns)) {
            add_rows(out, x, a);
        }
    }
}

/// Whole blocks from column `from` on; gives the first column that is left.
#[inline(always)]
fn blocks<const WIDTH: usize, T: Scalar>(
    sum: &mut [T],
    rows: &[T],
    stride: usize,
    x: &[T],
    from: usize,
) -> usize {
    let (len, mut column) = (sum.len(), from);
    while column + WIDTH <= len {
        let mut block = [T::zero(); WIDTH];
        block.copy_from_slice(&sum[column..column + WIDTH]);
        let mut at = column;
        for &x in x {
            let row = &rows[at..at + WIDTH];
            for lane in 0..WIDTH {
                block[lane] += row[lane] * x;
            }
            at += stride;
        }
        sum[column..column + WIDTH].copy_from_slice(&block);
        column += WIDTH;
    }
    column
}

/// `y = W x`, `W` row by row; four parallel sums hide the latency of the additions.
#[inline(always)]
pub(crate) fn product<T: Scalar>(weights: &[T], x: &[T], y: &mut [T]) {
    for (y, row) in y.iter_mut().zip(weights.chunks_exact(x.len())) {
        let mut sums = [T::zero(); 4];
        let (mut left, mut right) = (row.chunks_exact(4), x.chunks_exact(4));
        for (w, x) in (&mut left).zip(&mut right) {
            for lane in 0..4 {
                sums[lane] += w[lane] * x[lane];
            }
        }
        for (lane, (&w, &x)) in left.remainder().iter().zip(right.remainder()).enumerate() {
            sums[lane] += w * x;
        }
        *y = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }
}

/// `a' b`; eight parallel sums hide the latency of the additions.
#[inline(always)]
pub(crate) fn dot<T: Scalar>(a: &[T], b: &[T]) -> T {
    let mut sums = [T::zero(); 8];
    let (mut left, mut right) = (a.chunks_exact(8), b.chunks_exact(8));
    for (a, b) in (&mut left).zip(&mut right) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    for (lane, (&a, &b)) in left.remainder().iter().zip(right.remainder()).enumerate() {
        sums[lane] += a * b;
    }
    let [a, b, c, d, e, f, g, h] = sums;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
