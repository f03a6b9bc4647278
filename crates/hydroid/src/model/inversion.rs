//! Models in the affine form of control laws: `d nu/dt = f(nu) + sum_i g_i(nu) e_i`.

use std::sync::Arc;

use hydroid_core::actuator::Channel;
use hydroid_core::control::{Affine, AffineEquations, AffineNetwork, AffinePlant, Motion};
use hydroid_core::model::sparse::Equations;

use crate::craft::CraftFile;

#[derive(Debug)]
pub(crate) enum InvertibleModel {
    Equations(Box<AffineEquations>),
    Plant(Box<AffinePlant>),
    Network(Box<AffineNetwork>),
}

impl Clone for InvertibleModel {
    fn clone(&self) -> Self {
        match self {
            Self::Equations(equations) => Self::Equations(equations.clone()),
            Self::Plant(plant) => Self::Plant(plant.clone()),
            Self::Network(network) => Self::Network(network.clone()),
        }
    }

    /// Copies without allocation between models of one kind.
    fn clone_from(&mut self, from: &Self) {
        match (self, from) {
            (Self::Equations(into), Self::Equations(from)) => into.clone_from(from),
            (Self::Plant(into), Self::Plant(from)) => into.clone_from(from),
            (Self::Network(into), Self::Network(from)) => into.clone_from(from),
            (into, from) => *into = from.clone(),
        }
    }
}

impl InvertibleModel {
    /// Writes the measured actuator states of a model that has them as outputs; NaN otherwise.
    pub(crate) fn actuators_of(&self, y: &[f64], into: &mut [f64]) {
        match self {
            Self::Equations(equations) => equations.actuators_of(y, into),
            Self::Plant(_) | Self::Network(_) => into.fill(f64::NAN),
        }
    }
}

impl Affine for InvertibleModel {
    fn channels(&self) -> &[Channel] {
        match self {
            Self::Equations(equations) => equations.channels(),
            Self::Plant(plant) => plant.channels(),
            Self::Network(network) => network.channels(),
        }
    }

    fn evaluate(&mut self, nu: [f64; 3], into: &mut Motion) {
        match self {
            Self::Equations(equations) => equations.evaluate(nu, into),
            Self::Plant(plant) => plant.evaluate(nu, into),
            Self::Network(network) => network.evaluate(nu, into),
        }
    }
}

/// Map from the weights of an adapter to the coefficients of an [`InvertibleModel`].
pub(crate) enum WeightMap {
    Equations {
        coefficients: Vec<f64>,
        places: Vec<usize>,
    },
    /// Numbers of a vessel, and the places of each weight.
    Vessel {
        numbers: Vec<f64>,
        places: Vec<Vec<usize>>,
    },
}

impl WeightMap {
    pub(crate) fn equations(equations: &Arc<Equations>) -> Self {
        let coefficients = equations.coefficients().to_vec();
        let places = (0..coefficients.len()).filter(|&place| coefficients[place] != 0.0).collect();
        Self::Equations { coefficients, places }
    }

    pub(crate) fn vessel(file: &CraftFile) -> Self {
        let numbers = file.craft.parameters().into_iter().map(|(_, number)| number).collect();
        Self::Vessel { numbers, places: file.learned() }
    }

    pub(crate) const fn len(&self) -> usize {
        match self {
            Self::Equations { places, .. } => places.len(),
            Self::Vessel { places, .. } => places.len(),
        }
    }

    /// Writes weights to the coefficients of a model. Invalid vessel parameters leave the model unchanged.
    pub(crate) fn apply(&mut self, weights: &[f64], into: &mut InvertibleModel) {
        match (self, into) {
            (Self::Equations { coefficients, places }, InvertibleModel::Equations(affine)) => {
                for (&place, weight) in places.iter().zip(weights) {
                    coefficients[place] = *weight;
                }
                affine.set_coefficients(coefficients);
            }
            (Self::Vessel { numbers, places }, InvertibleModel::Plant(affine)) => {
                for (group, weight) in places.iter().zip(weights) {
                    for &place in group {
                        numbers[place] = *weight;
                    }
                }
                affine.set_numbers(numbers);
            }
            _ => {}
        }
    }
}
