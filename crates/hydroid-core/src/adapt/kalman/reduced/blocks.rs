//! Groups of blocks of weights, each by itself.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;

use super::super::root::take;
use super::panels::Panel;
use crate::math::Scalar;
use crate::math::rows::dot;

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
            self.numbers.iter_mut().for_each(|p| *p = *p * scale);
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
                let (p, diagonal) = (&self.numbers[begin..begin + i], self.numbers[begin + i]);
                begin += i + 1;
                for (x, out) in rows.chunks_exact(panel.width).zip(out.chunks_exact_mut(panel.width)) {
                    out[i] += dot(p, &x[..i]) + diagonal * x[i];
                    take(&mut out[..i], p, -x[i]);
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
                for w in w.chunks_exact(panel.width) {
                    take(p, &w[..=i], w[i]);
                }
            }
        }
    }
}
