//! The last layer of a direct predictor, learned on the way: all steps of a horizon from one regressor.
//!
//! A [`Direct`] network reads a window that ends at the sample `k` and gives all outputs of the next `H` samples. Its last
//! layer is linear, and all of its numbers share one regressor:
//!
//! ```text
//! phi_k   = [h(x_k), 1]                              x_k: the window, h: what the last hidden layer makes of it
//! g_{k,i} = phi_k' theta_i                           i = (j, c): step j = 1 .. H, output c
//! t_{k,i} = (y_{k+j,c} - b_{k,i}) / scale_c          what was measured of it; b: what the model adds it to
//! ```
//!
//! So one covariance serves all `H n` of them ([`RecursiveLeastSquares`]), and learning is exact for each.
//!
//! **Delayed targets.** `x_k` holds the commands up to `c_{k+H-1}`, which are known when `y_{k+H}` is measured and not
//! before: only then is the regressor of the near steps known, too, although their targets came earlier. So the sample `m` completes
//! the window `k = m - H`, with all of its targets, and every step learns from it at once:
//!
//! ```text
//! K  = P phi_k / (1 + phi_k' P phi_k)
//! theta_i += K (t_{k,i} - phi_k' theta_i)             all i
//! P <- P - K phi_k' P
//! P <- forget(P)                                      the data, never the prior
//! ```
//!
//! `K` depends on regressors alone and is the same for all steps. (To let the step `j` learn `H - j` samples earlier its
//! regressor would need commands that have not been given; with others in their place each step had regressors, and a covariance, of its own.)
//!
//! **What was not measured** teaches nothing: `theta_i` stays where `t_{k,i}` is missing, or is moved by a share where its measurement
//! counts as noisier. The covariance goes on as if all had been there, and is a little too sure of such an output: it is
//! learned more slowly than its own covariance would let it, never faster. The prior, and forgetting, bound that.

mod adapter;
mod options;
mod session;
mod windows;

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::{Innovation, Outcome, RecursiveLeastSquares, Rejection};
use crate::model::direct::{Direct, DirectSession};
use windows::Windows;

pub use options::{LastLayerError, LastLayerOptions, SHORTEST_FORGETTING};

/// Windows before the errors of a step are known well enough for a band.
const FEWEST_WINDOWS: usize = 30;

/// Errors beyond so many standard deviations widen the bands no further: one bad sample must not.
const FARTHEST: f64 = 5.0;

/// A session of a [`Direct`] model whose last layer is learned by recursive least squares, all steps of its horizon from one regressor and one covariance (`docs/adapt.md`).
///
/// The weights are those of the read-out, its matrix row by row, then its bias, as at the end of the model's. The snapshot is
/// that of a [`DirectSession`] with these behind it.
#[derive(Clone, Debug)]
pub struct DirectLastLayer {
    session: DirectSession,
    windows: Windows,
    /// None for one that never learns: a companion of a guard.
    learner: Option<RecursiveLeastSquares>,
    options: LastLayerOptions,
    /// The regressor.
    phi: Vec<f64>,
    /// What the network gives, then how far that is off.
    errors: Vec<f64>,
    /// What the model's equations say of the same numbers; empty without equations.
    below: Vec<f64>,
    /// Variance of the errors of each number that the network gives, scaled, and windows that it is from: not all outputs are
    /// measured as often.
    variance: Vec<f64>,
    seen: Vec<usize>,
    /// `1 + phi' P phi` of the last window.
    s_over_r: f64,
    /// What the noise of the next measurement counts for.
    inflation: f64,
    frozen: bool,
    outcome: Outcome,
    innovations: Vec<Innovation>,
}

impl DirectLastLayer {
    /// A session at the start of a run, with the model's weights.
    ///
    /// # Errors
    /// If model or options make no sense.
    pub fn new(model: Arc<Direct>, options: &LastLayerOptions) -> Result<Self, LastLayerError> {
        options.check()?;
        let mut own = Self::companion(model, options)?;
        let (n, gives) = (own.phi.len(), own.errors.len());
        let (matrix, bias) = own.session.read_out().split_at((n - 1) * gives);
        let rows = (0..gives).flat_map(|i| matrix[i * (n - 1)..][..n - 1].iter().chain([&bias[i]]));
        let theta: Vec<f64> = rows.copied().collect();
        own.learner = Some(RecursiveLeastSquares::new(n, &theta, options.information, options.leak));
        Ok(own)
    }

    /// The same that never learns and has no covariance: what a [`Guard`](super::guard::Guard) needs beside one that does.
    ///
    /// # Errors
    /// If the model makes no sense.
    pub fn companion(model: Arc<Direct>, options: &LastLayerOptions) -> Result<Self, LastLayerError> {
        let session = DirectSession::with_own_read_out(model).map_err(LastLayerError::Model)?;
        let (gives, outputs) = (session.model().network.outputs, session.model().outputs());
        Ok(Self {
            windows: Windows::new(session.model()),
            learner: None,
            options: *options,
            phi: vec![1.0; session.features() + 1],
            errors: vec![0.0; gives],
            below: vec![0.0; if session.model().equations().is_some() { gives } else { 0 }],
            variance: vec![0.0; gives],
            seen: vec![0; gives],
            s_over_r: f64::NAN,
            inflation: 1.0,
            frozen: false,
            outcome: Outcome::Waiting,
            innovations: Vec::with_capacity(outputs),
            session,
        })
    }

    /// The model with the weights that it was given at first.
    pub fn model(&self) -> &Direct {
        self.session.model()
    }

    /// The regression; none of a companion.
    pub fn learner(&self) -> Option<&RecursiveLeastSquares> {
        self.learner.as_ref()
    }

    /// Regressor and errors of the window that the present sample completes; false where something of its past is not known.
    fn meet(&mut self) -> bool {
        let Some([outputs, passed, ahead]) = self.windows.oldest() else { return false };
        let features = self.phi.len() - 1;
        self.session.look(outputs, passed, ahead, &mut self.phi[..features]);
        self.session.give(&self.phi[..features], &mut self.errors);
        let [present, memory, commands] = self.windows.oldest_below();
        self.session.of_equations(present, memory, commands, &mut self.below);
        self.windows.subtract_from_targets(self.session.model(), &self.below, &mut self.errors);
        true
    }

    /// What the last step of each output was off by, and what was expected of that; then the errors themselves widen or narrow
    /// what is expected of the next.
    fn note(&mut self) {
        let n = self.session.model().outputs();
        let scale = &self.session.model().scaling.correction_scale;
        let last = self.errors.len() - n;
        self.innovations.clear();
        for c in 0..n {
            let deviation = if self.is_known(last + c) {
                num_traits::Float::sqrt(self.variance[last + c] * self.s_over_r)
            } else {
                f64::NAN
            };
            let value = self.errors[last + c] * scale[c];
            self.innovations.push(Innovation { value, deviation: deviation * scale[c] });
        }
        let numbers = self.variance.iter_mut().zip(&mut self.seen).zip(&self.errors);
        for ((variance, seen), error) in numbers.filter(|(_, error)| error.is_finite()) {
            let share = self.options.noise_rate.max(1.0 / (*seen + 1) as f64);
            // A variance of 0 bounds nothing: it would stay 0 whatever came.
            let bounds = *seen >= FEWEST_WINDOWS && *variance > 0.0;
            let most = if bounds { FARTHEST * FARTHEST * *variance } else { f64::INFINITY };
            *variance += share * ((error * error / self.s_over_r).min(most) - *variance);
            *seen = seen.saturating_add(1);
        }
    }

    /// Whether the errors of a number are known well enough for a band.
    fn is_known(&self, number: usize) -> bool {
        self.seen[number] >= FEWEST_WINDOWS
    }

    /// Learns from the window that the present sample completes.
    fn learn(&mut self) {
        self.innovations.clear();
        self.outcome = Outcome::Waiting;
        let learning = self.learner.is_some() && !self.frozen;
        if !self.meet() {
            return;
        }
        self.s_over_r = match self.learner.as_mut().filter(|_| learning) {
            Some(learner) => 1.0 + learner.project(&self.phi),
            None => 1.0,
        };
        if !self.s_over_r.is_finite() {
            self.s_over_r = f64::NAN;
            self.outcome = Outcome::Rejected(Rejection::NotFinite);
            return;
        }
        if self.errors.iter().all(|error| error.is_nan()) {
            return;
        }
        // What is missing is NaN; what is too large for its square would be in weights and variances for good.
        if self.errors.iter().any(|error| (error * error).is_infinite()) {
            self.outcome = Outcome::Rejected(Rejection::NotFinite);
            return;
        }
        self.note();
        let Some(learner) = self.learner.as_mut().filter(|_| learning) else {
            self.innovations.clear();
            return;
        };
        for (i, (into, &error)) in learner.innovations_mut().iter_mut().zip(&self.errors).enumerate() {
            *into = if error.is_nan() { 0.0 } else { error / self.windows.inflation(i) };
        }
        learner.correct(1.0);
        // Last: errors are those of the weights that the session had.
        learner.forget(self.options.forgetting);
        self.outcome = Outcome::Accepted;
        self.take_over();
    }

    /// The learner's weights become those of the session.
    fn take_over(&mut self) {
        let Some(learner) = &self.learner else { return };
        let features = self.phi.len() - 1;
        let (matrix, bias) = self.session.read_out_mut().split_at_mut(features * self.errors.len());
        let rows = matrix.chunks_exact_mut(features).zip(bias);
        for ((row, bias), theta) in rows.zip(learner.coefficients().chunks_exact(features + 1)) {
            row.copy_from_slice(&theta[..features]);
            *bias = theta[features];
        }
    }

    /// The weights of the session become those of the learner.
    fn hand_over(&mut self) {
        let Some(learner) = &mut self.learner else { return };
        let features = self.phi.len() - 1;
        let (matrix, bias) = self.session.read_out().split_at(features * self.errors.len());
        let rows = matrix.chunks_exact(features).zip(bias);
        for ((row, bias), theta) in rows.zip(learner.coefficients_mut().chunks_exact_mut(features + 1)) {
            theta[..features].copy_from_slice(row);
            theta[features] = *bias;
        }
    }
}
