//! A model that learns along a log, judged beside the same model frozen.
//!
//! Both walk the same runs through [`evaluate`](fn@evaluate); at each origin the adapted model predicts with the weights
//! of that moment, learned from the samples up to it and none after.
//!
//! # How the defaults were chosen
//!
//! On six records that appear in no table of results: the tug's `run1`, the tanker's zigzag at 10 rps
//! (`13_22_52`), a simulated vessel whose drag grows by 1.6, the same vessel unchanged, the reference's
//! lawn-mower `lawn3` with a model of the low-speed mode alone, and a hydrofoil under a model that leaves its
//! mode and its hidden force out. Forgetting times of 30, 60, 120, 300 s, priors of 3, 10, 30, 100 s, windows
//! of 0.5, 1, 2, 5 s or the model's own. The window that identification has chosen by rollouts suits the
//! tanker (15 s: 0.86 of the frozen error, 1 s: 1.00) and the tug less (5 s: 0.87, 1 s: 0.79). Shorter
//! memory follows a change faster (30 s: 0.36, 60 s: 0.41, 120 s: 0.50) and costs where nothing
//! changes (30 s and a prior of 3 s: up to 1.02; 60 s and 10 s: at most 1.00).

pub mod stream;
mod watch;

use std::sync::Arc;

use hydroid_core::adapt::{Adapter, RecursiveEquations, Settings, SettingsError};
use hydroid_core::model::sparse::Equations;
use serde::Serialize;

use crate::evaluate::{self, EvaluateError, Evaluation, evaluate};
use crate::log::Trajectory;
use crate::model::{Body, Members, Model, Motion};
use crate::progress::Progress;
use watch::Watched;

pub use hydroid_core::adapt::Gate;
pub use watch::{Counts, Coverage, Times};

/// How to adapt, and how to judge it.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Time \[s\] after which a sample counts `1/e`; infinite to forget nothing.
    pub forgetting_s: f64,
    /// Time \[s\] that an increment spans (default: what the model's own identification chose, or 1 s).
    pub window_s: Option<f64>,
    /// Seconds of lively sailing that the model from shore is worth.
    pub prior_s: f64,
    /// Whether coefficients about which the log has long said nothing return to the model from shore.
    pub leak: bool,
    /// Whether terms that are not in an equation may enter it.
    pub all_terms: bool,
    /// What happens to samples that are far off.
    pub gate: Gate,
    /// Horizons and origins.
    pub evaluate: evaluate::Options,
}

/// Forgetting time \[s\] where none is asked for; see the [module](self) for why.
pub const FORGETTING_S: f64 = 60.0;

/// What the model from shore is worth \[s\] where nothing else is asked for.
pub const PRIOR_S: f64 = 10.0;

impl Default for Options {
    fn default() -> Self {
        Self {
            forgetting_s: FORGETTING_S,
            window_s: None,
            prior_s: PRIOR_S,
            leak: true,
            all_terms: false,
            gate: Gate::default(),
            evaluate: evaluate::Options::default(),
        }
    }
}

/// Frozen beside adapted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The model as it is, restarted from each measurement.
    pub frozen: Evaluation,
    /// The model with a filter on its state alone; none for models without a hidden state.
    pub frozen_filtered: Option<Evaluation>,
    /// The model that learns on the way.
    pub adapted: Evaluation,
    /// What became of the samples.
    pub guard: Counts,
    /// Time that the adapter took for a sample.
    pub us_per_sample: Times,
    /// How often its bands were right.
    pub coverage: Coverage,
    /// Settings, with what was chosen written out.
    pub settings: Used,
}

/// The settings that were used; they stand in the adapted model's provenance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Used {
    /// Forgetting time \[s\]; `null` where nothing is forgotten.
    pub forgetting_s: f64,
    /// Time that an increment spans \[s\].
    pub window_s: f64,
    /// What the prior is worth \[s\].
    pub prior_s: f64,
    /// Leak towards the model from shore.
    pub leak: bool,
    /// All terms of the library.
    pub all_terms: bool,
    /// Innovations beyond which samples weigh less, and are rejected \[standard deviations\].
    pub gate: [f64; 2],
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
    /// A model that is not made of equations.
    #[error(
        "a model of kind '{kind}' cannot learn on the way yet: recursive least squares needs equations. Give a model that the methods sindy, lagged or recursive made; `hydroid evaluate` judges this one as it stands"
    )]
    Kind {
        /// Of the model.
        kind: &'static str,
    },
    /// The settings make no sense.
    #[error("the model cannot be adapted: {0}")]
    Settings(SettingsError),
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

/// The settings of the core for a model.
///
/// # Errors
/// If the options do not fit the model.
pub fn settings(model: &Model, options: &Options) -> Result<Settings, AdaptError> {
    let dt = model.description.dt;
    let wanted = options.window_s.unwrap_or_else(|| default_window_s(model));
    if !(wanted >= 0.5 * dt && wanted / dt < 1e6) {
        return Err(AdaptError::Window { window_s: wanted, dt, longest_s: f64::INFINITY });
    }
    // Between one and a million.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let window = (wanted / dt).round().max(1.0) as usize;
    Ok(Settings {
        forgetting_s: options.forgetting_s,
        window,
        prior_s: options.prior_s,
        leak: options.leak,
        all_terms: options.all_terms,
        gate: options.gate,
    })
}

/// The equations that are adapted.
///
/// # Errors
/// If the model is not made of equations.
pub fn adaptable(model: &Model) -> Result<Motion<'_>, AdaptError> {
    model.equations().ok_or_else(|| AdaptError::Kind { kind: model.kind() })
}

/// The session that adapts a model, and the settings that it was made with.
///
/// # Errors
/// If the options do not fit the model.
pub fn adapter(model: &Model, options: &Options) -> Result<(RecursiveEquations, Used), AdaptError> {
    let settings = settings(model, options)?;
    let adapter = adaptable(model)?.learner(&settings).map_err(AdaptError::Settings)?;
    let used = Used {
        forgetting_s: settings.forgetting_s,
        window_s: settings.window as f64 * model.description.dt,
        prior_s: settings.prior_s,
        leak: settings.leak,
        all_terms: settings.all_terms,
        gate: [settings.gate.inflate, settings.gate.reject],
    };
    Ok((adapter, used))
}

/// The window that the model's identification chose by rollouts, or a second. A weak form counts half: its test
/// function averages about as much as an increment over half of its window.
fn default_window_s(model: &Model) -> f64 {
    let chosen = &model.description.provenance.settings["chosen"]["regression"];
    let intervals = |kind: &str| chosen[kind]["intervals"].as_f64();
    let intervals = intervals("midpoint").or(intervals("weak").map(|n| (0.5 * n).max(1.0)));
    intervals.map_or(1.0, |intervals| intervals * model.description.dt)
}

/// Runs a model frozen and adapted over runs, in their order; what is learned on one is kept for the next.
///
/// # Errors
/// If the options do not fit the model, or the runs cannot be judged (see [`evaluate`](fn@evaluate)).
pub fn adapt(
    model: &Model,
    runs: &[&Trajectory],
    options: &Options,
    progress: Progress<'_>,
) -> Result<Adapted, AdaptError> {
    let (mut adapter, used) = adapter(model, options)?;
    let longest_s = runs.iter().map(|run| run.duration_s()).fold(0.0, f64::max);
    if used.window_s >= longest_s {
        let dt = model.description.dt;
        return Err(AdaptError::Window { window_s: used.window_s, dt, longest_s });
    }
    let ranges = model.output_ranges();
    let name = &model.description.name;
    // A model that learns by itself is no yardstick: its equations are, as they stand.
    let mut frozen_session = Model { learning: None, ..model.clone() }.session();
    let frozen = evaluate(name, frozen_session.as_mut(), &ranges, runs, &options.evaluate, &mut |done| {
        progress(0.5 * done)
    })?;
    let mut watched = Watched::new(&mut adapter);
    let adapted =
        evaluate(&format!("{name}, adapted"), &mut watched, &ranges, runs, &options.evaluate, &mut |done| {
            progress(0.5 + 0.5 * done)
        })?;
    let report = Report {
        frozen,
        frozen_filtered: None,
        adapted,
        guard: watched.counts(),
        us_per_sample: watched.times(),
        coverage: watched.coverage(),
        settings: used,
    };
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    Ok(Adapted { model: learned(model, adapter.weights(), &names, used)?, report })
}

/// The model with the weights that an adapter of [`adapter`] has; its provenance says from which runs, and how.
///
/// # Errors
/// If they are not weights of this model under these settings.
pub fn learned(model: &Model, weights: &[f64], runs: &[&str], used: Used) -> Result<Model, AdaptError> {
    let equations = with_weights(adaptable(model)?.equations(), weights, used.all_terms)?;
    let mut model = model.clone();
    model.body = Body::Equations(Arc::new(equations));
    // They spread around coefficients that the model no longer has.
    model.members = Members::default();
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

/// Equations with other coefficients where there are some, or everywhere.
fn with_weights(equations: &Equations, weights: &[f64], all_terms: bool) -> Result<Equations, AdaptError> {
    let adapts = |xi: &f64| all_terms || *xi != 0.0;
    let mut coefficients = equations.coefficients().to_vec();
    if coefficients.iter().filter(|xi| adapts(xi)).count() != weights.len() {
        return Err(AdaptError::Settings(SettingsError::Nothing));
    }
    for (xi, weight) in coefficients.iter_mut().filter(|xi| adapts(xi)).zip(weights) {
        *xi = *weight;
    }
    Equations::with_signals(
        equations.terms().to_vec(),
        coefficients,
        equations.outputs(),
        equations.inputs(),
        equations.signals().to_vec(),
        equations.dt(),
        equations.substeps(),
    )
    .map_err(|error| AdaptError::Settings(SettingsError::Equations(error)))
}
