//! Feedback linearization with a correction that is learned under way.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::affine::Affine;
use super::error::{ControlError, positive};
use super::feedback_linearization::FeedbackLinearization;
use super::lookahead_point::shortened;
use super::status::Status;
use super::{Controller, Estimate};
use crate::adapt::kalman::{Filter, Learnable, LearnableNetwork, Tuning};
use crate::guidance::Reference;
use crate::model::recurrent::{Cell, Network, Packed};

/// Inputs of the network: `u, v, r`, scaled, and the heading as cosine and sine, so that it can tell what is constant north and
/// east from what turns with the vessel.
const INPUTS: usize = 5;

/// Share of a window's evidence that is left after the next one, in what decides whether the correction is used.
const KEPT: f64 = 0.95;

/// What the correction must have saved before it is used, in squares of the noise: what noise alone makes of a network that has
/// nothing to learn stays below it.
const EVIDENCE: f64 = 4.0;

/// How a [`AdaptiveAugmentation`] learns. The defaults are those of a boat of some metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdaptiveAugmentationOptions {
    /// Hidden units of the network.
    pub hidden: usize,
    /// Time over which an acceleration is measured, and after which the network learns and gives the next correction \[s\].
    pub window_s: f64,
    /// Size of what the base's model may miss \[m/s^2\].
    pub scale: f64,
    /// No correction is longer than this \[m/s^2\].
    pub most: f64,
    /// Size of the noise of an acceleration that is measured over a window \[m/s^2\].
    pub noise: f64,
    /// Time after which weights have forgotten \[s\].
    pub memory_s: f64,
    /// Size of surge, sway (both \[m/s\]) and yaw rate \[rad/s\].
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

/// [`FeedbackLinearization`], and a recurrent network that learns under way what its model misses.
///
/// # Law
///
/// The base commands an acceleration `w` of the point; where model and vessel do not agree the tracking error obeys
///
/// ```text
/// d2e/dt2 + k_d de/dt + k_p e = -b,     b = d2p/dt2 - (what the model says of the commands)
/// ```
///
/// A small recurrent network (`tanh`, a linear read-out) gives `b^`, in the body frame, and the base commands `w - b^`. Over
/// windows of `window_s` the mean of `b` is measured, which is what the tracking error did beyond what it should have done, and
/// an extended Kalman filter ([`Filter`]) corrects the network's state and weights by it:
///
/// ```text
/// h   = tanh(W x + U h + c),   b^ = scale (V h + d),     x = [u v r cos psi sin psi], scaled
/// [h; theta] <- [h; theta] + K (R(psi)' b / scale - b^ / scale)
/// ```
///
/// The read-out begins at zero: before anything is learned the law is its base. `b` does not depend on `b^` (what is commanded
/// is in what the model says), so that learning cannot excite itself.
///
/// Source: F. L. Lewis, S. Jagannathan and A. Yesildirek, *Neural Network Control of Robot Manipulators and Nonlinear Systems*,
/// 1999 (a network for what a linearizing law misses); the filter: [`kalman`](crate::adapt::kalman).
///
/// # Guard
///
/// A correction can do harm only if it is farther from what happens than nothing would be. Each window is foretold before it is
/// learned from, and `|b|^2 - |b - b^|^2`, summed with a memory of some 20 windows, says whether that has been of use. While it
/// has not, beyond what noise makes of it, the base alone commands, and learning goes on. No correction is longer than `most`.
///
/// # Assumptions and tuning
///
/// Those of the base. `noise` is that of a velocity of the point times `sqrt(2) / window_s`; a longer window has less of it and
/// follows later. `scale` is the prior: accelerations that a wrong mass, a current or a fouled hull leave. What changes within
/// a window is not learned.
///
/// # When it fails
///
/// Commands at their limits are no disturbance (what they could not do is known), but nothing that is learned makes a vessel do
/// more than it can. Where the base is lost, it is lost.
#[derive(Clone, Debug)]
pub struct AdaptiveAugmentation<M> {
    base: FeedbackLinearization<M>,
    settings: AdaptiveAugmentationOptions,
    filter: Filter<f64, LearnableNetwork<f64>>,
    /// First weights.
    first: Vec<f64>,
    /// Samples of a window.
    samples: usize,
    window: Window,
    /// `b^`, body frame \[m/s^2\], as the network has it now.
    foretold: [f64; 2],
    /// What it has saved.
    saved: f64,
    x: Vec<f64>,
}

/// A window that is being measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Window {
    samples: usize,
    /// Velocity of the point at its begin, north and east.
    begin: [f64; 2],
    /// Sum of the accelerations that the model has told.
    told: [f64; 2],
    /// Sums of cosine and sine of the heading.
    heading: [f64; 2],
}

impl<M: Affine> AdaptiveAugmentation<M> {
    /// Around a base; `seed` is that of the network's first weights.
    ///
    /// # Errors
    /// If a setting is not possible.
    pub fn new(
        base: FeedbackLinearization<M>,
        settings: AdaptiveAugmentationOptions,
        seed: u64,
    ) -> Result<Self, ControlError> {
        let AdaptiveAugmentationOptions { hidden, window_s, scale, most, noise, memory_s, nu } = settings;
        for (what, value) in [
            ("the window", window_s),
            ("the size of what a model may miss", scale),
            ("the longest correction", most),
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
        // The read-out may become as large as what is missed; the other layers stay near where they begin.
        let read_out = weights.len() - 2 * (hidden + 1);
        let mut tuning =
            Tuning::uniform(weights.len(), 0.0, 0.0, (0.01, 1e-4), &[(noise / scale).powi(2); 2]);
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
            settings,
            filter,
            first: weights,
            samples,
            window: Window::default(),
            foretold: [0.0; 2],
            saved: 0.0,
            x: vec![0.0; INPUTS],
        })
    }

    /// The law that it corrects.
    pub const fn base(&self) -> &FeedbackLinearization<M> {
        &self.base
    }

    /// Lets the base's model change ([`FeedbackLinearization::update`]).
    ///
    /// # Errors
    /// If a channel cannot be inverted any more: the model is what it was before, and so is the law.
    pub fn update(&mut self, change: impl FnOnce(&mut M)) -> Result<(), ControlError>
    where
        M: Clone,
    {
        self.base.update(change)
    }

    /// Whether the correction is in use.
    pub fn is_used(&self) -> bool {
        self.saved > EVIDENCE * self.settings.noise * self.settings.noise
    }

    /// The correction as the network has it now, in use or not: forward and to starboard \[m/s^2\].
    pub const fn correction(&self) -> [f64; 2] {
        self.foretold
    }

    /// Learns from a window that is over, and foretells the next.
    fn learn(&mut self, nu: [f64; 3], velocity: [f64; 2]) {
        let Window { samples, begin, told, heading } = self.window;
        let count = samples as f64;
        let span = count * self.base.dt();
        let missed: [f64; 2] = core::array::from_fn(|i| (velocity[i] - begin[i]) / span - told[i] / count);
        let length = Float::hypot(heading[0], heading[1]);
        let (cos, sin) = (heading[0] / length, heading[1] / length);
        let missed = [missed[0] * cos + missed[1] * sin, missed[1] * cos - missed[0] * sin];
        let square = |[a, b]: [f64; 2]| a * a + b * b;
        let left = [missed[0] - self.foretold[0], missed[1] - self.foretold[1]];
        let saved = KEPT * self.saved + square(missed) - square(left);
        let AdaptiveAugmentationOptions { scale, most, nu: sizes, .. } = self.settings;
        let z = missed.map(|b| b / scale);
        if self.filter.has_moved() && z.iter().all(|z| z.is_finite()) {
            self.filter.observe(&z);
        }
        for (x, (nu, size)) in self.x.iter_mut().zip(nu.iter().zip(sizes)) {
            *x = nu / size;
        }
        (self.x[3], self.x[4]) = (cos, sin);
        self.filter.advance(&self.x);
        let mut given = [0.0; 2];
        self.filter.model().output(self.filter.state(), &mut given);
        if given.iter().all(|b| b.is_finite()) && saved.is_finite() {
            self.foretold = shortened(given.map(|b| b * scale), most);
            self.saved = saved;
        } else {
            self.forget();
        }
    }

    /// Back to its base.
    fn forget(&mut self) {
        let rest = core::iter::repeat_n(0.0, self.filter.state().len());
        self.filter.set(rest, self.first.iter().copied());
        self.filter.restart();
        self.filter.reset();
        self.foretold = [0.0; 2];
        self.saved = 0.0;
    }
}

impl<M: Affine> Controller for AdaptiveAugmentation<M> {
    fn inputs(&self) -> usize {
        self.base.inputs()
    }

    /// Back to its base: what was learned is forgotten.
    fn reset(&mut self) {
        self.base.reset();
        self.window = Window::default();
        self.forget();
    }

    fn command(&mut self, estimate: &Estimate<'_>, reference: &Reference, command: &mut [f64]) -> Status {
        if !(estimate.is_finite() && reference.is_finite()) {
            // What was measured so far has a gap.
            self.window = Window::default();
            return self.base.command(estimate, reference, command);
        }
        let (sin, cos) = Float::sin_cos(estimate.eta[2]);
        let velocity = self.base.velocity(estimate);
        if self.window.samples == self.samples {
            self.learn(estimate.nu, velocity);
            self.window = Window::default();
        }
        if self.window.samples == 0 {
            self.window.begin = velocity;
        }
        let [x, y] = if self.is_used() { self.foretold } else { [0.0; 2] };
        let disturbance = [x * cos - y * sin, x * sin + y * cos];
        let (status, told) = self.base.command_against(estimate, reference, disturbance, command);
        self.window.samples += 1;
        for (sum, value) in self.window.told.iter_mut().zip(told) {
            *sum += value;
        }
        self.window.heading = [self.window.heading[0] + cos, self.window.heading[1] + sin];
        status
    }
}

/// First weights: small, different and the same for a seed; nothing in the read-out.
fn first_weights(network: &Network, seed: u64) -> Vec<f64> {
    let mut noise = super::noise::Noise::new(seed);
    let Cell::Vanilla { hidden, .. } = network.cell else { return Vec::new() };
    let size = 1.0 / Float::sqrt((hidden + INPUTS) as f64);
    let mut weights: Vec<f64> = (0..network.weights()).map(|_| size * noise.normal()).collect();
    let read_out = weights.len() - 2 * (hidden + 1);
    weights[read_out..].fill(0.0);
    weights
}
