//! The extended Kalman filter over state and weights.

use alloc::vec;
use alloc::vec::Vec;

use pulp::{Arch, Simd, WithSimd};

use super::gain::Gain;
use super::learnable::Learnable;
use super::triangle::{Pass, Triangle};
use super::tuning::{Tuning, TuningError};
use crate::math::Scalar;
use crate::math::rows::add_rows;

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
    model: M,
    tuning: Tuning,
    /// `h`, all weights, and those that were given.
    state: Vec<T>,
    weights: Vec<T>,
    given: Vec<T>,
    /// `R`, which may move.
    noise: Vec<T>,
    /// `P_hh` (`n x n`), `P_ht` (`n x width`), `P_tt`.
    hh: Vec<T>,
    ht: Vec<T>,
    tt: Triangle<T>,
    /// Which block each block of the triangle is.
    learned: Vec<usize>,
    /// Of each padded weight: where it stands among the weights. Padding stands nowhere.
    places: Vec<Option<usize>>,
    weight_noise: Vec<T>,
    /// What the last measurement takes from `P_tt`, `rank x width`; whether there is something to take.
    downdate: Vec<T>,
    pending: bool,
    /// `L`, by local row (`rows x width`), and `L P_tt` (`blocks rows x width`).
    local: Vec<T>,
    products: Vec<T>,
    /// Whether a step was made since the last measurement.
    moved: bool,
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
    /// `n x width`.
    wide: Vec<T>,
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
        for (columns, &b) in tt.columns().zip(&learned) {
            for (column, &place) in columns.zip(&model.blocks()[b]) {
                places[column] = Some(place);
            }
        }
        let weight_noise = places.iter().map(|p| T::of(p.map_or(0.0, |p| tuning.weight_noise[p]))).collect();
        let (all_rows, side) = (model.blocks().len() * rows, n.max(outputs));
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
            gain: Gain::new(outputs),
            scratch: Scratch {
                by_state: vec![T::zero(); all_rows * n],
                by_output: vec![T::zero(); all_rows * outputs],
                square: vec![T::zero(); n * side],
                turned: vec![T::zero(); n * side],
                wide: vec![T::zero(); n * width],
                narrow: vec![T::zero(); outputs * n],
                chain: vec![T::zero(); model.scratch(width.max(side))],
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

    /// What was expected of the last measurement that [`observe`](Self::observe) was given: innovations `z - y`, NaN where
    /// nothing was measured, and the diagonal of `S`.
    pub fn innovation(&self) -> (&[T], &[T]) {
        (&self.gain.innovation, &self.gain.variance)
    }

    /// The diagonals of `P_hh` and `P_tt` (in the order of the weights; zero for those that are not learned), after the last
    /// measurement.
    pub fn variances(&self) -> (Vec<T>, Vec<T>) {
        let (n, width) = (self.state.len(), self.tt.width());
        let mut padded = vec![T::zero(); width];
        self.tt.clone().diagonal(&mut padded);
        if self.pending {
            for w in self.downdate.chunks_exact(width) {
                padded.iter_mut().zip(w).for_each(|(p, &w)| *p -= w * w);
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

    /// Time update: `h <- f(h, x)`, `theta <- theta_0 + (1 - leak) (theta - theta_0)`.
    ///
    /// # Panics
    /// If `x` is shorter than the model's input.
    pub fn advance(&mut self, x: &[T]) {
        self.model.step(&mut self.state, x);
        self.linearize();
        let keeps = T::of(1.0 - self.tuning.leak);
        let grows = keeps / T::of(self.tuning.forgetting).sqrt();
        let mut pass = Pass {
            downdate: if self.pending { &self.downdate } else { &[] },
            scale: grows * grows,
            noise: &self.weight_noise,
            local: &self.local,
            rows: self.model.rows(),
            products: &mut self.products,
        };
        self.tt.pass(&mut pass);
        self.pending = false;
        self.spread(grows);
        if self.tuning.leak > 0.0 {
            for (weight, &given) in self.weights.iter_mut().zip(&self.given) {
                *weight = given + keeps * (*weight - given);
            }
            self.model.set_weights(&self.weights);
        }
        self.moved = true;
    }

    /// `L` of the step that was just made.
    fn linearize(&mut self) {
        let width = self.tt.width();
        for (columns, &block) in self.tt.columns().zip(&self.learned) {
            for (row, all) in self.local.chunks_exact_mut(width).enumerate() {
                self.model.local(block, row, &mut all[columns.clone()]);
            }
        }
    }

    /// `P_hh` and `P_ht` of the time update, from `L P_tt`; with `G = [A B]`, `[P_hh P_ht]+ = G P G', G P`.
    fn spread(&mut self, grows: T) {
        let (n, width) = (self.state.len(), self.tt.width());
        let blocks = (self.learned.as_slice(), self.model.rows());
        let Scratch { by_state, square, turned, wide, chain, .. } = &mut self.scratch;
        // G P, columns of the state: A P_hh + B P_th, B P_th = C (L P_th).
        local_products(&self.local, &self.ht, self.tt.columns(), blocks, width, by_state);
        self.model.chain(&self.hh, by_state, n, &mut square[..n * n], chain);
        // G P, columns of the weights.
        self.model.chain(&self.ht, &self.products, width, wide, chain);
        // G (G P)'.
        transpose(n, n, &square[..n * n], &mut turned[..n * n]);
        local_products(&self.local, wide, self.tt.columns(), blocks, width, by_state);
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
        for (ht, &wide) in self.ht.iter_mut().zip(&*wide) {
            *ht = wide * grows;
        }
        self.after_time_update(grows * grows);
    }

    /// `L P_tt` becomes that of the covariance after the time update, for the blocks that the outputs depend on.
    fn after_time_update(&mut self, scale: T) {
        let (width, rows) = (self.tt.width(), self.model.rows());
        for (columns, &block) in self.tt.columns().zip(&self.learned) {
            for row in 0..rows {
                let products = &mut self.products[(block * rows + row) * width..][..width];
                if scale != T::one() {
                    products.iter_mut().for_each(|p| *p = *p * scale);
                }
                for column in columns.clone() {
                    products[column] += self.weight_noise[column] * self.local[row * width + column];
                }
            }
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
        let (n, width) = (self.state.len(), self.tt.width());
        self.expect();
        let deviations = self.gain.take(z, &self.noise);
        let limit = T::of(self.tuning.huber);
        let weight = if deviations > limit { self.gain.soften(limit) } else { T::one() };
        if !self.gain.factor() {
            self.restart();
            self.reset();
            return Correction::Lost;
        }
        self.gain.whiten(&mut self.scratch.narrow, n);
        self.gain.whiten(&mut self.downdate, width);
        let count = self.gain.measured.len();
        self.downdate[count * width..].fill(T::zero());
        self.pending = true;
        let w_h = &self.scratch.narrow[..count * n];
        let w_t = &self.downdate[..count * width];
        Arch::new().dispatch(Downdate { n, width, w_h, w_t, hh: &mut self.hh, ht: &mut self.ht });
        for (k, &e) in self.gain.whitened[..count].iter().enumerate() {
            for (h, &w) in self.state.iter_mut().zip(&w_h[k * n..]) {
                *h += w * e;
            }
            for (&place, &w) in self.places.iter().zip(&w_t[k * width..]) {
                if let Some(place) = place {
                    self.weights[place] += w * e;
                }
            }
        }
        self.model.set_weights(&self.weights);
        if self.tuning.noise_rate > 0.0 {
            self.gain.follow(&mut self.noise, T::of(self.tuning.noise_rate));
        }
        Correction::Made {
            nis: self.gain.nis().wide(),
            deviations: deviations.wide(),
            weight: weight.wide(),
        }
    }

    /// What the outputs are expected to be: `y`, `G' = H P` and `H P H'`, before any measurement.
    fn expect(&mut self) {
        let (n, q, width) = (self.state.len(), self.gain.predicted.len(), self.tt.width());
        let blocks = (self.learned.as_slice(), self.model.rows());
        let Scratch { by_state, by_output, turned, narrow, .. } = &mut self.scratch;
        self.model.output(&self.state, &mut self.gain.predicted);
        local_products(&self.local, &self.ht, self.tt.columns(), blocks, width, by_state);
        self.model.output_chain(&self.hh, by_state, n, narrow);
        let gain = &mut self.downdate[..q * width];
        self.model.output_chain(&self.ht, &self.products, width, gain);
        transpose(q, n, narrow, &mut turned[..n * q]);
        local_products(&self.local, gain, self.tt.columns(), blocks, width, by_output);
        self.model.output_chain(&turned[..n * q], by_output, q, &mut self.gain.spread);
    }
}

/// `L M'`, where `M` is `count x width` and what comes out `blocks rows x count`.
fn local_products<T: Scalar>(
    local: &[T],
    matrix: &[T],
    columns: impl Iterator<Item = core::ops::Range<usize>>,
    (learned, rows): (&[usize], usize),
    width: usize,
    out: &mut [T],
) {
    let count = matrix.len() / width.max(1);
    for (columns, &block) in columns.zip(learned) {
        for row in 0..rows {
            let partials = &local[row * width..][columns.clone()];
            for j in 0..count {
                let of = &matrix[j * width..][columns.clone()];
                out[(block * rows + row) * count + j] = dot(partials, of);
            }
        }
    }
}

/// Eight sums side by side, or each addition would wait for the last.
fn dot<T: Scalar>(a: &[T], b: &[T]) -> T {
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

fn transpose<T: Copy>(rows: usize, columns: usize, matrix: &[T], into: &mut [T]) {
    for i in 0..rows {
        for j in 0..columns {
            into[j * rows + i] = matrix[i * columns + j];
        }
    }
}

/// `P_hh -= W_h W_h'`, `P_ht -= W_h W_t'`, as what [`Arch`] compiles for the processor.
struct Downdate<'a, T> {
    n: usize,
    width: usize,
    w_h: &'a [T],
    w_t: &'a [T],
    hh: &'a mut [T],
    ht: &'a mut [T],
}

impl<T: Scalar> WithSimd for Downdate<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { n, width, w_h, w_t, hh, ht } = self;
        let count = w_h.len() / n.max(1);
        for i in 0..n {
            for k in 0..count {
                let minus = [-w_h[k * n + i]];
                add_rows(&mut hh[i * n..(i + 1) * n], &w_h[k * n..(k + 1) * n], &minus);
                add_rows(&mut ht[i * width..(i + 1) * width], &w_t[k * width..(k + 1) * width], &minus);
            }
        }
    }
}
