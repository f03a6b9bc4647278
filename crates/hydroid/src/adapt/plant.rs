//! Adaptation of vessels by an extended Kalman filter over motion, propeller force and parameters.

use hydroid_core::adapt::kalman::{KalmanError, KalmanPlant, LearnablePlant};
use hydroid_core::model::PlantModel;
use hydroid_core::vessel::PARAMETER;
use serde::Serialize;

use super::AdaptError;
use super::kalman::{KalmanOptions, ResolvedKalman};
use crate::log::Trajectory;
use crate::model::Model;

/// A parameter of a vessel before and after the adaptation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LearnedParameter {
    /// Path in the vessel file.
    pub path: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Value before.
    pub given: f64,
    /// Value after.
    pub learned: f64,
}

impl KalmanOptions {
    /// Defaults for vessels. Variances of weights are those of relative parameter changes.
    pub fn of_plants() -> Self {
        Self {
            weight_variance: 0.01,
            weight_noise_per_s: 1e-6,
            state_noise_per_s: 1e-5,
            noise_factor: 1.0,
            leak_s: f64::INFINITY,
            ..Self::default()
        }
    }
}

/// Adapter of a vessel and its resolved options. `runs` give the noise if options and model do not.
pub(super) fn adapter(
    model: &Model,
    plant: &PlantModel,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<(KalmanPlant, ResolvedKalman), AdaptError> {
    let noise = options.noise_of(model, runs)?;
    let learnable = LearnablePlant::new(plant);
    let scale = &learnable.scale()[..PlantModel::OUTPUTS];
    let filter = options.uniform(learnable.places().len(), &noise, scale, plant.dt());
    let adapter = KalmanPlant::new(plant, filter).map_err(KalmanError::Options)?;
    Ok((adapter, options.resolved(noise)))
}

pub(super) fn learned(model: &Model, plant: &PlantModel, weights: &[f64]) -> Result<Model, AdaptError> {
    let (mut numbers, learnable) = (*plant.numbers(), LearnablePlant::new(plant));
    if weights.len() != learnable.places().len() {
        return Err(AdaptError::Weights);
    }
    for (&place, weight) in learnable.places().iter().zip(weights) {
        numbers[place] = *weight;
    }
    let mut params = plant.params().clone();
    params.set_numbers(&numbers);
    let learned = Model::of_vessel(&params, plant.dt()).map_err(|_| AdaptError::Weights)?;
    Ok(Model { description: model.description.clone(), ..learned })
}

/// Parameters before and after; empty for other models.
pub(super) fn parameters(before: &Model, after: &Model) -> Vec<LearnedParameter> {
    let (Some(before), Some(after)) = (before.plant(), after.plant()) else { return Vec::new() };
    PARAMETER
        .iter()
        .zip(before.numbers().iter().zip(after.numbers()))
        .filter(|(_, (given, _))| **given != 0.0)
        .map(|(p, (&given, &learned))| LearnedParameter { path: p.path, unit: p.unit, given, learned })
        .collect()
}
