//! Plants by name.

use std::path::Path;

use crate::config::SettingError;
use crate::craft::{self, CraftFile};
use crate::excitation::PropellerRudder;
use crate::key::key;
use crate::model::{self, Model};

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
    /// A vessel with [one propeller and one rudder](PropellerRudder).
    Vessel(Box<CraftFile>),
    /// A vessel with any other set of actuators, or an identified model.
    Model(Box<Model>),
}

impl Plant {
    /// A plant by its name: a built-in vessel, a vessel file, or a model file. Built-in vessels precede files.
    ///
    /// # Errors
    /// If there is no plant of this name, or its file cannot be read.
    pub fn read(name: &str) -> Result<Self, SettingError> {
        if let Some(vessel) = craft::built_in(name) {
            return Ok(Self { name: name.to_owned(), kind: PlantKind::Vessel(Box::new(vessel.into())) });
        }
        let path = Path::new(name);
        if path.extension().is_none() {
            return Err(SettingError::UnknownPlant { name: name.to_owned() });
        }
        Ok(Self { name: name.to_owned(), ..Self::of(model::read(path)?) })
    }

    /// The plant of a model.
    pub fn of(model: Model) -> Self {
        let name = model.description.name.clone();
        let vessel = model.craft_file().filter(|file| PropellerRudder::new(&file.craft).is_ok());
        let kind = match vessel {
            Some(file) => PlantKind::Vessel(Box::new(file.clone())),
            None => PlantKind::Model(Box::new(model)),
        };
        Self { name, kind }
    }

    /// The text of the vessel's file.
    ///
    /// # Errors
    /// If the plant is an identified model.
    pub fn vessel_text(&self) -> Result<String, SettingError> {
        let file = match &self.kind {
            PlantKind::Vessel(file) => Some(&**file),
            PlantKind::Model(model) => model.craft_file(),
        };
        let needed = || SettingError::Option(self.needs_a_vessel("print_vessel"));
        file.map(CraftFile::text).ok_or_else(needed)
    }

    /// The content of the vessel's file as JSON.
    ///
    /// # Errors
    /// If the plant is an identified model.
    pub fn vessel_json(&self) -> Result<serde_json::Value, SettingError> {
        toml::from_str(&self.vessel_text()?).map_err(|error| SettingError::Option(error.to_string()))
    }

    pub(super) fn needs_a_vessel(&self, option: &str) -> String {
        format!("{} needs a vessel: '{}' is an identified model", key(option), self.name)
    }
}
