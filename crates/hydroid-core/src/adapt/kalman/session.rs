//! A recurrent model that learns on the way.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::ahead::Ahead;
use super::courses::Courses;
use super::filter::{Correction, Filter};
use super::network::LearnableNetwork;
use super::rehearsal::{Rehearsal, Rehearser};
use super::tuning::{Tuning, TuningError};
use crate::adapt::memory::{Reader, Writer};
use crate::adapt::{Adapter, Health, Innovation, Outcome, Rejection};
use crate::math::Scalar;
use crate::model::recurrent::{BaseModel, Packed, Recurrent, RecurrentError, RecurrentSession};
use crate::predict::{Predictor, Workspace};

/// Why a model cannot learn so.
#[derive(Clone, Debug, PartialEq)]
pub enum KalmanError {
    /// The model makes no sense.
    Model(RecurrentError),
    /// The tuning does not fit it.
    Tuning(TuningError),
}

impl core::fmt::Display for KalmanError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Model(error) => error.fmt(f),
            Self::Tuning(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for KalmanError {}

/// A session of a [`Recurrent`] model whose hidden state and weights are estimated by a [`Filter`], in scaled units: the
/// tuning is in those of the network's input and output.
///
/// A network that gives the outputs themselves from inputs alone is corrected in both, and its present outputs are what
/// it reads out of its state. One that sees its outputs, or stands on a base, takes the measurements as its inputs: what
/// it gives next is compared with the measurement less the base, and the noise of the measurement it began from counts as
/// noise of that; its present outputs are the measured ones.
///
/// `T` is the precision of the filter; predictions are made in double precision.
///
/// The snapshot is that of a [`RecurrentSession`] with weights of its own.
#[derive(Clone, Debug)]
pub struct KalmanNetwork<T: Scalar> {
    session: RecurrentSession,
    filter: Filter<T, Courses<LearnableNetwork<T>>>,
    rehearser: Option<Rehearser<T>>,
    /// What the network's output is added to, at the present sample.
    base: Vec<f64>,
    /// Input and output of the network, in double precision and in the filter's.
    x: Vec<f64>,
    z: Vec<f64>,
    x_filter: Vec<T>,
    z_filter: Vec<T>,
    /// Hidden state and weights on their way from the filter.
    wide: Vec<f64>,
    outcome: Outcome,
    nis: f64,
    innovations: Vec<Innovation>,
    ahead: Ahead,
}

impl<T: Scalar> KalmanNetwork<T> {
    /// A session at the start of a run, with the model's weights.
    ///
    /// # Errors
    /// If model or tuning make no sense, or do not fit together.
    pub fn new(model: Arc<Recurrent>, tuning: Tuning) -> Result<Self, KalmanError> {
        Self::rehearsed(model, tuning, None)
    }

    /// The same, which rehearses the windows that it is given ([`Adapter::keep`]).
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn rehearsed(
        model: Arc<Recurrent>,
        tuning: Tuning,
        rehearsal: Option<Rehearsal>,
    ) -> Result<Self, KalmanError> {
        if rehearsal.as_ref().is_some_and(|rehearsal| !rehearsal.is_sound()) {
            return Err(KalmanError::Tuning(TuningError::Number("a number of the rehearsal")));
        }
        let session = RecurrentSession::with_own_weights(model).map_err(KalmanError::Model)?;
        let model = session.model();
        let weights: Vec<T> = model.weights.iter().map(|&w| T::of(w)).collect();
        let network = LearnableNetwork::new(Packed::new(model.network, &weights));
        let rehearser = rehearsal.map(|settings| Rehearser::new(&network, settings));
        let courses = Courses::new(network, 1 + usize::from(rehearser.is_some()));
        let filter = Filter::new(courses, tuning).map_err(KalmanError::Tuning)?;
        let outputs = model.outputs();
        Ok(Self {
            base: vec![f64::NAN; outputs],
            x: vec![0.0; model.network.inputs],
            z: vec![0.0; outputs],
            x_filter: vec![T::zero(); model.network.inputs],
            z_filter: vec![T::zero(); outputs],
            wide: vec![0.0; model.network.state_len().max(weights.len())],
            outcome: Outcome::Waiting,
            nis: f64::NAN,
            innovations: Vec::with_capacity(outputs),
            ahead: Ahead::new(model),
            session,
            filter,
            rehearser,
        })
    }

    /// The model with the weights that it was given at first.
    pub fn model(&self) -> &Recurrent {
        self.session.model()
    }

    /// The filter.
    pub fn filter(&self) -> &Filter<T, Courses<LearnableNetwork<T>>> {
        &self.filter
    }

    /// Normalised innovation squared of the last sample; NaN where nothing was learned from.
    pub fn nis(&self) -> f64 {
        self.nis
    }

    /// Whether what it gives is the outputs, from inputs alone.
    fn is_plain(&self) -> bool {
        let model = self.session.model();
        matches!(model.base, BaseModel::Nothing) && !model.feedback
    }

    /// Takes state and weights of the filter into use.
    fn take_over(&mut self, weights: bool) {
        let state = self.filter.state();
        self.session.hidden_mut().iter_mut().zip(state).for_each(|(into, h)| *into = h.wide());
        if weights {
            let wide = &mut self.wide[..self.filter.weights().len()];
            wide.iter_mut().zip(self.filter.weights()).for_each(|(into, w)| *into = w.wide());
            self.session.set_weights(wide);
        }
        if self.is_plain() {
            self.session.read_out();
        }
    }

    /// What the filter made of the measurement that stands in `z`, in units of the outputs.
    fn note(&mut self, correction: Correction) {
        self.innovations.clear();
        self.nis = f64::NAN;
        self.outcome = match correction {
            Correction::None => Outcome::Waiting,
            Correction::Lost => Outcome::Rejected(Rejection::NotFinite),
            Correction::Made { nis, deviations, weight } => {
                self.nis = nis;
                let scale = &self.session.model().scaling.correction_scale;
                let (e, s) = self.filter.innovation();
                self.innovations.extend(e.iter().zip(s).zip(scale).map(|((e, s), scale)| Innovation {
                    value: e.wide() * scale,
                    deviation: num_traits::Float::sqrt(s.wide()) * scale,
                }));
                if weight < 1.0 { Outcome::Inflated { deviations, weight } } else { Outcome::Accepted }
            }
        };
    }
}

impl<T: Scalar> Predictor for KalmanNetwork<T> {
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
        if let Some(rehearser) = &mut self.rehearser {
            rehearser.begin_again();
        }
        self.base.fill(f64::NAN);
        self.note(Correction::None);
    }

    fn observe(&mut self, y: &[f64]) {
        let scale = &self.session.model().scaling.correction_scale;
        for i in 0..y.len() {
            self.z[i] = (y[i] - self.base[i]) / scale[i];
            // What is infinite was not measured.
            self.z_filter[i] = if self.z[i].is_finite() { T::of(self.z[i]) } else { T::nan() };
        }
        // A plain network's outputs are what it reads out of its state, as soon as it has made a step.
        if !(self.is_plain() && self.filter.has_moved()) {
            self.session.observe(y);
        }
        let correction = self.filter.observe(&self.z_filter);
        if correction != Correction::None {
            self.take_over(self.filter.learns());
        }
        self.note(correction);
        if y.iter().any(|y| y.is_infinite()) {
            self.outcome = Outcome::Rejected(Rejection::NotFinite);
        }
    }

    fn advance(&mut self, c: &[f64]) {
        if self.session.is_waiting() {
            // The network of one that hears its outputs rests until it has heard each of them; without feedback it walks
            // on, and the filter with it.
            self.base.fill(f64::NAN);
            if self.session.model().feedback {
                return self.session.advance(c);
            }
        }
        self.session.inputs_of_network(c, &mut self.x);
        for (into, &x) in self.x_filter.iter_mut().zip(&self.x) {
            *into = T::of(x);
        }
        match &self.session.model().base {
            BaseModel::Nothing => self.base.copy_from_slice(&self.session.model().scaling.output_mean),
            BaseModel::Hold => self.session.output(&mut self.base),
            BaseModel::Equations(_) => {}
        }
        self.session.advance(c);
        if let BaseModel::Equations(_) = self.session.model().base {
            // What the equations gave: the outputs less what the network added.
            self.session.output(&mut self.base);
            self.session.correction(&mut self.z);
            self.base.iter_mut().zip(&self.z).for_each(|(base, z)| *base -= z);
        }
        let rehearsed = self.rehearser.as_mut().is_some_and(|rehearser| rehearser.walk(&mut self.filter));
        self.filter.advance(&self.x_filter);
        if self.filter.state().iter().all(|h| h.is_finite()) {
            self.take_over(rehearsed || self.filter.leaks());
        } else {
            // Whatever is measured later, it would stay so.
            self.filter.restart();
            self.filter.reset();
            if let Some(rehearser) = &mut self.rehearser {
                rehearser.begin_again();
            }
            self.session.hidden_mut().fill(0.0);
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

    /// The filter goes on from the state and the weights of the snapshot; how uncertain they are stays as it is now.
    fn restore(&mut self, from: &[f64]) {
        self.session.restore(from);
        let narrow = |x: &f64| T::of(*x);
        self.filter.set(self.session.hidden().iter().map(narrow), self.session.weights().iter().map(narrow));
        self.base.fill(f64::NAN);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout_batch(count, commands, work, y);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        self.session.fork()
    }
}

impl<T: Scalar> Adapter for KalmanNetwork<T> {
    fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }

    fn weights(&self) -> &[f64] {
        self.session.weights()
    }

    fn freeze(&mut self, frozen: bool) {
        self.filter.learn(!frozen);
    }

    fn inflate(&mut self, factor: f64) {
        self.filter.inflate(T::of(factor));
    }

    fn restart(&mut self) {
        self.filter.restart();
    }

    fn rehearsal(&self) -> Option<&Rehearsal> {
        self.rehearser.as_ref().map(Rehearser::settings)
    }

    fn keep(&mut self, outputs: &[f64], commands: &[f64]) {
        let (q, m) = (self.session.outputs(), self.session.inputs());
        let count = (outputs.len() / q).min(commands.len() / m);
        let Some(wash_in) = self.rehearsal().and_then(|own| count.checked_sub(own.samples + 1)) else {
            return;
        };
        // The network from shore, with a filter on its state alone, finds what it is given and the state at the start.
        let Ok(mut walker) = Self::new(self.session.shared_model().clone(), self.filter.known()) else {
            return;
        };
        let Some((state, samples)) = self.rehearser.as_mut().and_then(Rehearser::room) else { return };
        let rows = outputs.chunks_exact(q).zip(commands.chunks_exact(m)).take(count);
        for (y, c) in rows.clone().take(wash_in) {
            walker.observe(y);
            walker.advance(c);
        }
        walker.observe(&outputs[wash_in * q..(wash_in + 1) * q]);
        state.copy_from_slice(walker.filter.state());
        let commanded = commands.chunks_exact(m).skip(wash_in);
        for (((x, z), (y, _)), c) in samples.zip(rows.skip(wash_in + 1)).zip(commanded) {
            walker.advance(c);
            walker.observe(y);
            x.copy_from_slice(&walker.x_filter);
            z.copy_from_slice(&walker.z_filter);
        }
    }

    fn health(&self) -> Health {
        self.filter.health()
    }

    fn memory_len(&self) -> usize {
        let rehearser = self.rehearser.as_ref().map_or(0, Rehearser::memory_len);
        self.session.snapshot_len() + self.base.len() + self.filter.memory_len() + rehearser
    }

    fn save(&self, into: &mut [f64]) {
        let mut writer = Writer::new(into);
        self.session.snapshot(writer.part(self.session.snapshot_len()));
        writer.numbers(&self.base);
        self.filter.save(writer.part(self.filter.memory_len()));
        if let Some(rehearser) = &self.rehearser {
            rehearser.save(&mut writer);
        }
    }

    fn load(&mut self, from: &[f64]) {
        let mut reader = Reader::new(from);
        self.session.restore(reader.part(self.session.snapshot_len()));
        reader.numbers(&mut self.base);
        self.filter.load(reader.part(self.filter.memory_len()));
        if let Some(rehearser) = &mut self.rehearser {
            rehearser.load(&mut reader);
        }
        self.note(Correction::None);
    }

    /// Of weights, state and measurement together, through the rollout's gradients; NaN for a network on equations.
    /// Allocates where a horizon is longer than any before.
    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        _: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let q = self.session.outputs();
        assert_eq!(deviations.len(), horizons.len() * q, "one row of deviations for each horizon");
        let last = horizons.iter().copied().max().unwrap_or(0);
        let commands = &commands[..last * self.session.inputs()];
        if self.session.is_waiting() || !self.ahead.walk(&self.session, commands) {
            return deviations.fill(f64::NAN);
        }
        let scale = &self.session.model().scaling.correction_scale;
        for (&horizon, into) in horizons.iter().zip(deviations.chunks_exact_mut(q)) {
            self.ahead.back(&self.session, horizon);
            let noise = |i: usize| self.filter.noise()[i].wide() * scale[i] * scale[i];
            for (i, into) in into.iter_mut().enumerate() {
                // Of the measurement itself, and of those that the rollout begins from.
                let begun = |j: usize| num_traits::Float::powi(self.ahead.outputs[j * q + i], 2) * noise(j);
                *into = noise(i) + (0..q).map(begun).sum::<f64>();
            }
            self.filter.add_variances(&self.ahead.state, &self.ahead.weights, into);
            for variance in into.iter_mut() {
                *variance = num_traits::Float::sqrt(variance.max(0.0));
            }
        }
    }
}
