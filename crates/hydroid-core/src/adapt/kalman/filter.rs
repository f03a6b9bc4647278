//! The extended Kalman filter over state and weights.

use alloc::vec;
use alloc::vec::Vec;

use super::gain::Gain;
use super::joint::Joint;
use super::learnable::Learnable;
use super::tuning::{Tuning, TuningError};
use crate::adapt::Health;
use crate::math::Scalar;

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
/// What it keeps of the covariance, and so how its time and memory grow with the number of weights, is
/// [`Tuning::memory`].
#[derive(Clone, Debug)]
pub struct Filter<T, M> {
    pub(super) model: M,
    tuning: Tuning,
    /// `h`, all weights, and those that were given.
    pub(super) state: Vec<T>,
    pub(super) weights: Vec<T>,
    given: Vec<T>,
    /// `R`, which may move.
    pub(super) noise: Vec<T>,
    pub(super) joint: Joint<T>,
    /// Whether a step was made since the last measurement.
    pub(super) moved: bool,
    /// Whether measurements change the weights.
    pub(super) learns: bool,
    gain: Gain<T>,
    /// What the noise of the next measurement is multiplied by.
    inflation: T,
    /// A vector of state and weights, the latter in the order of the covariance's columns: how they change.
    by_state: Vec<T>,
    change: Vec<T>,
}

impl<T: Scalar, M: Learnable<T>> Filter<T, M> {
    /// A filter at the start of a run, with the weights that the model has.
    ///
    /// # Errors
    /// If the tuning makes no sense or does not fit the model.
    pub fn new(model: M, tuning: Tuning) -> Result<Self, TuningError> {
        let (n, outputs) = (model.state_len(), model.outputs());
        tuning.check(model.weights().len(), outputs)?;
        let learned: Vec<usize> = (0..model.blocks().len())
            .filter(|&b| model.blocks()[b].iter().any(|&weight| tuning.learns(weight)))
            .collect();
        if learned.is_empty() && tuning.initial_state == 0.0 && tuning.state_noise == 0.0 {
            return Err(TuningError::Nothing);
        }
        let joint = Joint::new(&model, &tuning, learned);
        let weights = model.weights().to_vec();
        let mut filter = Self {
            state: vec![T::zero(); n],
            given: weights.clone(),
            weights,
            noise: vec![T::zero(); outputs],
            moved: false,
            learns: true,
            gain: Gain::new(outputs),
            inflation: T::one(),
            by_state: vec![T::zero(); n],
            change: vec![T::zero(); joint.places().len()],
            joint,
            model,
            tuning,
        };
        filter.restart();
        filter.reset();
        Ok(filter)
    }

    /// Forgets how sure it is of the weights: their covariance is as at the start. The weights stay.
    pub fn restart(&mut self) {
        for (initial, place) in self.change.iter_mut().zip(self.joint.places()) {
            *initial = T::of(place.map_or(0.0, |place| self.tuning.initial_weights[place]));
        }
        self.joint.restart(&self.change);
        for (noise, &given) in self.noise.iter_mut().zip(&self.tuning.noise) {
            *noise = T::of(given);
        }
    }

    /// Back to the start of a run: the state is zero, as uncertain as at first. What was learned stays.
    pub fn reset(&mut self) {
        self.state.fill(T::zero());
        self.by_state.fill(T::of(self.tuning.initial_state));
        self.joint.reset(&self.by_state);
        self.moved = false;
    }

    /// The start of a run, of a model whose state begins with its outputs: these were measured; what is behind them is as
    /// uncertain as at first. What was learned stays.
    pub(super) fn begin(&mut self, state: impl IntoIterator<Item = T>) {
        self.state.iter_mut().zip(state).for_each(|(into, h)| *into = h);
        self.by_state.fill(T::of(self.tuning.initial_state));
        self.by_state[..self.noise.len()].copy_from_slice(&self.noise);
        self.joint.reset(&self.by_state);
        self.moved = false;
    }

    /// The part of the state that moves is this from now on, each number as uncertain as `variance` says and independent of
    /// all else.
    pub(super) fn begin_part(&mut self, state: &[T], variance: T) {
        let part = self.model.moving();
        self.state[part.clone()].copy_from_slice(state);
        self.joint.reset_part(part, variance);
        self.moved = false;
    }

    /// [`inflate`](Self::inflate), and what it was.
    pub(super) fn replace_inflation(&mut self, factor: T) -> T {
        core::mem::replace(&mut self.inflation, factor)
    }

    /// `Q_h`.
    pub(super) fn state_noise(&self) -> f64 {
        self.tuning.state_noise
    }

    /// Whether measurements change the weights, as they do at first. Otherwise they correct the state alone, the
    /// uncertainty of the weights being what it is (the Schmidt-Kalman filter, which considers it).
    pub fn learn(&mut self, learns: bool) {
        self.learns = learns;
    }

    /// Whether they do.
    pub fn learns(&self) -> bool {
        self.learns
    }

    /// The next measurement has so many times the variance of the noise.
    pub fn inflate(&mut self, factor: T) {
        self.inflation = factor;
    }

    /// What the covariance and the last measurement tell.
    pub fn health(&self) -> Health {
        Health { least_variance: self.joint.least_variance().wide(), sureness: self.gain.sureness().wide() }
    }

    /// `h` and `theta` become these; how uncertain they are stays. The step before is none that a measurement belongs to.
    pub fn set(&mut self, state: impl IntoIterator<Item = T>, weights: impl IntoIterator<Item = T>) {
        self.state.iter_mut().zip(state).for_each(|(into, h)| *into = h);
        self.weights.iter_mut().zip(weights).for_each(|(into, w)| *into = w);
        self.model.admit(&mut self.weights);
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

    /// Its tuning, with weights that are known.
    pub(super) fn known(&self) -> Tuning {
        let weights = vec![0.0; self.weights.len()];
        Tuning { initial_weights: weights.clone(), weight_noise: weights, ..self.tuning.clone() }
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
        let (of_state, padded) = self.joint.variances();
        let mut of_weights = vec![T::zero(); self.weights.len()];
        for (&place, &p) in self.joint.places().iter().zip(&padded) {
            if let Some(place) = place {
                of_weights[place] = p;
            }
        }
        (of_state, of_weights)
    }

    /// Adds to `out` the variances of linear functions of state and weights, after the last measurement. `by_state` and
    /// `by_weights` have their gradients as columns: `state x functions`, `weights x functions`; what the state has beyond
    /// its gradients' rows does not count.
    pub(super) fn add_variances(&mut self, by_state: &[f64], by_weights: &[f64], out: &mut [f64]) {
        let (count, v_h, v_t) = (out.len(), &mut self.by_state, &mut self.change);
        for (r, out) in out.iter_mut().enumerate() {
            v_h.fill(T::zero());
            let rows = by_state.chunks_exact(count);
            v_h.iter_mut().zip(rows).for_each(|(v, row)| *v = T::of(row[r]));
            for (v, &place) in v_t.iter_mut().zip(self.joint.places()) {
                *v = place.map_or(T::zero(), |place| T::of(by_weights[place * count + r]));
            }
            *out += self.joint.variance(v_h, v_t).wide();
        }
    }

    /// Numbers that it keeps of the covariance of state and weights: what [`Tuning::memory`] chooses.
    pub fn covariance_len(&self) -> usize {
        self.joint.len()
    }

    /// Time update: `h <- f(h, x)`, `theta <- theta_0 + (1 - leak) (theta - theta_0)`.
    ///
    /// # Panics
    /// If `x` is shorter than the model's input.
    pub fn advance(&mut self, x: &[T]) {
        self.model.step(&mut self.state, x);
        // Weights that do not learn stay where they are, and nothing of them is forgotten.
        let (leak, forgetting) =
            if self.learns { (self.tuning.leak, self.tuning.forgetting) } else { (0.0, 1.0) };
        let keeps = T::of(1.0 - leak);
        let grows = keeps / T::of(forgetting).sqrt();
        self.joint.advance(&self.model, grows, T::of(self.tuning.state_noise));
        if leak > 0.0 {
            for (weight, &given) in self.weights.iter_mut().zip(&self.given) {
                *weight = given + keeps * (*weight - given);
            }
            self.model.admit(&mut self.weights);
            self.model.set_weights(&self.weights);
        }
        self.moved = true;
    }

    /// Measurement update with the measurements `z` (NaN where there is none) of the outputs after the last step.
    /// Before the first step of a run, and for a second measurement of the same step, nothing is done.
    ///
    /// # Panics
    /// If `z` has not one number for each output.
    pub fn observe(&mut self, z: &[T]) -> Correction {
        // Of this measurement, whether it is used or not.
        let inflation = core::mem::replace(&mut self.inflation, T::one());
        if !self.moved || z.iter().all(|z| z.is_nan()) {
            return Correction::None;
        }
        self.moved = false;
        self.model.output(&self.state, &mut self.gain.predicted);
        self.joint.expect(&self.model, &mut self.gain);
        let deviations = self.gain.take(z, &self.noise);
        self.gain.inflate(inflation);
        let limit = T::of(self.tuning.huber);
        let weight = if deviations > limit { self.gain.soften(limit) } else { T::one() };
        let Self { state, joint, gain, change, .. } = self;
        if !gain.factor() || !joint.correct(gain, state, change, self.learns) {
            self.restart();
            self.reset();
            return Correction::Lost;
        }
        if !self.learns {
            return self.made(deviations, weight);
        }
        for (&place, &change) in self.joint.places().iter().zip(&self.change) {
            if let Some(place) = place {
                self.weights[place] += change;
            }
        }
        self.model.admit(&mut self.weights);
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
}
