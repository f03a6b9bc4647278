//! A model that learns along a log, judged beside the same model frozen.
//!
//! Both walk the same runs through [`evaluate`](fn@evaluate); at each origin the adapted model predicts with the weights
//! of that moment, learned from the samples up to it and none after.

mod equations;
pub mod events;
mod guarded;
mod kalman;
pub mod least_squares;
mod plant;
mod read_out;
mod watch;

use hydroid_core::adapt::guard::GuardError;
use hydroid_core::adapt::kalman::{KalmanError, Rehearsal};
use hydroid_core::adapt::{Adapter, ReadOutError, SettingsError};
use serde::{Deserialize, Serialize};

use crate::evaluate::{self, EvaluateError, Evaluation, evaluate};
use crate::log::Trajectory;
use crate::model::{Body, Model};
use crate::progress::Progress;
use watch::Watched;

pub use events::Happened;
pub use hydroid_core::adapt::Gate;
pub use hydroid_core::adapt::guard::GuardOptions;
pub use hydroid_core::adapt::kalman::Memory;
pub use kalman::{Kalman, Rehearse, UsedKalman, Which};
pub use least_squares::{FORGETTING_S, LeastSquares, PRIOR_S, UsedLeastSquares};
pub use plant::LearnedParameter;
pub use read_out::UsedReadOut;
pub use watch::{BAND_80, BAND_95, Counts, Coverage, Times};

/// How equations learn. Recurrent networks and vessels learn by the filter, and direct predictors by least squares, whatever is
/// chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Recursive least squares on increments: the coefficients, beside a state that is measured.
    #[default]
    LeastSquares,
    /// An extended Kalman filter: the coefficients together with the outputs, which it filters.
    Kalman,
}

/// How to adapt, and how to judge it. [`Options::of`] is where to begin: what suits one kind of model does not suit another.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// How equations learn.
    pub method: Method,
    /// For equations that learn by least squares; for direct predictors [`LeastSquares::of_read_outs`] is where to begin.
    pub least_squares: LeastSquares,
    /// For recurrent networks; for equations that learn by the filter [`Kalman::of_equations`] is where to begin, for vessels
    /// [`Kalman::of_plants`].
    pub kalman: Kalman,
    /// Whether, and how, what is learned is guarded.
    pub guard: Option<GuardOptions>,
    /// Horizons and origins.
    #[serde(skip)]
    pub evaluate: evaluate::Options,
}

/// Frozen beside adapted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The model as it is, restarted from each measurement.
    pub frozen: Evaluation,
    /// The model with a filter on its state alone; none for equations that learn by least squares, and networks whose state a
    /// measurement enters otherwise.
    pub frozen_filtered: Option<Evaluation>,
    /// The model that learns on the way.
    pub adapted: Evaluation,
    /// What became of the samples.
    pub guard: Counts,
    /// What the guard did, if there was one, but for the snapshots that it took.
    pub events: Vec<Happened>,
    /// Time that the adapter took for a sample.
    pub us_per_sample: Times,
    /// How often its bands were right.
    pub coverage: Coverage,
    /// Settings, with what was chosen written out.
    pub settings: Used,
    /// Parameters of a vessel before and after; none of other models.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub parameters: Vec<LearnedParameter>,
}

/// The settings that were used; they stand in the adapted model's provenance.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "method", rename_all = "snake_case")]
pub enum Used {
    /// Of equations.
    LeastSquares(UsedLeastSquares),
    /// Of a direct predictor.
    ReadOut(UsedReadOut),
    /// Of a recurrent network, a vessel, or equations that learn by the filter.
    Kalman(UsedKalman),
}

/// An adapted model and how it did.
#[derive(Clone, Debug)]
pub struct Adapted {
    /// Frozen beside adapted.
    pub report: Report,
    /// The model with the weights that it had at the end of the last run.
    pub model: Model,
}

/// Why a model cannot be adapted.
#[derive(Debug, thiserror::Error)]
pub enum AdaptError {
    /// A model that nothing here can adapt.
    #[error(
        "a model of kind '{kind}' cannot learn on the way: give one of equations (methods sindy, lagged, recursive), a recurrent network (lstm, gru, rnn), a direct predictor or a vessel; `hydroid evaluate` judges this one as it stands"
    )]
    Kind {
        /// Of the model.
        kind: &'static str,
    },
    /// The last layer cannot learn so.
    #[error("the model cannot be adapted: {0}")]
    ReadOut(#[from] ReadOutError),
    /// The last layer cannot forget so fast.
    #[error(
        "the forgetting time is {given_s} s: at least {least_s:.3} s are needed, which are 9.5 samples; give it, as in --forgetting 300"
    )]
    Forgetting {
        /// Asked for \[s\].
        given_s: f64,
        /// The least \[s\].
        least_s: f64,
    },
    /// The settings make no sense.
    #[error("the model cannot be adapted: {0}")]
    Settings(SettingsError),
    /// The filter cannot be tuned so.
    #[error("the model cannot be adapted: {0}")]
    Kalman(#[from] KalmanError),
    /// What only networks have.
    #[error("{what} is for networks: this model is none")]
    OnlyNetworks {
        /// Asked for.
        what: &'static str,
    },
    /// The guard does not fit the model.
    #[error("the model cannot be guarded: {0}")]
    Guard(GuardError),
    /// Nobody says how noisy the sensors are.
    #[error(
        "how noisy the outputs are is not known: the model file does not say it, and a stream cannot be looked through first. Give standard deviations, as in --noise u=0.01,v=0.01,r=0.02"
    )]
    NoNoise,
    /// A standard deviation that is none.
    #[error(
        "the noise of '{channel}' has a standard deviation of {std}: it must be positive. Give it, as in --noise {channel}=0.01"
    )]
    Noise {
        /// The output.
        channel: String,
        /// Given or found.
        std: f64,
    },
    /// Weights that are not those of the model.
    #[error("what was learned are no weights of this model")]
    Weights,
    /// The window does not fit the log.
    #[error(
        "a window of {window_s} s does not fit: it must be at least one sample ({dt} s), and shorter than the longest run ({longest_s} s)"
    )]
    Window {
        /// Asked for \[s\].
        window_s: f64,
        /// Sample time \[s\].
        dt: f64,
        /// Of the longest run \[s\].
        longest_s: f64,
    },
    /// Frozen and adapted cannot be judged.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
}

impl Options {
    /// The defaults for a model of its kind, without a guard (see [`guarded`](Self::guarded)).
    ///
    /// Those of the filter are set for equations too, which learn by least squares: choosing [`Method::Kalman`] is enough.
    pub fn of(model: &Model) -> Self {
        let (method, least_squares, kalman) = match &model.body {
            Body::Equations(_) => (Method::LeastSquares, LeastSquares::default(), Kalman::of_equations()),
            Body::Direct(_) => (Method::LeastSquares, LeastSquares::of_read_outs(), Kalman::default()),
            Body::Recurrent(_) => (Method::Kalman, LeastSquares::default(), Kalman::default()),
            Body::Plant(_) => (Method::Kalman, LeastSquares::default(), Kalman::of_plants()),
            // Nothing adapts these yet: `adaptable` says so.
            Body::Affine(_) => return Self::default(),
        };
        Self { method, least_squares, kalman, ..Self::default() }
    }
}

/// Whether a model can be adapted.
///
/// # Errors
/// If nothing here adapts a model of its kind.
pub fn adaptable(model: &Model) -> Result<(), AdaptError> {
    match &model.body {
        Body::Equations(_) | Body::Recurrent(_) | Body::Direct(_) | Body::Plant(_) => Ok(()),
        Body::Affine(_) => Err(AdaptError::Kind { kind: model.kind() }),
    }
}

/// The session that adapts a model, and the settings that it was made with. `runs` are looked through for what the model does
/// not know of its sensors; there may be none.
///
/// # Errors
/// If the options do not fit the model.
pub fn adapter(
    model: &Model,
    options: &Options,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, Used), AdaptError> {
    match &options.guard {
        Some(settings) => guarded::guard(model, options, settings, runs),
        None => learner(model, options, runs),
    }
}

/// The same without a guard.
fn learner(
    model: &Model,
    options: &Options,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, Used), AdaptError> {
    match &model.body {
        Body::Equations(equations) => {
            let motion = model.named(equations);
            if options.method == Method::Kalman {
                let (adapter, used) = equations::adapter(model, &motion, &options.kalman, runs)?;
                return Ok((Box::new(adapter), Used::Kalman(used)));
            }
            let (adapter, used) = least_squares::adapter(model, &motion, &options.least_squares)?;
            Ok((Box::new(adapter), Used::LeastSquares(used)))
        }
        Body::Recurrent(network) => {
            let (adapter, used) = kalman::adapter(model, network, &options.kalman, runs)?;
            Ok((adapter, Used::Kalman(used)))
        }
        Body::Direct(direct) => {
            let (adapter, used) = read_out::adapter(model, direct, &options.least_squares)?;
            Ok((Box::new(adapter), Used::ReadOut(used)))
        }
        Body::Plant(vessel) => {
            let (adapter, used) = plant::adapter(model, vessel, &options.kalman, runs)?;
            Ok((Box::new(adapter), Used::Kalman(used)))
        }
        Body::Affine(_) => Err(AdaptError::Kind { kind: model.kind() }),
    }
}

/// A network with a filter on its state alone; none for models whose state a measurement enters otherwise, or whose noise
/// nobody knows.
pub(crate) fn state_filtered(model: &Model) -> Option<Model> {
    let noise = Kalman::default().noise_of(model, &[]).ok()?;
    kalman::filtered(model, &noise)
}

/// Walks an adapter through runs that its model was trained on, so that it knows what they determine of the weights; then it
/// stands at the start of a run.
///
/// A filter that begins with all weights equally uncertain forgets what the model knew as soon as it learns something new.
pub fn remember_shore(adapter: &mut dyn Adapter, shore: &[&Trajectory]) {
    for run in shore {
        adapter.reset();
        for k in 0..run.len() {
            adapter.observe(run.outputs.row(k));
            adapter.advance(run.inputs.row(k));
        }
    }
    adapter.reset();
}

/// Gives an adapter that rehearses windows of runs that its model was trained on, spread evenly over them; each washes in
/// for as long as it lasts. Nothing for those that do not.
pub fn rehearse_shore(adapter: &mut dyn Adapter, shore: &[&Trajectory]) {
    let Some(&Rehearsal { windows, samples, .. }) = adapter.rehearsal() else { return };
    let wash_in = samples.max(adapter.warm_up());
    let starts = |run: &Trajectory| run.len().saturating_sub(wash_in + samples);
    let all: usize = shore.iter().map(|run| starts(run)).sum();
    for window in 0..windows.min(all) {
        let mut start = (2 * window + 1) * all / (2 * windows);
        for run in shore {
            if start < starts(run) {
                let rows = start..start + wash_in + samples + 1;
                adapter.keep(run.outputs.rows(rows.start, rows.end), run.inputs.rows(rows.start, rows.end));
                break;
            }
            start -= starts(run);
        }
    }
}

/// Runs that a model was trained on, for one that is not to forget them.
#[derive(Clone, Debug, Default)]
pub struct Shore {
    /// Walked through first ([`remember_shore`]).
    pub walked: Vec<Trajectory>,
    /// Rehearsed on the way ([`rehearse_shore`]), by models that do.
    pub rehearsed: Vec<Trajectory>,
}

impl Shore {
    /// Lets an adapter remember them; it then stands at the start of a run.
    pub fn remember(&self, adapter: &mut dyn Adapter) {
        rehearse_shore(adapter, &self.rehearsed.iter().collect::<Vec<_>>());
        remember_shore(adapter, &self.walked.iter().collect::<Vec<_>>());
    }
}

/// Evaluates a model frozen and adapted over runs, in their order; the weights learned on one run are kept for the next.
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
        used: &Used,
        runs: &[&Trajectory],
        options: &Options,
        progress: Progress<'_>,
    ) -> Result<Self, AdaptError> {
        let longest_s = runs.iter().map(|run| run.duration_s()).fold(0.0, f64::max);
        if let Used::LeastSquares(UsedLeastSquares { window_s, .. }) = *used
            && window_s >= longest_s
        {
            return Err(AdaptError::Window { window_s, dt: model.description.dt, longest_s });
        }
        let ranges = model.output_ranges();
        let name = &model.description.name;
        // A model that learns by itself is no yardstick: its equations are, as they stand.
        let mut session = Model { learning: None, ..model.clone() }.session();
        let restarted = evaluate(name, session.as_mut(), &ranges, runs, &options.evaluate, &mut |done| {
            progress(0.5 * done)
        })?;
        let filtered = match (used, model.equations(), model.plant()) {
            (Used::LeastSquares(_) | Used::ReadOut(_), ..) => None,
            (Used::Kalman(_), Some(motion), _) => {
                Some(equations::filtered(model, &motion, &options.kalman, runs)?)
            }
            (Used::Kalman(_), _, Some(vessel)) => {
                Some(plant::filtered(model, vessel, &options.kalman, runs)?)
            }
            (Used::Kalman(used), None, None) => {
                kalman::filtered(model, &used.noise).map(|model| model.session())
            }
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

/// The same with an adapter of [`adapter`], or one around it, and the evaluation of the frozen model.
///
/// # Errors
/// As [`adapt`].
pub fn adapt_by(
    model: &Model,
    adapter: &mut dyn Adapter,
    used: Used,
    frozen: Frozen,
    runs: &[&Trajectory],
    options: &Options,
    progress: Progress<'_>,
) -> Result<Adapted, AdaptError> {
    let ranges = model.output_ranges();
    let name = format!("{}, adapted", model.description.name);
    let mut watched = Watched::new(adapter);
    let adapted = evaluate(&name, &mut watched, &ranges, runs, &options.evaluate, &mut |done| {
        progress(0.5 + 0.5 * done)
    })?;
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    let after = learned(model, watched.weights(), &names, &used)?;
    let report = Report {
        frozen: frozen.restarted,
        frozen_filtered: frozen.filtered,
        adapted,
        guard: watched.counts(),
        events: events::happened(watched.events(), runs, &events::names(model)),
        us_per_sample: watched.times(),
        coverage: watched.coverage(),
        parameters: plant::parameters(model, &after),
        settings: used,
    };
    Ok(Adapted { model: after, report })
}

/// The model with the weights that an adapter of [`adapter`] has; its provenance says from which runs, and how.
///
/// # Errors
/// If they are not weights of this model under these settings.
pub fn learned(model: &Model, weights: &[f64], runs: &[&str], used: &Used) -> Result<Model, AdaptError> {
    let mut model = match &model.body {
        Body::Equations(_) => {
            let all_terms = matches!(used, Used::LeastSquares(used) if used.all_terms);
            least_squares::learned(model, weights, all_terms)?
        }
        Body::Recurrent(network) => kalman::learned(model, network, weights)?,
        Body::Direct(direct) => read_out::learned(model, direct, weights)?,
        Body::Affine(_) => return Err(AdaptError::Kind { kind: model.kind() }),
        Body::Plant(vessel) => plant::learned(model, vessel, weights)?,
    };
    let entry = serde_json::json!({ "runs": runs, "hydroid": env!("CARGO_PKG_VERSION"), "settings": used });
    let settings = &mut model.description.provenance.settings;
    if !settings.is_object() {
        *settings = serde_json::json!({ "chosen": settings.take() });
    }
    // A model may be adapted again and again.
    match settings["adapted"].as_array_mut() {
        Some(before) => before.push(entry),
        None => settings["adapted"] = serde_json::json!([entry]),
    }
    Ok(model)
}
