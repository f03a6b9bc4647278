//! The extended Kalman filter (EKF) over state and weights: time update and measurement update.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::covariance::JointCovariance;
use super::learnable::Learnable;
use super::measurement::MeasurementUpdate;
use super::options::{FilterOptions, FilterOptionsError};
use crate::adapt::Health;
use crate::memory::Memory;

/// Result of a measurement update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Correction {
    /// No update: there is no measurement, or no step before it.
    None,
    /// State and weights were corrected.
    Applied {
        /// Normalised innovation squared, `e' S^-1 e`.
        nis: f64,
        /// The largest innovation \[standard deviations\].
        deviations: f64,
        /// The smallest weight of an output: below 1 if [`FilterOptions::huber`] limits an innovation.
        weight: f64,
    },
    /// The innovation or its covariance is not finite. The measurement was not used, and the covariance was reset.
    Diverged,
}

/// An extended Kalman filter over the state and the weights of a [`Learnable`] model; equations in the [module](super).
///
/// [`advance`](Self::advance) is the time update, [`observe`](Self::observe) the measurement update. A sample without a
/// measurement is an `advance` alone. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct Filter<M> {
    pub(super) model: M,
    options: FilterOptions,
    /// `h`, all weights, and the initial weights `theta_0`.
    state: Vec<f64>,
    weights: Vec<f64>,
    given: Vec<f64>,
    covariance: JointCovariance,
    stepped: bool,
    learns: bool,
    update: MeasurementUpdate,
    noise_scale: f64,
    /// Scratch over the state, and over the columns of the covariance of the weights.
    by_state: Vec<f64>,
    change: Vec<f64>,
    /// Gradients of functions, with respect to the state, and to the columns of the covariance of the weights.
    gradients: [Vec<f64>; 2],
}

impl<M: Learnable> Filter<M> {
    /// A filter at the start of a run, with the weights of the model.
    ///
    /// # Errors
    /// If the options are out of range or do not fit the model.
    pub fn new(model: M, options: FilterOptions) -> Result<Self, FilterOptionsError> {
        let (n, outputs) = (model.state_len(), model.outputs());
        options.check(model.weights().len(), outputs)?;
        let learned: Vec<usize> = (0..model.blocks().len())
            .filter(|&b| model.blocks()[b].iter().any(|&weight| options.learns(weight)))
            .collect();
        if learned.is_empty() && options.initial_state == 0.0 && options.state_noise == 0.0 {
            return Err(FilterOptionsError::Nothing);
        }
        let covariance = JointCovariance::new(&model, &options, learned);
        let weights = model.weights().to_vec();
        let mut filter = Self {
            state: vec![0.0; n],
            given: weights.clone(),
            weights,
            stepped: false,
            learns: true,
            update: MeasurementUpdate::new(outputs),
            noise_scale: 1.0,
            by_state: vec![0.0; n],
            change: vec![0.0; covariance.places().len()],
            gradients: [Vec::new(), Vec::new()],
            covariance,
            model,
            options,
        };
        filter.restart();
        filter.reset();
        Ok(filter)
    }

    /// Resets the covariance of the weights to its initial value. The weights stay.
    pub fn restart(&mut self) {
        for (initial, place) in self.change.iter_mut().zip(self.covariance.places()) {
            *initial = place.map_or(0.0, |place| self.options.initial_weights[place]);
        }
        self.covariance.restart(&self.change);
    }

    /// Starts a run: the state is zero, with its initial variance. Weights and their covariance stay.
    pub fn reset(&mut self) {
        self.state.fill(0.0);
        self.by_state.fill(self.options.initial_state);
        self.covariance.reset(&self.by_state);
        self.stepped = false;
    }

    /// Starts a run of a model whose state begins with its outputs, from their measurement. Their variance is `R`, that
    /// of the rest of the state the initial one.
    pub(super) fn begin(&mut self, state: impl IntoIterator<Item = f64>) {
        self.state.iter_mut().zip(state).for_each(|(into, h)| *into = h);
        self.by_state.fill(self.options.initial_state);
        self.by_state[..self.options.noise.len()].copy_from_slice(&self.options.noise);
        self.covariance.reset(&self.by_state);
        self.stepped = false;
    }

    /// Sets the active state and its variances. Its correlations become zero.
    pub(super) fn begin_active(&mut self, state: &[f64], variance: f64) {
        let active = self.model.active_state();
        self.state[active.clone()].copy_from_slice(state);
        self.covariance.reset_part(active, variance);
        self.stepped = false;
    }

    pub(super) fn replace_noise_scale(&mut self, factor: f64) -> f64 {
        core::mem::replace(&mut self.noise_scale, factor)
    }

    pub(super) fn state_noise(&self) -> f64 {
        self.options.state_noise
    }

    /// Whether measurements change the weights (initially true). If not, they correct the state with the covariance of
    /// the weights unchanged (Schmidt-Kalman or "consider" filter).
    pub fn learn(&mut self, learns: bool) {
        self.learns = learns;
    }

    /// Whether measurements change the weights.
    pub fn learns(&self) -> bool {
        self.learns
    }

    /// Multiplies the noise variance of the next measurement.
    pub fn scale_noise(&mut self, factor: f64) {
        self.noise_scale = factor;
    }

    /// Indicators of the covariance and of the last measurement.
    pub fn health(&self) -> Health {
        Health { least_variance: self.covariance.least_variance(), min_s_over_r: self.update.min_s_over_r() }
    }

    /// Sets `h` and `theta`. The covariance stays; the next measurement requires a step before it.
    pub fn set(&mut self, state: impl IntoIterator<Item = f64>, weights: impl IntoIterator<Item = f64>) {
        self.state.iter_mut().zip(state).for_each(|(into, h)| *into = h);
        self.weights.iter_mut().zip(weights).for_each(|(into, w)| *into = w);
        self.set_model_weights();
        self.stepped = false;
    }

    fn set_model_weights(&mut self) {
        self.model.project(&mut self.weights);
        self.model.set_weights(&self.weights);
    }

    /// Whether a step was made since the last measurement.
    pub fn has_stepped(&self) -> bool {
        self.stepped
    }

    /// Whether the weights change without measurements.
    pub fn leaks(&self) -> bool {
        self.options.leak > 0.0
    }

    /// The options for known weights: neither initial variance nor noise.
    pub(super) fn without_weight_uncertainty(&self) -> FilterOptions {
        let weights = vec![0.0; self.weights.len()];
        FilterOptions { initial_weights: weights.clone(), weight_noise: weights, ..self.options.clone() }
    }

    /// The model, with the current weights.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// The state `h`.
    pub fn state(&self) -> &[f64] {
        &self.state
    }

    /// All current weights `theta`, learned or not.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// `R` of each output.
    pub fn noise(&self) -> &[f64] {
        &self.options.noise
    }

    /// Innovations `z - y` of the last measurement (NaN if missing), and the diagonal of `S`.
    pub fn innovation(&self) -> (&[f64], &[f64]) {
        (&self.update.innovation, &self.update.variance)
    }

    /// `H P H' = S - R` of all outputs before the last measurement, row by row.
    pub fn prior_output_covariance(&self) -> &[f64] {
        &self.update.covariance
    }

    /// The diagonals of `P_hh` and of `P_tt` after the last measurement, the latter in the order of the weights with
    /// zeros for weights that are not learned.
    pub fn variances(&self) -> (Vec<f64>, Vec<f64>) {
        let (of_state, padded) = self.covariance.variances();
        let mut of_weights = vec![0.0; self.weights.len()];
        for (&place, &p) in self.covariance.places().iter().zip(&padded) {
            if let Some(place) = place {
                of_weights[place] = p;
            }
        }
        (of_state, of_weights)
    }

    /// Sets the gradients of `count` linear functions of state and weights, from the function `first` on. They are the
    /// columns of `by_state` (`state x count`, without rows of trailing states of zero gradient) and of `by_weights`
    /// (`weights x count`). Allocates for more functions than ever before.
    pub(super) fn set_gradients(&mut self, first: usize, count: usize, by_state: &[f64], by_weights: &[f64]) {
        let (n, places) = (self.state.len(), self.covariance.places());
        let [v_h, v_t] = &mut self.gradients;
        v_h.resize(v_h.len().max((first + count) * n), 0.0);
        v_t.resize(v_t.len().max((first + count) * places.len()), 0.0);
        for r in 0..count {
            let (v_h, v_t) = (&mut v_h[(first + r) * n..][..n], &mut v_t[(first + r) * places.len()..]);
            v_h.fill(0.0);
            v_h.iter_mut().zip(by_state.chunks_exact(count)).for_each(|(v, row)| *v = row[r]);
            for (v, &place) in v_t.iter_mut().zip(places) {
                *v = place.map_or(0.0, |place| by_weights[place * count + r]);
            }
        }
    }

    /// Adds the variances of the first functions of [`set_gradients`](Self::set_gradients), after the last measurement.
    pub(super) fn add_variances(&mut self, out: &mut [f64]) {
        let [v_h, v_t] = &self.gradients;
        self.covariance.add_variances(v_h, v_t, out);
    }

    /// Number of stored numbers of the covariance; it depends on [`FilterOptions::covariance`].
    pub fn covariance_len(&self) -> usize {
        self.covariance.len()
    }

    /// Time update: `h <- f(h, x)`, `theta <- theta_0 + (1 - leak) (theta - theta_0)`.
    ///
    /// # Panics
    /// If `x` is shorter than the input of the model.
    pub fn advance(&mut self, x: &[f64]) {
        self.model.step(&mut self.state, x);
        let (leak, forgetting) =
            if self.learns { (self.options.leak, self.options.forgetting) } else { (0.0, 1.0) };
        let keeps = 1.0 - leak;
        let growth = keeps / Float::sqrt(forgetting);
        self.covariance.advance(&self.model, growth, self.options.state_noise);
        if leak > 0.0 {
            for (weight, &given) in self.weights.iter_mut().zip(&self.given) {
                *weight = given + keeps * (*weight - given);
            }
            self.set_model_weights();
        }
        self.stepped = true;
    }

    /// Measurement update with the outputs `z` after the last step (NaN if missing). No effect before the first step of
    /// a run, and for a second measurement of one step.
    ///
    /// # Panics
    /// If `z` has not one number for each output.
    pub fn observe(&mut self, z: &[f64]) -> Correction {
        // The factor belongs to this measurement, even if it is not used.
        let noise_scale = core::mem::replace(&mut self.noise_scale, 1.0);
        if !self.stepped || z.iter().all(|z| z.is_nan()) {
            return Correction::None;
        }
        self.stepped = false;
        self.model.output(&self.state, &mut self.update.predicted);
        self.covariance.predict_output(&self.model, &mut self.update);
        let deviations = self.update.set(z, &self.options.noise);
        self.update.scale_noise(noise_scale);
        let limit = self.options.huber;
        let weight = if deviations > limit { self.update.downweight(limit) } else { 1.0 };
        let Self { state, covariance, update, change, .. } = self;
        if !update.factor() || !covariance.correct(update, state, change, self.learns) {
            self.restart();
            self.reset();
            return Correction::Diverged;
        }
        if self.learns {
            for (&place, &change) in self.covariance.places().iter().zip(&self.change) {
                if let Some(place) = place {
                    self.weights[place] += change;
                }
            }
            self.set_model_weights();
        }
        Correction::Applied { nis: self.update.nis(), deviations, weight }
    }

    /// Visits all numbers that the filter continues from. After loading those of a filter of the same model and options,
    /// both continue identically to the last bit.
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.flag(self.covariance.pending().unwrap_or(&mut false));
        memory.flag(&mut self.stepped);
        memory.flag(&mut self.learns);
        memory.number(&mut self.noise_scale);
        memory.numbers(&mut self.state);
        memory.numbers(&mut self.weights);
        self.covariance.parts().into_iter().for_each(|numbers| memory.numbers(numbers));
        if memory.is_loading() {
            self.set_model_weights();
        }
    }

    /// Whether state and weights are finite, and the variances finite and not negative.
    pub fn is_sound(&self) -> bool {
        let finite = self.state.iter().chain(&self.weights).all(|x| x.is_finite());
        // NaN if a variance is.
        finite && self.covariance.least_variance() >= 0.0
    }
}
