//! Vessels with given parameters as models: the classical answer, beside which identified models stand.

use std::path::Path;
use std::sync::Arc;

use hydroid_core::model::{PlantModel, PlantModelError};
use hydroid_core::vessel::{PARAMETER, VesselParams};

use super::file::ModelError;
use super::{Body, Description, Members, Model, Port, Provenance, Reading};
use crate::evaluate::DesignRange;
use crate::log::{Channel, ChannelSpec, PrepareOptions, Selection};
use crate::simulate::{built_in, parse_vessel, vessel_toml};
use crate::toml_file::TomlError;

/// Sample time \[s\] of a vessel until a log says another.
pub const PLANT_DT_S: f64 = 0.1;

/// What a line of a vessel's file begins with that says how its parameters were learned. For what reads vessels it is a
/// comment.
const LEARNED: &str = "# adapted: ";

impl Model {
    /// A vessel as a model with outputs `u`, `v`, `r` and its two commands as inputs. Its ranges are what it reaches under
    /// the limits of its commands.
    ///
    /// # Errors
    /// If the parameters describe no vessel, or it cannot step `dt_s` seconds.
    pub fn of_vessel(params: &VesselParams, dt_s: f64) -> Result<Self, PlantModelError> {
        let plant = PlantModel::new(params, dt_s)?;
        let range = |[low, high]: [f64; 2]| {
            // A vessel that cannot turn still needs a width to be judged by.
            let room = if high > low { 0.0 } else { 1.0 };
            DesignRange { low: low - room, high: high + room }
        };
        let noise = [params.noise.u, params.noise.v, params.noise.r];
        let outputs = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")];
        let outputs: Vec<Port> = outputs
            .iter()
            .zip(plant.ranges())
            .zip(noise)
            .map(|((&(name, unit), &reached), noise)| Port {
                channel: Channel::new(name, unit),
                range: range(reached),
                visited: None,
                noise: (noise > 0.0).then_some(noise),
            })
            .collect();
        let commands = [&params.commands.propeller, &params.commands.rudder];
        let inputs: Vec<Port> = commands
            .iter()
            .map(|command| Port {
                channel: Channel::new(command.name.as_str(), command.unit.as_str()),
                range: range(command.limits),
                visited: None,
                noise: None,
            })
            .collect();
        let named = |ports: &[Port]| ports.iter().map(|p| ChannelSpec::named(&p.channel.name)).collect();
        let names: Vec<&str> = outputs.iter().chain(&inputs).map(|p| p.channel.name.as_str()).collect();
        let settings = serde_json::json!({ "ranges_given": names });
        let selection =
            Selection { outputs: named(&outputs), inputs: named(&inputs), ..Selection::default() };
        let description = Description {
            name: params.name.clone(),
            dt: dt_s,
            reading: Reading { selection, options: PrepareOptions::default() },
            provenance: Provenance {
                hydroid: env!("CARGO_PKG_VERSION").to_owned(),
                seed: 0,
                training: Vec::new(),
                validation: Vec::new(),
                settings,
            },
            outputs,
            inputs,
        };
        let body = Body::Plant(Arc::new(plant));
        Ok(Self { description, body, members: Members::default(), learning: None })
    }

    /// The vessel; none for identified models.
    pub fn plant(&self) -> Option<&Arc<PlantModel>> {
        match &self.body {
            Body::Plant(plant) => Some(plant),
            Body::Equations(_) | Body::Recurrent(_) | Body::Direct(_) | Body::Affine(_) => None,
        }
    }

    /// A vessel can be asked at any sample time: the same one at that of a log. Other models stay as they are.
    ///
    /// # Errors
    /// If it cannot step so.
    pub fn at_step(self, dt_s: f64) -> Result<Self, PlantModelError> {
        let Some(plant) = self.plant() else { return Ok(self) };
        let body = Body::Plant(Arc::new(PlantModel::new(plant.params(), dt_s)?));
        let description = Description { dt: dt_s, ..self.description };
        Ok(Self { description, body, ..self })
    }

    /// The parameters of a vessel, one line for each that is not zero; none for identified models.
    pub fn plant_text(&self) -> Vec<String> {
        let Some(plant) = self.plant() else { return Vec::new() };
        let numbers = PARAMETER.iter().zip(plant.numbers());
        let there = numbers.filter(|(_, number)| **number != 0.0);
        there.map(|(p, number)| format!("{:<26} {number:>12.6} {}", p.path, p.unit)).collect()
    }
}

/// A vessel by its built-in name, where no file is called so; or from a file that ends in `.toml`. None: something else.
pub(super) fn read(path: &Path) -> Option<Result<Model, ModelError>> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Some(read_file(path));
    }
    let params = path.to_str().and_then(built_in).filter(|_| !path.exists())?;
    Some(model(&params, path))
}

fn model(params: &VesselParams, path: &Path) -> Result<Model, ModelError> {
    Model::of_vessel(params, PLANT_DT_S).map_err(|source| ModelError::Plant { path: path.to_owned(), source })
}

fn read_file(path: &Path) -> Result<Model, ModelError> {
    let unreadable = |source| TomlError::Read { path: path.to_owned(), source };
    let text = std::fs::read_to_string(path).map_err(|error| ModelError::Vessel(unreadable(error).into()))?;
    let mut model = model(&parse_vessel(&text, path).map_err(ModelError::Vessel)?, path)?;
    // A comment that somebody has changed is no history.
    let history: Vec<serde_json::Value> = text
        .lines()
        .filter_map(|line| line.strip_prefix(LEARNED))
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect();
    if !history.is_empty() {
        model.description.provenance.settings["adapted"] = history.into();
    }
    Ok(model)
}

/// The file of a vessel, with what was learned along which logs in comments at its head.
pub(super) fn encode(model: &Model, plant: &PlantModel) -> Result<String, toml::ser::Error> {
    let mut text = String::new();
    if let Some(history) = model.description.provenance.settings["adapted"].as_array() {
        text.push_str("# Parameters that were learned with `hydroid adapt`; one line for each time.\n");
        for entry in history {
            text.extend([LEARNED, &entry.to_string(), "\n"]);
        }
    }
    Ok(text + &vessel_toml(plant.params())?)
}
