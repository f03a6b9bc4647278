//! Control-affine networks. File: weights as tensors with PyTorch's names; the effectors are in the head.

use std::sync::Arc;

use hydroid_core::actuator::Map;
use hydroid_core::control::AffineNetwork;
use hydroid_core::model::affine::{ControlAffine, ControlAffineSession, Effector};
use hydroid_core::model::direct::Perceptron;
use hydroid_core::model::recurrent::Scaling;
use hydroid_core::predict::Predictor;
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::recurrent::ScalingFields;
use super::{Body, Encoded, InvertibleModel, Kind, NotInvertible, check_channels, layer_sizes};
use crate::model::file::{network_tensors, weights};
use crate::model::{Description, Members, Model};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::model) struct Structure {
    network: Perceptron,
    #[serde(with = "ScalingFields")]
    scaling: Scaling,
    effectors: Vec<Effector>,
    wash_out: usize,
}

impl Structure {
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let Self { network, scaling, effectors, wash_out } = self;
        // Sizes are checked before anything is allocated.
        network.check().map_err(|error| error.to_string())?;
        let weights = weights(&network.tensors(), tensors)?;
        let dt = description.dt;
        let affine = ControlAffine { network, weights, scaling, effectors, dt, wash_out };
        affine.check().map_err(|error| error.to_string())?;
        check_channels(affine.outputs(), affine.inputs(), &description)?;
        let (body, members) = (Body::Affine(Arc::new(affine)), Members::default());
        Ok(Model { description, body, members, learning: None })
    }
}

impl Kind for Arc<ControlAffine> {
    fn name(&self, _: &Model) -> &'static str {
        "control_affine"
    }

    fn title(&self, _: &Model) -> &'static str {
        "A control-affine network: a feed-forward network of the rates that is affine in its inputs"
    }

    fn weights(&self) -> usize {
        self.weights.len() + self.effectors.len()
    }

    fn session(&self, _: &Model) -> Box<dyn Predictor> {
        match ControlAffineSession::new(Self::clone(self)) {
            Ok(session) => Box::new(session),
            Err(error) => panic!("{error}"),
        }
    }

    fn encode(&self, _: &Model) -> Result<Encoded, String> {
        let ControlAffine { network, weights, scaling, effectors, wash_out, .. } = ControlAffine::clone(self);
        let tensors = network_tensors(&network.tensors(), &weights)?;
        let structure = Structure { network, scaling, effectors, wash_out };
        Ok(Encoded::Tensors(super::Structure::ControlAffine(structure), tensors))
    }

    fn scaling(&self) -> Option<&Scaling> {
        Some(&self.scaling)
    }

    fn network_text(&self, description: &Description) -> Vec<String> {
        let mut lines = vec![
            format!("feed-forward network {}, tanh between its layers", layer_sizes(&self.network)),
            String::from("outputs: rates f(outputs) + sum of g(outputs) phi(actuator), affine by structure"),
        ];
        for (port, effector) in description.inputs.iter().zip(&self.effectors) {
            let name = &port.channel.name;
            let phi = match effector.map {
                Map::Identity => "a".to_owned(),
                Map::Sine => "sin(a)".to_owned(),
                Map::SignedSquare => "a |a|".to_owned(),
            };
            let lag = effector.time_constant_s;
            lines.push(format!("{name}: phi(a) = {phi}, a follows {name} with a lag of {lag:.3} s"));
        }
        lines
    }

    fn invert(&self, _: &Model, _: [usize; 3]) -> Result<InvertibleModel, NotInvertible> {
        Ok(InvertibleModel::Network(Box::new(AffineNetwork::new(Self::clone(self))?)))
    }
}
