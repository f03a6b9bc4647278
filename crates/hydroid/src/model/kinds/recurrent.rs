//! Recurrent networks. File: weights as tensors with PyTorch's names, and `coefficients` of the base equations.

use std::sync::Arc;

use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, RecurrentSession, Scaling};
use hydroid_core::model::sparse::Equations;
use hydroid_core::predict::Predictor;
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::equations::{self, Library};
use super::{Body, Encoded, Kind, check_channels};
use crate::model::file::{network_tensors, weights};
use crate::model::{Description, Members, Model};

const MAX_WASH_OUT: usize = 1_000_000;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::model) struct Structure {
    network: Network,
    #[serde(with = "ScalingFields")]
    scaling: Scaling,
    base: BaseFields,
    feedback: bool,
    wash_out: usize,
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

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum BaseFields {
    Nothing,
    Hold,
    Equations(Library),
}

impl Structure {
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let Self { network, scaling, base, feedback, wash_out } = self;
        // Sizes are checked before anything is allocated.
        network.check().map_err(|error| error.to_string())?;
        if wash_out > MAX_WASH_OUT {
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
        let recurrent = Recurrent { network, weights, scaling, base, feedback, wash_out };
        recurrent.check().map_err(|error| error.to_string())?;
        let scaling = &recurrent.scaling;
        check_channels(scaling.output_mean.len(), scaling.input_mean.len(), &description)?;
        let body = Body::Recurrent(Arc::new(recurrent));
        Ok(Model { description, body, members: Members::default(), learning: None })
    }
}

/// Description of a cell: `LSTM with 18 cells, projected to 3`.
pub fn cell_text(cell: &Cell) -> String {
    let s = |n: usize| if n == 1 { "" } else { "s" };
    match *cell {
        Cell::Lstm { hidden, projection: None } => format!("LSTM with {hidden} cell{}", s(hidden)),
        Cell::Lstm { hidden, projection: Some(to) } => {
            format!("LSTM with {hidden} cell{}, projected to {to}", s(hidden))
        }
        Cell::Gru { hidden } => format!("GRU with {hidden} cell{}", s(hidden)),
        Cell::Vanilla { hidden, layers } => {
            format!("vanilla recurrent network, {layers} layer{} of {hidden} cell{}", s(layers), s(hidden))
        }
    }
}

impl Kind for Arc<Recurrent> {
    fn name(&self, _: &Model) -> &'static str {
        "recurrent"
    }

    fn title(&self, _: &Model) -> &'static str {
        match self.base {
            BaseModel::Equations(_) => "A recurrent network on equations of motion",
            BaseModel::Nothing | BaseModel::Hold => "A recurrent network",
        }
    }

    fn weights(&self) -> usize {
        self.weights.len()
    }

    fn session(&self, _: &Model) -> Box<dyn Predictor> {
        match RecurrentSession::new(Self::clone(self)) {
            Ok(session) => Box::new(session),
            Err(error) => panic!("{error}"),
        }
    }

    fn encode(&self, _: &Model) -> Result<Encoded, String> {
        let mut tensors = network_tensors(&self.network.tensors(), &self.weights)?;
        let base = match &self.base {
            BaseModel::Nothing => BaseFields::Nothing,
            BaseModel::Hold => BaseFields::Hold,
            BaseModel::Equations(base) => {
                tensors.push(equations::coefficients(base));
                BaseFields::Equations(Library::of(base))
            }
        };
        let structure = Structure {
            network: self.network,
            scaling: self.scaling.clone(),
            base,
            feedback: self.feedback,
            wash_out: self.wash_out,
        };
        Ok(Encoded::Tensors(super::Structure::Recurrent(structure), tensors))
    }

    fn scaling(&self) -> Option<&Scaling> {
        Some(&self.scaling)
    }

    fn network_text(&self, description: &Description) -> Vec<String> {
        let network = &self.network;
        let output_layer =
            if network.read_out { "linear output layer" } else { "the hidden state is the output" };
        let inputs = if self.feedback {
            "inputs: the model's inputs and its outputs (predicted outputs in a rollout)"
        } else {
            "inputs: the model's inputs only"
        };
        let outputs = match self.base {
            BaseModel::Nothing => "outputs: the next outputs",
            BaseModel::Hold => "outputs: increments of the outputs",
            BaseModel::Equations(_) => {
                "outputs: corrections of equations of motion over a sample (a grey box)"
            }
        };
        vec![
            format!(
                "{}, {output_layer}; hidden state of length {}",
                cell_text(&network.cell),
                network.state_len()
            ),
            inputs.to_owned(),
            outputs.to_owned(),
            format!("wash-out: {} samples, {:.3} s", self.wash_out, self.wash_out as f64 * description.dt),
        ]
    }

    fn base_equations(&self) -> Option<&Arc<Equations>> {
        if let BaseModel::Equations(base) = &self.base { Some(base) } else { None }
    }
}
