//! Vessels: an extended Kalman filter over the motion, the hidden propeller force, and the parameters.
//!
//! # How the defaults were chosen
//!
//! On simulated hydrofoils alone, 900 s of `mixed` commands with seeds 101 and 102, adapted from the built-in one: itself,
//! and with 1.3 times the surge drag, 1.2 times the mass, 0.8 times the rudder gain, a transition 0.3 m/s later, and all of
//! these together. Initial variances of the weights of 0.003, 0.01, 0.04 and 0.1: from 0.04 on the filter overshoots where
//! several parameters are wrong at once (mean NRMSE at 10 s of all together 0.087, of 0.01 0.026), because the take-off is
//! far from linear. Noise of the weights of 1e-7 and 1e-6 differ by less than a tenth of the errors; 1e-5 is worse. Of the
//! state 1e-7 trusts the form so much that it overshoots, 1e-3 is slower; 1e-5 is between these.

use hydroid_core::adapt::kalman::{KalmanError, KalmanPlant, LearnablePlant, Memory};
use hydroid_core::model::PlantModel;
use hydroid_core::predict::Predictor;
use hydroid_core::vessel::PARAMETER;
use serde::Serialize;

use super::AdaptError;
use super::kalman::{Kalman, UsedKalman, Which};
use crate::log::Trajectory;
use crate::model::Model;

/// A parameter of a vessel before and after.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LearnedParameter {
    /// Where it stands in the vessel's file.
    pub path: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// As the vessel had it.
    pub given: f64,
    /// As it was learned.
    pub learned: f64,
}

impl Kalman {
    /// For vessels; chosen on simulated ones. Variances of weights are of relative changes of parameters.
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

/// The session that adapts a vessel, and the settings that it was made with. `runs` tell the noise where nothing else does.
pub(super) fn adapter(
    model: &Model,
    plant: &PlantModel,
    options: &Kalman,
    runs: &[&Trajectory],
) -> Result<(KalmanPlant, UsedKalman), AdaptError> {
    if options.weights != Which::All {
        return Err(AdaptError::OnlyNetworks { what: "a choice of the layers that learn" });
    }
    if options.single_precision {
        return Err(AdaptError::OnlyNetworks { what: "single precision" });
    }
    let noise = options.noise_of(model, runs)?;
    let learnable = LearnablePlant::new(plant);
    let scale = &learnable.scale()[..PlantModel::OUTPUTS];
    let tuning = options.uniform(learnable.places().len(), &noise, scale, plant.dt());
    let adapter = KalmanPlant::new(plant, tuning).map_err(KalmanError::Tuning)?;
    Ok((adapter, options.used(noise)))
}

/// The same filter on motion and propeller force alone: of the parameters it is sure.
pub(super) fn filtered(
    model: &Model,
    plant: &PlantModel,
    options: &Kalman,
    runs: &[&Trajectory],
) -> Result<Box<dyn Predictor>, AdaptError> {
    let sure = Kalman {
        weight_variance: 0.0,
        weight_noise_per_s: 0.0,
        leak_s: f64::INFINITY,
        forgetting_s: f64::INFINITY,
        memory: Memory::Full,
        ..options.clone()
    };
    let (session, _) = adapter(model, plant, &sure, runs)?;
    Ok(Box::new(session))
}

/// The vessel with the parameters that an adapter of it has.
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
    // Channels and ranges stay those that it was read with.
    Ok(Model { description: model.description.clone(), ..learned })
}

/// Parameters before and after; none for other models.
pub(super) fn parameters(before: &Model, after: &Model) -> Vec<LearnedParameter> {
    let (Some(before), Some(after)) = (before.plant(), after.plant()) else { return Vec::new() };
    PARAMETER
        .iter()
        .zip(before.numbers().iter().zip(after.numbers()))
        .filter(|(_, (given, _))| **given != 0.0)
        .map(|(p, (&given, &learned))| LearnedParameter { path: p.path, unit: p.unit, given, learned })
        .collect()
}
