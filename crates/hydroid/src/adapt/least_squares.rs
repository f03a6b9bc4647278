//! Adaptation of equations by recursive least squares on their coefficients.

use std::sync::Arc;

use hydroid_core::adapt::{RecursiveEquations, RecursiveOptions, RecursiveOptionsError};
use hydroid_core::model::sparse::Equations;
use serde::{Deserialize, Serialize};

use super::{AdaptError, InnovationGate};
use crate::model::{Body, Members, Model, NamedEquations};

/// Options of recursive least squares for equations; for direct predictors see
/// [`for_last_layer`](Self::for_last_layer).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeastSquaresOptions {
    /// Time constant of the forgetting \[s\], `lambda = exp(-dt / forgetting_s)`; infinite for none.
    pub forgetting_s: f64,
    /// Span of an increment \[s\]; default the window of the model's identification, or 1 s.
    pub window_s: Option<f64>,
    /// Weight of the reference model as seconds of excited data.
    pub prior_s: f64,
    /// Whether coefficients without excitation return to the reference model (leakage).
    pub leak: bool,
    /// Whether terms with zero coefficients are adapted as well.
    pub all_terms: bool,
    /// Innovation gate.
    pub gate: InnovationGate,
}

/// Default time constant of the forgetting \[s\].
pub(super) const FORGETTING_S: f64 = 60.0;

/// Default weight of the reference model \[s\].
pub(super) const PRIOR_S: f64 = 10.0;

impl Default for LeastSquaresOptions {
    fn default() -> Self {
        Self {
            forgetting_s: FORGETTING_S,
            window_s: None,
            prior_s: PRIOR_S,
            leak: true,
            all_terms: false,
            gate: InnovationGate::default(),
        }
    }
}

/// Resolved options.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ResolvedLeastSquares {
    /// Time constant of the forgetting \[s\]; `null` for none.
    pub forgetting_s: f64,
    /// Span of an increment \[s\].
    pub window_s: f64,
    /// Weight of the reference model \[s\].
    pub prior_s: f64,
    /// Leakage to the reference model.
    pub leak: bool,
    /// Whether all terms of the library are adapted.
    pub all_terms: bool,
    /// Innovations \[standard deviations\] above which samples are down-weighted and rejected.
    pub gate: [f64; 2],
}

/// Options of the core for a model; an error if the window is shorter than half a sample or too long.
#[doc(hidden)]
pub fn recursive_options(
    model: &Model,
    options: &LeastSquaresOptions,
) -> Result<RecursiveOptions, AdaptError> {
    let dt = model.description.dt;
    let wanted = options.window_s.unwrap_or_else(|| default_window_s(model));
    if !(wanted >= 0.5 * dt && wanted / dt < 1e6) {
        return Err(AdaptError::Window { window_s: wanted, dt, longest_s: f64::INFINITY });
    }
    // The number is between one and a million.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let window = (wanted / dt).round().max(1.0) as usize;
    Ok(RecursiveOptions {
        forgetting_s: options.forgetting_s,
        window,
        prior_s: options.prior_s,
        leak: options.leak,
        all_terms: options.all_terms,
        gate: options.gate,
    })
}

pub(super) fn adapter(
    model: &Model,
    motion: &NamedEquations<'_>,
    options: &LeastSquaresOptions,
) -> Result<(RecursiveEquations, ResolvedLeastSquares), AdaptError> {
    let recursive = recursive_options(model, options)?;
    let adapter = motion.learner(&recursive).map_err(AdaptError::Options)?;
    let used = ResolvedLeastSquares {
        forgetting_s: recursive.forgetting_s,
        window_s: recursive.window as f64 * model.description.dt,
        prior_s: recursive.prior_s,
        leak: recursive.leak,
        all_terms: recursive.all_terms,
        gate: [recursive.gate.inflate, recursive.gate.reject],
    };
    Ok((adapter, used))
}

pub(super) fn learned(model: &Model, weights: &[f64], all_terms: bool) -> Result<Model, AdaptError> {
    let motion = model.equations().ok_or(AdaptError::Weights)?;
    let equations = with_weights(motion.equations(), weights, all_terms)?;
    // The ensemble belongs to the previous coefficients.
    Ok(Model { body: Body::Equations(Arc::new(equations)), members: Members::default(), ..model.clone() })
}

/// Window of the model's identification, or 1 s. A weak form counts half: its test function averages about as much as
/// an increment over half of its window.
fn default_window_s(model: &Model) -> f64 {
    let chosen = &model.description.provenance.settings["chosen"]["regression"];
    let intervals = |kind: &str| chosen[kind]["intervals"].as_f64();
    let intervals = intervals("midpoint").or(intervals("weak").map(|n| (0.5 * n).max(1.0)));
    intervals.map_or(1.0, |intervals| intervals * model.description.dt)
}

/// Equations with other non-zero coefficients, or with all coefficients replaced.
fn with_weights(equations: &Equations, weights: &[f64], all_terms: bool) -> Result<Equations, AdaptError> {
    let adapts = |xi: &f64| all_terms || *xi != 0.0;
    let mut coefficients = equations.coefficients().to_vec();
    if coefficients.iter().filter(|xi| adapts(xi)).count() != weights.len() {
        return Err(AdaptError::Options(RecursiveOptionsError::Nothing));
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
    .map_err(|error| AdaptError::Options(RecursiveOptionsError::Equations(error)))
}
