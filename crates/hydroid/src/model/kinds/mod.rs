//! Kinds of models: one file per kind, with its session, description, ensemble, inversion and file format.
//!
//! A new kind is a variant of [`Body`], an implementation of [`Kind`] in its own file, and its lines in this file.

mod committee;
mod control_affine;
mod craft;
mod direct;
mod equations;
mod recurrent;
mod vessel;

use std::sync::Arc;

use hydroid_core::adapt::Adapter;
use hydroid_core::control::ControlError;
use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::committee::Committee;
use hydroid_core::model::direct::{Direct, Perceptron};
use hydroid_core::model::recurrent::{Recurrent, Scaling};
use hydroid_core::model::sparse::Equations;
use hydroid_core::predict::Predictor;
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::file::Tensor;
use super::inversion::{InvertibleModel, WeightMap};
use super::{Description, Model, NamedEquations};

pub(super) use vessel::{parse as parse_vessel, read as read_vessel};

pub use committee::NamedMember;
pub use craft::NamedCraft;
pub use recurrent::cell_text;

/// Structure and numbers of a model, by kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Sparse equations of motion.
    Equations(Arc<Equations>),
    /// Recurrent network, with or without base equations.
    Recurrent(Arc<Recurrent>),
    /// Direct predictor: a feed-forward network with all outputs of a horizon.
    Direct(Arc<Direct>),
    /// Feed-forward network of the rates that is affine in the efforts of the inputs.
    Affine(Arc<ControlAffine>),
    /// Committee of difference equations.
    Committee(Arc<Committee>),
    /// Vessel with any set of actuators.
    Craft(Arc<NamedCraft>),
}

#[expect(clippy::large_enum_variant, reason = "one value exists at a time, while a file is written")]
pub(super) enum Encoded {
    /// Structure and tensors of a safetensors file.
    Tensors(Structure, Vec<Tensor>),
    /// Text of a vessel's TOML file.
    Text(String),
}

/// Reason why a model cannot be inverted by a control law.
#[derive(Debug)]
pub(crate) enum NotInvertible {
    /// The model is not affine in its commands: reason, further remedy.
    NotAffine(String, String),
    Control(ControlError),
}

impl From<ControlError> for NotInvertible {
    fn from(error: ControlError) -> Self {
        Self::Control(error)
    }
}

/// Capabilities of a kind of model. Defaults are for kinds without the capability.
pub(super) trait Kind {
    /// Name in files and messages.
    fn name(&self, model: &Model) -> &'static str;

    fn title(&self, model: &Model) -> &'static str;

    /// Number of weights, or of coefficients or parameters that are not zero.
    fn weights(&self) -> usize;

    fn session(&self, model: &Model) -> Box<dyn Predictor>;

    /// The session of a model that learns along each run.
    fn learning_session(&self, _: &Model) -> Option<Box<dyn Adapter>> {
        None
    }

    fn encode(&self, model: &Model) -> Result<Encoded, String>;

    fn scaling(&self) -> Option<&Scaling> {
        None
    }

    fn network_text(&self, _: &Description) -> Vec<String> {
        Vec::new()
    }

    fn base_equations(&self) -> Option<&Arc<Equations>> {
        None
    }

    /// Length of the vector of numbers that ensemble members replace; 0 for kinds without ensembles.
    fn ensemble_numbers(&self) -> usize {
        0
    }

    fn member_session(&self, _: Vec<f64>) -> Option<Box<dyn Predictor>> {
        None
    }

    /// Affine form for a control law; `motion` are the indices of `u`, `v`, `r` in the outputs.
    fn invert(&self, model: &Model, _: [usize; 3]) -> Result<InvertibleModel, NotInvertible> {
        let why = format!("a model of kind '{}' has no affine form in its commands", model.kind());
        Err(NotInvertible::NotAffine(why, String::new()))
    }

    /// Map from an adapter's weights to the coefficients of the affine form.
    fn weight_map(&self) -> Option<WeightMap> {
        None
    }
}

impl Body {
    pub(super) fn kind(&self) -> &dyn Kind {
        match self {
            Self::Equations(equations) => equations,
            Self::Recurrent(recurrent) => recurrent,
            Self::Direct(direct) => direct,
            Self::Affine(affine) => affine,
            Self::Committee(committee) => committee,
            Self::Craft(craft) => craft,
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum Structure {
    SparseEquations(equations::Structure),
    Recurrent(recurrent::Structure),
    Direct(direct::Structure),
    ControlAffine(control_affine::Structure),
    Committee(committee::Structure),
}

impl Structure {
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        match self {
            Self::SparseEquations(structure) => structure.read(tensors, description),
            Self::Recurrent(structure) => structure.read(tensors, description),
            Self::Direct(structure) => structure.read(tensors, description),
            Self::ControlAffine(structure) => structure.read(tensors, description),
            Self::Committee(structure) => structure.read(tensors, description),
        }
    }
}

impl Model {
    /// The equations of motion, if the model is of that kind.
    pub fn equations(&self) -> Option<NamedEquations<'_>> {
        let Body::Equations(equations) = &self.body else { return None };
        let members = Some(&self.members).filter(|_| self.learning.is_none());
        Some(NamedEquations { members, ..self.named(equations) })
    }

    /// The recurrent network, if the model is of that kind.
    pub fn recurrent(&self) -> Option<&Arc<Recurrent>> {
        if let Body::Recurrent(recurrent) = &self.body { Some(recurrent) } else { None }
    }

    /// The direct predictor, if the model is of that kind.
    pub fn direct(&self) -> Option<&Arc<Direct>> {
        if let Body::Direct(direct) = &self.body { Some(direct) } else { None }
    }

    /// The control-affine network, if the model is of that kind.
    pub fn control_affine(&self) -> Option<&Arc<ControlAffine>> {
        if let Body::Affine(affine) = &self.body { Some(affine) } else { None }
    }

    /// The committee, if the model is of that kind.
    pub fn committee(&self) -> Option<&Arc<Committee>> {
        if let Body::Committee(committee) = &self.body { Some(committee) } else { None }
    }
}

fn layer_sizes(network: &Perceptron) -> String {
    let all = [&[network.inputs], network.hidden.as_slice(), &[network.outputs]].concat();
    all.iter().map(usize::to_string).collect::<Vec<_>>().join("-")
}

fn check_channels(outputs: usize, inputs: usize, description: &Description) -> Result<(), String> {
    let expected = (description.outputs.len(), description.inputs.len());
    if (outputs, inputs) == expected {
        return Ok(());
    }
    Err(format!(
        "its network has {outputs} outputs and {inputs} inputs, its description {} and {}",
        expected.0, expected.1
    ))
}
