//! The session of a model with state and weights estimated by a filter.

mod equations;
mod network;
mod plant;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::filter::{Correction, Filter};
use super::learnable::Learnable;
use super::rehearsal::RehearsalOptions;
use crate::adapt::{Health, Innovation, Learning, Outcome, Rehearsing, Rejection, SaveState};
use crate::memory::Memory;
use crate::predict::{Predictor, Workspace, plain};

pub use equations::{EquationsKind, KalmanEquations};
pub use network::{KalmanError, KalmanNetwork, NetworkKind};
pub use plant::{KalmanPlant, PlantKind};

/// Connection of a prediction session with the filter, for one kind of model.
pub trait ModelKind: Clone + Send + Sync {
    /// The model of the filter.
    type Model: Learnable;
    /// The prediction session; its snapshots contain the weights.
    type Session: Predictor;

    /// The prediction session.
    fn session(&self) -> &Self::Session;

    /// The prediction session, mutable.
    fn session_mut(&mut self) -> &mut Self::Session;

    /// See [`Learning::weights`].
    fn weights(&self) -> &[f64];

    /// Unit of each scaled output.
    fn output_scale<'a>(&'a self, model: &'a Self::Model) -> &'a [f64];

    /// Starts a run.
    fn reset(&mut self) {}

    /// Writes the measurement `y` of a sample into `z`, scaled, with NaN for missing and infinite values. Returns false
    /// if the sample starts a run, or none has started: the filter then has no measurement update.
    fn take_measurement(&mut self, filter: &mut Filter<Self::Model>, y: &[f64], z: &mut [f64]) -> bool;

    /// Copies the state of the filter into the session, and its weights if they changed.
    fn sync_session(&mut self, filter: &Filter<Self::Model>, weights: bool);

    /// Continues after [`Correction::Diverged`].
    fn recover(&mut self, filter: &Filter<Self::Model>);

    /// Advances session and filter under the command `c`.
    fn advance(&mut self, filter: &mut Filter<Self::Model>, c: &[f64]);

    /// Copies state and weights of the restored session into the filter.
    fn sync_filter(&mut self, filter: &mut Filter<Self::Model>);

    /// Visits all numbers that the model continues from, outside session and filter. A loaded session was restored before.
    fn visit_state(&mut self, _memory: &mut Memory<'_>) {}

    /// See [`Learning::deviations`].
    fn deviations(
        &mut self,
        filter: &mut Filter<Self::Model>,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    );

    /// See [`Rehearsing::rehearsal`].
    fn rehearsal(&self) -> Option<&RehearsalOptions> {
        None
    }

    /// See [`Rehearsing::store_window`].
    fn store_window(&mut self, _filter: &Filter<Self::Model>, _outputs: &[f64], _commands: &[f64]) {}
}

/// A session whose state and weights are estimated by a [`Filter`], in the scaled units of its options.
///
/// Snapshots are those of the prediction session. [`restore`](Predictor::restore) sets state and weights of the filter;
/// its covariance stays. A second measurement of one sample is not used.
#[derive(Clone, Debug)]
pub struct KalmanSession<K: ModelKind> {
    kind: K,
    filter: Filter<K::Model>,
    z: Vec<f64>,
    outcome: Outcome,
    nis: f64,
    innovations: Vec<Innovation>,
}

impl<K: ModelKind> KalmanSession<K> {
    fn of(kind: K, filter: Filter<K::Model>) -> Self {
        let outputs = kind.session().outputs();
        Self {
            kind,
            filter,
            z: vec![f64::NAN; outputs],
            outcome: Outcome::Waiting,
            nis: f64::NAN,
            innovations: Vec::with_capacity(outputs),
        }
    }

    /// The filter.
    pub fn filter(&self) -> &Filter<K::Model> {
        &self.filter
    }

    /// Normalised innovation squared of the last sample; NaN if there was no measurement update.
    pub fn nis(&self) -> f64 {
        self.nis
    }

    fn record_update(&mut self, correction: Correction) {
        self.innovations.clear();
        self.nis = f64::NAN;
        self.outcome = match correction {
            Correction::None => Outcome::Waiting,
            Correction::Diverged => Outcome::Rejected(Rejection::NotFinite),
            Correction::Applied { nis, deviations, weight } => {
                self.nis = nis;
                let (e, s) = self.filter.innovation();
                let scale = self.kind.output_scale(self.filter.model());
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

impl<K: ModelKind> Predictor for KalmanSession<K> {
    plain!(over_ground advance_observe rollout_snapshots);

    fn outputs(&self) -> usize {
        self.kind.session().outputs()
    }

    fn inputs(&self) -> usize {
        self.kind.session().inputs()
    }

    fn warm_up(&self) -> usize {
        self.kind.session().warm_up()
    }

    fn reset(&mut self) {
        self.kind.session_mut().reset();
        self.filter.reset();
        self.kind.reset();
        self.record_update(Correction::None);
    }

    fn observe(&mut self, y: &[f64]) {
        let correction = if self.kind.take_measurement(&mut self.filter, y, &mut self.z) {
            self.filter.observe(&self.z)
        } else {
            Correction::None
        };
        match correction {
            Correction::None => {}
            Correction::Applied { .. } => self.kind.sync_session(&self.filter, self.filter.learns()),
            Correction::Diverged => self.kind.recover(&self.filter),
        }
        self.record_update(correction);
        if y.iter().any(|y| y.is_infinite()) {
            self.outcome = Outcome::Rejected(Rejection::NotFinite);
        }
    }

    fn advance(&mut self, c: &[f64]) {
        self.kind.advance(&mut self.filter, c);
    }

    fn output(&self, y: &mut [f64]) {
        self.kind.session().output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.kind.session().rollout(commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.kind.session().snapshot_len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        self.kind.session().snapshot(into);
    }

    fn restore(&mut self, from: &[f64]) {
        self.kind.session_mut().restore(from);
        self.kind.sync_filter(&mut self.filter);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.kind.session().rollout_batch(count, commands, work, y);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        self.kind.session().fork()
    }
}

impl<K: ModelKind> Learning for KalmanSession<K> {
    plain!(no_guard);

    fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }

    fn weights(&self) -> &[f64] {
        self.kind.weights()
    }

    fn freeze(&mut self, frozen: bool) {
        self.filter.learn(!frozen);
    }

    fn scale_noise(&mut self, factor: f64) {
        self.filter.scale_noise(factor);
    }

    fn restart(&mut self) {
        self.filter.restart();
    }

    fn health(&self) -> Health {
        self.filter.health()
    }

    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        self.kind.deviations(&mut self.filter, commands, horizons, work, deviations);
    }
}

impl<K: ModelKind> SaveState for KalmanSession<K> {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.session(self.kind.session_mut());
        self.kind.visit_state(memory);
        self.filter.visit_state(memory);
        if memory.is_loading() {
            self.record_update(Correction::None);
        }
    }

    fn is_sound(&self) -> bool {
        self.filter.is_sound()
    }
}

impl<K: ModelKind> Rehearsing for KalmanSession<K> {
    fn rehearsal(&self) -> Option<&RehearsalOptions> {
        self.kind.rehearsal()
    }

    fn store_window(&mut self, outputs: &[f64], commands: &[f64]) {
        self.kind.store_window(&self.filter, outputs, commands);
    }
}
