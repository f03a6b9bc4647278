//! Vessels with any set of actuators. File: TOML.

use std::sync::Arc;

use hydroid_core::control::AffinePlant;
use hydroid_core::craft::Craft;
use hydroid_core::model::{CraftModel, CraftSession};
use hydroid_core::predict::Predictor;

use super::vessel::history_text;
use super::{Body, Encoded, InvertibleModel, Kind, NotInvertible, WeightMap};
use crate::craft::CraftFile;
use crate::model::Model;

/// A vessel with the content of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCraft {
    /// The vessel over samples.
    pub model: CraftModel,
    /// Its file.
    pub file: CraftFile,
}

impl Model {
    /// The vessel with any set of actuators, if the model is of that kind.
    pub fn craft(&self) -> Option<&Craft> {
        self.craft_file().map(|file| &file.craft)
    }

    /// The vessel file, if the model is a vessel with any set of actuators.
    pub fn craft_file(&self) -> Option<&CraftFile> {
        if let Body::Craft(craft) = &self.body { Some(&craft.file) } else { None }
    }

    /// Whether numbers of its vessel file are estimates.
    pub fn has_estimates(&self) -> bool {
        self.craft_file().is_some_and(|file| file.estimate.iter().any(|number| number.deviation.is_some()))
    }

    /// Whether the model is a vessel with given parameters, and not identified.
    pub fn is_vessel(&self) -> bool {
        matches!(self.body, Body::Craft(_))
    }
}

impl Kind for Arc<NamedCraft> {
    fn name(&self, _: &Model) -> &'static str {
        "craft"
    }

    fn title(&self, _: &Model) -> &'static str {
        "A vessel with given parameters"
    }

    fn weights(&self) -> usize {
        self.file.craft.parameters().iter().filter(|(_, number)| *number != 0.0).count()
    }

    fn session(&self, _: &Model) -> Box<dyn Predictor> {
        Box::new(CraftSession::new(&self.model))
    }

    fn encode(&self, model: &Model) -> Result<Encoded, String> {
        Ok(Encoded::Text(history_text(model) + &self.file.text()))
    }

    fn invert(&self, _: &Model, _: [usize; 3]) -> Result<InvertibleModel, NotInvertible> {
        let plant = AffinePlant::new(&self.file.craft)
            .map_err(|error| NotInvertible::NotAffine(error.to_string(), String::new()))?;
        Ok(InvertibleModel::Plant(Box::new(plant)))
    }

    fn weight_map(&self) -> Option<WeightMap> {
        Some(WeightMap::vessel(&self.file))
    }
}
