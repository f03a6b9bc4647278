//! Recurrent networks in a file: one tensor for each of PyTorch's, under its name, and `coefficients` of the equations
//! that a grey box corrects.

use std::sync::Arc;

use hydroid_core::model::recurrent::{BaseModel, Network, Recurrent, Scaling, StateFilter};
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::super::{Body, Description, Members, Model};
use super::equations::{self, Library};
use super::tensors::{Written, weights, write};

/// A wash-out at the most \[samples\].
const LONGEST: usize = 1_000_000;

/// Structure of a network.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Structure {
    network: Network,
    #[serde(with = "ScalingFields")]
    scaling: Scaling,
    base: BaseFields,
    feedback: bool,
    wash_out: usize,
    /// Whether measurements correct the hidden state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    state_filter: Option<StateFilter>,
}

/// The fields of [`Scaling`].
#[derive(Serialize, Deserialize)]
#[serde(remote = "Scaling", deny_unknown_fields)]
pub(super) struct ScalingFields {
    output_mean: Vec<f64>,
    output_scale: Vec<f64>,
    input_mean: Vec<f64>,
    input_scale: Vec<f64>,
    correction_scale: Vec<f64>,
}

/// What the network corrects.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum BaseFields {
    Nothing,
    Hold,
    Equations(Library),
}

impl Structure {
    /// Structure and tensors of a network.
    pub(super) fn write(recurrent: &Recurrent) -> Result<(Self, Vec<Written>), String> {
        let mut tensors = Vec::new();
        for tensor in recurrent.network.tensors() {
            let values = recurrent
                .weights
                .get(tensor.range())
                .ok_or_else(|| format!("the network has {} weights", recurrent.weights.len()))?;
            tensors.push(write(&tensor.name, tensor.shape(), values));
        }
        let base = match &recurrent.base {
            BaseModel::Nothing => BaseFields::Nothing,
            BaseModel::Hold => BaseFields::Hold,
            BaseModel::Equations(of) => {
                tensors.push(equations::coefficients(of));
                BaseFields::Equations(Library::of(of))
            }
        };
        let structure = Self {
            network: recurrent.network,
            scaling: recurrent.scaling.clone(),
            base,
            feedback: recurrent.feedback,
            wash_out: recurrent.wash_out,
            state_filter: recurrent.state_filter.clone(),
        };
        Ok((structure, tensors))
    }

    /// The model, with its numbers from the file.
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let Self { network, scaling, base, feedback, wash_out, state_filter } = self;
        // Sizes come before whatever is made from them.
        network.check().map_err(|error| error.to_string())?;
        if wash_out > LONGEST {
            return Err(format!("a wash-out of {wash_out} samples is longer than any log"));
        }
        if !(description.dt.is_finite() && description.dt > 0.0) {
            return Err(format!("its sample time is {} s", description.dt));
        }
        let weights = weights(&network.tensors(), tensors)?;
        let base = match base {
            BaseFields::Nothing => BaseModel::Nothing,
            BaseFields::Hold => BaseModel::Hold,
            BaseFields::Equations(terms) => {
                BaseModel::Equations(Arc::new(terms.read(tensors, &description)?))
            }
        };
        let recurrent = Recurrent { network, weights, scaling, base, feedback, wash_out, state_filter };
        let (outputs, inputs) = (description.outputs.len(), description.inputs.len());
        recurrent.check().map_err(|error| error.to_string())?;
        if recurrent.scaling.output_mean.len() != outputs || recurrent.scaling.input_mean.len() != inputs {
            return Err(format!(
                "its network is of {} outputs and {} inputs, its description of {outputs} and {inputs}",
                recurrent.scaling.output_mean.len(),
                recurrent.scaling.input_mean.len()
            ));
        }
        let body = Body::Recurrent(Arc::new(recurrent));
        Ok(Model { description, body, members: Members::default(), learning: None })
    }
}
