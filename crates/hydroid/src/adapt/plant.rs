//! Adaptation of vessels by an extended Kalman filter over motion, positions of the actuators and numbers.

use hydroid_core::adapt::kalman::{KalmanError, KalmanPlant, LearnablePlant};
use hydroid_core::model::CraftModel;
use serde::Serialize;

use super::AdaptError;
use super::kalman::{KalmanOptions, ResolvedKalman};
use crate::log::Trajectory;
use crate::model::{Model, NamedCraft};

/// A number of a vessel before and after the adaptation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LearnedParameter {
    /// Path in the vessel file.
    pub path: String,
    /// Unit.
    pub unit: &'static str,
    /// Value before.
    pub given: f64,
    /// Value after.
    pub learned: f64,
}

impl KalmanOptions {
    /// Defaults for vessels. Variances of weights are those of relative changes of the numbers.
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
    vessel: &NamedCraft,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<(KalmanPlant, ResolvedKalman), AdaptError> {
    let noise = options.noise_of(model, runs)?;
    let learning = vessel.model.clone().with_learned(vessel.file.learned());
    let learnable = LearnablePlant::new(&learning);
    let scale = &learnable.scale()[..CraftModel::OUTPUTS];
    let filter = options.uniform(learnable.places().len(), &noise, scale, learning.dt());
    let adapter = KalmanPlant::new(&learning, filter).map_err(KalmanError::Options)?;
    Ok((adapter, options.resolved(noise)))
}

pub(super) fn learned(model: &Model, vessel: &NamedCraft, weights: &[f64]) -> Result<Model, AdaptError> {
    let (mut file, groups) = (vessel.file.clone(), vessel.file.learned());
    if weights.len() != groups.len() {
        return Err(AdaptError::Weights);
    }
    let mut numbers: Vec<f64> = file.craft.parameters().iter().map(|(_, number)| *number).collect();
    for (group, weight) in groups.iter().zip(weights) {
        for &index in group {
            numbers[index] = *weight;
        }
    }
    file.set_numbers(&numbers);
    // The estimates are those of an identification: they do not hold for the numbers of an adaptation.
    file.estimate.iter_mut().for_each(|estimate| estimate.deviation = None);
    let learned = Model::of_craft(&file, vessel.model.dt()).map_err(|_| AdaptError::Weights)?;
    Ok(Model { description: model.description.clone(), ..learned })
}

/// Numbers before and after that an adaptation learns; empty for other models.
pub(super) fn parameters(before: &Model, after: &Model) -> Vec<LearnedParameter> {
    let (Some(before), Some(after)) = (before.craft_file(), after.craft_file()) else { return Vec::new() };
    let (given, learned) = (before.craft.parameters(), after.craft.parameters());
    let of = |group: Vec<usize>| {
        let (parameter, given) = &given[group[0]];
        LearnedParameter {
            path: parameter.path.clone(),
            unit: parameter.unit,
            given: *given,
            learned: learned[group[0]].1,
        }
    };
    before.learned().into_iter().map(of).collect()
}
