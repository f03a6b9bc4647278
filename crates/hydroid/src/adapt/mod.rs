//! Online adaptation of a model along a log, evaluated beside the frozen model.
//!
//! Both models are evaluated on the same runs by [`evaluate`](fn@evaluate). At each origin the adapted model predicts
//! with the weights of that time, adapted from the samples up to it.

mod committee;
mod equations;
#[doc(hidden)]
pub mod events;
mod guarded;
mod kalman;
mod last_layer;
mod least_squares;
mod metrics;
mod plant;

use std::borrow::Cow;

use hydroid_core::adapt::guard::GuardError;
use hydroid_core::adapt::kalman::{KalmanError, RehearsalOptions};
use hydroid_core::adapt::{Adapter, LastLayerError, RecursiveOptionsError};
use hydroid_core::predict::Predictor;
use serde::{Deserialize, Serialize};

use crate::evaluate::{self, EvaluateError, Evaluation, evaluate};
use crate::key::key;
use crate::log::Trajectory;
use crate::model::{Body, CurrentError, Model};
use crate::progress::Progress;

pub use guarded::reference;
pub use hydroid_core::adapt::InnovationGate;
pub use hydroid_core::adapt::guard::GuardOptions;
pub use hydroid_core::adapt::kalman::CovarianceForm;
pub use kalman::{KalmanOptions, Rehearse};
pub use least_squares::LeastSquaresOptions;
#[doc(hidden)]
pub use metrics::MeteredAdapter;
pub use metrics::{Counts, Coverage, Times};
pub use plant::LearnedParameter;
#[doc(hidden)]
pub use {
    committee::ResolvedCommittee,
    events::LoggedEvent,
    kalman::{ResolvedKalman, network_filter_options},
    last_layer::ResolvedLastLayer,
    least_squares::{ResolvedLeastSquares, recursive_options},
    metrics::{BAND_80, BAND_95},
};

/// Adaptation method of equations. Networks and vessels use the filter, direct predictors least squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
pub enum Method {
    /// Recursive least squares on increments (equations) or on the last layer (direct predictors)
    #[default]
    #[serde(alias = "least-squares")]
    LeastSquares,
    /// An extended Kalman filter over state and weights, which also filters the measurement noise
    Kalman,
}

/// Options of the adaptation and its evaluation. [`Options::of`] has the defaults for a kind of model.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// Adaptation method of equations.
    pub method: Method,
    /// Options of least squares; [`LeastSquaresOptions::for_last_layer`] has the defaults for direct predictors.
    pub least_squares: LeastSquaresOptions,
    /// Options of the filter; see [`KalmanOptions::of_equations`] and [`KalmanOptions::of_plants`].
    pub kalman: KalmanOptions,
    /// Options of the guard; `None` for no guard.
    pub guard: Option<GuardOptions>,
    /// Standard deviation of the components of a current that is estimated beside the weights \[m/s\]; `None` for that of
    /// the model, which may have none. See [`Model::with_current`].
    pub current_m_s: Option<f64>,
    /// Options of the evaluation.
    #[serde(skip)]
    pub evaluate: evaluate::Options,
}

/// Errors of the frozen and the adapted model, with metrics of the adaptation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The frozen model, restarted from each measurement.
    pub frozen: Evaluation,
    /// The frozen model with a state filter; `None` for least squares, and for networks with output feedback or a base.
    pub frozen_filtered: Option<Evaluation>,
    /// The adapted model.
    pub adapted: Evaluation,
    /// Outcomes of the samples.
    pub guard: Counts,
    /// Events of the guard without snapshots.
    pub events: Vec<LoggedEvent>,
    /// Computing time of the adapter for a sample.
    pub us_per_sample: Times,
    /// Coverage of its bands.
    pub coverage: Coverage,
    /// Resolved options.
    pub settings: ResolvedOptions,
    /// Parameters of a vessel before and after; empty for other models.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<LearnedParameter>,
}

/// Resolved options, as in the provenance of the adapted model.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "method", rename_all = "snake_case")]
pub enum ResolvedOptions {
    /// Least squares of equations.
    LeastSquares(ResolvedLeastSquares),
    /// Least squares of the last layer of a direct predictor.
    LastLayer(ResolvedLastLayer),
    /// Least squares of the members of a committee.
    Committee(ResolvedCommittee),
    /// Kalman filter.
    Kalman(ResolvedKalman),
}

/// An adapted model and its report.
#[derive(Clone, Debug)]
pub struct Adapted {
    /// Report.
    pub report: Report,
    /// The model with the weights at the end of the last run.
    pub model: Model,
}

/// Error of an adaptation.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum AdaptError {
    #[error(
        "a model of kind '{kind}' cannot be adapted: give one of equations (methods sindy, lagged, recursive), a committee, a recurrent network (lstm, gru, rnn), a direct predictor or a vessel; `hydroid evaluate` evaluates this one without adaptation"
    )]
    Kind { kind: &'static str },
    #[error("the model cannot be adapted: {0}")]
    LastLayer(#[from] LastLayerError),
    #[error(
        "the forgetting time is {given_s} s: at least {least_s:.3} s are needed, which are 9.5 samples; give it, as in {}",
        key("forgetting").is(300)
    )]
    Forgetting { given_s: f64, least_s: f64 },
    #[error("the model cannot be adapted: {0}")]
    Options(RecursiveOptionsError),
    #[error("the model cannot be adapted: {0}")]
    Kalman(#[from] KalmanError),
    #[error("the model cannot be guarded: {0}")]
    Guard(GuardError),
    #[error(
        "the measurement noise is unknown: the model file does not state it, and it cannot be estimated from a stream. Give standard deviations, as in {}",
        key("noise").is("u=0.01,v=0.01,r=0.02")
    )]
    NoNoise,
    #[error(
        "the noise of '{channel}' has a standard deviation of {std}: it must be positive. Give it, as in {}",
        key("noise").is(format_args!("{channel}=0.01"))
    )]
    Noise { channel: String, std: f64 },
    #[error("the adapted weights do not belong to this model")]
    Weights,
    #[error(
        "a window of {window_s} s does not fit: it must be at least one sample ({dt} s), and shorter than the longest run ({longest_s} s)"
    )]
    Window { window_s: f64, dt: f64, longest_s: f64 },
    #[error(transparent)]
    Current(#[from] CurrentError),
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
}

impl Options {
    /// Defaults for the kind of a model, without a guard ([`guarded`](Self::guarded)); for equations of both methods.
    pub fn of(model: &Model) -> Self {
        let (method, least_squares, kalman) = match &model.body {
            Body::Equations(_) => {
                (Method::LeastSquares, LeastSquaresOptions::default(), KalmanOptions::of_equations())
            }
            Body::Direct(_) => {
                (Method::LeastSquares, LeastSquaresOptions::for_last_layer(), KalmanOptions::default())
            }
            Body::Recurrent(_) => (Method::Kalman, LeastSquaresOptions::default(), KalmanOptions::default()),
            Body::Craft(_) => (Method::Kalman, LeastSquaresOptions::default(), KalmanOptions::of_plants()),
            Body::Affine(_) | Body::Committee(_) => return Self::default(),
        };
        Self { method, least_squares, kalman, ..Self::default() }
    }
}

/// Checks that a model can be adapted.
///
/// # Errors
/// If its kind has no adaptation.
pub fn adaptable(model: &Model) -> Result<(), AdaptError> {
    match &model.body {
        Body::Affine(_) => Err(AdaptError::Kind { kind: model.kind() }),
        Body::Equations(_) | Body::Recurrent(_) | Body::Direct(_) | Body::Committee(_) | Body::Craft(_) => {
            Ok(())
        }
    }
}

/// Adapter of a model and its resolved options. `runs` (may be empty) give the noise if the model does not state it.
///
/// # Errors
/// If the options do not fit the model.
pub fn adapter(
    model: &Model,
    options: &Options,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, ResolvedOptions), AdaptError> {
    adaptable(model)?;
    let model = &*in_current(model, options)?;
    match &options.guard {
        Some(settings) => guarded::guard(model, options, settings, runs),
        None => learner(model, options, runs),
    }
}

/// The model with the estimate of the current of the options.
fn in_current<'a>(model: &'a Model, options: &Options) -> Result<Cow<'a, Model>, AdaptError> {
    match options.current_m_s {
        Some(initial_m_s) => Ok(Cow::Owned(model.with_current(initial_m_s)?)),
        None => Ok(Cow::Borrowed(model)),
    }
}

fn learner(
    model: &Model,
    options: &Options,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, ResolvedOptions), AdaptError> {
    let (adapter, used) = inner_learner(model, options, runs)?;
    Ok((model.whole_adapter(adapter), used))
}

/// The adapter of the motion that the model predicts, over ground or through the water.
fn inner_learner(
    model: &Model,
    options: &Options,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, ResolvedOptions), AdaptError> {
    match &model.body {
        Body::Equations(equations) => {
            let motion = model.named(equations);
            if options.method == Method::Kalman {
                let (adapter, used) = equations::adapter(model, &motion, &options.kalman, runs)?;
                return Ok((Box::new(adapter), ResolvedOptions::Kalman(used)));
            }
            let (adapter, used) = least_squares::adapter(model, &motion, &options.least_squares)?;
            Ok((Box::new(adapter), ResolvedOptions::LeastSquares(used)))
        }
        Body::Recurrent(network) => {
            let (adapter, used) = kalman::adapter(model, network, &options.kalman, runs)?;
            Ok((adapter, ResolvedOptions::Kalman(used)))
        }
        Body::Direct(direct) => {
            let (adapter, used) = last_layer::adapter(model, direct, &options.least_squares)?;
            Ok((Box::new(adapter), ResolvedOptions::LastLayer(used)))
        }
        Body::Craft(craft) => {
            let (adapter, used) = plant::adapter(model, craft, &options.kalman, runs)?;
            Ok((Box::new(adapter), ResolvedOptions::Kalman(used)))
        }
        Body::Committee(committee) => {
            let (adapter, used) = committee::adapter(model, committee)?;
            Ok((Box::new(adapter), ResolvedOptions::Committee(used)))
        }
        Body::Affine(_) => Err(AdaptError::Kind { kind: model.kind() }),
    }
}

/// A session of a network with a state filter; `None` for models with output feedback or a base, or with unknown noise.
pub(crate) fn state_filtered(model: &Model) -> Option<Box<dyn Predictor>> {
    let noise = KalmanOptions::default().noise_of(model, &[]).ok()?;
    kalman::filtered(model, &noise).ok()?
}

/// Runs an adapter along training runs of its model and resets its state. The covariance then reflects what the runs
/// determine; with equal initial variances of all weights the filter would forget the training data quickly.
#[doc(hidden)]
pub fn replay_training_runs(adapter: &mut dyn Adapter, training_runs: &[&Trajectory]) {
    for run in training_runs {
        adapter.reset();
        for k in 0..run.len() {
            adapter.observe_heading(run.heading_at(k));
            adapter.observe(run.outputs.row(k));
            adapter.advance(run.inputs.row(k));
        }
    }
    adapter.reset();
}

/// Stores evenly spread training windows, each after a wash-out of its own length, in an adapter's rehearsal memory.
#[doc(hidden)]
pub fn store_rehearsal_windows(adapter: &mut dyn Adapter, training_runs: &[&Trajectory]) {
    let Some(&RehearsalOptions { windows, samples, .. }) = adapter.rehearsal() else { return };
    let wash_in = samples.max(adapter.warm_up());
    let starts = |run: &Trajectory| run.len().saturating_sub(wash_in + samples);
    let all: usize = training_runs.iter().map(|run| starts(run)).sum();
    for window in 0..windows.min(all) {
        let mut start = (2 * window + 1) * all / (2 * windows);
        for run in training_runs {
            if start < starts(run) {
                let rows = start..start + wash_in + samples + 1;
                adapter.store_window(
                    run.outputs.rows(rows.start, rows.end),
                    run.inputs.rows(rows.start, rows.end),
                );
                break;
            }
            start -= starts(run);
        }
    }
}

/// Training runs against forgetting.
#[derive(Clone, Debug, Default)]
pub struct TrainingRuns {
    /// Replayed before the adaptation ([`replay_training_runs`]).
    pub replayed: Vec<Trajectory>,
    /// Rehearsed during the adaptation ([`store_rehearsal_windows`]).
    pub rehearsed: Vec<Trajectory>,
}

impl TrainingRuns {
    /// Stores the rehearsal windows and replays the runs; the adapter is then at the start of a run.
    pub fn remember(&self, adapter: &mut dyn Adapter) {
        store_rehearsal_windows(adapter, &self.rehearsed.iter().collect::<Vec<_>>());
        replay_training_runs(adapter, &self.replayed.iter().collect::<Vec<_>>());
    }
}

/// Evaluates a model frozen and adapted over runs, in their order. Learned weights are kept for the next run.
///
/// # Errors
/// If the options do not fit the model, or the runs cannot be evaluated (see [`evaluate`](fn@evaluate)).
pub fn adapt(
    model: &Model,
    runs: &[&Trajectory],
    options: &Options,
    progress: Progress<'_>,
) -> Result<Adapted, AdaptError> {
    let (mut adapter, used) = adapter(model, options, runs)?;
    let frozen = Frozen::evaluate(model, &used, runs, options, progress)?;
    adapt_by(model, adapter.as_mut(), used, frozen, runs, options, progress)
}

/// The evaluations of a model that does not learn.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct Frozen {
    /// The model, restarted from each measurement.
    pub restarted: Evaluation,
    /// The model with a filter on its state alone; see [`Report::frozen_filtered`].
    pub filtered: Option<Evaluation>,
}

impl Frozen {
    /// Evaluates a model over runs; `used` are the settings of the adapter that it is compared with.
    ///
    /// # Errors
    /// If a window of the settings is longer than all runs, or the runs cannot be evaluated.
    pub fn evaluate(
        model: &Model,
        used: &ResolvedOptions,
        runs: &[&Trajectory],
        options: &Options,
        progress: Progress<'_>,
    ) -> Result<Self, AdaptError> {
        let longest_s = runs.iter().map(|run| run.duration_s()).fold(0.0, f64::max);
        if let ResolvedOptions::LeastSquares(ResolvedLeastSquares { window_s, .. }) = *used
            && window_s >= longest_s
        {
            return Err(AdaptError::Window { window_s, dt: model.description.dt, longest_s });
        }
        let ranges = model.output_ranges();
        let name = &model.description.name;
        // A model with online learning is evaluated with constant equations.
        let mut session = model.frozen().session();
        let restarted = evaluate(name, session.as_mut(), &ranges, runs, &options.evaluate, &mut |done| {
            progress(0.5 * done)
        })?;
        let filtered = match (used, model.equations(), &model.body) {
            (
                ResolvedOptions::LeastSquares(_)
                | ResolvedOptions::LastLayer(_)
                | ResolvedOptions::Committee(_),
                ..,
            ) => None,
            (ResolvedOptions::Kalman(_), Some(motion), _) => {
                let options = options.kalman.with_constant_weights();
                let (session, _) = equations::adapter(model, &motion, &options, runs)?;
                Some(model.whole_session(Box::new(session)))
            }
            (ResolvedOptions::Kalman(_), _, Body::Craft(vessel)) => {
                let options = options.kalman.with_constant_weights();
                let (session, _) = plant::adapter(model, vessel, &options, runs)?;
                Some(model.whole_session(Box::new(session)))
            }
            (ResolvedOptions::Kalman(used), None, _) => kalman::filtered(model, &used.noise)?,
        };
        let filtered = match filtered {
            Some(mut session) => {
                let name = format!("{name}, state filtered");
                Some(evaluate(&name, session.as_mut(), &ranges, runs, &options.evaluate, &mut |_| {
                    progress(0.5)
                })?)
            }
            None => None,
        };
        Ok(Self { restarted, filtered })
    }
}

/// As [`adapt`], with an adapter of [`adapter`] or a wrapper of it, and with the evaluation of the frozen model.
///
/// # Errors
/// As [`adapt`].
#[doc(hidden)]
pub fn adapt_by(
    model: &Model,
    adapter: &mut dyn Adapter,
    used: ResolvedOptions,
    frozen: Frozen,
    runs: &[&Trajectory],
    options: &Options,
    progress: Progress<'_>,
) -> Result<Adapted, AdaptError> {
    let ranges = model.output_ranges();
    let name = format!("{}, adapted", model.description.name);
    let mut watched = MeteredAdapter::new(adapter);
    let adapted = evaluate(&name, &mut watched, &ranges, runs, &options.evaluate, &mut |done| {
        progress(0.5 + 0.5 * done)
    })?;
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    let after = learned(model, options, watched.weights(), &names, &used)?;
    let report = Report {
        frozen: frozen.restarted,
        frozen_filtered: frozen.filtered,
        adapted,
        guard: watched.counts(),
        events: events::logged(watched.events(), runs, &events::names(model)),
        us_per_sample: watched.times(),
        coverage: watched.coverage(),
        parameters: plant::parameters(model, &after),
        settings: used,
    };
    Ok(Adapted { model: after, report })
}

/// The model with the weights of an adapter of [`adapter`], and with the estimate of the current of the options; its provenance
/// states the runs and the settings.
///
/// # Errors
/// If the weights do not fit the model and the settings.
pub fn learned(
    model: &Model,
    options: &Options,
    weights: &[f64],
    runs: &[&str],
    used: &ResolvedOptions,
) -> Result<Model, AdaptError> {
    let model = &*in_current(model, options)?;
    let mut model = match &model.body {
        Body::Equations(_) => {
            let all_terms = matches!(used, ResolvedOptions::LeastSquares(used) if used.all_terms);
            least_squares::learned(model, weights, all_terms)?
        }
        Body::Recurrent(network) => kalman::learned(model, network, weights)?,
        Body::Direct(direct) => last_layer::learned(model, direct, weights)?,
        Body::Committee(committee) => committee::learned(model, committee, weights)?,
        Body::Affine(_) => return Err(AdaptError::Kind { kind: model.kind() }),
        Body::Craft(craft) => plant::learned(model, craft, weights)?,
    };
    let entry = serde_json::json!({ "runs": runs, "hydroid": env!("CARGO_PKG_VERSION"), "settings": used });
    let settings = &mut model.description.provenance.settings;
    if !settings.is_object() {
        *settings = serde_json::json!({ "chosen": settings.take() });
    }
    match settings["adapted"].as_array_mut() {
        Some(before) => before.push(entry),
        None => settings["adapted"] = serde_json::json!([entry]),
    }
    Ok(model)
}
