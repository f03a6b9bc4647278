//! Adaptation of direct predictors by recursive least squares on their last layer.

use std::sync::Arc;

use hydroid_core::adapt::{DirectLastLayer, LastLayerOptions, SHORTEST_FORGETTING};
use hydroid_core::model::direct::Direct;
use serde::Serialize;

use super::{AdaptError, LeastSquaresOptions};
use crate::model::{Body, Members, Model};

/// Default time constant of the forgetting \[s\].
const FORGETTING_S: f64 = 300.0;

/// Default weight of the reference weights \[s\].
const PRIOR_S: f64 = 3e-3;

/// Time constant of the error variances, from which bands are computed \[s\].
const NOISE_S: f64 = 20.0;

impl LeastSquaresOptions {
    /// Defaults for direct predictors; window, choice of terms and gate do not apply. The prior is short because the
    /// features of the last layer are strongly collinear.
    pub fn for_last_layer() -> Self {
        Self { forgetting_s: FORGETTING_S, prior_s: PRIOR_S, ..Self::default() }
    }
}

/// Resolved options.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ResolvedLastLayer {
    /// Time constant of the forgetting \[s\]; `null` for none.
    pub forgetting_s: f64,
    /// Weight of the reference weights \[s\].
    pub prior_s: f64,
    /// Leakage to the reference weights.
    pub leak: bool,
}

fn last_layer_options(options: &LeastSquaresOptions, dt: f64) -> LastLayerOptions {
    LastLayerOptions {
        forgetting: (-dt / options.forgetting_s).exp(),
        information: options.prior_s / dt,
        leak: options.leak,
        noise_rate: (dt / NOISE_S).min(1.0),
    }
}

pub(super) fn adapter(
    model: &Model,
    direct: &Arc<Direct>,
    options: &LeastSquaresOptions,
) -> Result<(DirectLastLayer, ResolvedLastLayer), AdaptError> {
    let (given_s, least_s) = (options.forgetting_s, SHORTEST_FORGETTING * model.description.dt);
    if given_s.is_nan() || given_s < least_s {
        return Err(AdaptError::Forgetting { given_s, least_s });
    }
    let adapter =
        DirectLastLayer::new(Arc::clone(direct), &last_layer_options(options, model.description.dt))?;
    let LeastSquaresOptions { forgetting_s, prior_s, leak, .. } = *options;
    Ok((adapter, ResolvedLastLayer { forgetting_s, prior_s, leak }))
}

/// Session of the reference model for the guard.
pub(super) fn companion(
    model: &Model,
    direct: &Arc<Direct>,
    options: &LeastSquaresOptions,
) -> Result<DirectLastLayer, AdaptError> {
    Ok(DirectLastLayer::companion(Arc::clone(direct), &last_layer_options(options, model.description.dt))?)
}

pub(super) fn learned(model: &Model, direct: &Direct, weights: &[f64]) -> Result<Model, AdaptError> {
    let features = direct.network.hidden.last().copied().unwrap_or(direct.network.inputs);
    let len = (features + 1) * direct.network.outputs;
    if weights.len() != len || weights.iter().any(|w| !w.is_finite()) {
        return Err(AdaptError::Weights);
    }
    let mut own = direct.clone();
    // The last layer is at the end of the weights.
    let at = own.weights.len() - len;
    own.weights[at..].copy_from_slice(weights);
    // The ensemble belongs to the previous weights.
    Ok(Model { body: Body::Direct(Arc::new(own)), members: Members::default(), ..model.clone() })
}
