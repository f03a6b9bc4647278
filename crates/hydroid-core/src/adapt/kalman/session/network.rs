//! The session of a recurrent network.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::super::filter::Filter;
use super::super::learnable::{LearnableNetwork, SharedWeightStates};
use super::super::options::{FilterOptions, FilterOptionsError};
use super::super::rehearsal::{Rehearsal, RehearsalOptions};
use super::super::rollout_gradient::RolloutGradient;
use super::{KalmanSession, ModelKind};
use crate::memory::Memory;
use crate::model::recurrent::{BaseModel, Packed, Recurrent, RecurrentError, RecurrentSession};
use crate::predict::{Predictor, Workspace};

/// Reasons why a network cannot learn by the filter.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum KalmanError {
    #[error(transparent)]
    Model(RecurrentError),
    #[error(transparent)]
    Options(FilterOptionsError),
}

/// A [`KalmanSession`] of a [`Recurrent`] model: hidden state and weights are estimated, in the units of input and
/// output of the network.
///
/// For a network without feedback and base, the present outputs are the output of the network at the estimated state. A
/// network with feedback or a base has the measurements as inputs: its next output is compared with the measurement
/// less the base, the noise of the measurement at the start of the step counts as noise of the output, and the present
/// outputs are the measured ones.
pub type KalmanNetwork = KalmanSession<NetworkKind>;

/// The part of a [`KalmanNetwork`] outside filter and measurement.
#[derive(Clone, Debug)]
pub struct NetworkKind {
    session: RecurrentSession,
    rehearsal: Option<Rehearsal>,
    /// Base at the present sample, to which the output of the network is added.
    base: Vec<f64>,
    x: Vec<f64>,
    correction: Vec<f64>,
    gradient: RolloutGradient,
}

impl KalmanNetwork {
    /// A session at the start of a run, with the weights of the model.
    ///
    /// # Errors
    /// If model or options are not valid, or do not fit together.
    pub fn new(model: Arc<Recurrent>, options: FilterOptions) -> Result<Self, KalmanError> {
        Self::with_rehearsal(model, options, None)
    }

    /// A session that rehearses the windows given by [`store_window`](crate::adapt::Rehearsing::store_window).
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_rehearsal(
        model: Arc<Recurrent>,
        options: FilterOptions,
        rehearsal: Option<RehearsalOptions>,
    ) -> Result<Self, KalmanError> {
        if rehearsal.as_ref().is_some_and(|rehearsal| !rehearsal.is_valid()) {
            return Err(KalmanError::Options(FilterOptionsError::Rehearsal));
        }
        let session = RecurrentSession::with_own_weights(model).map_err(KalmanError::Model)?;
        Self::around(session, options, rehearsal)
    }

    fn around(
        session: RecurrentSession,
        options: FilterOptions,
        rehearsal: Option<RehearsalOptions>,
    ) -> Result<Self, KalmanError> {
        let model = session.model();
        let network = LearnableNetwork::new(Packed::new(model.network, &model.weights));
        let rehearsal = rehearsal.map(|options| Rehearsal::new(&network, options));
        let states = SharedWeightStates::new(network, 1 + usize::from(rehearsal.is_some()));
        let filter = Filter::new(states, options).map_err(KalmanError::Options)?;
        let kind = NetworkKind {
            base: vec![f64::NAN; model.outputs()],
            x: vec![0.0; model.network.inputs],
            correction: vec![0.0; model.outputs()],
            gradient: RolloutGradient::new(model),
            session,
            rehearsal,
        };
        Ok(Self::of(kind, filter))
    }

    /// A session that filters the hidden state of a network without feedback and base, with constant weights. `process`
    /// is the variance that each state gains in a sample, `initial` its variance at the start of a run, `noise` the
    /// variance of the measurement of each output, all in scaled units.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn state_filter(
        model: Arc<Recurrent>,
        process: f64,
        initial: f64,
        noise: &[f64],
    ) -> Result<Self, KalmanError> {
        let options = FilterOptions::uniform(model.weights.len(), 0.0, 0.0, (initial, process), noise);
        let session = RecurrentSession::new(model).map_err(KalmanError::Model)?;
        let mut filtered = Self::around(session, options, None)?;
        filtered.filter.learn(false);
        Ok(filtered)
    }

    /// The model with its initial weights.
    pub fn model(&self) -> &Recurrent {
        self.kind.session.model()
    }
}

impl NetworkKind {
    fn is_open_loop(&self) -> bool {
        let model = self.session.model();
        matches!(model.base, BaseModel::Nothing) && !model.feedback
    }
}

impl ModelKind for NetworkKind {
    type Model = SharedWeightStates<LearnableNetwork>;
    type Session = RecurrentSession;

    fn session(&self) -> &RecurrentSession {
        &self.session
    }

    fn session_mut(&mut self) -> &mut RecurrentSession {
        &mut self.session
    }

    fn weights(&self) -> &[f64] {
        self.session.weights()
    }

    fn output_scale<'a>(&'a self, _: &'a Self::Model) -> &'a [f64] {
        &self.session.model().scaling.correction_scale
    }

    fn reset(&mut self) {
        if let Some(rehearsal) = &mut self.rehearsal {
            rehearsal.begin_window();
        }
        self.base.fill(f64::NAN);
    }

    fn take_measurement(&mut self, filter: &mut Filter<Self::Model>, y: &[f64], z: &mut [f64]) -> bool {
        let scale = &self.session.model().scaling.correction_scale;
        for i in 0..y.len() {
            let scaled = (y[i] - self.base[i]) / scale[i];
            z[i] = if scaled.is_finite() { scaled } else { f64::NAN };
        }
        // After a step the outputs of an open-loop network are those at the estimated state.
        if !(self.is_open_loop() && filter.has_stepped()) {
            self.session.observe(y);
        }
        true
    }

    fn sync_session(&mut self, filter: &Filter<Self::Model>, weights: bool) {
        let state = filter.state();
        self.session.hidden_mut().iter_mut().zip(state).for_each(|(into, &h)| *into = h);
        if weights {
            self.session.set_weights(filter.weights());
        }
        if self.is_open_loop() {
            self.session.read_out();
        }
    }

    fn recover(&mut self, filter: &Filter<Self::Model>) {
        self.sync_session(filter, filter.learns());
    }

    fn advance(&mut self, filter: &mut Filter<Self::Model>, c: &[f64]) {
        // Before all outputs were measured there is no prediction to learn from; a network without feedback follows the commands.
        let waiting = self.session.is_waiting();
        if waiting {
            self.base.fill(f64::NAN);
            if self.session.model().feedback {
                return self.session.advance(c);
            }
        }
        self.session.inputs_of_network(c, &mut self.x);
        match &self.session.model().base {
            _ if waiting => {}
            BaseModel::Nothing => self.base.copy_from_slice(&self.session.model().scaling.output_mean),
            BaseModel::Hold => self.session.output(&mut self.base),
            BaseModel::Equations(_) => {}
        }
        self.session.advance(c);
        if !waiting && let BaseModel::Equations(_) = self.session.model().base {
            // The prediction of the equations is the output less the correction by the network.
            self.session.output(&mut self.base);
            self.session.correction(&mut self.correction);
            self.base.iter_mut().zip(&self.correction).for_each(|(base, correction)| *base -= correction);
        }
        let rehearsed = self.rehearsal.as_mut().is_some_and(|rehearsal| rehearsal.advance(filter));
        filter.advance(&self.x);
        if filter.state().iter().all(|h| h.is_finite()) {
            self.sync_session(filter, rehearsed || filter.leaks());
        } else {
            // Later measurements cannot make the state finite again.
            filter.restart();
            filter.reset();
            if let Some(rehearsal) = &mut self.rehearsal {
                rehearsal.begin_window();
            }
            self.session.hidden_mut().fill(0.0);
            // The weights have leaked.
            self.session.set_weights(filter.weights());
        }
    }

    fn sync_filter(&mut self, filter: &mut Filter<Self::Model>) {
        filter.set(self.session.hidden().iter().copied(), self.session.weights().iter().copied());
        self.base.fill(f64::NAN);
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.base);
        if let Some(rehearsal) = &mut self.rehearsal {
            rehearsal.visit_state(memory);
        }
    }

    /// From the uncertainty of weights, state and measurements, by the gradients of the rollout; NaN for a network on
    /// equations. Allocates for a horizon longer than any before.
    fn deviations(
        &mut self,
        filter: &mut Filter<Self::Model>,
        commands: &[f64],
        horizons: &[usize],
        _: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let q = self.session.outputs();
        assert_eq!(deviations.len(), horizons.len() * q, "one row of deviations for each horizon");
        let last = horizons.iter().copied().max().unwrap_or(0);
        let commands = &commands[..last * self.session.inputs()];
        if self.session.is_waiting() || !self.gradient.roll_out(&self.session, commands) {
            return deviations.fill(f64::NAN);
        }
        let scale = &self.session.model().scaling.correction_scale;
        for (h, (&horizon, into)) in horizons.iter().zip(deviations.chunks_exact_mut(q)).enumerate() {
            self.gradient.back_propagate(&self.session, horizon);
            let noise = |i: usize| filter.noise()[i] * scale[i] * scale[i];
            for (i, into) in into.iter_mut().enumerate() {
                // The noise at the target and at the origin.
                let initial = |j: usize| Float::powi(self.gradient.outputs[j * q + i], 2) * noise(j);
                *into = noise(i) + (0..q).map(initial).sum::<f64>();
            }
            filter.set_gradients(h * q, q, &self.gradient.state, &self.gradient.weights);
        }
        filter.add_variances(deviations);
        for variance in deviations.iter_mut() {
            *variance = Float::sqrt(variance.max(0.0));
        }
    }

    fn rehearsal(&self) -> Option<&RehearsalOptions> {
        self.rehearsal.as_ref().map(Rehearsal::options)
    }

    fn store_window(&mut self, filter: &Filter<Self::Model>, outputs: &[f64], commands: &[f64]) {
        let (q, m) = (self.session.outputs(), self.session.inputs());
        let count = (outputs.len() / q).min(commands.len() / m);
        let Some(wash_in) = self.rehearsal().and_then(|own| count.checked_sub(own.samples + 1)) else {
            return;
        };
        // The initial network with a filter of its state alone gives the initial state, and inputs and outputs.
        let options = filter.without_weight_uncertainty();
        let Ok(mut initial) = KalmanNetwork::new(self.session.shared_model().clone(), options) else {
            return;
        };
        let Some((state, samples)) = self.rehearsal.as_mut().and_then(Rehearsal::next_window) else { return };
        let rows = outputs.chunks_exact(q).zip(commands.chunks_exact(m)).take(count);
        for (y, c) in rows.clone().take(wash_in) {
            initial.observe(y);
            initial.advance(c);
        }
        initial.observe(&outputs[wash_in * q..(wash_in + 1) * q]);
        state.copy_from_slice(initial.filter.state());
        let commanded = commands.chunks_exact(m).skip(wash_in);
        for (((x, z), (y, _)), c) in samples.zip(rows.skip(wash_in + 1)).zip(commanded) {
            initial.advance(c);
            initial.observe(y);
            x.copy_from_slice(&initial.kind.x);
            z.copy_from_slice(&initial.z);
        }
    }
}
