//! Groups of blocks of weights, each by itself.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;
use core::array::from_fn;

use super::panels::Panel;
use crate::math::Scalar;
use crate::math::rows::add_parts;

/// `P = diag(P_1, P_2, ..)`, one for each panel: of each its lower triangle, row by row. That the other half is kept nowhere
/// makes it symmetric.
#[derive(Clone, Debug)]
pub(super) struct Blocks<T> {
    pub(super) numbers: Vec<T>,
}

/// Numbers of a triangle.
const fn triangle(width: usize) -> usize {
    width * (width + 1) / 2
}

impl<T: Scalar> Blocks<T> {
    pub(super) fn new(panels: &[Panel]) -> Self {
        Self { numbers: vec![T::zero(); panels.iter().map(|panel| triangle(panel.width)).sum()] }
    }

    /// The diagonal, one after the other.
    pub(super) fn each_diagonal(&mut self, panels: &[Panel], mut with: impl FnMut(usize, &mut T)) {
        let (mut begin, mut column) = (0, 0);
        for panel in panels {
            for i in 0..panel.width {
                with(column + i, &mut self.numbers[begin + triangle(i) + i]);
            }
            begin += triangle(panel.width);
            column += panel.width;
        }
    }

    /// `P <- grows^2 P + diag(noise)`.
    #[inline(always)]
    pub(super) fn advance(&mut self, panels: &[Panel], grows: T, noise: &[T]) {
        let scale = grows * grows;
        if scale != T::one() {
            self.numbers.iter_mut().for_each(|p| *p *= scale);
        }
        self.each_diagonal(panels, |at, p| *p += noise[at]);
    }

    /// `out = rows P`; of each, `count` rows.
    #[inline(always)]
    pub(super) fn times(&self, panels: &[Panel], count: usize, rows: &[T], out: &mut [T]) {
        let mut begin = 0;
        for panel in panels {
            let (rows, out) = (&rows[panel.of(count)], &mut out[panel.of(count)]);
            out.fill(T::zero());
            for i in 0..panel.width {
                let p = &self.numbers[begin..=begin + i];
                begin += i + 1;
                let (mut x, mut out, mut left) = (rows, &mut *out, count);
                while left > 0 {
                    let some = if left < SIDE_BY_SIDE { 1 } else { SIDE_BY_SIDE };
                    let (own, rest) = out.split_at_mut(some * panel.width);
                    if some == 1 {
                        row_times::<1, T>(p, x, own, panel.width);
                    } else {
                        row_times::<SIDE_BY_SIDE, T>(p, x, own, panel.width);
                    }
                    (x, out, left) = (&x[some * panel.width..], rest, left - some);
                }
            }
        }
    }

    /// `P <- P - sum_k w_k w_k'`, of its blocks; `w` are the first `count` of `rows` rows.
    #[inline(always)]
    pub(super) fn correct(&mut self, panels: &[Panel], (rows, count): (usize, usize), w: &[T]) {
        let mut begin = 0;
        for panel in panels {
            let w = &w[panel.of(rows)][..count * panel.width];
            for i in 0..panel.width {
                let p = &mut self.numbers[begin..=begin + i];
                begin += i + 1;
                for w in w.chunks(SIDE_BY_SIDE * panel.width) {
                    let minus: [T; SIDE_BY_SIDE] =
                        from_fn(|k| w.get(k * panel.width + i).map_or(T::zero(), |&w| -w));
                    add_parts(p, w, panel.width, &minus[..w.len() / panel.width]);
                }
            }
        }
    }
}

/// Rows that share the loads of the covariance: as many as vessels have outputs.
const SIDE_BY_SIDE: usize = 3;

/// What a row of the triangle, up to its diagonal, is in `N` products: `out_i += p x` and, mirrored, `out += p x_i`.
#[inline(always)]
fn row_times<const N: usize, T: Scalar>(p: &[T], x: &[T], out: &mut [T], width: usize) {
    const LANES: usize = 8;
    let i = p.len() - 1;
    let x_i: [T; N] = from_fn(|n| x[n * width + i]);
    let mut sums = [[T::zero(); LANES]; N];
    let whole = i / LANES * LANES;
    for at in (0..whole).step_by(LANES) {
        let p = &p[at..at + LANES];
        for n in 0..N {
            let x = &x[n * width + at..][..LANES];
            let out = &mut out[n * width + at..][..LANES];
            for lane in 0..LANES {
                sums[n][lane] += p[lane] * x[lane];
                out[lane] += p[lane] * x_i[n];
            }
        }
    }
    for n in 0..N {
        let mut sum: T = sums[n].iter().copied().sum::<T>() + p[i] * x_i[n];
        for at in whole..i {
            sum += p[at] * x[n * width + at];
            out[n * width + at] += p[at] * x_i[n];
        }
        out[n * width + i] += sum;
    }
}
