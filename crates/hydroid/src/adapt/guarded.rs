//! The guard around whatever learns: the same model from shore, twice, with a filter on its state alone.

use hydroid_core::adapt::Adapter;
use hydroid_core::adapt::guard::{Guard, GuardOptions};
use hydroid_core::adapt::kalman::Memory;
use hydroid_core::model::recurrent::BaseModel;

use super::kalman::{Kalman, LEAST_NOISE};
use super::{AdaptError, Options, Used, learner, read_out};
use crate::log::Trajectory;
use crate::model::{Body, Model};

/// Variances of a state that no measurement is to correct.
const SURE: f64 = 1e-12;

/// Process noise of the filter on the state alone, for a second.
const STATE_FILTER_PROCESS_PER_S: f64 = 1e-3;

/// A learner under guard, and the settings that it was made with.
pub(super) fn guard(
    model: &Model,
    options: &Options,
    settings: &GuardOptions,
    runs: &[&Trajectory],
) -> Result<(Box<dyn Adapter>, Used), AdaptError> {
    let (adapter, used) = learner(model, options, runs)?;
    let sure = Options { kalman: sure(model, options), ..options.clone() };
    let companion = || -> Result<Box<dyn Adapter>, AdaptError> {
        if let Body::Direct(direct) = &model.body {
            return Ok(Box::new(read_out::companion(model, direct, &options.least_squares)?));
        }
        let (mut companion, _) = learner(model, &sure, runs)?;
        companion.freeze(true);
        Ok(companion)
    };
    let noise = match &used {
        Used::Kalman(used) => used.noise.clone(),
        Used::LeastSquares(_) | Used::ReadOut(_) => {
            options.kalman.noise_of(model, runs).unwrap_or_else(|_| floor(model))
        }
    };
    let ranges = model.description.ranges();
    let guard = Guard::new(adapter, [companion()?, companion()?], &ranges, &noise, settings.clone())
        .map_err(AdaptError::Guard)?;
    Ok((Box::new(guard), used))
}

/// The filter of a model whose weights are known.
fn sure(model: &Model, options: &Options) -> Kalman {
    let sure = Kalman {
        weight_variance: 0.0,
        weight_noise_per_s: 0.0,
        leak_s: f64::INFINITY,
        rehearsal: None,
        forgetting_s: f64::INFINITY,
        memory: Memory::Full,
        ..options.kalman.clone()
    };
    match &model.body {
        Body::Recurrent(network) if network.feedback || network.base != BaseModel::Nothing => {
            // Measurements enter as its inputs.
            Kalman { state_variance: SURE, state_noise_per_s: SURE, ..sure }
        }
        Body::Recurrent(_) => Kalman {
            state_variance: 1.0,
            state_noise_per_s: STATE_FILTER_PROCESS_PER_S,
            noise_factor: 1.0,
            ..sure
        },
        Body::Equations(_) | Body::Direct(_) | Body::Affine(_) | Body::Plant(_) => sure,
    }
}

/// Noise of outputs of which nobody knows it: that of a sensor that is worth its range.
fn floor(model: &Model) -> Vec<f64> {
    let of = |range: (f64, f64)| LEAST_NOISE * (range.1 - range.0);
    let ranges = model.description.ranges();
    ranges.into_iter().take(model.description.outputs.len()).map(of).collect()
}

impl Options {
    /// The same under guard, for a model.
    #[must_use]
    pub fn guarded(self, model: &Model) -> Self {
        Self { guard: Some(GuardOptions::new(model.description.dt)), ..self }
    }
}
