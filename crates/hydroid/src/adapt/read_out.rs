//! Direct predictors: recursive least squares on their last layer.

use std::sync::Arc;

use hydroid_core::adapt::{DirectReadOut, ReadOutSettings, SHORTEST_FORGETTING};
use hydroid_core::model::direct::Direct;
use serde::Serialize;

use super::{AdaptError, LeastSquares};
use crate::model::{Body, Members, Model};

/// Forgetting time \[s\] of direct predictors where none is asked for.
const FORGETTING_S: f64 = 300.0;

/// What the last layer from shore is worth \[s\] where nothing else is asked for.
const PRIOR_S: f64 = 3e-3;

/// Time \[s\] over which the errors of each step are known, of which bands are made.
const NOISE_S: f64 = 20.0;

impl LeastSquares {
    /// For direct predictors, of which the window, the choice of terms and the gate are not.
    ///
    /// The prior is short because what a last layer reads is alike in all of its numbers: a second of sailing says much about
    /// few directions and nothing about most.
    pub fn of_read_outs() -> Self {
        Self { forgetting_s: FORGETTING_S, prior_s: PRIOR_S, ..Self::default() }
    }
}

/// The settings that were used.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UsedReadOut {
    /// Forgetting time \[s\]; `null` where nothing is forgotten.
    pub forgetting_s: f64,
    /// What the last layer from shore is worth \[s\].
    pub prior_s: f64,
    /// Leak towards the last layer from shore.
    pub leak: bool,
}

/// The settings of the core for samples of `dt` seconds.
fn settings(options: &LeastSquares, dt: f64) -> ReadOutSettings {
    ReadOutSettings {
        forgetting: (-dt / options.forgetting_s).exp(),
        information: options.prior_s / dt,
        leak: options.leak,
        noise_rate: (dt / NOISE_S).min(1.0),
    }
}

/// The session that adapts a direct predictor, and the settings that it was made with.
pub(super) fn adapter(
    model: &Model,
    direct: &Arc<Direct>,
    options: &LeastSquares,
) -> Result<(DirectReadOut, UsedReadOut), AdaptError> {
    let (given_s, least_s) = (options.forgetting_s, SHORTEST_FORGETTING * model.description.dt);
    if given_s.is_nan() || given_s < least_s {
        return Err(AdaptError::Forgetting { given_s, least_s });
    }
    let adapter = DirectReadOut::new(Arc::clone(direct), &settings(options, model.description.dt))?;
    let LeastSquares { forgetting_s, prior_s, leak, .. } = *options;
    Ok((adapter, UsedReadOut { forgetting_s, prior_s, leak }))
}

/// The same that does not learn.
pub(super) fn companion(
    model: &Model,
    direct: &Arc<Direct>,
    options: &LeastSquares,
) -> Result<DirectReadOut, AdaptError> {
    Ok(DirectReadOut::companion(Arc::clone(direct), &settings(options, model.description.dt))?)
}

/// The model with the last layer that an adapter of it has.
pub(super) fn learned(model: &Model, direct: &Direct, weights: &[f64]) -> Result<Model, AdaptError> {
    let features = direct.network.hidden.last().copied().unwrap_or(direct.network.inputs);
    let len = (features + 1) * direct.network.outputs;
    if weights.len() != len || weights.iter().any(|w| !w.is_finite()) {
        return Err(AdaptError::Weights);
    }
    let mut own = direct.clone();
    // The last layer stands at the end.
    let at = own.weights.len() - len;
    own.weights[at..].copy_from_slice(weights);
    // The members are other networks around weights that this one no longer has.
    Ok(Model { body: Body::Direct(Arc::new(own)), members: Members::default(), ..model.clone() })
}
