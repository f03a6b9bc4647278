//! The guard around an adapter, beside the reference model, whose state alone is filtered.

use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::guard::{Guard, GuardOptions};
use hydroid_core::model::recurrent::BaseModel;

use super::kalman::{KalmanOptions, LEAST_NOISE};
use super::{AdaptError, Options, ResolvedOptions, last_layer, learner};
use crate::log::Trajectory;
use crate::model::{Body, Model};

/// Variance of a state that is not corrected by measurements.
const NEGLIGIBLE_VARIANCE: f64 = 1e-12;

/// Process noise of the state filter \[1/s\].
const STATE_FILTER_PROCESS_PER_S: f64 = 1e-3;

pub(super) fn guard(
    model: &Model,
    options: &Options,
    settings: &GuardOptions,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, ResolvedOptions), AdaptError> {
    let (adapter, used) = learner(model, options, runs)?;
    let (unguarded, _) = learner(model, options, runs)?;
    let reference = reference(model, options, runs)?;
    let noise = match &used {
        ResolvedOptions::Kalman(used) => used.noise.clone(),
        ResolvedOptions::LeastSquares(_) | ResolvedOptions::LastLayer(_) | ResolvedOptions::Committee(_) => {
            options.kalman.noise_of(model, runs).unwrap_or_else(|_| default_noise(model))
        }
    };
    let ranges = &model.description.ranges()[..model.description.outputs.len()];
    let guard = Guard::new(adapter, unguarded, reference, ranges, &noise, settings.clone())
        .map_err(AdaptError::Guard)?;
    Ok((Box::new(guard), used))
}

/// The reference model of a guard: constant weights, and a state that follows the measurements.
///
/// # Errors
/// If the options do not fit the model.
pub fn reference(
    model: &Model,
    options: &Options,
    runs: &[&Trajectory],
) -> Result<Box<dyn Adapter>, AdaptError> {
    if let Body::Direct(direct) = &model.body {
        let companion = last_layer::companion(model, direct, &options.least_squares)?;
        return Ok(model.whole_adapter(Box::new(companion)));
    }
    let constant = Options { kalman: constant_weights(model, options), ..options.clone() };
    let (mut reference, _) = learner(model, &constant, runs)?;
    reference.freeze(true);
    Ok(reference)
}

fn constant_weights(model: &Model, options: &Options) -> KalmanOptions {
    let filter = options.kalman.with_constant_weights();
    match &model.body {
        Body::Recurrent(network) if network.feedback || network.base != BaseModel::Nothing => {
            // Measurements enter as inputs.
            KalmanOptions {
                state_variance: NEGLIGIBLE_VARIANCE,
                state_noise_per_s: NEGLIGIBLE_VARIANCE,
                ..filter
            }
        }
        Body::Recurrent(_) => KalmanOptions {
            state_variance: 1.0,
            state_noise_per_s: STATE_FILTER_PROCESS_PER_S,
            noise_factor: 1.0,
            ..filter
        },
        Body::Equations(_) | Body::Direct(_) | Body::Affine(_) | Body::Committee(_) | Body::Craft(_) => {
            filter
        }
    }
}

/// Default standard deviations of the measurement noise: a fixed share of the design range.
fn default_noise(model: &Model) -> Vec<f64> {
    let of = |range: (f64, f64)| LEAST_NOISE * (range.1 - range.0);
    let ranges = model.description.ranges();
    ranges.into_iter().take(model.description.outputs.len()).map(of).collect()
}

impl Options {
    /// The options with a guard for a model.
    #[must_use]
    pub fn guarded(self, model: &Model) -> Self {
        Self { guard: Some(GuardOptions::new(model.description.dt)), ..self }
    }
}
