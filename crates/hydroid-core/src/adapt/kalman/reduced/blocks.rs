//! Groups of blocks of weights, each by itself.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;
use core::array::from_fn;

use pulp::Simd;

use super::panels::Panel;
use crate::math::Scalar;
use crate::math::rows::add_parts;
use crate::math::vectors::Pack;

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
    pub(super) fn times<S: Simd>(&self, simd: S, panels: &[Panel], count: usize, rows: &[T], out: &mut [T]) {
        let mut begin = 0;
        for panel in panels {
            let (rows, out) = (&rows[panel.of(count)], &mut out[panel.of(count)]);
            out.fill(T::zero());
            for i in 0..panel.width {
                let p = &self.numbers[begin..=begin + i];
                begin += i + 1;
                let some = SIDE_BY_SIDE * panel.width;
                for (x, out) in rows.chunks(some).zip(out.chunks_mut(some)) {
                    if x.len() == some {
                        row_times::<S, T, SIDE_BY_SIDE>(simd, p, x, out, panel.width);
                    } else {
                        for (x, out) in x.chunks_exact(panel.width).zip(out.chunks_exact_mut(panel.width)) {
                            row_times::<S, T, 1>(simd, p, x, out, panel.width);
                        }
                    }
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
fn row_times<S: Simd, T: Scalar, const N: usize>(simd: S, p: &[T], x: &[T], out: &mut [T], width: usize) {
    let i = p.len() - 1;
    let (diagonal, p) = (p[i], &p[..i]);
    let x: [&[T]; N] = from_fn(|n| &x[n * width..(n + 1) * width]);
    let mut rows = out.chunks_exact_mut(width);
    let mut out: [&mut [T]; N] = from_fn(|_| rows.next().unwrap_or_default());
    let (p_whole, p_rest) = T::whole::<S>(p);
    let (len, whole) = (p_whole.len(), i - p_rest.len());
    let x_i = x.map(|x| x[i]);
    let x_whole = x.map(|x| &T::whole::<S>(&x[..i]).0[..len]);
    let out_whole = out.each_mut().map(|out| &mut T::whole_mut::<S>(&mut out[..i]).0[..len]);
    let by = x_i.map(|x| Pack::<S, T>::splat(simd, x));
    let mut sums = [Pack::<S, T>::splat(simd, T::zero()); N];
    for c in 0..len {
        let p = Pack::new(simd, p_whole[c]);
        for n in 0..N {
            sums[n] = p.mul_add(Pack::new(simd, x_whole[n][c]), sums[n]);
            out_whole[n][c] = p.mul_add(by[n], Pack::new(simd, out_whole[n][c])).v;
        }
    }
    for n in 0..N {
        let mut sum = sums[n].sum() + diagonal * x_i[n];
        for (&p, (&x, out)) in p_rest.iter().zip(x[n][whole..i].iter().zip(&mut out[n][whole..i])) {
            sum += p * x;
            *out += p * x_i[n];
        }
        out[n][i] += sum;
    }
}
