//! Every weight by itself.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;

use super::panels::Panel;
use crate::math::Scalar;

/// `P = diag(p)`.
#[derive(Clone, Debug)]
pub(super) struct Diagonal<T> {
    pub(super) p: Vec<T>,
}

impl<T: Scalar> Diagonal<T> {
    pub(super) fn new(width: usize) -> Self {
        Self { p: vec![T::zero(); width] }
    }

    /// `P <- grows^2 P + diag(noise)`.
    #[inline(always)]
    pub(super) fn advance(&mut self, grows: T, noise: &[T]) {
        for (p, &noise) in self.p.iter_mut().zip(noise) {
            *p = grows * grows * *p + noise;
        }
    }

    /// `out = rows P`; of each, `count` rows.
    #[inline(always)]
    pub(super) fn times(&self, panels: &[Panel], count: usize, rows: &[T], out: &mut [T]) {
        for panel in panels {
            let (rows, out) = (&rows[panel.of(count)], &mut out[panel.of(count)]);
            for (row, out) in rows.chunks_exact(panel.width).zip(out.chunks_exact_mut(panel.width)) {
                for ((out, &row), &p) in out.iter_mut().zip(row).zip(&self.p[panel.of(1)]) {
                    *out = row * p;
                }
            }
        }
    }

    /// `P <- P - sum_k w_k w_k'`, of its diagonal; `w` are the first `count` of `rows` rows.
    #[inline(always)]
    pub(super) fn correct(&mut self, panels: &[Panel], (rows, count): (usize, usize), w: &[T]) {
        for panel in panels {
            for w in w[panel.of(rows)].chunks_exact(panel.width).take(count) {
                for (p, &w) in self.p[panel.of(1)].iter_mut().zip(w) {
                    *p -= w * w;
                }
            }
        }
    }
}
