//! The covariance of state and weights, all of it.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::gain::Gain;
use super::learnable::Learnable;
use super::lines::Lines;
use super::root::{set_part, take_column, transpose};
use super::triangle::{Pass, Span, Triangle, least};
use super::tuning::Tuning;
use crate::math::Scalar;
use crate::math::aligned::Aligned;
use crate::math::rows::{add_rows, dot};

/// `P` as the [module](super) has it.
///
/// The covariance of the weights is touched once a sample, in `advance`: what the last measurement takes from it is
/// taken when the next step's products with it are made, in one pass ([`Triangle::pass`]).
#[derive(Clone, Debug)]
pub(super) struct Full<T> {
    /// `P_hh` (`n x n`), `P_ht` (`n x width`, in panels), `P_tt`.
    hh: Vec<T>,
    ht: Aligned<T>,
    tt: Triangle<T>,
    /// Which block each block of the triangle is.
    learned: Vec<usize>,
    /// Of each padded weight: where it stands among the weights. Padding stands nowhere.
    pub(super) places: Vec<Option<usize>>,
    weight_noise: Vec<T>,
    /// What the last measurement takes from `P_tt`, `rank x width` in panels; whether there is something to take.
    downdate: Aligned<T>,
    pub(super) pending: bool,
    /// `L` (`rows x width`) and `L P_tt` (`blocks rows x width`), in panels.
    local: Aligned<T>,
    products: Aligned<T>,
    scratch: Scratch<T>,
}

#[derive(Clone, Debug)]
struct Scratch<T> {
    /// `blocks rows x n`, and `x outputs`; of blocks that are not learned they stay zero.
    by_state: Vec<T>,
    by_output: Vec<T>,
    /// `n x max(n, outputs)`, twice.
    square: Vec<T>,
    turned: Vec<T>,
    /// A panel of `n x width`.
    wide: Aligned<T>,
    taken: Vec<T>,
    /// `G_h'` (`outputs x n`).
    narrow: Vec<T>,
    /// The model's.
    chain: Vec<T>,
}

impl<T: Scalar> Full<T> {
    /// Of the weights that are learned, block by block; all zero.
    pub(super) fn new<M: Learnable<T>>(model: &M, tuning: &Tuning, learned: Vec<usize>) -> Self {
        let (n, outputs, rows) = (model.state_len(), model.outputs(), model.rows());
        let tt = Triangle::new(learned.iter().map(|&b| (model.blocks()[b].len(), b * rows, model.split(b))));
        let width = tt.width();
        let mut places = vec![None; width];
        for (span, &b) in tt.spans().iter().zip(&learned) {
            for (column, &place) in span.weights().zip(&model.blocks()[b]) {
                places[column] = Some(place);
            }
        }
        let weight_noise = places.iter().map(|p| T::of(p.map_or(0.0, |p| tuning.weight_noise[p]))).collect();
        let (all_rows, side) = (model.blocks().len() * rows, n.max(outputs));
        let widest = tt.spans().iter().map(|span| span.padded).max().unwrap_or(0);
        Self {
            hh: vec![T::zero(); n * n],
            ht: Aligned::zeros(n * width),
            tt,
            learned,
            places,
            weight_noise,
            downdate: Aligned::zeros(Triangle::<T>::rank(outputs) * width),
            pending: false,
            local: Aligned::zeros(rows * width),
            products: Aligned::zeros(all_rows * width),
            scratch: Scratch {
                by_state: vec![T::zero(); all_rows * n],
                by_output: vec![T::zero(); all_rows * outputs],
                square: vec![T::zero(); n * side],
                turned: vec![T::zero(); n * side],
                wide: Aligned::zeros(n * widest),
                taken: vec![T::zero(); Triangle::<T>::rank(outputs)],
                narrow: vec![T::zero(); outputs * n],
                chain: vec![T::zero(); model.scratch(widest.max(side))],
            },
        }
    }

    /// `P_tt` becomes diagonal (`width`), `P_ht` zero.
    pub(super) fn restart(&mut self, initial: &[T]) {
        self.tt.set_diagonal(initial);
        self.ht.fill(T::zero());
        self.pending = false;
    }

    /// `P_hh` becomes diagonal, `P_ht` zero.
    pub(super) fn reset(&mut self, initial: &[T]) {
        let n = initial.len();
        self.hh.fill(T::zero());
        for (i, &initial) in initial.iter().enumerate() {
            self.hh[i * (n + 1)] = initial;
        }
        self.ht.fill(T::zero());
    }

    /// A part of the state becomes independent of all else.
    pub(super) fn reset_part(&mut self, part: Range<usize>, initial: T) {
        let n = self.hh.len().isqrt();
        set_part(&mut self.hh, part.clone(), initial);
        for span in self.tt.spans() {
            self.ht[span.panel(n)][part.start * span.padded..part.end * span.padded].fill(T::zero());
        }
    }

    /// The diagonals of `P_hh` and `P_tt` (`width`).
    pub(super) fn variances(&self) -> (Vec<T>, Vec<T>) {
        let n = self.hh.len().isqrt();
        let mut padded = vec![T::zero(); self.tt.width()];
        self.tt.clone().diagonal(&mut padded);
        if self.pending {
            let rank = self.scratch.taken.len();
            for span in self.tt.spans() {
                for w in self.downdate[span.panel(rank)].chunks_exact(span.padded) {
                    padded[span.panel(1)].iter_mut().zip(w).for_each(|(p, &w)| *p -= w * w);
                }
            }
        }
        ((0..n).map(|i| self.hh[i * (n + 1)]).collect(), padded)
    }

    /// The smallest variance, of the state after the last measurement, of the weights before it.
    pub(super) fn least_variance(&self) -> T {
        let n = self.hh.len().isqrt();
        least((0..n).map(|i| self.hh[i * (n + 1)]).chain([self.tt.least()]))
    }

    /// `v' P v` of state (`n`) and weights (`width`).
    pub(super) fn variance(&mut self, v_h: &[T], v_t: &[T]) -> T {
        let n = v_h.len();
        let taken = &mut self.scratch.taken;
        let mut sum = self.tt.quadratic(v_t);
        for (row, &v_i) in self.hh.chunks_exact(n).zip(v_h) {
            sum += v_i * dot(row, v_h);
        }
        let rank = taken.len();
        taken.fill(T::zero());
        for span in self.tt.spans() {
            let v = &v_t[span.panel(1)];
            for (ht, &v_i) in self.ht[span.panel(n)].chunks_exact(span.padded).zip(v_h) {
                let cross = v_i * dot(ht, v);
                sum += cross + cross;
            }
            if self.pending {
                let w = self.downdate[span.panel(rank)].chunks_exact(span.padded);
                w.zip(&mut *taken).for_each(|(w, taken)| *taken += dot(w, v));
            }
        }
        taken.iter().fold(sum, |sum, &taken| sum - taken * taken)
    }

    /// Numbers that it keeps of `P`.
    pub(super) fn len(&self) -> usize {
        self.hh.len() + self.ht.len() + self.tt.numbers().len()
    }

    /// All that it goes on from, but for the flag.
    pub(super) fn parts(&self) -> [&[T]; 6] {
        [&self.hh, &self.ht, self.tt.numbers(), &self.downdate, &self.local, &self.products]
    }

    /// The same, to put it back.
    pub(super) fn parts_mut(&mut self) -> [&mut [T]; 6] {
        let Self { hh, ht, tt, downdate, local, products, .. } = self;
        [hh, ht, tt.numbers_mut(), downdate, local, products]
    }

    /// Time update of a step that was just made; the weights' part grows by `grows^2`, the state's by `noise`.
    pub(super) fn advance<M: Learnable<T>>(&mut self, model: &M, grows: T, noise: T) {
        self.linearize(model);
        let all_rows = model.blocks().len() * model.rows();
        self.tt.pass(&mut Pass {
            downdate: self.pending.then_some(&self.downdate),
            rank: self.scratch.taken.len(),
            scale: grows * grows,
            noise: &self.weight_noise,
            local: &self.local,
            rows: model.rows(),
            products: &mut self.products,
            all_rows,
        });
        self.pending = false;
        self.spread(model, grows, noise);
    }

    /// Takes what a measurement tells from `P`, adds it to the state, and gives what it adds to the weights (`width`), which
    /// are corrected where `learns`.
    pub(super) fn correct(&mut self, gain: &Gain<T>, state: &mut [T], change: &mut [T], learns: bool) {
        T::full_correct(Arch::new(), Correct { own: self, gain, state, change });
        self.pending = learns;
    }

    /// `L` of the step that was just made.
    fn linearize<M: Learnable<T>>(&mut self, model: &M) {
        let rows = model.rows();
        for (span, &block) in self.tt.spans().iter().zip(&self.learned) {
            let panel = &mut self.local[span.panel(rows)];
            for (row, partials) in panel.chunks_exact_mut(span.padded).enumerate() {
                model.local(block, row, &mut partials[..span.len]);
            }
        }
    }

    /// `P_hh` and `P_ht` of the time update, from `L P_tt`; with `G = [A B]`, `[P_hh P_ht]+ = G P G', G P`.
    fn spread<M: Learnable<T>>(&mut self, model: &M, grows: T, noise: T) {
        let (n, rows, arch) = (model.state_len(), model.rows(), Arch::new());
        let all_rows = model.blocks().len() * rows;
        let lines = &mut Lines::new();
        let Scratch { by_state, square, turned, wide, chain, .. } = &mut self.scratch;
        // G P, columns of the state: A P_hh + B P_th, B P_th = C (L P_th).
        for span in self.tt.spans() {
            let (local, matrix) = (&self.local[span.panel(rows)], &self.ht[span.panel(n)]);
            T::full_products(arch, Products { lines, span, local, matrix, out: by_state });
        }
        model.chain(&self.hh, by_state, n, &mut square[..n * n], chain);
        transpose(n, n, &square[..n * n], &mut turned[..n * n]);
        for span in self.tt.spans() {
            // G P, columns of the weights; and L of them, for G (G P)'.
            let (ht, wide) = (&mut self.ht[span.panel(n)], &mut wide[..n * span.padded]);
            let products = &mut self.products[span.panel(all_rows)];
            model.chain(ht, products, span.padded, wide, chain);
            let (local, noise) = (&self.local[span.panel(rows)], &self.weight_noise[span.weights()]);
            let shown = model.shown() * rows;
            T::full_spread(
                arch,
                Spread { lines, span, local, wide, by_state, grows, ht, noise, shown, products },
            );
        }
        model.chain(&turned[..n * n], by_state, n, &mut square[..n * n], chain);
        for i in 0..n {
            for j in 0..=i {
                // Both triangles are the same but for rounding; from here on they are the same.
                let p = square[i * n + j];
                self.hh[i * n + j] = p;
                self.hh[j * n + i] = p;
            }
        }
        model.moving().for_each(|i| self.hh[i * (n + 1)] += noise);
    }

    /// What is expected of the outputs before any measurement, `G' = H P` and `H P H'`, the latter into `gain`.
    pub(super) fn expect<M: Learnable<T>>(&mut self, model: &M, gain: &mut Gain<T>) {
        let (n, q, rows, arch) = (model.state_len(), model.outputs(), model.rows(), Arch::new());
        let (all_rows, rank) = (model.blocks().len() * rows, self.scratch.taken.len());
        let lines = &mut Lines::new();
        let Scratch { by_state, by_output, turned, narrow, .. } = &mut self.scratch;
        for span in self.tt.spans() {
            let (local, ht) = (&self.local[span.panel(rows)], &self.ht[span.panel(n)]);
            let shown = span.row >= model.shown() * rows;
            if shown {
                T::full_products(arch, Products { lines, span, local, matrix: ht, out: by_state });
            }
            let product = &mut self.downdate[span.panel(rank)][..q * span.padded];
            model.output_chain(ht, &self.products[span.panel(all_rows)], span.padded, product);
            if shown {
                T::full_products(arch, Products { lines, span, local, matrix: product, out: by_output });
            }
        }
        model.output_chain(&self.hh, by_state, n, narrow);
        transpose(q, n, narrow, &mut turned[..n * q]);
        model.output_chain(&turned[..n * q], by_output, q, &mut gain.spread);
    }
}

/// A block's rows of `L M'`, from its panels of both: `M` has as many rows as there are columns of what comes out.
pub struct Products<'a, T> {
    lines: &'a mut Lines<T>,
    span: &'a Span,
    local: &'a [T],
    matrix: &'a [T],
    /// Of all blocks.
    out: &'a mut [T],
}

impl<T: Scalar> WithSimd for Products<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { lines, span, local, matrix, out } = self;
        let count = matrix.len() / span.padded;
        let rows = span.rows(local.len() / span.padded);
        let out = out[span.row * count..(span.row + rows) * count].chunks_exact_mut(count);
        for (partials, out) in local.chunks_exact(span.padded).zip(out) {
            lines.product(simd, partials, matrix, out);
        }
    }
}

/// What a panel of `G P` gives in the time update, with its part of `L P_tt` and of the noise.
pub struct Spread<'a, T> {
    lines: &'a mut Lines<T>,
    span: &'a Span,
    local: &'a [T],
    wide: &'a [T],
    by_state: &'a mut [T],
    grows: T,
    ht: &'a mut [T],
    noise: &'a [T],
    /// The first row of `products` that the outputs want.
    shown: usize,
    products: &'a mut [T],
}

impl<T: Scalar> WithSimd for Spread<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { lines, span, local, wide, by_state, grows, ht, noise, shown, products } = self;
        Products { lines, span, local, matrix: wide, out: by_state }.with_simd(simd);
        for (ht, &wide) in ht.iter_mut().zip(wide) {
            *ht = wide * grows;
        }
        // Of L P_tt the outputs want the rows of their own blocks, of the covariance after the time update.
        let scale = grows * grows;
        if scale != T::one() {
            for p in &mut products[shown * span.padded..] {
                *p *= scale;
            }
        }
        if span.row < shown {
            return;
        }
        let own = &mut products[span.row * span.padded..];
        for (own, local) in own.chunks_exact_mut(span.padded).zip(local.chunks_exact(span.padded)) {
            for ((p, &l), &noise) in own.iter_mut().zip(local).zip(noise) {
                *p += noise * l;
            }
        }
    }
}

/// `W`, and what it takes from `P_hh` and `P_ht` and adds to state and weights.
pub struct Correct<'a, T> {
    own: &'a mut Full<T>,
    gain: &'a Gain<T>,
    state: &'a mut [T],
    change: &'a mut [T],
}

impl<T: Scalar> WithSimd for Correct<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { own: Full { hh, ht, tt, downdate, scratch, .. }, gain, state, change } = self;
        let (n, rank, count) = (state.len(), scratch.taken.len(), gain.measured.len());
        let (w_h, e) = (&mut scratch.narrow, &gain.whitened[..count]);
        gain.whiten(w_h, n);
        add_rows(state, &w_h[..count * n], e);
        for span in tt.spans() {
            let w_t = &mut downdate[span.panel(rank)];
            gain.whiten(w_t, span.padded);
            let (w_t, rest) = w_t.split_at_mut(count * span.padded);
            rest.fill(T::zero());
            let change = &mut change[span.panel(1)];
            change.fill(T::zero());
            add_rows(change, w_t, e);
            for (i, ht) in ht[span.panel(n)].chunks_exact_mut(span.padded).enumerate() {
                take_column(ht, w_t, w_h, i, n);
            }
        }
        for (i, hh) in hh.chunks_exact_mut(n).enumerate() {
            take_column(hh, &w_h[..count * n], w_h, i, n);
        }
    }
}
