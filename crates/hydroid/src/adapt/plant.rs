//! Adaptation of vessels by an extended Kalman filter over motion, positions of the actuators and numbers.

use hydroid_core::adapt::kalman::{KalmanError, KalmanPlant, LearnablePlant};
use hydroid_core::craft::Craft;
use hydroid_core::model::{CraftModel, PlantModel};
use hydroid_core::vessel::PARAMETER;
use serde::Serialize;

use super::AdaptError;
use super::kalman::{KalmanOptions, ResolvedKalman};
use crate::log::Trajectory;
use crate::model::{Body, Model, NamedCraft, plant_places};

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

/// A vessel in the form that learns.
pub(super) enum Vessel<'a> {
    /// With one propeller and one rudder.
    Plant(&'a PlantModel),
    /// With any set of actuators.
    Craft(&'a NamedCraft),
}

impl<'a> Vessel<'a> {
    /// The vessel of a model, if it is one.
    pub(super) fn of(model: &'a Model) -> Option<Self> {
        match &model.body {
            Body::Plant(plant) => Some(Self::Plant(plant)),
            Body::Craft(craft) => Some(Self::Craft(craft)),
            _ => None,
        }
    }

    /// The model whose numbers are learned.
    fn learning(&self) -> Result<CraftModel, AdaptError> {
        match self {
            Self::Plant(plant) => {
                let craft = Craft::from(plant.params());
                let learned =
                    plant_places(plant.params()).into_iter().map(|(index, _)| vec![index]).collect();
                Ok(CraftModel::new(craft, plant.dt()).map_err(|_| AdaptError::Weights)?.with_learned(learned))
            }
            Self::Craft(craft) => Ok(craft.model.clone().with_learned(craft.file.learned())),
        }
    }
}

/// Adapter of a vessel and its resolved options. `runs` give the noise if options and model do not.
pub(super) fn adapter(
    model: &Model,
    vessel: &Vessel<'_>,
    options: &KalmanOptions,
    runs: &[&Trajectory],
) -> Result<(KalmanPlant, ResolvedKalman), AdaptError> {
    let noise = options.noise_of(model, runs)?;
    let learning = vessel.learning()?;
    let learnable = LearnablePlant::new(&learning);
    let scale = &learnable.scale()[..CraftModel::OUTPUTS];
    let filter = options.uniform(learnable.places().len(), &noise, scale, learning.dt());
    let adapter = KalmanPlant::new(&learning, filter).map_err(KalmanError::Options)?;
    Ok((adapter, options.resolved(noise)))
}

pub(super) fn learned(model: &Model, vessel: &Vessel<'_>, weights: &[f64]) -> Result<Model, AdaptError> {
    let learned = match vessel {
        Vessel::Plant(plant) => {
            let (mut params, mut numbers) = (plant.params().clone(), *plant.numbers());
            let places = plant_places(&params);
            if weights.len() != places.len() {
                return Err(AdaptError::Weights);
            }
            for ((_, place), weight) in places.into_iter().zip(weights) {
                numbers[place] = *weight;
            }
            params.set_numbers(&numbers);
            Model::of_vessel(&params, plant.dt())
        }
        Vessel::Craft(craft) => {
            let (mut file, groups) = (craft.file.clone(), craft.file.learned());
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
            Model::of_craft(&file, craft.model.dt())
        }
    };
    let learned = learned.map_err(|_| AdaptError::Weights)?;
    Ok(Model { description: model.description.clone(), ..learned })
}

/// Numbers before and after that an adaptation learns; empty for other models.
pub(super) fn parameters(before: &Model, after: &Model) -> Vec<LearnedParameter> {
    match (&before.body, &after.body) {
        (Body::Plant(before), Body::Plant(after)) => PARAMETER
            .iter()
            .zip(before.numbers().iter().zip(after.numbers()))
            .filter(|(_, (given, _))| **given != 0.0)
            .map(|(p, (&given, &learned))| LearnedParameter {
                path: p.path.to_owned(),
                unit: p.unit,
                given,
                learned,
            })
            .collect(),
        (Body::Craft(before), Body::Craft(after)) => {
            let (given, learned) = (before.file.craft.parameters(), after.file.craft.parameters());
            let of = |group: Vec<usize>| {
                let (parameter, given) = &given[group[0]];
                LearnedParameter {
                    path: parameter.path.clone(),
                    unit: parameter.unit,
                    given: *given,
                    learned: learned[group[0]].1,
                }
            };
            before.file.learned().into_iter().map(of).collect()
        }
        _ => Vec::new(),
    }
}
