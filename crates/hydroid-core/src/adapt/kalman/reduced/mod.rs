//! Covariances whose memory does not grow with the square of the number of weights.
//!
//! Of the covariance of the weights `P_tt` a structure is kept: blocks, a diagonal, or a diagonal and some directions in its
//! inverse. Next to that, `P_ht` and `P_hh` cannot be kept by themselves: the joint covariance might be that of nothing.
//! What is kept instead is how the error of the state comes about,
//!
//! ```text
//! h~ = Psi theta~ + xi        P_ht = Psi P_tt        P_hh = Psi P_tt Psi' + Pi
//! ```
//!
//! with `xi`, of covariance `Pi`, independent of the error `theta~` of the weights: whatever is dropped from `P_tt`, the
//! joint covariance is one. With `A = df/dh`, `B = df/dtheta` and `g = (1 - leak) / sqrt(lambda)`, by which the error of the
//! weights is multiplied over a sample, the time update is
//!
//! ```text
//! Psi <- (A Psi + B) / g        Pi <- A Pi A' + Q_h        P_tt <- g^2 P_tt + Q_theta
//! ```
//!
//! since `h~+ = (A Psi + B) theta~ + A xi` and `theta~+ = g theta~`. The noise of the weights is taken as if it had been
//! in them while `Psi` came about, so that `P_hh` has `Psi Q_theta Psi'` too much and `P_ht` likewise: an approximation of the
//! order of `Q_theta`.
//!
//! The measurement update, with `H~ = H_h Psi + H_t`, `R~ = H_h Pi H_h' + R`, is that of a measurement of the weights
//! whose noise is `R~`,
//!
//! ```text
//! S = H~ P_tt H~' + R~        theta <- theta + P_tt H~' S^-1 e        h <- h + (Psi P_tt H~' + Pi H_h') S^-1 e
//! P_tt <- P_tt - P_tt H~' S^-1 H~ P_tt, of which the structure is kept
//! Psi  <- Psi - Pi H_h' R~^-1 H~        Pi <- Pi - Pi H_h' R~^-1 H_h Pi
//! ```
//!
//! and where the weights do not learn, with the state's gain `K`,
//!
//! ```text
//! Psi <- Psi - K H~        Pi <- (I - K H_h) Pi (I - K H_h)' + K R K'
//! ```
//!
//! With all weights in one block and no noise of theirs, this is the full filter.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

mod blocks;
mod diagonal;
mod jacobi;
mod low_rank;
mod panels;
pub(crate) mod structure;

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use self::panels::Panel;
use self::structure::Structure;
use super::gain::Gain;
use super::learnable::Learnable;
use super::root::{Root, gather, set_part, take_column, transpose};
use super::triangle::least;
use super::tuning::{Memory, Tuning};
use crate::math::Scalar;
use crate::math::rows::{add_rows, dot};

/// The joint covariance as the [module](self) has it. Matrices with a column for each weight are in panels.
#[derive(Clone, Debug)]
pub(super) struct Reduced<T> {
    panels: Vec<Panel>,
    /// Of each column: where its weight stands among the weights.
    pub(super) places: Vec<Option<usize>>,
    weight_noise: Vec<T>,
    /// `Psi` (`n x width`), `Pi` (`n x n`), `P_tt`.
    psi: Vec<T>,
    pi: Vec<T>,
    structure: Structure<T>,
    /// Local partials of the last step (`rows x width`).
    local: Vec<T>,
    /// Of `R~`, of what was measured.
    root: Root<T>,
    scratch: Scratch<T>,
}

#[derive(Clone, Debug)]
struct Scratch<T> {
    /// A panel of local rows of all blocks; the same, zero, with as many columns as state or outputs.
    expanded: Vec<T>,
    zeros: Vec<T>,
    /// A panel of `n x width`.
    wide: Vec<T>,
    /// `H~` and `H~ P_tt` (`outputs x width`).
    seen: Vec<T>,
    product: Vec<T>,
    /// `H_h Pi`, what becomes of it, and one more (`outputs x n`).
    narrow: Vec<T>,
    whitened: Vec<T>,
    left: Vec<T>,
    /// `H_h Pi H_h'`, and another (`outputs x outputs`).
    own: Vec<T>,
    roots: Vec<T>,
    /// `n x max(n, outputs)`, twice.
    square: Vec<T>,
    turned: Vec<T>,
    /// The model's.
    chain: Vec<T>,
}

impl<T: Scalar> Reduced<T> {
    /// Of the blocks that are learned; all zero.
    pub(super) fn new<M: Learnable<T>>(model: &M, tuning: &Tuning, learned: &[usize]) -> Self {
        let (n, outputs, rows) = (model.state_len(), model.outputs(), model.rows());
        let group = match tuning.memory {
            Memory::Full => model.blocks().len(),
            Memory::Blocks { group } => group,
            Memory::Diagonal | Memory::LowRank { .. } => 1,
        };
        let panels = Panel::all(model, learned, group.max(1));
        let places: Vec<usize> = panels.iter().flat_map(|panel| panel.places(model.blocks())).collect();
        let weight_noise = places.iter().map(|&place| T::of(tuning.weight_noise[place])).collect();
        let (width, all_rows, side) = (places.len(), model.blocks().len() * rows, n.max(outputs));
        let widest = panels.iter().map(|panel| panel.width).max().unwrap_or(0);
        let zeros = |len: usize| vec![T::zero(); len];
        Self {
            structure: Structure::new(tuning.memory, &panels, outputs),
            panels,
            places: places.into_iter().map(Some).collect(),
            weight_noise,
            psi: zeros(n * width),
            pi: zeros(n * n),
            local: zeros(rows * width),
            root: Root::new(outputs),
            scratch: Scratch {
                expanded: zeros(all_rows * widest),
                zeros: zeros(all_rows * side),
                wide: zeros(n * widest),
                seen: zeros(outputs * width),
                product: zeros(outputs * width),
                narrow: zeros(outputs * n),
                whitened: zeros(outputs * n),
                left: zeros(outputs * n),
                own: zeros(outputs * outputs),
                roots: zeros(outputs * outputs),
                square: zeros(n * side),
                turned: zeros(n * side),
                chain: zeros(model.scratch(widest.max(side))),
            },
        }
    }

    /// The weights are as uncertain as this says; the state as it was, of itself.
    pub(super) fn restart(&mut self, initial: &[T]) {
        self.fold();
        self.psi.fill(T::zero());
        self.structure.set_diagonal(&self.panels, initial);
    }

    /// Each number of the state is as uncertain as this says, of itself.
    pub(super) fn reset(&mut self, initial: &[T]) {
        let n = initial.len();
        self.psi.fill(T::zero());
        self.pi.fill(T::zero());
        (0..n).for_each(|i| self.pi[i * (n + 1)] = initial[i]);
    }

    /// A part of the state becomes independent of all else.
    pub(super) fn reset_part(&mut self, part: Range<usize>, initial: T) {
        let n = self.pi.len().isqrt();
        set_part(&mut self.pi, part.clone(), initial);
        for panel in &self.panels {
            self.psi[panel.of(n)][part.start * panel.width..part.end * panel.width].fill(T::zero());
        }
    }

    /// `Pi <- Pi + Psi P_tt Psi'`, as many rows at a time as there are outputs.
    fn fold(&mut self) {
        let Self { panels, psi, pi, structure, scratch: Scratch { seen, product, own, .. }, .. } = self;
        let (n, q) = (pi.len().isqrt(), own.len().isqrt());
        for from in (0..n).step_by(q) {
            let rows = from..n.min(from + q);
            let count = rows.len();
            for panel in &*panels {
                let psi = &psi[panel.of(n)][rows.start * panel.width..rows.end * panel.width];
                seen[panel.of(count)].copy_from_slice(psi);
            }
            structure.times(panels, count, seen, product);
            for panel in &*panels {
                let product = product[panel.of(count)].chunks_exact(panel.width);
                for (i, product) in rows.clone().zip(product) {
                    for (j, psi) in psi[panel.of(n)].chunks_exact(panel.width).take(i + 1).enumerate() {
                        pi[i * n + j] += dot(product, psi);
                    }
                }
            }
        }
        for i in 0..n {
            (0..i).for_each(|j| pi[j * n + i] = pi[i * n + j]);
        }
    }

    /// The diagonals of `P_hh` and `P_tt` (`width`).
    pub(super) fn variances(&self) -> (Vec<T>, Vec<T>) {
        let n = self.pi.len().isqrt();
        let mut own = self.clone();
        own.fold();
        ((0..n).map(|i| own.pi[i * (n + 1)]).collect(), self.structure.diagonal(&self.panels))
    }

    /// The smallest variance of the state, given the weights; those of the weights are squares.
    pub(super) fn least_variance(&self) -> T {
        let n = self.pi.len().isqrt();
        least((0..n).map(|i| self.pi[i * (n + 1)]))
    }

    /// `v' P v` of state (`n`) and weights (`width`): with `w = Psi' v_h + v_t`, `w' P_tt w + v_h' Pi v_h`.
    pub(super) fn variance(&mut self, v_h: &[T], v_t: &[T]) -> T {
        let Self { panels, psi, pi, structure, scratch: Scratch { seen, product, .. }, .. } = self;
        let (n, width) = (v_h.len(), v_t.len());
        seen[..width].copy_from_slice(v_t);
        for panel in &*panels {
            add_rows(&mut seen[panel.of(1)], &psi[panel.of(n)], v_h);
        }
        structure.times(panels, 1, &seen[..width], &mut product[..width]);
        let of_state: T = pi.chunks_exact(n).zip(v_h).map(|(row, &v)| v * dot(row, v_h)).sum();
        of_state + dot(&seen[..width], &product[..width])
    }

    /// Numbers that it keeps of `P`.
    pub(super) fn len(&self) -> usize {
        self.psi.len() + self.pi.len() + self.structure.parts().iter().map(|part| part.len()).sum::<usize>()
    }

    /// All that it goes on from.
    pub(super) fn parts(&self) -> [&[T]; 6] {
        let [first, second] = self.structure.parts();
        [&self.psi, &self.pi, &self.local, first, second, &[]]
    }

    /// The same, to put it back.
    pub(super) fn parts_mut(&mut self) -> [&mut [T]; 6] {
        let [first, second] = self.structure.parts_mut();
        [&mut self.psi, &mut self.pi, &mut self.local, first, second, &mut []]
    }

    /// Time update of a step that was just made.
    pub(super) fn advance<M: Learnable<T>>(&mut self, model: &M, grows: T, noise: T) {
        let Self { panels, psi, pi, local, structure, weight_noise, scratch, .. } = self;
        let Scratch { expanded, zeros, wide, square, turned, chain, .. } = scratch;
        let (n, rows) = (model.state_len(), model.rows());
        let all_rows = model.blocks().len() * rows;
        let by = T::one() / grows;
        for panel in &*panels {
            let (expanded, wide) = (&mut expanded[..all_rows * panel.width], &mut wide[..n * panel.width]);
            panel.linearize(model, &mut local[panel.of(rows)]);
            panel.expand(&local[panel.of(rows)], expanded);
            let psi = &mut psi[panel.of(n)];
            model.chain(psi, expanded, panel.width, wide, chain);
            T::reduced_scale(Arch::new(), Scale { x: wide, by, into: psi });
        }
        let (zeros, square, turned) = (&zeros[..all_rows * n], &mut square[..n * n], &mut turned[..n * n]);
        model.chain(pi, zeros, n, square, chain);
        transpose(n, n, square, turned);
        model.chain(turned, zeros, n, square, chain);
        for i in 0..n {
            for j in 0..=i {
                // Both triangles are the same but for rounding; from here on they are the same.
                pi[i * n + j] = square[i * n + j];
                pi[j * n + i] = square[i * n + j];
            }
        }
        model.moving().for_each(|i| pi[i * (n + 1)] += noise);
        structure.advance(panels, grows, weight_noise);
    }

    /// `H~`, `H~ P_tt`, `H_h Pi`, and what they tell of the outputs, before any measurement, into `gain`.
    pub(super) fn expect<M: Learnable<T>>(&mut self, model: &M, gain: &mut Gain<T>) {
        let Self { panels, psi, pi, local, structure, scratch, .. } = self;
        let Scratch { expanded, zeros, seen, product, narrow, own, turned, .. } = scratch;
        let (n, q, rows) = (model.state_len(), model.outputs(), model.rows());
        let all_rows = model.blocks().len() * rows;
        for panel in &*panels {
            let expanded = &mut expanded[..all_rows * panel.width];
            panel.expand(&local[panel.of(rows)], expanded);
            model.output_chain(&psi[panel.of(n)], expanded, panel.width, &mut seen[panel.of(q)]);
        }
        structure.times(panels, q, seen, product);
        model.output_chain(pi, &zeros[..all_rows * n], n, narrow);
        transpose(q, n, narrow, &mut turned[..n * q]);
        model.output_chain(&turned[..n * q], &zeros[..all_rows * q], q, own);
        gain.spread.copy_from_slice(own);
        T::reduced_expect(Arch::new(), Expect { panels, seen, product, spread: &mut gain.spread });
    }

    /// Measurement update; false where `R~` is not positive.
    pub(super) fn correct(
        &mut self,
        gain: &Gain<T>,
        state: &mut [T],
        change: &mut [T],
        learns: bool,
    ) -> bool {
        T::reduced_correct(Arch::new(), Correct { own: self, gain, state, change, learns })
    }
}

/// `into = by x`.
pub struct Scale<'a, T> {
    x: &'a [T],
    by: T,
    into: &'a mut [T],
}

impl<T: Scalar> WithSimd for Scale<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.into.iter_mut().zip(self.x).for_each(|(into, &x)| *into = x * self.by);
    }
}

/// Adds `H~ P_tt H~'` to what is expected of the outputs.
pub struct Expect<'a, T> {
    panels: &'a [Panel],
    seen: &'a [T],
    product: &'a [T],
    spread: &'a mut [T],
}

impl<T: Scalar> WithSimd for Expect<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { panels, seen, product, spread } = self;
        let q = spread.len().isqrt();
        for panel in panels {
            for (i, seen) in seen[panel.of(q)].chunks_exact(panel.width).enumerate() {
                let product = product[panel.of(q)].chunks_exact(panel.width);
                for (j, product) in product.take(i + 1).enumerate() {
                    spread[i * q + j] += dot(seen, product);
                }
            }
        }
    }
}

/// [`Reduced::correct`] for whatever vectors there are.
pub struct Correct<'a, T> {
    own: &'a mut Reduced<T>,
    gain: &'a Gain<T>,
    state: &'a mut [T],
    change: &'a mut [T],
    learns: bool,
}

impl<T: Scalar> WithSimd for Correct<'_, T> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Self { own, gain, state, change, learns } = self;
        let Reduced { panels, psi, pi, structure, root, scratch, .. } = own;
        let Scratch { seen, product, narrow, whitened: u, left, own, roots, .. } = scratch;
        let (n, q, measured) = (state.len(), gain.noise.len(), &gain.measured);
        let (count, e) = (measured.len(), &gain.whitened[..measured.len()]);
        let of_noise = |i: usize, j: usize| {
            let noise = if i == j { gain.noise[measured[i]] } else { T::zero() };
            own[measured[i] * q + measured[j]] + noise
        };
        if !root.factor(count, of_noise) {
            return false;
        }
        // R~ = L~ L~': what the measurement tells of xi alone, U' = L~^-1 H_h Pi.
        u.copy_from_slice(narrow);
        gather(measured, u, n);
        root.forward(u, n);
        // S = L L': of the state, W_h' = L^-1 (H~ P_tt Psi' + H_h Pi).
        for panel in &*panels {
            let product = product[panel.of(q)].chunks_exact(panel.width);
            for (product, narrow) in product.zip(narrow.chunks_exact_mut(n)) {
                for (psi, narrow) in psi[panel.of(n)].chunks_exact(panel.width).zip(narrow) {
                    *narrow += dot(product, psi);
                }
            }
        }
        gain.whiten(narrow, n);
        add_rows(state, &narrow[..count * n], e);
        for panel in &*panels {
            let (width, seen, product) = (panel.width, &mut seen[panel.of(q)], &mut product[panel.of(q)]);
            let lost = if learns {
                gather(measured, seen, width);
                root.forward(seen, width);
                gain.whiten(product, width);
                let change = &mut change[panel.of(1)];
                change.fill(T::zero());
                add_rows(change, &product[..count * width], e);
                &*u
            } else {
                gain.whiten(seen, width);
                &*narrow
            };
            for (i, psi) in psi[panel.of(n)].chunks_exact_mut(width).enumerate() {
                take_column(psi, &seen[..count * width], lost, i, n);
            }
        }
        if learns {
            structure.correct(panels, (q, count), product, seen);
        } else {
            // K R~ K' - K H_h Pi - .. is (K L~ - U) (K L~ - U)' - U U', with K L~ = W_h L^-1 L~.
            (0..count * count).for_each(|at| roots[at] = root.at(at / count, at % count));
            gain.root.forward(roots, count);
            for k in 0..count {
                let left = &mut left[k * n..(k + 1) * n];
                left.iter_mut().zip(&u[k * n..]).for_each(|(left, &u)| *left = -u);
                for (l, w) in narrow.chunks_exact(n).take(count).enumerate() {
                    add_rows(left, w, &[roots[l * count + k]]);
                }
            }
            for (i, pi) in pi.chunks_exact_mut(n).enumerate() {
                (0..count).for_each(|k| add_rows(pi, &left[k * n..(k + 1) * n], &[left[k * n + i]]));
            }
        }
        for (i, pi) in pi.chunks_exact_mut(n).enumerate() {
            take_column(pi, &u[..count * n], u, i, n);
        }
        true
    }
}
