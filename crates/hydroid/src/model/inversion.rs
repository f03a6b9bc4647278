//! Models in the affine form of control laws: `d nu/dt = f(nu) + sum_i g_i(nu) e_i`.

use std::sync::Arc;

use hydroid_core::actuator::Channel;
use hydroid_core::control::{Affine, AffineEquations, AffineNetwork, AffinePlant, Motion};
use hydroid_core::craft::Craft;
use hydroid_core::model::PlantModel;
use hydroid_core::model::sparse::Equations;
use hydroid_core::vessel::{Numbers, PARAMETER, VesselParams};

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
    Equations { coefficients: Vec<f64>, places: Vec<usize> },
    Plant { params: Box<VesselParams>, numbers: Box<Numbers>, places: Vec<usize> },
}

impl WeightMap {
    pub(crate) fn equations(equations: &Arc<Equations>) -> Self {
        let coefficients = equations.coefficients().to_vec();
        let places = (0..coefficients.len()).filter(|&place| coefficients[place] != 0.0).collect();
        Self::Equations { coefficients, places }
    }

    pub(crate) fn plant(plant: &Arc<PlantModel>) -> Self {
        let (params, numbers) = (Box::new(plant.params().clone()), Box::new(*plant.numbers()));
        let places = plant_places(plant.params()).into_iter().map(|(_, place)| place).collect();
        Self::Plant { params, numbers, places }
    }

    pub(crate) const fn len(&self) -> usize {
        match self {
            Self::Equations { places, .. } | Self::Plant { places, .. } => places.len(),
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
            (Self::Plant { params, numbers, places }, InvertibleModel::Plant(affine)) => {
                for (&place, weight) in places.iter().zip(weights) {
                    numbers[place] = *weight;
                }
                params.set_numbers(numbers);
                if let Ok(learned) = AffinePlant::new(params) {
                    **affine = learned;
                }
            }
            _ => {}
        }
    }
}

/// Index in [`Craft::parameters`] and in [`PARAMETER`] of the numbers of a vessel that an adapter learns, in the order of its
/// weights: those that are not zero.
pub(crate) fn plant_places(params: &VesselParams) -> Vec<(usize, usize)> {
    let numbers = params.numbers();
    let place = |path: &str| {
        let path = match path {
            "thruster.propeller.lag" => "propeller.lag",
            "rudder.rudder.gain" => "rudder.gain",
            path => path,
        };
        PARAMETER.iter().position(|parameter| parameter.path == path)
    };
    let all = Craft::from(params).parameters().into_iter().enumerate();
    all.filter_map(|(index, (parameter, _))| Some((index, place(&parameter.path)?)))
        .filter(|(_, place)| numbers[*place] != 0.0)
        .collect()
}
