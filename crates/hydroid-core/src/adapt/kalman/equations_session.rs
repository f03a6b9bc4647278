//! Sparse equations that learn on the way by a filter.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::equations::LearnableEquations;
use super::filter::{Correction, Filter};
use super::learnable::Learnable;
use super::tuning::{Tuning, TuningError};
use crate::adapt::memory::{Reader, Writer};
use crate::adapt::{Adapter, Health, Innovation, Outcome, Rejection, WeightedSession};
use crate::model::sparse::Equations;
use crate::predict::{Predictor, Workspace};

/// A session of sparse equations whose outputs and coefficients are estimated by a [`Filter`], in the units of
/// [`LearnableEquations`]: the tuning is in those.
///
/// The present outputs are what the filter makes of measurement and equations together, and the past outputs among the
/// signals are these estimates. A run begins where every output has been measured once, and all of the past that the
/// equations ask for is known: the state is what was measured, as uncertain as `R` says ([`Tuning::initial_state`] counts
/// for nothing). It begins anew after a step or a measurement that leaves all bounds; the weights stay.
///
/// The snapshot is that of a [`WeightedSession`].
#[derive(Clone, Debug)]
pub struct KalmanEquations {
    session: WeightedSession,
    filter: Filter<f64, LearnableEquations>,
    /// Command and memory, and the scaled measurement.
    x: Vec<f64>,
    z: Vec<f64>,
    /// The coefficients at the adapted places, and room for them in the filter's units.
    weights: Vec<f64>,
    scaled: Vec<f64>,
    outcome: Outcome,
    nis: f64,
    innovations: Vec<Innovation>,
}

impl KalmanEquations {
    /// A session at the start of a run, with the coefficients that the equations have.
    ///
    /// # Errors
    /// If the tuning makes no sense, or does not fit the equations.
    pub fn new(model: LearnableEquations, tuning: Tuning) -> Result<Self, TuningError> {
        let outputs = model.outputs();
        let session = WeightedSession::new(model.equations().clone(), model.places().to_vec());
        let mut weights = vec![0.0; model.places().len()];
        session.weights(&mut weights);
        Ok(Self {
            session,
            x: vec![0.0; model.inputs()],
            z: vec![0.0; outputs],
            scaled: weights.clone(),
            weights,
            outcome: Outcome::Waiting,
            nis: f64::NAN,
            innovations: Vec::with_capacity(outputs),
            filter: Filter::new(model, tuning)?,
        })
    }

    /// The equations of the moment.
    pub fn equations(&self) -> &Equations {
        self.session.equations()
    }

    /// The filter.
    pub fn filter(&self) -> &Filter<f64, LearnableEquations> {
        &self.filter
    }

    /// Normalised innovation squared of the last sample; NaN where nothing was learned from.
    pub fn nis(&self) -> f64 {
        self.nis
    }

    fn outputs_now(&self) -> &[f64] {
        &self.session.state()[..self.z.len()]
    }

    /// Whether no run has begun: an output is not known.
    fn is_waiting(&self) -> bool {
        self.outputs_now().iter().any(|y| y.is_nan())
    }

    /// Takes state, and weights if they have changed, of the filter into use.
    fn take_over(&mut self, weights: bool) {
        let model = self.filter.model();
        for (i, (y, h)) in self.session.state_mut().iter_mut().zip(self.filter.state()).enumerate() {
            *y = model.unscaled(i, *h);
        }
        if weights {
            for ((into, w), unit) in self.weights.iter_mut().zip(self.filter.weights()).zip(model.units()) {
                *into = w * unit;
            }
            self.session.set_weights(&self.weights);
        }
    }

    /// The run has to begin anew: the outputs are not known.
    fn wait(&mut self) {
        self.session.state_mut()[..self.z.len()].fill(f64::NAN);
        self.forget_infinite();
    }

    /// What is infinite is not known: as a lag's state it would stay so.
    fn forget_infinite(&mut self) {
        self.session.state_mut().iter_mut().filter(|x| x.is_infinite()).for_each(|x| *x = f64::NAN);
    }

    /// The session's outputs into `z`.
    fn scale_outputs(&mut self) {
        for (i, z) in self.z.iter_mut().enumerate() {
            *z = self.filter.model().scaled(i, self.session.state()[i]);
        }
    }

    /// The filter's state becomes the session's outputs, just measured.
    fn begin(&mut self) {
        self.scale_outputs();
        self.filter.begin(self.z.iter().copied());
    }

    /// What the filter made of a measurement, in units of the outputs.
    fn note(&mut self, correction: Correction) {
        self.innovations.clear();
        self.nis = f64::NAN;
        self.outcome = match correction {
            Correction::None => Outcome::Waiting,
            Correction::Lost => Outcome::Rejected(Rejection::NotFinite),
            Correction::Made { nis, deviations, weight } => {
                self.nis = nis;
                let (e, s) = self.filter.innovation();
                let scale = self.filter.model().scale();
                let innovation = |((e, s), scale): ((&f64, &f64), &f64)| Innovation {
                    value: e * scale,
                    deviation: Float::sqrt(*s) * scale,
                };
                self.innovations.extend(e.iter().zip(s).zip(scale).map(innovation));
                if weight < 1.0 { Outcome::Inflated { deviations, weight } } else { Outcome::Accepted }
            }
        };
    }
}

impl Predictor for KalmanEquations {
    fn outputs(&self) -> usize {
        self.session.outputs()
    }

    fn inputs(&self) -> usize {
        self.session.inputs()
    }

    fn warm_up(&self) -> usize {
        self.session.warm_up()
    }

    fn reset(&mut self) {
        self.session.reset();
        self.filter.reset();
        self.note(Correction::None);
    }

    /// A second measurement of the same sample is not used, once a run has begun.
    fn observe(&mut self, y: &[f64]) {
        // What is infinite was not measured.
        for (z, y) in self.z.iter_mut().zip(y) {
            *z = if y.is_finite() { *y } else { f64::NAN };
        }
        let correction = if self.is_waiting() {
            self.session.observe(&self.z);
            if !self.is_waiting() {
                self.begin();
            }
            Correction::None
        } else {
            for (i, z) in self.z.iter_mut().enumerate() {
                *z = self.filter.model().scaled(i, *z);
            }
            self.filter.observe(&self.z)
        };
        match correction {
            Correction::None => {}
            Correction::Made { .. } => self.take_over(self.filter.learns),
            Correction::Lost => self.wait(),
        }
        self.note(correction);
        if y.iter().any(|y| y.is_infinite()) {
            self.outcome = Outcome::Rejected(Rejection::NotFinite);
        }
    }

    fn advance(&mut self, c: &[f64]) {
        if self.is_waiting() {
            self.session.advance(c);
            return self.forget_infinite();
        }
        let (command, memory) = self.x.split_at_mut(c.len());
        command.copy_from_slice(c);
        memory.copy_from_slice(&self.session.state()[self.z.len()..]);
        // What signals remember moves on, whatever comes of the outputs.
        self.session.advance(c);
        if self.outputs_now().iter().all(|y| y.is_finite()) {
            self.filter.advance(&self.x);
            self.take_over(self.filter.leaks());
        }
        if !self.outputs_now().iter().all(|y| y.is_finite()) {
            // A past that is not known yet, or a step that has left all bounds.
            self.wait();
        }
    }

    fn output(&self, y: &mut [f64]) {
        self.session.output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout(commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.session.snapshot_len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        self.session.snapshot(into);
    }

    /// The filter goes on from the outputs and the coefficients of the snapshot; how uncertain they are stays as it is now.
    fn restore(&mut self, from: &[f64]) {
        self.session.restore(from);
        self.session.weights(&mut self.weights);
        self.scale_outputs();
        let units = self.filter.model().units();
        self.scaled.iter_mut().zip(&self.weights).zip(units).for_each(|((into, w), unit)| *into = w / unit);
        self.filter.set(self.z.iter().copied(), self.scaled.iter().copied());
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout_batch(count, commands, work, y);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        self.session.fork()
    }
}

impl Adapter for KalmanEquations {
    fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn freeze(&mut self, frozen: bool) {
        self.filter.learn(!frozen);
    }

    fn inflate(&mut self, factor: f64) {
        self.filter.inflate(factor);
    }

    fn restart(&mut self) {
        self.filter.restart();
    }

    fn health(&self) -> Health {
        self.filter.health()
    }

    fn memory_len(&self) -> usize {
        self.session.snapshot_len() + self.filter.memory_len()
    }

    fn save(&self, into: &mut [f64]) {
        assert_eq!(into.len(), self.memory_len(), "room for the memory");
        let mut writer = Writer::new(into);
        self.session.snapshot(writer.part(self.session.snapshot_len()));
        self.filter.save(writer.part(self.filter.memory_len()));
    }

    fn load(&mut self, from: &[f64]) {
        assert_eq!(from.len(), self.memory_len(), "a memory of this adapter");
        let mut reader = Reader::new(from);
        self.session.restore(reader.part(self.session.snapshot_len()));
        self.session.weights(&mut self.weights);
        self.filter.load(reader.part(self.filter.memory_len()));
        self.note(Correction::None);
    }

    /// Of outputs and coefficients as the filter knows them, of `Q_h` in each step, and of the measurement:
    ///
    /// ```text
    /// S_n P S_n' + sum_{j<n} Phi_j Q_h Phi_j' + R        S_n = [Phi_n dy_n/dw],  Phi_n = dy_n/dh
    /// ```
    ///
    /// NaN before a run has begun.
    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let (n, count) = (self.z.len(), self.weights.len());
        assert_eq!(deviations.len(), horizons.len() * n, "a row for each horizon");
        let steps = horizons.iter().copied().max().unwrap_or(0);
        let commands = &commands[..steps * self.session.inputs()];
        if self.is_waiting() || commands.iter().any(|c| c.is_nan()) {
            return deviations.fill(f64::NAN);
        }
        let sensitivity = self.filter.model().sensitivity();
        let p = sensitivity.parameters();
        let rows = (steps + 1) * n;
        let (y, rest) =
            work.take(rows * (1 + p) + (n + count + 1) * n + sensitivity.scratch()).split_at_mut(rows);
        let (s, rest) = rest.split_at_mut(rows * p);
        let (by_state, rest) = rest.split_at_mut(n * n);
        let (by_weights, rest) = rest.split_at_mut(count * n);
        let (drifted, scratch) = rest.split_at_mut(n);
        sensitivity.rollout_in(self.session.state(), commands, scratch, y, s);
        drifted.fill(0.0);
        let q = self.filter.state_noise();
        let mut done = 0;
        for (&horizon, into) in horizons.iter().zip(deviations.chunks_exact_mut(n)) {
            let model = self.filter.model();
            for row in s[done * n * p..horizon * n * p].chunks_exact(n * p) {
                for (drifted, row) in drifted.iter_mut().zip(row.chunks_exact(p)) {
                    let by = |(s, scale): (&f64, &f64)| Float::powi(s * scale, 2);
                    *drifted += q * row.iter().zip(model.scale()).map(by).sum::<f64>();
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
                into[i] = drifted[i] + self.filter.noise()[i] * Float::powi(model.scale()[i], 2);
            }
            self.filter.add_variances(by_state, by_weights, into);
            for variance in into.iter_mut() {
                // Rounding; what is no number stays so.
                *variance = Float::sqrt(variance.clamp(0.0, f64::INFINITY));
            }
        }
    }
}
