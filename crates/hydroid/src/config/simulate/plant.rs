//! Plants by name.

use std::path::Path;

use hydroid_core::vessel::VesselParams;

use crate::config::SettingError;
use crate::craft;
use crate::key::key;
use crate::model::{self, Model};
use crate::simulate::{self, built_in};

/// A plant with its name in messages.
#[derive(Clone, Debug)]
pub struct Plant {
    /// The name as given.
    pub name: String,
    /// The plant.
    pub kind: PlantKind,
}

/// Kinds of plants, which have different excitations.
#[derive(Clone, Debug)]
pub enum PlantKind {
    /// A vessel with one propeller and one rudder.
    Vessel(Box<VesselParams>),
    /// A vessel with any other set of actuators, or an identified model.
    Model(Box<Model>),
}

impl Plant {
    /// A plant by its name: a built-in vessel, a vessel file, or a model file. Built-in vessels precede files.
    ///
    /// # Errors
    /// If there is no plant of this name, or its file cannot be read.
    pub fn read(name: &str) -> Result<Self, SettingError> {
        let plant = |kind| Ok(Self { name: name.to_owned(), kind });
        if let Some(vessel) = built_in(name) {
            return plant(PlantKind::Vessel(Box::new(vessel)));
        }
        let path = Path::new(name);
        let Some(extension) = path.extension() else {
            return Err(SettingError::UnknownPlant { name: name.to_owned() });
        };
        let has_actuators = || std::fs::read_to_string(path).is_ok_and(|text| craft::is_craft(&text));
        if extension.eq_ignore_ascii_case("toml") && !has_actuators() {
            return plant(PlantKind::Vessel(Box::new(simulate::load_vessel(path)?)));
        }
        plant(PlantKind::Model(Box::new(model::read(path)?)))
    }

    /// The plant of a model.
    pub fn of(model: Model) -> Self {
        let name = model.description.name.clone();
        let kind = match model.plant() {
            Some(vessel) => PlantKind::Vessel(Box::new(vessel.params().clone())),
            None => PlantKind::Model(Box::new(model)),
        };
        Self { name, kind }
    }

    /// The text of the vessel's file.
    ///
    /// # Errors
    /// If the plant is an identified model.
    pub fn vessel_text(&self) -> Result<String, SettingError> {
        let text = match &self.kind {
            PlantKind::Vessel(vessel) => simulate::vessel_toml(vessel).map_err(|error| error.to_string()),
            PlantKind::Model(model) => match model.craft_file() {
                Some(file) => Ok(file.text()),
                None => Err(self.needs_a_vessel("print_vessel")),
            },
        };
        text.map_err(SettingError::Option)
    }

    pub(super) fn needs_a_vessel(&self, option: &str) -> String {
        format!("{} needs a vessel: '{}' is an identified model", key(option), self.name)
    }
}
