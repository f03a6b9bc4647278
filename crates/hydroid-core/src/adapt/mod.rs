//! Online adaptation, sample by sample.
//!
//! An [`Adapter`] is a prediction session ([`Predictor`]) that adapts its own weights along a run. Evaluation and
//! controllers use it as any session. Its snapshots contain the weights, and a rollout from a snapshot uses them.
//!
//! | adapter | adapted weights and method |
//! | --- | --- |
//! | [`RecursiveEquations`] | coefficients of sparse equations, by [`RecursiveLeastSquares`] on increments |
//! | [`KalmanEquations`](kalman::KalmanEquations) | outputs and coefficients of sparse equations, by an extended Kalman filter |
//! | [`KalmanPlant`](kalman::KalmanPlant) | motion, positions of the actuators and numbers of a vessel, by the filter |
//! | [`KalmanNetwork`](kalman::KalmanNetwork) | hidden state and weights of a recurrent network, by the filter |
//! | [`DirectLastLayer`] | last layer of a direct predictor, by [`RecursiveLeastSquares`] |
//! | [`ExpertMixture`] | several [`RecursiveEquations`] with different priors, weighted by their past errors |
//! | [`CommitteeSession`] | coefficients of the members of a committee, by [`RecursiveLeastSquares`] on averaged increments |
//! | [`Guard`](guard::Guard) | supervises another adapter |

mod committee;
mod equations;
mod expert_mixture;
pub mod guard;
mod increments;
mod innovation_gate;
pub mod kalman;
mod last_layer;
mod least_squares;
mod options;
mod parametric_session;
mod prediction_variance;
mod scale;
mod ud_factor;

use crate::memory::Memory;
use crate::predict::{Predictor, Workspace};

#[doc(hidden)]
pub use committee::LearnerConstants;
pub use committee::{CommitteeSession, increment_stride};
pub use equations::RecursiveEquations;
#[doc(hidden)]
pub use equations::{EquationsConstants, GroupConstants};
pub use expert_mixture::{ExpertMixture, ExpertMixtureOptions};
pub use innovation_gate::InnovationGate;
#[doc(hidden)]
pub use innovation_gate::NoiseConstants;
pub use last_layer::{DirectLastLayer, LastLayerError, LastLayerOptions, SHORTEST_FORGETTING};
pub use least_squares::RecursiveLeastSquares;
pub use options::{RecursiveOptions, RecursiveOptionsError};
pub use parametric_session::ParametricSession;
pub use scale::rms_over_range;
pub use ud_factor::UdFactor;

/// A prediction session that adapts its weights along the run.
///
/// It learns in [`observe`](Predictor::observe); [`outcome`](Self::outcome) reports the result. A
/// [`reset`](Predictor::reset) starts a run and preserves the weights.
pub trait Learning: Predictor {
    /// Effect of the last observed sample on the weights.
    fn outcome(&self) -> Outcome;

    /// Innovation and standard deviation of each output at the last sample before the update, in its unit.
    /// Empty if the outcome is [`Outcome::Waiting`].
    fn innovations(&self) -> &[Innovation];

    /// Current weights in the units and order of the model. A [`snapshot`](Predictor::snapshot) ends with as many
    /// numbers, which determine them.
    fn weights(&self) -> &[f64];

    /// Stops or resumes learning. A frozen adapter predicts with its current weights.
    fn freeze(&mut self, frozen: bool);

    /// Multiplies the noise variance of the next measurement.
    fn scale_noise(&mut self, factor: f64);

    /// Resets the covariance of the weights to its initial value. The weights stay.
    fn restart(&mut self);

    /// Indicators of the covariance.
    fn health(&self) -> Health;

    /// This session as a guard, if it is one.
    fn guard(&self) -> Option<&guard::Guard>;

    /// Standard deviations of the measurements at the `horizons` \[samples\] (ascending, at least 1) under the commands
    /// `c_k, ..` (rows of `commands`, as many as the last horizon), from the uncertainty of weights and state and from
    /// the measurement noise. `deviations` receives `horizons x outputs` numbers in the units of the outputs; NaN where
    /// the adapter has no estimate. Allocates only while `work` grows.
    ///
    /// # Panics
    /// If the lengths do not fit together.
    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    );
}

/// State that can be saved and loaded.
pub trait SaveState {
    /// Visits the numbers that predictions and further learning depend on: the [`snapshot`](Predictor::snapshot),
    /// covariances, incomplete windows and counters.
    fn visit_state(&mut self, memory: &mut Memory<'_>);

    /// Length of [`save`](Self::save); constant over the life of the adapter.
    fn memory_len(&mut self) -> usize {
        Memory::len_of(|memory| self.visit_state(memory))
    }

    /// Writes the numbers of the state.
    ///
    /// # Panics
    /// If `into` has not [`memory_len`](Self::memory_len) numbers.
    fn save(&mut self, into: &mut [f64]) {
        assert_eq!(into.len(), self.memory_len(), "room for the memory");
        self.visit_state(&mut Memory::Saving(into));
    }

    /// Restores the numbers that [`save`](Self::save) of an adapter of the same model and options wrote. Both continue
    /// identically to the last bit; until the next sample the [`outcome`](Learning::outcome) is [`Outcome::Waiting`].
    ///
    /// # Panics
    /// If `from` has not [`memory_len`](Self::memory_len) numbers.
    fn load(&mut self, from: &[f64]) {
        assert_eq!(from.len(), self.memory_len(), "a memory of this adapter");
        self.visit_state(&mut Memory::Loading(from));
    }

    /// Whether the memory can be that of a session: weights and states are finite, variances finite and not negative.
    /// A file or a fault of the arithmetic may violate this; [`load`](Self::load) of a sound memory repairs it. Cheap
    /// beside an update.
    fn is_sound(&self) -> bool;
}

/// Whether all numbers are finite and none is negative.
pub(crate) fn are_variances(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.is_finite() && *x >= 0.0)
}

/// Rehearsal of windows of the training data beside the run.
pub trait Rehearsing {
    /// Options of the rehearsal; `None` without rehearsal.
    fn rehearsal(&self) -> Option<&kalman::RehearsalOptions>;

    /// Stores a window while there is room: measured `outputs` and `commands` of consecutive samples, row by row. The
    /// last [`samples`](kalman::RehearsalOptions::samples) are stored, the samples before settle the state. Allocates.
    fn store_window(&mut self, outputs: &[f64], commands: &[f64]);
}

/// A session that learns, can be saved, and may rehearse.
pub trait Adapter: Learning + SaveState + Rehearsing {}

impl<T: Learning + SaveState + Rehearsing + ?Sized> Adapter for T {}

/// Indicators of a covariance that precede prediction errors; NaN if unknown or correct by construction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Health {
    /// The smallest variance of a weight or a hidden state, in its scaled unit.
    pub least_variance: f64,
    /// The smallest `S_ii / R_ii` of the last measurement; at least 1 up to rounding.
    pub min_s_over_r: f64,
}

impl Health {
    /// No indicator is known.
    pub const UNKNOWN: Self = Self { least_variance: f64::NAN, min_s_over_r: f64::NAN };
}

/// Effect of a sample on the weights.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Outcome {
    /// No update: a window is incomplete, a value is missing, or the adapter is frozen.
    #[default]
    Waiting,
    /// Update with full weight.
    Accepted,
    /// Update with a reduced weight, equivalent to a larger noise variance.
    Inflated {
        /// The largest innovation, in standard deviations.
        deviations: f64,
        /// Weight relative to an accepted sample.
        weight: f64,
    },
    /// No update.
    Rejected(Rejection),
    /// The weights were restored from an earlier snapshot.
    RolledBack,
}

/// Reason for rejecting a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// An innovation exceeds the upper threshold of the gate.
    Outlier {
        /// The largest innovation, in standard deviations.
        deviations: f64,
    },
    /// A value is infinite, or its square overflows.
    NotFinite,
}

/// Innovation of one output: measurement minus prediction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Innovation {
    /// Measurement minus prediction.
    pub value: f64,
    /// Its standard deviation, from measurement noise and weight uncertainty.
    pub deviation: f64,
}
