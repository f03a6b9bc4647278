//! Equations: recursive least squares on their coefficients.
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

use std::sync::Arc;

use hydroid_core::adapt::{RecursiveEquations, Settings, SettingsError};
use hydroid_core::model::sparse::Equations;
use serde::{Deserialize, Serialize};

use super::{AdaptError, Gate};
use crate::model::{Body, Members, Model, NamedEquations};

/// How equations are adapted, and the last layer of direct predictors, for which the default is
/// [`of_read_outs`](Self::of_read_outs).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeastSquares {
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
}

/// Forgetting time \[s\] where none is asked for; see the [module](self) for why.
pub const FORGETTING_S: f64 = 60.0;

/// What the model from shore is worth \[s\] where nothing else is asked for.
pub const PRIOR_S: f64 = 10.0;

impl Default for LeastSquares {
    fn default() -> Self {
        Self {
            forgetting_s: FORGETTING_S,
            window_s: None,
            prior_s: PRIOR_S,
            leak: true,
            all_terms: false,
            gate: Gate::default(),
        }
    }
}

/// The settings that were used, with what was chosen written out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UsedLeastSquares {
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

/// The settings of the core for a model.
///
/// # Errors
/// If the options do not fit the model.
pub(super) fn settings(model: &Model, options: &LeastSquares) -> Result<Settings, AdaptError> {
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

/// The session that adapts equations, and the settings that it was made with.
pub(super) fn adapter(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &LeastSquares,
) -> Result<(RecursiveEquations, UsedLeastSquares), AdaptError> {
    let settings = settings(model, options)?;
    let adapter = motion.learner(&settings).map_err(AdaptError::Settings)?;
    let used = UsedLeastSquares {
        forgetting_s: settings.forgetting_s,
        window_s: settings.window as f64 * model.description.dt,
        prior_s: settings.prior_s,
        leak: settings.leak,
        all_terms: settings.all_terms,
        gate: [settings.gate.inflate, settings.gate.reject],
    };
    Ok((adapter, used))
}

/// The model with the weights that an adapter of its equations has.
pub(super) fn learned(model: &Model, weights: &[f64], all_terms: bool) -> Result<Model, AdaptError> {
    let motion = model.equations().ok_or(AdaptError::Weights)?;
    let equations = with_weights(motion.equations(), weights, all_terms)?;
    // The members spread around coefficients that the model no longer has.
    Ok(Model { body: Body::Equations(Arc::new(equations)), members: Members::default(), ..model.clone() })
}

/// The window that the model's identification chose by rollouts, or a second. A weak form counts half: its test
/// function averages about as much as an increment over half of its window.
fn default_window_s(model: &Model) -> f64 {
    let chosen = &model.description.provenance.settings["chosen"]["regression"];
    let intervals = |kind: &str| chosen[kind]["intervals"].as_f64();
    let intervals = intervals("midpoint").or(intervals("weak").map(|n| (0.5 * n).max(1.0)));
    intervals.map_or(1.0, |intervals| intervals * model.description.dt)
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
