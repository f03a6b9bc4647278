//! Direct predictors in a file: one tensor for each of PyTorch's, under its name, `coefficients` of the equations that one
//! adds to, and the members of an ensemble.

use std::sync::Arc;

use hydroid_core::model::direct::{Direct, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Scaling};
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::super::{Body, Description, Model};
use super::equations::{self, Library};
use super::members;
use super::recurrent::ScalingFields;
use super::tensors::{Written, weights, write};

/// Structure of a direct predictor.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Structure {
    network: Perceptron,
    #[serde(with = "ScalingFields")]
    scaling: Scaling,
    history: usize,
    horizon: usize,
    hold: bool,
    /// The equations that it adds to; then it does not hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    equations: Option<Library>,
}

impl Structure {
    /// Structure and tensors of a direct predictor.
    pub(super) fn write(model: &Model, direct: &Direct) -> Result<(Self, Vec<Written>), String> {
        let mut tensors = Vec::new();
        for tensor in direct.network.tensors() {
            let values = direct
                .weights
                .get(tensor.range())
                .ok_or_else(|| format!("the network has {} weights", direct.weights.len()))?;
            tensors.push(write(&tensor.name, tensor.shape(), values));
        }
        tensors.extend(members::write(&model.members)?);
        tensors.extend(direct.equations().map(|of| equations::coefficients(of)));
        let equations = direct.equations().map(|of| Library::of(of));
        let hold = direct.base == BaseModel::Hold;
        let Direct { network, scaling, history, horizon, .. } = direct.clone();
        Ok((Self { network, scaling, history, horizon, hold, equations }, tensors))
    }

    /// The model, with its numbers from the file.
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let Self { network, scaling, history, horizon, hold, equations } = self;
        // Sizes come before whatever is made from them.
        network.check().map_err(|error| error.to_string())?;
        if !(description.dt.is_finite() && description.dt > 0.0) {
            return Err(format!("its sample time is {} s", description.dt));
        }
        let weights = weights(&network.tensors(), tensors)?;
        let members = members::read(tensors, weights.len())?;
        let base = match (hold, equations) {
            (false, None) => BaseModel::Nothing,
            (true, None) => BaseModel::Hold,
            (false, Some(terms)) => BaseModel::Equations(Arc::new(terms.read(tensors, &description)?)),
            (true, Some(_)) => {
                return Err(String::from("it adds both to the present outputs and to equations"));
            }
        };
        let direct = Direct { network, weights, scaling, history, horizon, base };
        direct.check().map_err(|error| error.to_string())?;
        let (outputs, inputs) = (description.outputs.len(), description.inputs.len());
        if (direct.outputs(), direct.inputs()) != (outputs, inputs) {
            return Err(format!(
                "its network is of {} outputs and {} inputs, its description of {outputs} and {inputs}",
                direct.outputs(),
                direct.inputs()
            ));
        }
        Ok(Model { description, body: Body::Direct(Arc::new(direct)), members, learning: None })
    }
}
