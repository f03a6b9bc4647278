//! Control-affine networks in a file: one tensor for each of PyTorch's, under its name; how commands act is in the head.

use std::sync::Arc;

use hydroid_core::model::affine::{ControlAffine, Effector};
use hydroid_core::model::direct::Perceptron;
use hydroid_core::model::recurrent::Scaling;
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::super::{Body, Description, Members, Model};
use super::recurrent::ScalingFields;
use super::tensors::{Written, weights, write};

/// Structure of a control-affine network.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Structure {
    network: Perceptron,
    #[serde(with = "ScalingFields")]
    scaling: Scaling,
    effectors: Vec<Effector>,
    wash_out: usize,
}

impl Structure {
    /// Structure and tensors of a network.
    pub(super) fn write(affine: &ControlAffine) -> Result<(Self, Vec<Written>), String> {
        let ControlAffine { network, weights, scaling, effectors, wash_out, .. } = affine.clone();
        let mut tensors = Vec::new();
        for tensor in network.tensors() {
            let values = weights
                .get(tensor.range())
                .ok_or_else(|| format!("the network has {} weights", weights.len()))?;
            tensors.push(write(&tensor.name, tensor.shape(), values));
        }
        Ok((Self { network, scaling, effectors, wash_out }, tensors))
    }

    /// The model, with its numbers from the file.
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let Self { network, scaling, effectors, wash_out } = self;
        // Sizes come before whatever is made from them.
        network.check().map_err(|error| error.to_string())?;
        let weights = weights(&network.tensors(), tensors)?;
        let dt = description.dt;
        let affine = ControlAffine { network, weights, scaling, effectors, dt, wash_out };
        affine.check().map_err(|error| error.to_string())?;
        let (outputs, inputs) = (description.outputs.len(), description.inputs.len());
        if (affine.outputs(), affine.inputs()) != (outputs, inputs) {
            return Err(format!(
                "its network is of {} outputs and {} inputs, its description of {outputs} and {inputs}",
                affine.outputs(),
                affine.inputs()
            ));
        }
        let (body, members) = (Body::Affine(Arc::new(affine)), Members::default());
        Ok(Model { description, body, members, learning: None })
    }
}
