//! Direct predictors. File: weights with PyTorch's names, `coefficients` of the base equations, the ensemble.

use std::sync::Arc;

use hydroid_core::model::direct::{Direct, DirectSession, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Scaling};
use hydroid_core::model::sparse::Equations;
use hydroid_core::predict::Predictor;
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::equations::{self, Library};
use super::recurrent::ScalingFields;
use super::{Body, Encoded, Kind, check_channels, layer_sizes};
use crate::model::file::{ensemble, network_tensors, weights};
use crate::model::{Description, Model};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::model) struct Structure {
    network: Perceptron,
    #[serde(with = "ScalingFields")]
    scaling: Scaling,
    history: usize,
    horizon: usize,
    hold: bool,
    /// Base equations; excludes `hold`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    equations: Option<Library>,
}

impl Structure {
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let Self { network, scaling, history, horizon, hold, equations } = self;
        // Sizes are checked before anything is allocated.
        network.check().map_err(|error| error.to_string())?;
        if !(description.dt.is_finite() && description.dt > 0.0) {
            return Err(format!("its sample time is {} s", description.dt));
        }
        let weights = weights(&network.tensors(), tensors)?;
        let members = ensemble::read(tensors, weights.len())?;
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
        check_channels(direct.outputs(), direct.inputs(), &description)?;
        Ok(Model { description, body: Body::Direct(Arc::new(direct)), members, learning: None })
    }
}

impl Kind for Arc<Direct> {
    fn name(&self, _: &Model) -> &'static str {
        "direct"
    }

    fn title(&self, _: &Model) -> &'static str {
        match self.base {
            BaseModel::Equations(_) => {
                "A direct predictor on equations of motion: a feed-forward network for all steps of a horizon"
            }
            BaseModel::Nothing | BaseModel::Hold => {
                "A direct predictor: a feed-forward network for all steps of a horizon"
            }
        }
    }

    fn weights(&self) -> usize {
        self.weights.len()
    }

    fn session(&self, _: &Model) -> Box<dyn Predictor> {
        match DirectSession::new(Self::clone(self)) {
            Ok(session) => Box::new(session),
            Err(error) => panic!("{error}"),
        }
    }

    fn encode(&self, model: &Model) -> Result<Encoded, String> {
        let mut tensors = network_tensors(&self.network.tensors(), &self.weights)?;
        tensors.extend(ensemble::write(&model.members)?);
        tensors.extend(self.equations().map(|base| equations::coefficients(base)));
        let structure = Structure {
            network: self.network.clone(),
            scaling: self.scaling.clone(),
            history: self.history,
            horizon: self.horizon,
            hold: self.base == BaseModel::Hold,
            equations: self.equations().map(|base| Library::of(base)),
        };
        Ok(Encoded::Tensors(super::Structure::Direct(structure), tensors))
    }

    fn scaling(&self) -> Option<&Scaling> {
        Some(&self.scaling)
    }

    fn network_text(&self, description: &Description) -> Vec<String> {
        let seconds = |samples: usize| samples as f64 * description.dt;
        vec![
            format!("feed-forward network {}, tanh between its layers", layer_sizes(&self.network)),
            format!(
                "inputs: the last {} samples ({:.3} s) of outputs and inputs, and the future inputs",
                self.history,
                seconds(self.history)
            ),
            format!(
                "outputs: the next {} samples ({:.3} s) at once{}; longer predictions are chained",
                self.horizon,
                seconds(self.horizon),
                match self.base {
                    BaseModel::Nothing => "",
                    BaseModel::Hold => ", as differences to the present outputs",
                    BaseModel::Equations(_) =>
                        ", as corrections of a rollout of equations of motion (a grey box)",
                }
            ),
        ]
    }

    fn base_equations(&self) -> Option<&Arc<Equations>> {
        self.equations()
    }

    fn ensemble_numbers(&self) -> usize {
        self.weights.len()
    }

    fn member_session(&self, weights: Vec<f64>) -> Option<Box<dyn Predictor>> {
        let member = Direct { weights, ..Direct::clone(self) };
        Some(Box::new(DirectSession::new(Self::new(member)).ok()?))
    }
}
