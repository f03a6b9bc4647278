//! The session of sparse equations.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::super::filter::Filter;
use super::super::learnable::{Learnable, LearnableEquations};
use super::super::options::{FilterOptions, FilterOptionsError};
use super::{KalmanSession, ModelKind};
use crate::adapt::parametric_session::ParametricSession;
use crate::memory::Memory;
use crate::model::sparse::Equations;
use crate::predict::{Predictor, Workspace};

/// A [`KalmanSession`] of sparse equations: outputs and coefficients are estimated, in the units of
/// [`LearnableEquations`].
///
/// The present outputs are the estimates of the filter, and so are the past outputs among the signals. A run starts
/// when every output has been measured once and the past that the equations need is known: the state is the
/// measurement, with the variance `R` ([`FilterOptions::initial_state`] is not used). A divergent step or measurement
/// starts the run again; the weights stay.
///
/// The snapshot is that of a [`ParametricSession`].
pub type KalmanEquations = KalmanSession<EquationsKind>;

/// The part of a [`KalmanEquations`] outside filter and measurement.
#[derive(Clone, Debug)]
pub struct EquationsKind {
    session: ParametricSession,
    x: Vec<f64>,
    weights: Vec<f64>,
    scaled: Vec<f64>,
}

impl KalmanEquations {
    /// A session at the start of a run, with the coefficients of the equations.
    ///
    /// # Errors
    /// If the options are out of range or do not fit the equations.
    pub fn new(model: LearnableEquations, options: FilterOptions) -> Result<Self, FilterOptionsError> {
        let session = ParametricSession::new(model.equations().clone(), model.places().to_vec());
        let mut weights = vec![0.0; model.places().len()];
        session.weights(&mut weights);
        let kind = EquationsKind {
            x: vec![0.0; model.inputs()],
            scaled: vec![0.0; model.outputs() + weights.len()],
            session,
            weights,
        };
        Ok(Self::of(kind, Filter::new(model, options)?))
    }

    /// The equations with their current coefficients.
    pub fn equations(&self) -> &Equations {
        self.kind.session.equations()
    }
}

impl EquationsKind {
    fn present_outputs(&self) -> &[f64] {
        &self.session.state()[..self.session.outputs()]
    }

    fn is_waiting(&self) -> bool {
        self.present_outputs().iter().any(|y| y.is_nan())
    }

    fn wait(&mut self) {
        let outputs = self.session.outputs();
        self.session.state_mut()[..outputs].fill(f64::NAN);
        self.clear_infinite();
    }

    /// Infinite values count as unknown: in the state of a lag they would remain.
    fn clear_infinite(&mut self) {
        self.session.state_mut().iter_mut().filter(|x| x.is_infinite()).for_each(|x| *x = f64::NAN);
    }
}

impl ModelKind for EquationsKind {
    type Model = LearnableEquations;
    type Session = ParametricSession;

    fn session(&self) -> &ParametricSession {
        &self.session
    }

    fn session_mut(&mut self) -> &mut ParametricSession {
        &mut self.session
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn output_scale<'a>(&'a self, model: &'a LearnableEquations) -> &'a [f64] {
        model.scale()
    }

    fn take_measurement(
        &mut self,
        filter: &mut Filter<LearnableEquations>,
        y: &[f64],
        z: &mut [f64],
    ) -> bool {
        for (z, y) in z.iter_mut().zip(y) {
            *z = if y.is_finite() { *y } else { f64::NAN };
        }
        let waiting = self.is_waiting();
        if waiting {
            self.session.observe(z);
            if self.is_waiting() {
                return false;
            }
            z.copy_from_slice(self.present_outputs());
        }
        for (i, z) in z.iter_mut().enumerate() {
            *z = filter.model().scaled(i, *z);
        }
        if waiting {
            filter.begin(z.iter().copied());
        }
        !waiting
    }

    fn sync_session(&mut self, filter: &Filter<LearnableEquations>, weights: bool) {
        let model = filter.model();
        for (i, (y, h)) in self.session.state_mut().iter_mut().zip(filter.state()).enumerate() {
            *y = model.unscaled(i, *h);
        }
        if weights {
            for ((into, w), unit) in self.weights.iter_mut().zip(filter.weights()).zip(model.units()) {
                *into = w * unit;
            }
            self.session.set_weights(&self.weights);
        }
    }

    fn recover(&mut self, _: &Filter<LearnableEquations>) {
        self.wait();
    }

    fn advance(&mut self, filter: &mut Filter<LearnableEquations>, c: &[f64]) {
        if self.is_waiting() {
            self.session.advance(c);
            return self.clear_infinite();
        }
        let (command, memory) = self.x.split_at_mut(c.len());
        command.copy_from_slice(c);
        memory.copy_from_slice(&self.session.state()[self.session.outputs()..]);
        // The memory of the signals advances even if the outputs are not finite.
        self.session.advance(c);
        if self.present_outputs().iter().all(|y| y.is_finite()) {
            filter.advance(&self.x);
            self.sync_session(filter, filter.leaks());
        }
        if !self.present_outputs().iter().all(|y| y.is_finite()) {
            self.wait();
        }
    }

    fn sync_filter(&mut self, filter: &mut Filter<LearnableEquations>) {
        self.session.weights(&mut self.weights);
        let model = filter.model();
        let (outputs, coefficients) = self.scaled.split_at_mut(self.session.outputs());
        for (i, (into, y)) in outputs.iter_mut().zip(self.session.state()).enumerate() {
            *into = model.scaled(i, *y);
        }
        for ((into, w), unit) in coefficients.iter_mut().zip(&self.weights).zip(model.units()) {
            *into = w / unit;
        }
        filter.set(outputs.iter().copied(), coefficients.iter().copied());
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        if memory.is_loading() {
            self.session.weights(&mut self.weights);
        }
    }

    /// From the covariance of outputs and coefficients, `Q_h` in each step, and the noise of the measurement:
    ///
    /// ```text
    /// S_n P S_n' + sum_{j<n} Phi_j Q_h Phi_j' + R        S_n = [Phi_n dy_n/dw],  Phi_n = dy_n/dh
    /// ```
    ///
    /// NaN before a run has started.
    fn deviations(
        &mut self,
        filter: &mut Filter<LearnableEquations>,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let (n, count) = (self.session.outputs(), self.weights.len());
        assert_eq!(deviations.len(), horizons.len() * n, "one row of deviations for each horizon");
        let steps = horizons.iter().copied().max().unwrap_or(0);
        let commands = &commands[..steps * self.session.inputs()];
        if self.is_waiting() || commands.iter().any(|c| c.is_nan()) {
            return deviations.fill(f64::NAN);
        }
        let sensitivity = filter.model().sensitivity();
        let p = sensitivity.parameters();
        let rows = (steps + 1) * n;
        let (y, rest) =
            work.take(rows * (1 + p) + (n + count + 1) * n + sensitivity.scratch()).split_at_mut(rows);
        let (s, rest) = rest.split_at_mut(rows * p);
        let (by_state, rest) = rest.split_at_mut(n * n);
        let (by_weights, rest) = rest.split_at_mut(count * n);
        let (process, scratch) = rest.split_at_mut(n);
        sensitivity.rollout(self.session.state(), commands, scratch, y, s);
        process.fill(0.0);
        let q = filter.state_noise();
        let mut done = 0;
        for (h, (&horizon, into)) in horizons.iter().zip(deviations.chunks_exact_mut(n)).enumerate() {
            let model = filter.model();
            for row in s[done * n * p..horizon * n * p].chunks_exact(n * p) {
                for (process, row) in process.iter_mut().zip(row.chunks_exact(p)) {
                    let by = |(s, scale): (&f64, &f64)| Float::powi(s * scale, 2);
                    *process += q * row.iter().zip(model.scale()).map(by).sum::<f64>();
                }
            }
            done = horizon;
            for (i, row) in s[horizon * n * p..(horizon + 1) * n * p].chunks_exact(p).enumerate() {
                let (by_outputs, by_coefficients) = row.split_at(n);
                for (j, (s, scale)) in by_outputs.iter().zip(model.scale()).enumerate() {
                    by_state[j * n + i] = s * scale;
                }
                for (j, (s, unit)) in by_coefficients.iter().zip(model.units()).enumerate() {
                    by_weights[j * n + i] = s * unit;
                }
                into[i] = process[i] + filter.noise()[i] * Float::powi(model.scale()[i], 2);
            }
            filter.set_gradients(h * n, n, by_state, by_weights);
        }
        filter.add_variances(deviations);
        for variance in deviations.iter_mut() {
            *variance = Float::sqrt(variance.clamp(0.0, f64::INFINITY));
        }
    }
}
