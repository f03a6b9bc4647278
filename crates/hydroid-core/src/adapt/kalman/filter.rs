//! The extended Kalman filter over state and weights.
#![expect(
    clippy::inline_always,
    reason = "what a step is made of must become a part of the function that was compiled for the processor"
)]

use alloc::vec;
use alloc::vec::Vec;

use pulp::{Arch, Simd, WithSimd};

use super::gain::Gain;
use super::learnable::Learnable;
use super::triangle::{Pass, Span, Triangle};
use super::tuning::{Tuning, TuningError};
use crate::math::Scalar;
use crate::math::rows::{add_rows, dot};

/// What a measurement did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Correction {
    /// Nothing: there is no measurement, or no step before it.
    None,
    /// It corrected state and weights.
    Made {
        /// Normalised innovation squared, `e' S^-1 e`.
        nis: f64,
        /// The largest innovation, in standard deviations.
        deviations: f64,
        /// The least weight that a channel had: below 1 where [`Tuning::huber`] softened it.
        weight: f64,
    },
    /// Innovation or covariance are not finite: it was left out, and the covariance starts again.
    Lost,
}

/// An extended Kalman filter over the state and the weights of a [`Learnable`] model, as the [module](super) has it.
///
/// [`advance`](Self::advance) is the time update, [`observe`](Self::observe) the measurement update; a step without
/// measurement is an `advance` alone. Nothing allocates but [`new`](Self::new).
///
/// The covariance of the weights is touched once a sample, in `advance`: what the last measurement takes from it is
/// taken when the next step's products with it are made, in one pass ([`Triangle::pass`]).
#[derive(Clone, Debug)]
pub struct Filter<T, M> {
    pub(super) model: M,
    pub(super) tuning: Tuning,
    /// `h`, all weights, and those that were given.
    pub(super) state: Vec<T>,
    pub(super) weights: Vec<T>,
    given: Vec<T>,
    /// `R`, which may move.
    pub(super) noise: Vec<T>,
    /// `P_hh` (`n x n`), `P_ht` (`n x width`, in panels), `P_tt`.
    pub(super) hh: Vec<T>,
    pub(super) ht: Vec<T>,
    pub(super) tt: Triangle<T>,
    /// Which block each block of the triangle is.
    learned: Vec<usize>,
    /// Of each padded weight: where it stands among the weights. Padding stands nowhere.
    places: Vec<Option<usize>>,
    weight_noise: Vec<T>,
    /// What the last measurement takes from `P_tt`, `rank x width` in panels; whether there is something to take.
    pub(super) downdate: Vec<T>,
    pub(super) pending: bool,
    /// `L` (`rows x width`) and `L P_tt` (`blocks rows x width`), in panels.
    pub(super) local: Vec<T>,
    pub(super) products: Vec<T>,
    /// Whether a step was made since the last measurement.
    pub(super) moved: bool,
    /// Whether measurements change the weights.
    pub(super) learns: bool,
    gain: Gain<T>,
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
    wide: Vec<T>,
    /// What the weights change by (`width`).
    change: Vec<T>,
    taken: Vec<T>,
    /// `G_h'` (`outputs x n`).
    narrow: Vec<T>,
    /// The model's.
    chain: Vec<T>,
}

impl<T: Scalar, M: Learnable<T>> Filter<T, M> {
    /// A filter at the start of a run, with the weights that the model has.
    ///
    /// # Errors
    /// If the tuning makes no sense or does not fit the model.
    pub fn new(model: M, tuning: Tuning) -> Result<Self, TuningError> {
        let (n, outputs, rows) = (model.state_len(), model.outputs(), model.rows());
        tuning.check(model.weights().len(), outputs)?;
        let learned: Vec<usize> = (0..model.blocks().len())
            .filter(|&b| model.blocks()[b].iter().any(|&weight| tuning.learns(weight)))
            .collect();
        if learned.is_empty() && tuning.initial_state == 0.0 && tuning.state_noise == 0.0 {
            return Err(TuningError::Nothing);
        }
        let tt = Triangle::new(learned.iter().map(|&b| (model.blocks()[b].len(), b * rows)));
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
        let weights = model.weights().to_vec();
        let mut filter = Self {
            state: vec![T::zero(); n],
            given: weights.clone(),
            weights,
            noise: vec![T::zero(); outputs],
            hh: vec![T::zero(); n * n],
            ht: vec![T::zero(); n * width],
            tt,
            learned,
            places,
            weight_noise,
            downdate: vec![T::zero(); Triangle::<T>::rank(outputs) * width],
            pending: false,
            local: vec![T::zero(); rows * width],
            products: vec![T::zero(); all_rows * width],
            moved: false,
            learns: true,
            gain: Gain::new(outputs),
            scratch: Scratch {
                by_state: vec![T::zero(); all_rows * n],
                by_output: vec![T::zero(); all_rows * outputs],
                square: vec![T::zero(); n * side],
                turned: vec![T::zero(); n * side],
                wide: vec![T::zero(); n * widest],
                change: vec![T::zero(); width],
                taken: vec![T::zero(); Triangle::<T>::rank(outputs)],
                narrow: vec![T::zero(); outputs * n],
                chain: vec![T::zero(); model.scratch(widest.max(side))],
            },
            model,
            tuning,
        };
        filter.restart();
        filter.reset();
        Ok(filter)
    }

    /// Forgets how sure it is of the weights: their covariance is as at the start. The weights stay.
    pub fn restart(&mut self) {
        let initial: Vec<T> =
            self.places.iter().map(|p| T::of(p.map_or(0.0, |p| self.tuning.initial_weights[p]))).collect();
        self.tt.set_diagonal(&initial);
        self.ht.fill(T::zero());
        self.pending = false;
        for (noise, &given) in self.noise.iter_mut().zip(&self.tuning.noise) {
            *noise = T::of(given);
        }
    }

    /// Back to the start of a run: the state is zero, as uncertain as at first. What was learned stays.
    pub fn reset(&mut self) {
        let n = self.state.len();
        self.state.fill(T::zero());
        self.hh.fill(T::zero());
        for i in 0..n {
            self.hh[i * (n + 1)] = T::of(self.tuning.initial_state);
        }
        self.ht.fill(T::zero());
        self.moved = false;
    }

    /// Whether measurements change the weights, as they do at first. Otherwise they correct the state alone, the
    /// uncertainty of the weights being what it is (the Schmidt-Kalman filter, which considers it).
    pub fn learn(&mut self, learns: bool) {
        self.learns = learns;
    }

    /// `h` and `theta` become these; how uncertain they are stays. The step before is none that a measurement belongs to.
    pub fn set(&mut self, state: impl IntoIterator<Item = T>, weights: impl IntoIterator<Item = T>) {
        self.state.iter_mut().zip(state).for_each(|(into, h)| *into = h);
        self.weights.iter_mut().zip(weights).for_each(|(into, w)| *into = w);
        self.model.set_weights(&self.weights);
        self.moved = false;
    }

    /// Whether a step was made since the last measurement.
    pub fn has_moved(&self) -> bool {
        self.moved
    }

    /// Whether the weights move without measurements.
    pub fn leaks(&self) -> bool {
        self.tuning.leak > 0.0
    }

    /// The model, with the weights of the moment.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// The state `h`.
    pub fn state(&self) -> &[T] {
        &self.state
    }

    /// All weights `theta` of the moment, learned or not.
    pub fn weights(&self) -> &[T] {
        &self.weights
    }

    /// `R` of each output, which moves where [`Tuning::noise_rate`] says so.
    pub fn noise(&self) -> &[T] {
        &self.noise
    }

    /// What was expected of the last measurement that [`observe`](Self::observe) was given: innovations `z - y`, NaN where
    /// nothing was measured, and the diagonal of `S`.
    pub fn innovation(&self) -> (&[T], &[T]) {
        (&self.gain.innovation, &self.gain.variance)
    }

    /// `S - R` of all outputs as the last measurement found it, row by row: what it was not sure of before.
    pub fn spread_before(&self) -> &[T] {
        &self.gain.spread
    }

    /// The diagonals of `P_hh` and `P_tt` (in the order of the weights; zero for those that are not learned), after the last
    /// measurement.
    pub fn variances(&self) -> (Vec<T>, Vec<T>) {
        let n = self.state.len();
        let mut padded = vec![T::zero(); self.tt.width()];
        self.tt.clone().diagonal(&mut padded);
        if self.pending {
            for span in self.tt.spans() {
                let panel = &self.downdate[span.panel(Triangle::<T>::rank(self.noise.len()))];
                for w in panel.chunks_exact(span.padded) {
                    padded[span.panel(1)].iter_mut().zip(w).for_each(|(p, &w)| *p -= w * w);
                }
            }
        }
        let mut of_weights = vec![T::zero(); self.weights.len()];
        for (&place, &p) in self.places.iter().zip(&padded) {
            if let Some(place) = place {
                of_weights[place] = p;
            }
        }
        ((0..n).map(|i| self.hh[i * (n + 1)]).collect(), of_weights)
    }

    /// Adds to `out` the variances of linear functions of state and weights, after the last measurement. `by_state` and
    /// `by_weights` have their gradients as columns: `state x functions`, `weights x functions`.
    pub(super) fn add_variances(&mut self, by_state: &[f64], by_weights: &[f64], out: &mut [f64]) {
        let (n, count) = (self.state.len(), out.len());
        let rank = Triangle::<T>::rank(self.noise.len());
        let Scratch { change: v, square: v_h, taken, .. } = &mut self.scratch;
        let v_h = &mut v_h[..n];
        for (r, out) in out.iter_mut().enumerate() {
            v_h.iter_mut().enumerate().for_each(|(i, v)| *v = T::of(by_state[i * count + r]));
            for (v, &place) in v.iter_mut().zip(&self.places) {
                *v = place.map_or(T::zero(), |place| T::of(by_weights[place * count + r]));
            }
            let mut sum = self.tt.quadratic(v);
            for (row, &v_i) in self.hh.chunks_exact(n).zip(&*v_h) {
                sum += v_i * dot(row, v_h);
            }
            taken.fill(T::zero());
            for span in self.tt.spans() {
                let v = &v[span.panel(1)];
                for (ht, &v_i) in self.ht[span.panel(n)].chunks_exact(span.padded).zip(&*v_h) {
                    let cross = v_i * dot(ht, v);
                    sum += cross + cross;
                }
                if self.pending {
                    let w = self.downdate[span.panel(rank)].chunks_exact(span.padded);
                    w.zip(&mut *taken).for_each(|(w, taken)| *taken += dot(w, v));
                }
            }
            *out += taken.iter().fold(sum, |sum, &taken| sum - taken * taken).wide();
        }
    }

    /// Time update: `h <- f(h, x)`, `theta <- theta_0 + (1 - leak) (theta - theta_0)`.
    ///
    /// # Panics
    /// If `x` is shorter than the model's input.
    pub fn advance(&mut self, x: &[T]) {
        self.model.step(&mut self.state, x);
        self.linearize();
        let keeps = T::of(1.0 - self.tuning.leak);
        let grows = keeps / T::of(self.tuning.forgetting).sqrt();
        let all_rows = self.all_rows();
        self.tt.pass(&mut Pass {
            downdate: self.pending.then_some(&self.downdate),
            rank: Triangle::<T>::rank(self.noise.len()),
            scale: grows * grows,
            noise: &self.weight_noise,
            local: &self.local,
            rows: self.model.rows(),
            products: &mut self.products,
            all_rows,
        });
        self.pending = false;
        Arch::new().dispatch(Spread { filter: self, grows });
        if self.tuning.leak > 0.0 {
            for (weight, &given) in self.weights.iter_mut().zip(&self.given) {
                *weight = given + keeps * (*weight - given);
            }
            self.model.set_weights(&self.weights);
        }
        self.moved = true;
    }

    /// Local rows of all blocks, learned or not.
    fn all_rows(&self) -> usize {
        self.model.blocks().len() * self.model.rows()
    }

    /// `L` of the step that was just made.
    fn linearize(&mut self) {
        let rows = self.model.rows();
        for (span, &block) in self.tt.spans().iter().zip(&self.learned) {
            let panel = &mut self.local[span.panel(rows)];
            for (row, partials) in panel.chunks_exact_mut(span.padded).enumerate() {
                self.model.local(block, row, &mut partials[..span.len]);
            }
        }
    }

    /// `P_hh` and `P_ht` of the time update, from `L P_tt`; with `G = [A B]`, `[P_hh P_ht]+ = G P G', G P`.
    #[inline(always)]
    fn spread(&mut self, grows: T) {
        let (n, rows, all_rows, scale) =
            (self.state.len(), self.model.rows(), self.all_rows(), grows * grows);
        let Scratch { by_state, square, turned, wide, chain, .. } = &mut self.scratch;
        // G P, columns of the state: A P_hh + B P_th, B P_th = C (L P_th).
        for span in self.tt.spans() {
            local_products(span, &self.local[span.panel(rows)], &self.ht[span.panel(n)], by_state);
        }
        self.model.chain(&self.hh, by_state, n, &mut square[..n * n], chain);
        transpose(n, n, &square[..n * n], &mut turned[..n * n]);
        for span in self.tt.spans() {
            // G P, columns of the weights; and L of them, for G (G P)'.
            let (ht, wide) = (&mut self.ht[span.panel(n)], &mut wide[..n * span.padded]);
            let products = &mut self.products[span.panel(all_rows)];
            self.model.chain(ht, products, span.padded, wide, chain);
            let local = &self.local[span.panel(rows)];
            local_products(span, local, wide, by_state);
            for (ht, &wide) in ht.iter_mut().zip(&*wide) {
                *ht = wide * grows;
            }
            // L P_tt becomes that of the covariance after the time update, which the outputs depend on.
            if scale != T::one() {
                products.iter_mut().for_each(|p| *p = *p * scale);
            }
            let own = &mut products[span.row * span.padded..(span.row + rows) * span.padded];
            for (own, local) in own.chunks_exact_mut(span.padded).zip(local.chunks_exact(span.padded)) {
                let noise = &self.weight_noise[span.weights()];
                for ((p, &l), &noise) in own.iter_mut().zip(local).zip(noise) {
                    *p += noise * l;
                }
            }
        }
        self.model.chain(&turned[..n * n], by_state, n, &mut square[..n * n], chain);
        let noise = T::of(self.tuning.state_noise);
        for i in 0..n {
            for j in 0..=i {
                // Both triangles are the same but for rounding; from here on they are the same.
                let p = square[i * n + j];
                self.hh[i * n + j] = p;
                self.hh[j * n + i] = p;
            }
            self.hh[i * (n + 1)] += noise;
        }
    }

    /// Measurement update with the measurements `z` (NaN where there is none) of the outputs after the last step.
    /// Before the first step of a run, and for a second measurement of the same step, nothing is done.
    ///
    /// # Panics
    /// If `z` has not one number for each output.
    pub fn observe(&mut self, z: &[T]) -> Correction {
        if !self.moved || z.iter().all(|z| z.is_nan()) {
            return Correction::None;
        }
        self.moved = false;
        Arch::new().dispatch(Expect { filter: self });
        let deviations = self.gain.take(z, &self.noise);
        let limit = T::of(self.tuning.huber);
        let weight = if deviations > limit { self.gain.soften(limit) } else { T::one() };
        if !self.gain.factor() {
            self.restart();
            self.reset();
            return Correction::Lost;
        }
        Arch::new().dispatch(Correct { filter: self });
        self.pending = self.learns;
        if !self.learns {
            return self.made(deviations, weight);
        }
        for (&place, &change) in self.places.iter().zip(&self.scratch.change) {
            if let Some(place) = place {
                self.weights[place] += change;
            }
        }
        self.model.set_weights(&self.weights);
        self.made(deviations, weight)
    }

    /// What came of a measurement that was used; `R` follows it.
    fn made(&mut self, deviations: T, weight: T) -> Correction {
        if self.tuning.noise_rate > 0.0 {
            self.gain.follow(&mut self.noise, T::of(self.tuning.noise_rate));
        }
        let (deviations, weight) = (deviations.wide(), weight.wide());
        Correction::Made { nis: self.gain.nis().wide(), deviations, weight }
    }

    /// What the outputs are expected to be: `y`, `G' = H P` and `H P H'`, before any measurement.
    #[inline(always)]
    fn expect(&mut self) {
        let (n, q, rows, all_rows) = (self.state.len(), self.noise.len(), self.model.rows(), self.all_rows());
        let rank = Triangle::<T>::rank(q);
        let Scratch { by_state, by_output, turned, narrow, .. } = &mut self.scratch;
        self.model.output(&self.state, &mut self.gain.predicted);
        for span in self.tt.spans() {
            let (local, ht) = (&self.local[span.panel(rows)], &self.ht[span.panel(n)]);
            local_products(span, local, ht, by_state);
            let gain = &mut self.downdate[span.panel(rank)][..q * span.padded];
            self.model.output_chain(ht, &self.products[span.panel(all_rows)], span.padded, gain);
            local_products(span, local, gain, by_output);
        }
        self.model.output_chain(&self.hh, by_state, n, narrow);
        transpose(q, n, narrow, &mut turned[..n * q]);
        self.model.output_chain(&turned[..n * q], by_output, q, &mut self.gain.spread);
    }

    /// `W`, and what it takes from `P_hh` and `P_ht` and adds to state and weights.
    #[inline(always)]
    fn correct(&mut self) {
        let (n, rank, count) =
            (self.state.len(), Triangle::<T>::rank(self.noise.len()), self.gain.measured.len());
        let (w_h, e) = (&mut self.scratch.narrow, &self.gain.whitened[..count]);
        self.gain.whiten(w_h, n);
        add_rows(&mut self.state, &w_h[..count * n], e);
        for span in self.tt.spans() {
            let w_t = &mut self.downdate[span.panel(rank)];
            self.gain.whiten(w_t, span.padded);
            let (w_t, rest) = w_t.split_at_mut(count * span.padded);
            rest.fill(T::zero());
            let change = &mut self.scratch.change[span.panel(1)];
            change.fill(T::zero());
            add_rows(change, w_t, e);
            for (i, ht) in self.ht[span.panel(n)].chunks_exact_mut(span.padded).enumerate() {
                add_minus_column(ht, w_t, w_h, i, n);
            }
        }
        for (i, hh) in self.hh.chunks_exact_mut(n).enumerate() {
            add_minus_column(hh, &w_h[..count * n], w_h, i, n);
        }
    }
}

/// `row -= sum_k w_h[k][i] rows[k]`.
#[inline(always)]
fn add_minus_column<T: Scalar>(row: &mut [T], rows: &[T], w_h: &[T], i: usize, n: usize) {
    for (k, other) in rows.chunks_exact(row.len()).enumerate() {
        let w = w_h[k * n + i];
        for (row, &other) in row.iter_mut().zip(other) {
            *row -= w * other;
        }
    }
}

/// A block's rows of `L M'`, from its panels of both: `M` has as many rows as there are columns of what comes out.
#[inline(always)]
fn local_products<T: Scalar>(span: &Span, local: &[T], matrix: &[T], out: &mut [T]) {
    let count = matrix.len() / span.padded;
    for (row, partials) in local.chunks_exact(span.padded).enumerate() {
        let out = &mut out[(span.row + row) * count..][..count];
        for (out, of) in out.iter_mut().zip(matrix.chunks_exact(span.padded)) {
            *out = dot(partials, of);
        }
    }
}

fn transpose<T: Copy>(rows: usize, columns: usize, matrix: &[T], into: &mut [T]) {
    for i in 0..rows {
        for j in 0..columns {
            into[j * rows + i] = matrix[i * columns + j];
        }
    }
}

/// Parts of a step as what [`Arch`] compiles for the processor.
macro_rules! dispatched {
    ($($name:ident: $method:ident($($argument:ident: $type:ty),*)),*) => {
        $(
            struct $name<'a, T, M> {
                filter: &'a mut Filter<T, M>,
                $($argument: $type),*
            }

            impl<T: Scalar, M: Learnable<T>> WithSimd for $name<'_, T, M> {
                type Output = ();

                #[inline(always)]
                fn with_simd<S: Simd>(self, _: S) {
                    self.filter.$method($(self.$argument),*);
                }
            }
        )*
    };
}

dispatched!(Spread: spread(grows: T), Expect: expect(), Correct: correct());
