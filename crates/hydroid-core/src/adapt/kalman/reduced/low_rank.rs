//! A diagonal and some directions, in the inverse of the covariance.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;

use super::super::root::{Root, take};
use super::jacobi::eigenvectors;
use super::panels::Panel;
use crate::math::Scalar;
use crate::math::rows::{add_rows, dot};

/// `P^-1 = diag(1 / v) + W W'`, `W` of `weights x rank` (LO-FI: Chang, Duran-Martin, Shestopaloff, Jones and Murphy,
/// "Low-rank extended Kalman filtering for online learning of neural networks from streaming data", `CoLLAs` 2023,
/// arXiv:2305.19535).
///
/// It is the variance `v` that is kept, not its inverse, so that a weight may be sure: `v = 0`.
///
/// Products with it are those of the Woodbury identity: `P = V - V W (I + W'V W)^-1 W'V`. So is the time update, which is
/// exact: `P+ = g^2 P + Q` has
///
/// ```text
/// v+ = g^2 v + q        W+ = g diag(v / v+) W M^-1/2        M = I + W' diag(q v / v+) W
/// ```
///
/// where any root of `M` will do. A measurement adds columns to `W`, `H' R^-1/2`; of all directions in their span the
/// `rank` largest are kept, and of those that are dropped the diagonal is added to `1 / v`.
#[derive(Clone, Debug)]
pub(super) struct LowRank<T> {
    rank: usize,
    pub(super) v: Vec<T>,
    /// `W'` (`rank x width`), in panels.
    pub(super) directions: Vec<T>,
    /// Of `I + W'V W`, or of `M`.
    root: Root<T>,
    /// With room for the directions of a measurement: `W'W`, and its eigenvectors as rows.
    gram: Vec<T>,
    vectors: Vec<T>,
    /// Eigenvalues, the largest first.
    order: Vec<usize>,
    /// `W'V rows'` (`rank x rows`).
    products: Vec<T>,
    /// A panel of all directions; of one row.
    all: Vec<T>,
    row: Vec<T>,
}

impl<T: Scalar> LowRank<T> {
    /// With room for measurements of so many outputs.
    pub(super) fn new(panels: &[Panel], rank: usize, outputs: usize) -> Self {
        let width: usize = panels.iter().map(|panel| panel.width).sum();
        let widest = panels.iter().map(|panel| panel.width).max().unwrap_or(0);
        let most = rank + outputs;
        Self {
            rank,
            v: vec![T::zero(); width],
            directions: vec![T::zero(); rank * width],
            root: Root::new(rank),
            gram: vec![T::zero(); most * most],
            vectors: vec![T::zero(); most * most],
            order: Vec::with_capacity(most),
            products: vec![T::zero(); rank * outputs],
            all: vec![T::zero(); most * widest],
            row: vec![T::zero(); widest],
        }
    }

    /// A diagonal covariance.
    pub(super) fn set_diagonal(&mut self, diagonal: &[T]) {
        self.v.copy_from_slice(diagonal);
        self.directions.fill(T::zero());
    }

    /// The diagonal of `P`: `v_i - |L^-1 (W'V)_i|^2` with `I + W'V W = L L'`.
    pub(super) fn diagonal(&self, panels: &[Panel]) -> Vec<T> {
        let (mut own, mut diagonal) = (self.clone(), self.v.clone());
        own.factor(panels, |at| self.v[at]);
        for panel in panels {
            let directions = &mut own.directions[panel.of(self.rank)];
            own.root.forward(directions, panel.width);
            let (p, v) = (&mut diagonal[panel.of(1)], &self.v[panel.of(1)]);
            for direction in directions.chunks_exact(panel.width) {
                for ((p, &v), &w) in p.iter_mut().zip(v).zip(direction) {
                    *p -= (v * w) * (v * w);
                }
            }
        }
        diagonal
    }

    /// The root of `I + W' diag(x) W`, `x` by column.
    #[inline(always)]
    fn factor(&mut self, panels: &[Panel], x: impl Fn(usize) -> T) -> bool {
        let Self { rank, directions, gram, row, root, .. } = self;
        let rank = *rank;
        gram[..rank * rank].fill(T::zero());
        for panel in panels {
            let directions = &directions[panel.of(rank)];
            let (begin, row) = (panel.of(1).start, &mut row[..panel.width]);
            for (i, w) in directions.chunks_exact(panel.width).enumerate() {
                for (k, (row, &w)) in row.iter_mut().zip(w).enumerate() {
                    *row = w * x(begin + k);
                }
                for (j, w) in directions.chunks_exact(panel.width).take(i + 1).enumerate() {
                    gram[i * rank + j] += dot(row, w);
                }
            }
        }
        let one = |i, j| if i == j { T::one() } else { T::zero() };
        root.factor(rank, |i, j| gram[i * rank + j] + one(i, j))
    }

    /// `P <- grows^2 P + diag(noise)`.
    #[inline(always)]
    pub(super) fn advance(&mut self, panels: &[Panel], grows: T, noise: &[T]) {
        let scale = grows * grows;
        // v / v+; what was sure has no direction to lose.
        let share = |v: T, q: T| if v > T::zero() { v / (scale * v + q) } else { T::zero() };
        let moves = noise.iter().any(|&q| q > T::zero());
        if moves {
            let v = core::mem::take(&mut self.v);
            // Where numbers have left all bounds, the next product tells.
            self.factor(panels, |at| noise[at] * share(v[at], noise[at]));
            self.v = v;
        }
        for panel in panels {
            let directions = &mut self.directions[panel.of(self.rank)];
            if moves {
                self.root.forward(directions, panel.width);
            }
            let (v, noise) = (&mut self.v[panel.of(1)], &noise[panel.of(1)]);
            for direction in directions.chunks_exact_mut(panel.width) {
                for ((w, &v), &q) in direction.iter_mut().zip(&*v).zip(noise) {
                    *w *= grows * share(v, q);
                }
            }
            for (v, &q) in v.iter_mut().zip(noise) {
                *v = scale * *v + q;
            }
        }
    }

    /// `out = rows P`; of each, `count` rows.
    #[inline(always)]
    pub(super) fn times(&mut self, panels: &[Panel], count: usize, rows: &[T], out: &mut [T]) {
        let v = core::mem::take(&mut self.v);
        let sound = self.factor(panels, |at| v[at]);
        self.v = v;
        if !sound {
            return out.fill(T::nan());
        }
        let Self { rank, v, directions, products, root, .. } = self;
        let products = &mut products[..*rank * count];
        products.fill(T::zero());
        for panel in panels {
            let (width, v) = (panel.width, &v[panel.of(1)]);
            let (rows, out) = (&rows[panel.of(count)], &mut out[panel.of(count)]);
            for ((k, row), out) in rows.chunks_exact(width).enumerate().zip(out.chunks_exact_mut(width)) {
                out.iter_mut().zip(row.iter().zip(v)).for_each(|(out, (&x, &v))| *out = x * v);
                for (r, w) in directions[panel.of(*rank)].chunks_exact(width).enumerate() {
                    products[r * count + k] += dot(w, out);
                }
            }
        }
        root.forward(products, count);
        root.backward(products, count);
        for panel in panels {
            let (width, v) = (panel.width, &v[panel.of(1)]);
            let (rows, out) = (&rows[panel.of(count)], &mut out[panel.of(count)]);
            for ((k, row), out) in rows.chunks_exact(width).enumerate().zip(out.chunks_exact_mut(width)) {
                out.copy_from_slice(row);
                for (r, w) in directions[panel.of(*rank)].chunks_exact(width).enumerate() {
                    take(out, w, products[r * count + k]);
                }
                out.iter_mut().zip(v).for_each(|(out, &v)| *out *= v);
            }
        }
    }

    /// `P^-1 <- P^-1 + sum_k h_k h_k'`; `h` are the first `count` of `rows` rows.
    #[inline(always)]
    pub(super) fn correct(&mut self, panels: &[Panel], (rows, count): (usize, usize), h: &[T]) {
        let Self { rank, v, directions, gram, vectors, order, all, row, .. } = self;
        let (rank, most) = (*rank, *rank + count);
        let (gram, vectors) = (&mut gram[..most * most], &mut vectors[..most * most]);
        gram.fill(T::zero());
        for panel in panels {
            let all = stack(panel, &directions[panel.of(rank)], &h[panel.of(rows)], all, most);
            for (i, a) in all.chunks_exact(panel.width).enumerate() {
                for (j, b) in all.chunks_exact(panel.width).take(i + 1).enumerate() {
                    gram[i * most + j] += dot(a, b);
                }
            }
        }
        for i in 0..most {
            for j in 0..i {
                gram[j * most + i] = gram[i * most + j];
            }
        }
        eigenvectors(gram, vectors, most);
        order.clear();
        order.extend(0..most);
        let eigenvalue = |i: usize| gram[i * (most + 1)].wide();
        order.sort_unstable_by(|&a, &b| eigenvalue(b).total_cmp(&eigenvalue(a)));
        let coefficients = |k: usize| &vectors[order[k] * most..(order[k] + 1) * most];
        for panel in panels {
            let own = &mut directions[panel.of(rank)];
            let all = stack(panel, own, &h[panel.of(rows)], all, most);
            own.fill(T::zero());
            for (k, w) in own.chunks_exact_mut(panel.width).enumerate() {
                add_rows(w, all, coefficients(k));
            }
            let (row, v) = (&mut row[..panel.width], &mut v[panel.of(1)]);
            for k in rank..most {
                row.fill(T::zero());
                add_rows(row, all, coefficients(k));
                for (v, &d) in v.iter_mut().zip(&*row) {
                    *v = *v / (T::one() + d * d * *v);
                }
            }
        }
    }
}

/// All directions of a panel, those that are kept and the new ones.
#[inline(always)]
fn stack<'a, T: Copy>(panel: &Panel, own: &[T], more: &[T], all: &'a mut [T], rows: usize) -> &'a [T] {
    let all = &mut all[..rows * panel.width];
    let (kept, new) = all.split_at_mut(own.len());
    kept.copy_from_slice(own);
    let len = new.len();
    new.copy_from_slice(&more[..len]);
    all
}
