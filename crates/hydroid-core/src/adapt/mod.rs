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
//! | [`DirectReadOut`] | the last layer of a direct predictor, all steps of its horizon at once, by [`RecursiveLeastSquares`] |
//! | [`BlendedEquations`] | several of these at different paces, weighed by what they have predicted of late |
//! | [`Guard`](guard::Guard) | what another one does, as long as that is to be trusted |

mod blend;
mod equations;
mod factor;
mod gate;
pub mod guard;
mod increments;
pub mod kalman;
mod least_squares;
mod memory;
mod read_out;
mod scale;
mod settings;
mod spread;
mod weighted;

use crate::predict::{Predictor, Workspace};

pub use blend::{BlendSettings, BlendedEquations};
pub use equations::RecursiveEquations;
pub use factor::Factor;
pub use gate::Gate;
pub use least_squares::RecursiveLeastSquares;
pub use read_out::{DirectReadOut, ReadOutError, ReadOutSettings, SHORTEST_FORGETTING};
pub use scale::rms_over_range;
pub use settings::{Settings, SettingsError};
pub use weighted::WeightedSession;

/// A session that learns on the way.
///
/// It learns in [`observe`](Predictor::observe), from all that it has seen up to this sample;
/// [`outcome`](Self::outcome) tells what came of it. A [`reset`](Predictor::reset) starts a new run and keeps
/// what was learned.
pub trait Adapter: Predictor {
    /// What the last observed sample did to the weights.
    fn outcome(&self) -> Outcome;

    /// What was predicted of the last observation, before it was learned from: innovation and its standard
    /// deviation for each output, in the same unit. Empty where the outcome is [`Outcome::Waiting`].
    fn innovations(&self) -> &[Innovation];

    /// The weights of the moment, in the model's own units and layout. A [`snapshot`](Predictor::snapshot) ends with as
    /// many numbers, which stand for them.
    fn weights(&self) -> &[f64];

    /// Whether to learn at all. A frozen adapter predicts with the weights it has.
    fn freeze(&mut self, frozen: bool);

    /// The next measurement counts as one with so many times the variance of the noise; that after it does not.
    fn inflate(&mut self, factor: f64);

    /// Forgets how sure it is of the weights: their covariance is as at the start. The weights stay.
    fn restart(&mut self);

    /// How windows of known waters are rehearsed on the way; `None` if they are not.
    fn rehearsal(&self) -> Option<&kalman::Rehearsal> {
        None
    }

    /// Keeps a window for rehearsal, as long as there is room: measured `outputs` and `commands` of samples that follow each
    /// other, row by row. The last [`samples`](kalman::Rehearsal::samples) are kept, those before wash in. Allocates.
    fn keep(&mut self, outputs: &[f64], commands: &[f64]) {
        let _ = (outputs, commands);
    }

    /// Whether the covariance is one.
    fn health(&self) -> Health;

    /// The guard that this is, if it is one.
    fn guard(&self) -> Option<&guard::Guard> {
        None
    }

    /// How many numbers [`save`](Self::save) gives; constant over the life of the adapter.
    fn memory_len(&self) -> usize;

    /// Copies all that predictions and further learning depend on: state and weights, as in a
    /// [`snapshot`](Predictor::snapshot), and covariances, windows that are filling, and counters beside them.
    ///
    /// # Panics
    /// If `into` has not [`memory_len`](Self::memory_len) numbers.
    fn save(&self, into: &mut [f64]);

    /// Puts back what [`save`](Self::save) gave, by an adapter of the same model and settings: from the next
    /// sample on both do the same to the last bit. Until then the [`outcome`](Self::outcome) is
    /// [`Outcome::Waiting`].
    ///
    /// # Panics
    /// If `from` has not [`memory_len`](Self::memory_len) numbers.
    fn load(&mut self, from: &[f64]);

    /// Standard deviations of what will be measured at the given `horizons` (ascending, in samples, at least 1)
    /// under the commands `c_k, ..` (rows of `commands`; as many as the last horizon): uncertainty of weights and
    /// state and the noise of the measurement together. Into `deviations` go `horizons x outputs` numbers in the
    /// units of the outputs; NaN where the adapter knows none. Nothing is allocated once `work` has grown.
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

/// Signs that a covariance gives before errors do. NaN is what an adapter does not know, or cannot get wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Health {
    /// The smallest variance of a weight or a hidden state, in its scaled unit.
    pub least_variance: f64,
    /// The smallest `S_ii / R_ii` of the last measurement: what is expected of it is never surer than its noise.
    pub sureness: f64,
}

impl Health {
    /// Nothing is known.
    pub const UNKNOWN: Self = Self { least_variance: f64::NAN, sureness: f64::NAN };
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
