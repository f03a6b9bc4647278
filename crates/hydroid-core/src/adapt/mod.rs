//! Learning on board, sample by sample.
//!
//! An [`Adapter`] is a prediction session ([`Predictor`]) that owns a model and changes its weights as it
//! walks along a run. Whoever can walk a session (evaluation, a controller) lets it learn on the way, and its
//! snapshots carry the weights of the moment: a rollout from a snapshot is made by the model as it was then.
//!
//! | adapter | what it adapts, and how |
//! | --- | --- |
//! | [`RecursiveEquations`] | coefficients of sparse equations, by [`RecursiveLeastSquares`] on increments |
//! | [`KalmanEquations`](kalman::KalmanEquations) | the same, with the outputs, by an extended Kalman [`Filter`](kalman::Filter) |
//! | [`KalmanPlant`](kalman::KalmanPlant) | motion, propeller force and parameters of a vessel, by such a filter |
//! | [`KalmanNetwork`](kalman::KalmanNetwork) | hidden state and weights of a recurrent network, by such a filter |
//! | [`DirectLastLayer`] | the last layer of a direct predictor, all steps of its horizon at once, by [`RecursiveLeastSquares`] |
//! | [`ExpertMixture`] | several of these at different paces, weighed by what they have predicted of late |
//! | [`Guard`](guard::Guard) | what another one does, as long as that is to be trusted |

mod equations;
mod expert_mixture;
pub mod guard;
mod increments;
mod innovation_gate;
pub mod kalman;
mod last_layer;
mod least_squares;
mod memory;
mod options;
mod parametric_session;
mod prediction_variance;
mod scale;
mod ud_factor;

use crate::predict::{Predictor, Workspace};

pub use equations::RecursiveEquations;
pub use expert_mixture::{ExpertMixture, ExpertMixtureOptions};
pub use innovation_gate::InnovationGate;
pub use last_layer::{DirectLastLayer, LastLayerError, LastLayerOptions, SHORTEST_FORGETTING};
pub use least_squares::RecursiveLeastSquares;
pub use options::{RecursiveOptions, RecursiveOptionsError};
pub use parametric_session::ParametricSession;
pub use scale::rms_over_range;
pub use ud_factor::UdFactor;

/// A prediction session that learns along the run.
///
/// It learns in [`observe`](Predictor::observe), from all samples up to this one; [`outcome`](Self::outcome) reports the result.
/// A [`reset`](Predictor::reset) starts a run and keeps what was learned.
pub trait Learning: Predictor {
    /// Effect of the last observed sample on the weights.
    fn outcome(&self) -> Outcome;

    /// Innovation of each output at the last sample and its standard deviation, in the unit of the output, before the update.
    /// Empty if the outcome is [`Outcome::Waiting`].
    fn innovations(&self) -> &[Innovation];

    /// Current weights in the units and order of the model. A [`snapshot`](Predictor::snapshot) ends with as many numbers,
    /// which determine them.
    fn weights(&self) -> &[f64];

    /// Stops or resumes learning. A frozen adapter predicts with its current weights.
    fn freeze(&mut self, frozen: bool);

    /// Multiplies the noise variance of the next measurement.
    fn scale_noise(&mut self, factor: f64);

    /// Resets the covariance of the weights to its initial value. The weights stay.
    fn restart(&mut self);

    /// Indicators of the covariance.
    fn health(&self) -> Health;

    /// The guard that this is, if it is one.
    fn guard(&self) -> Option<&guard::Guard> {
        None
    }

    /// Standard deviations of the measurements at the given `horizons` \[samples\] (ascending, at least 1) under the commands
    /// `c_k, ..` (rows of `commands`, as many as the last horizon): from the uncertainty of weights and state and the noise of
    /// the measurement. `deviations` receives `horizons x outputs` numbers in the units of the outputs; NaN where the adapter
    /// has no estimate. Allocates only while `work` grows.
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
    /// Length of [`save`](Self::save); constant over the life of the adapter.
    fn memory_len(&self) -> usize;

    /// Writes all numbers that predictions and further learning depend on: state and weights, as in a
    /// [`snapshot`](Predictor::snapshot), covariances, incomplete windows and counters.
    ///
    /// # Panics
    /// If `into` has not [`memory_len`](Self::memory_len) numbers.
    fn save(&self, into: &mut [f64]);

    /// Restores what [`save`](Self::save) of an adapter of the same model and options wrote: from the next sample on both
    /// continue identically to the last bit. Until then the [`outcome`](Learning::outcome) is [`Outcome::Waiting`].
    ///
    /// # Panics
    /// If `from` has not [`memory_len`](Self::memory_len) numbers.
    fn load(&mut self, from: &[f64]);
}

/// Rehearsal of windows of the training data beside the run. The defaults are for adapters that do not rehearse.
pub trait Rehearsing {
    /// Options of the rehearsal; `None` without rehearsal.
    fn rehearsal(&self) -> Option<&kalman::RehearsalOptions> {
        None
    }

    /// Stores a window while there is room: measured `outputs` and `commands` of consecutive samples, row by row. The last
    /// [`samples`](kalman::RehearsalOptions::samples) are stored, the samples before wash in. Allocates.
    fn store_window(&mut self, outputs: &[f64], commands: &[f64]) {
        let _ = (outputs, commands);
    }
}

/// A session that learns, can be saved, and may rehearse.
pub trait Adapter: Learning + SaveState + Rehearsing {}

impl<T: Learning + SaveState + Rehearsing + ?Sized> Adapter for T {}

/// Indicators of a covariance that precede errors of the predictions. NaN for unknown values, and for values that are correct
/// by construction.
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

/// What a sample did to the weights.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Outcome {
    /// There was nothing to learn from at this sample: a window is filling, a value is missing, or the adapter
    /// is frozen.
    #[default]
    Waiting,
    /// Learned from with full weight.
    Accepted,
    /// Learned from with less weight, as from a noisier measurement.
    Inflated {
        /// The largest innovation, in standard deviations.
        deviations: f64,
        /// Share of the full weight.
        weight: f64,
    },
    /// Not learned from.
    Rejected(Rejection),
    /// The weights went back to earlier ones.
    RolledBack,
}

/// Why a sample was not learned from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rejection {
    /// An innovation farther off than anything that noise explains.
    Outlier {
        /// The largest innovation, in standard deviations.
        deviations: f64,
    },
    /// Infinite, or so large that the regression overflows.
    NotFinite,
}

/// How far an observation was from what was expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Innovation {
    /// Observed less expected.
    pub value: f64,
    /// Standard deviation expected of it: of the noise and of the weights together.
    pub deviation: f64,
}
