//! Recursive least squares on the last layer of a direct predictor: all steps of the horizon from one regressor.
//!
//! A [`Direct`] network reads a window that ends at the sample `k` and computes the `n` outputs of the next `H`
//! samples. Its last layer is linear, and all of its `H n` targets share one regressor:
//!
//! ```text
//! phi_k   = [h(x_k), 1]                              x_k: the window, h: the last hidden layer
//! g_{k,i} = phi_k' theta_i                           i = (j, c): step j = 1 .. H, output c
//! t_{k,i} = (y_{k+j,c} - b_{k,i}) / scale_c          b: base of the model (mean, last output or equations)
//! ```
//!
//! One covariance serves all targets ([`RecursiveLeastSquares`]), and the update is exact for each.
//!
//! **Delayed targets.** `x_k` contains the commands up to `c_{k+H-1}`. The sample `m` completes the window `k = m - H`
//! with all of its targets:
//!
//! ```text
//! K  = P phi_k / (1 + phi_k' P phi_k)
//! theta_i += K (t_{k,i} - phi_k' theta_i)             all i
//! P <- P - K phi_k' P
//! P <- forget(P)                                      discounts the data, restores the prior
//! ```
//!
//! **Missing and noisy targets.** A missing target leaves its `theta_i` unchanged; the innovation of a target with `f`
//! times the noise variance is divided by `f`. The covariance is updated as if all targets were present. It is then too
//! small for such an output, whose weights adapt more slowly. Prior and forgetting bound the effect.

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

/// Windows before the error variance of a target is used.
const FEWEST_WINDOWS: usize = 30;

/// Bound on the normalized error in the variance estimate, which limits the effect of a faulty sample.
const FARTHEST: f64 = 5.0;

/// A session of a [`Direct`] model with adaptation of its last layer (`docs/online-adaptation.md`).
///
/// The weights are the matrix of the last layer row by row, then its bias. The snapshot is the snapshot of a
/// [`DirectSession`], then these weights.
#[derive(Clone, Debug)]
pub struct DirectLastLayer {
    session: DirectSession,
    windows: Windows,
    /// `None` for a companion of a guard.
    learner: Option<RecursiveLeastSquares>,
    options: LastLayerOptions,
    /// Regressor, with a 1 at its end.
    phi: Vec<f64>,
    /// Scaled outputs of the network, then the errors of all targets.
    errors: Vec<f64>,
    /// Prediction of the base equations for the targets, if any.
    base_targets: Vec<f64>,
    variance: Vec<f64>,
    seen: Vec<usize>,
    /// `S / R = 1 + phi' P phi` of the last window.
    s_over_r: f64,
    /// Factor of the noise variance of the next measurement.
    inflation: f64,
    frozen: bool,
    outcome: Outcome,
    innovations: Vec<Innovation>,
}

impl DirectLastLayer {
    /// A session at the start of a run, with the weights of the model.
    ///
    /// # Errors
    /// If the model or the options are invalid.
    pub fn new(model: Arc<Direct>, options: &LastLayerOptions) -> Result<Self, LastLayerError> {
        options.check()?;
        let mut own = Self::companion(model, options)?;
        let (n, targets) = (own.phi.len(), own.errors.len());
        let (matrix, bias) = own.session.last_layer().split_at((n - 1) * targets);
        let rows = (0..targets).flat_map(|i| matrix[i * (n - 1)..][..n - 1].iter().chain([&bias[i]]));
        let theta: Vec<f64> = rows.copied().collect();
        own.learner = Some(RecursiveLeastSquares::new(n, &theta, options.information, options.leak));
        Ok(own)
    }

    /// A session without adaptation, as a companion of an adapter in a [`Guard`](super::guard::Guard).
    ///
    /// # Errors
    /// If the model is invalid.
    pub fn companion(model: Arc<Direct>, options: &LastLayerOptions) -> Result<Self, LastLayerError> {
        let session = DirectSession::with_own_last_layer(model).map_err(LastLayerError::Model)?;
        let (targets, outputs) = (session.model().network.outputs, session.model().outputs());
        Ok(Self {
            windows: Windows::new(session.model()),
            learner: None,
            options: *options,
            phi: vec![1.0; session.features() + 1],
            errors: vec![0.0; targets],
            base_targets: vec![0.0; if session.model().equations().is_some() { targets } else { 0 }],
            variance: vec![0.0; targets],
            seen: vec![0; targets],
            s_over_r: f64::NAN,
            inflation: 1.0,
            frozen: false,
            outcome: Outcome::Waiting,
            innovations: Vec::with_capacity(outputs),
            session,
        })
    }

    /// The model with its original weights.
    pub fn model(&self) -> &Direct {
        self.session.model()
    }

    /// The regression; `None` for a companion.
    pub fn learner(&self) -> Option<&RecursiveLeastSquares> {
        self.learner.as_ref()
    }

    /// Computes regressor and errors of the window that the present sample completes; `false` if a value is unknown.
    fn load_window(&mut self) -> bool {
        let Some([outputs, passed, ahead]) = self.windows.oldest() else { return false };
        let features = self.phi.len() - 1;
        self.session.window_features(outputs, passed, ahead, &mut self.phi[..features]);
        self.session.apply_last_layer(&self.phi[..features], &mut self.errors);
        let [present, memory, commands] = self.windows.oldest_base();
        self.session.of_equations(present, memory, commands, &mut self.base_targets);
        self.windows.subtract_from_targets(self.session.model(), &self.base_targets, &mut self.errors);
        true
    }

    /// Stores the innovations of the last step with their standard deviations, then updates the error variances.
    fn record_errors(&mut self) {
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
            // A variance of 0 would bound all later errors to 0.
            let bounds = *seen >= FEWEST_WINDOWS && *variance > 0.0;
            let most = if bounds { FARTHEST * FARTHEST * *variance } else { f64::INFINITY };
            *variance += share * ((error * error / self.s_over_r).min(most) - *variance);
            *seen = seen.saturating_add(1);
        }
    }

    fn is_known(&self, number: usize) -> bool {
        self.seen[number] >= FEWEST_WINDOWS
    }

    fn learn(&mut self) {
        self.innovations.clear();
        self.outcome = Outcome::Waiting;
        let learning = self.learner.is_some() && !self.frozen;
        if !self.load_window() {
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
        // An error whose square overflows would remain in weights and variances. Missing targets are NaN.
        if self.errors.iter().any(|error| (error * error).is_infinite()) {
            self.outcome = Outcome::Rejected(Rejection::NotFinite);
            return;
        }
        self.record_errors();
        let Some(learner) = self.learner.as_mut().filter(|_| learning) else {
            self.innovations.clear();
            return;
        };
        for (i, (into, &error)) in learner.innovations_mut().iter_mut().zip(&self.errors).enumerate() {
            *into = if error.is_nan() { 0.0 } else { error / self.windows.inflation(i) };
        }
        learner.correct(1.0);
        learner.forget(self.options.forgetting);
        self.outcome = Outcome::Accepted;
        self.sync_session();
    }

    fn sync_session(&mut self) {
        let Some(learner) = &self.learner else { return };
        let features = self.phi.len() - 1;
        let (matrix, bias) = self.session.last_layer_mut().split_at_mut(features * self.errors.len());
        let rows = matrix.chunks_exact_mut(features).zip(bias);
        for ((row, bias), theta) in rows.zip(learner.coefficients().chunks_exact(features + 1)) {
            row.copy_from_slice(&theta[..features]);
            *bias = theta[features];
        }
    }

    fn sync_learner(&mut self) {
        let Some(learner) = &mut self.learner else { return };
        let features = self.phi.len() - 1;
        let (matrix, bias) = self.session.last_layer().split_at(features * self.errors.len());
        let rows = matrix.chunks_exact(features).zip(bias);
        for ((row, bias), theta) in rows.zip(learner.coefficients_mut().chunks_exact_mut(features + 1)) {
            theta[..features].copy_from_slice(row);
            theta[features] = *bias;
        }
    }
}
