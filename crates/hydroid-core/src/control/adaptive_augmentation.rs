//! Adaptive augmentation of feedback linearization: a recurrent network learns the model error online.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::affine::Affine;
use super::error::{ControlError, positive};
use super::feedback_linearization::FeedbackLinearization;
use super::lookahead_point::shortened;
use super::status::Status;
use super::{Controller, Estimate};
use crate::adapt::kalman::{Filter, FilterOptions, Learnable, LearnableNetwork};
use crate::guidance::Reference;
use crate::memory::Memory;
use crate::model::recurrent::{Cell, Network, Packed};

/// Inputs of the network: scaled `u, v, r`, and cosine and sine of the heading, for disturbances in the earth frame.
const INPUTS: usize = 5;

const EVIDENCE_DECAY: f64 = 0.95;

/// Evidence, in squares of the noise, above which the correction is applied; a fit to noise alone stays below it.
const EVIDENCE: f64 = 4.0;

/// Options of [`AdaptiveAugmentation`]. The defaults suit a boat of a few metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveAugmentationOptions {
    /// Number of hidden units.
    pub hidden: usize,
    /// Window of a measured acceleration \[s\]. The network learns and the correction changes once a window.
    pub window_s: f64,
    /// Typical size of the model error \[m/s^2\].
    pub scale: f64,
    /// Largest correction \[m/s^2\].
    pub most: f64,
    /// Noise of an acceleration measured over a window \[m/s^2\].
    pub noise: f64,
    /// Forgetting time of the weights \[s\].
    pub memory_s: f64,
    /// Typical surge, sway \[m/s\] and yaw rate \[rad/s\]: scales of the input of the network.
    pub nu: [f64; 3],
}

impl Default for AdaptiveAugmentationOptions {
    fn default() -> Self {
        Self {
            hidden: 6,
            window_s: 1.0,
            scale: 0.3,
            most: 0.6,
            noise: 0.05,
            memory_s: 120.0,
            nu: [3.0, 0.3, 0.2],
        }
    }
}

/// [`FeedbackLinearization`] with an adaptive correction of the model error by a recurrent network.
///
/// # Law
///
/// The base law commands an acceleration `w` of the lookahead point. With a model error `b` the tracking error obeys
///
/// ```text
/// d2e/dt2 + k_d de/dt + k_p e = -b,     b = d2p/dt2 - (acceleration predicted by the model)
/// ```
///
/// A recurrent network (`tanh`, linear output layer) estimates `b^` in the body frame, and the base law commands
/// `w - b^`. The mean of `b` over windows of `window_s` is measured, and an extended Kalman filter ([`Filter`])
/// corrects state and weights:
///
/// ```text
/// h   = tanh(W x + U h + c),   b^ = scale (V h + d),     x = [u v r cos psi sin psi], scaled
/// [h; theta] <- [h; theta] + K (R(psi)' b / scale - b^ / scale)
/// ```
///
/// The output layer starts at zero, so that the law starts as its base. The model predicts the effect of the command:
/// `b` does not depend on `b^`, and learning cannot excite itself.
///
/// Sources: A. J. Calise, N. Hovakimyan and M. Idan, *Adaptive output feedback control of nonlinear systems using
/// neural networks*, Automatica 37, 2001; F. L. Lewis, S. Jagannathan and A. Yesildirek, *Neural Network Control of
/// Robot Manipulators and Nonlinear Systems*, 1999; the filter: [`kalman`](crate::adapt::kalman).
///
/// # Supervision
///
/// Each window is predicted before the network learns from it. The correction is applied while the evidence
/// `sum |b|^2 - |b - b^|^2`, with a memory of about 20 windows, exceeds the noise; learning always continues. The norm
/// of the correction is at most `most`. It cannot extend the limits of the vessel or restore a lost reference.
///
/// # Tuning
///
/// `noise` is the noise of the velocity of the point times `sqrt(2) / window_s`; a longer window reduces the noise and
/// delays the correction. `scale` is the prior standard deviation of accelerations due to a wrong mass, a current or a
/// fouled hull. Changes within a window are not learned.
#[derive(Clone, Debug)]
pub struct AdaptiveAugmentation<M> {
    base: FeedbackLinearization<M>,
    options: AdaptiveAugmentationOptions,
    filter: Filter<LearnableNetwork>,
    first: Vec<f64>,
    samples: usize,
    window: Window,
    /// Estimate `b^` of the next window, body frame \[m/s^2\].
    predicted: [f64; 2],
    evidence: f64,
    x: Vec<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Window {
    samples: usize,
    begin: [f64; 2],
    modelled: [f64; 2],
    heading: [f64; 2],
}

impl<M: Affine> AdaptiveAugmentation<M> {
    /// Around a base; `seed` determines the initial weights of the network.
    ///
    /// # Errors
    /// If an option is out of range.
    pub fn new(
        base: FeedbackLinearization<M>,
        options: AdaptiveAugmentationOptions,
        seed: u64,
    ) -> Result<Self, ControlError> {
        let AdaptiveAugmentationOptions { hidden, window_s, scale, most, noise, memory_s, nu } = options;
        for (what, value) in [
            ("the window", window_s),
            ("the size of the model error", scale),
            ("the largest correction", most),
            ("the noise of a window", noise),
            ("the memory", memory_s),
            ("the size of surge", nu[0]),
            ("the size of sway", nu[1]),
            ("the size of the yaw rate", nu[2]),
        ] {
            positive(what, value)?;
        }
        let needed = "1 to 64 are needed";
        let setting =
            |value: f64| ControlError::Setting { what: "the number of hidden units", value, needed };
        if !(1..=64).contains(&hidden) {
            return Err(setting(hidden as f64));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and it saturates"
        )]
        let samples = (Float::round(window_s / base.dt()) as usize).max(1);
        let cell = Cell::Vanilla { hidden, layers: 1 };
        let network = Network { cell, inputs: INPUTS, outputs: 2, read_out: true };
        let weights = first_weights(&network, seed);
        // The output layer has the prior of the model error; the other layers stay close to their initial values.
        let read_out = weights.len() - 2 * (hidden + 1);
        let mut tuning =
            FilterOptions::uniform(weights.len(), 0.0, 0.0, (0.01, 1e-4), &[(noise / scale).powi(2); 2]);
        let forgotten = (window_s / memory_s).min(1.0);
        for (k, (initial, walk)) in
            tuning.initial_weights.iter_mut().zip(&mut tuning.weight_noise).enumerate()
        {
            *initial = if k < read_out { 0.05 } else { 1.0 };
            *walk = *initial * forgotten * forgotten;
        }
        tuning.huber = 3.0;
        let filter = Filter::new(LearnableNetwork::new(Packed::new(network, &weights)), tuning)
            .map_err(|_| setting(hidden as f64))?;
        Ok(Self {
            base,
            options,
            filter,
            first: weights,
            samples,
            window: Window::default(),
            predicted: [0.0; 2],
            evidence: 0.0,
            x: vec![0.0; INPUTS],
        })
    }

    /// The base law.
    pub const fn base(&self) -> &FeedbackLinearization<M> {
        &self.base
    }

    /// Changes the model of the base law; see [`FeedbackLinearization::update`].
    ///
    /// # Errors
    /// If a channel is not invertible any more. Model and law stay as they were.
    pub fn update(&mut self, change: impl FnOnce(&mut M)) -> Result<(), ControlError>
    where
        M: Clone,
    {
        self.base.update(change)
    }

    /// Whether the correction is applied.
    pub fn is_used(&self) -> bool {
        self.evidence > EVIDENCE * self.options.noise * self.options.noise
    }

    /// The present correction, applied or not, forward and to starboard \[m/s^2\].
    pub const fn correction(&self) -> [f64; 2] {
        self.predicted
    }

    fn learn(&mut self, nu: [f64; 3], velocity: [f64; 2]) {
        let Window { samples, begin, modelled, heading } = self.window;
        let count = samples as f64;
        let span = count * self.base.dt();
        let missed: [f64; 2] =
            core::array::from_fn(|i| (velocity[i] - begin[i]) / span - modelled[i] / count);
        let length = Float::hypot(heading[0], heading[1]);
        let (cos, sin) = (heading[0] / length, heading[1] / length);
        let missed = [missed[0] * cos + missed[1] * sin, missed[1] * cos - missed[0] * sin];
        let square = |[a, b]: [f64; 2]| a * a + b * b;
        let left = [missed[0] - self.predicted[0], missed[1] - self.predicted[1]];
        let evidence = EVIDENCE_DECAY * self.evidence + square(missed) - square(left);
        let AdaptiveAugmentationOptions { scale, most, nu: sizes, .. } = self.options;
        let z = missed.map(|b| b / scale);
        if self.filter.has_stepped() && z.iter().all(|z| z.is_finite()) {
            self.filter.observe(&z);
        }
        for (x, (nu, size)) in self.x.iter_mut().zip(nu.iter().zip(sizes)) {
            *x = nu / size;
        }
        (self.x[3], self.x[4]) = (cos, sin);
        self.filter.advance(&self.x);
        let mut given = [0.0; 2];
        self.filter.model().output(self.filter.state(), &mut given);
        if given.iter().all(|b| b.is_finite()) && evidence.is_finite() {
            self.predicted = shortened(given.map(|b| b * scale), most);
            self.evidence = evidence;
        } else {
            self.forget();
        }
    }

    fn forget(&mut self) {
        let rest = core::iter::repeat_n(0.0, self.filter.state().len());
        self.filter.set(rest, self.first.iter().copied());
        self.filter.restart();
        self.filter.reset();
        self.predicted = [0.0; 2];
        self.evidence = 0.0;
    }
}

impl<M: Affine> Controller for AdaptiveAugmentation<M> {
    fn inputs(&self) -> usize {
        self.base.inputs()
    }

    fn reset(&mut self) {
        self.base.reset();
        self.window = Window::default();
        self.forget();
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.base.visit_state(memory);
        let Window { samples, begin, modelled, heading } = &mut self.window;
        memory.count(samples, self.samples);
        for numbers in [begin, modelled, heading, &mut self.predicted] {
            memory.numbers(numbers);
        }
        memory.number(&mut self.evidence);
        self.filter.visit_state(memory);
    }

    fn command(&mut self, estimate: &Estimate<'_>, reference: &Reference, command: &mut [f64]) -> Status {
        if !(estimate.is_finite() && reference.is_finite()) {
            self.window = Window::default();
            return self.base.command(estimate, reference, command);
        }
        let (sin, cos) = Float::sin_cos(estimate.eta[2]);
        let velocity = self.base.velocity(estimate);
        if self.window.samples == self.samples {
            self.learn(estimate.through_water(), velocity);
            self.window = Window::default();
        }
        if self.window.samples == 0 {
            self.window.begin = velocity;
        }
        let [x, y] = if self.is_used() { self.predicted } else { [0.0; 2] };
        let disturbance = [x * cos - y * sin, x * sin + y * cos];
        let (status, modelled) = self.base.command_against(estimate, reference, disturbance, command);
        self.window.samples += 1;
        for (sum, value) in self.window.modelled.iter_mut().zip(modelled) {
            *sum += value;
        }
        self.window.heading = [self.window.heading[0] + cos, self.window.heading[1] + sin];
        status
    }
}

/// Small random initial weights from the seed, with an output layer of zero.
fn first_weights(network: &Network, seed: u64) -> Vec<f64> {
    let mut noise = super::noise::Noise::new(seed);
    let Cell::Vanilla { hidden, .. } = network.cell else { return Vec::new() };
    let size = 1.0 / Float::sqrt((hidden + INPUTS) as f64);
    let mut weights: Vec<f64> = (0..network.weights()).map(|_| size * noise.normal()).collect();
    let read_out = weights.len() - 2 * (hidden + 1);
    weights[read_out..].fill(0.0);
    weights
}
