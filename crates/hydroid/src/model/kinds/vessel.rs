//! Vessels with given parameters. File: TOML.

use std::path::Path;
use std::sync::Arc;

use hydroid_core::craft::Craft;
use hydroid_core::model::{CraftModel, CraftModelError};

use super::Body;
use super::craft::NamedCraft;
use crate::boat::{Boat, Evidence, Role};
use crate::craft::{self, CraftFile, CraftFileError};
use crate::evaluate::DesignRange;
use crate::log::{Channel, ChannelSpec, PrepareOptions, Selection};
use crate::model::{Description, Members, Model, ModelError, Port, Provenance, Reading};
use crate::toml_file::TomlError;

/// Default sample time of a vessel \[s\].
const VESSEL_DT_S: f64 = 0.1;

const ADAPTED: &str = "# adapted: ";

impl Model {
    /// A vessel as a model with outputs `u`, `v` \[m/s\], `r` \[rad/s\], its commands, and the ranges within their
    /// limits.
    ///
    /// # Errors
    /// If the vessel or the sample time is invalid.
    pub fn of_vessel(craft: &Craft, dt_s: f64) -> Result<Self, CraftModelError> {
        Self::of_craft(&craft.clone().into(), dt_s)
    }

    /// The vessel of a file as a model, as [`of_vessel`](Self::of_vessel).
    ///
    /// # Errors
    /// If the vessel or the sample time is invalid.
    pub fn of_craft(file: &CraftFile, dt_s: f64) -> Result<Self, CraftModelError> {
        let model = CraftModel::new(file.craft.clone(), dt_s)?;
        let craft = &file.craft;
        let commands = craft.commands.iter().map(|c| (c.name.as_str(), c.unit.as_str(), c.limits));
        let commands: Vec<(&str, &str, [f64; 2])> = commands.collect();
        let mut description = describe(&craft.name, dt_s, *model.ranges(), craft.noise, &commands);
        description.boat = by_actuators(&description, craft::roles(craft));
        for command in &craft.commands {
            state(&mut description.boat, &command.name, command.neutral, command.limits);
        }
        let body = Body::Craft(Arc::new(NamedCraft { model, file: file.clone() }));
        Ok(Self { description, body, members: Members::default(), learning: None })
    }
    /// The model at another sample time; identified models are unchanged.
    ///
    /// # Errors
    /// If the sample time is invalid.
    pub fn at_step(self, dt_s: f64) -> Result<Self, CraftModelError> {
        let body = match &self.body {
            Body::Craft(craft) => Body::Craft(Arc::new(NamedCraft {
                model: CraftModel::new(craft.file.craft.clone(), dt_s)?,
                file: craft.file.clone(),
            })),
            _ => return Ok(self),
        };
        let description = Description { dt: dt_s, ..self.description };
        Ok(Self { description, body, ..self })
    }

    /// Non-zero parameters of a vessel, line by line; empty for identified models.
    pub fn plant_text(&self) -> Vec<String> {
        let Some(craft) = self.craft() else { return Vec::new() };
        let numbers = craft.parameters().into_iter().filter(|(_, number)| *number != 0.0);
        numbers.map(|(p, number)| format!("{:<26} {number:>12.6} {}", p.path, p.unit)).collect()
    }
}

/// The boat whose inputs have roles by their actuators; a command without an actuator has none.
fn by_actuators(d: &Description, roles: impl IntoIterator<Item = Option<Role>>) -> Boat {
    let mut boat = Boat::default();
    for (port, role) in d.inputs.iter().zip(roles) {
        if let Some(role) = role {
            boat.found_role(&port.channel.name, role, Evidence::Actuators);
        }
    }
    boat
}

/// States neutral value and limits of a command.
fn state(boat: &mut Boat, name: &str, neutral: f64, limits: [f64; 2]) {
    let input = boat.inputs.entry(name.to_owned()).or_default();
    (input.neutral, input.limits) = (Some(neutral), Some(limits));
}

/// Description of a vessel with given ranges of `u`, `v`, `r`; names, units and limits of its commands.
fn describe(
    name: &str,
    dt_s: f64,
    ranges: [[f64; 2]; 3],
    noise: [f64; 3],
    commands: &[(&str, &str, [f64; 2])],
) -> Description {
    let range = |[low, high]: [f64; 2]| {
        // A range of zero width cannot scale errors.
        let room = if high > low { 0.0 } else { 1.0 };
        DesignRange { low: low - room, high: high + room }
    };
    let outputs = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")];
    let outputs: Vec<Port> = outputs
        .iter()
        .zip(ranges)
        .zip(noise)
        .map(|((&(name, unit), reached), noise)| Port {
            channel: Channel::new(name, unit),
            range: range(reached),
            training_range: None,
            noise: (noise > 0.0).then_some(noise),
            rate_limit: None,
        })
        .collect();
    let inputs: Vec<Port> = commands
        .iter()
        .map(|&(name, unit, limits)| Port {
            channel: Channel::new(name, unit),
            range: range(limits),
            training_range: None,
            noise: None,
            rate_limit: None,
        })
        .collect();
    let named = |ports: &[Port]| ports.iter().map(|p| ChannelSpec::named(&p.channel.name)).collect();
    let names: Vec<&str> = outputs.iter().chain(&inputs).map(|p| p.channel.name.as_str()).collect();
    let settings = serde_json::json!({ "ranges_given": names });
    let selection = Selection { outputs: named(&outputs), inputs: named(&inputs), ..Selection::default() };
    Description {
        bands: None,
        trial_errors: Vec::new(),
        current: None,
        boat: Boat::default(),
        name: name.to_owned(),
        dt: dt_s,
        reading: Reading { selection, options: PrepareOptions::default() },
        provenance: Provenance {
            hydroid: env!("CARGO_PKG_VERSION").to_owned(),
            seed: 0,
            training: Vec::new(),
            validation: Vec::new(),
            settings,
            ..Provenance::default()
        },
        outputs,
        inputs,
    }
}

/// Reads a vessel from a `.toml` file or by its built-in name; `None` for other files.
pub(in crate::model) fn read(path: &Path) -> Option<Result<Model, ModelError>> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Some(read_file(path));
    }
    let craft = path.to_str().and_then(craft::built_in).filter(|_| !path.exists())?;
    Some(model(&craft.into(), path))
}

fn model(file: &CraftFile, path: &Path) -> Result<Model, ModelError> {
    Model::of_craft(file, VESSEL_DT_S).map_err(|source| ModelError::Plant { path: path.to_owned(), source })
}

fn read_file(path: &Path) -> Result<Model, ModelError> {
    let unreadable = |source| TomlError::Read { path: path.to_owned(), source };
    let text = std::fs::read_to_string(path).map_err(|error| CraftFileError::from(unreadable(error)))?;
    parse(&text, path)
}

/// Reads a vessel from the text of a file; `path` is for messages.
pub(in crate::model) fn parse(text: &str, path: &Path) -> Result<Model, ModelError> {
    Ok(with_history(model(&craft::parse(text, path)?, path)?, text))
}

/// The model with the adaptations that its file states.
fn with_history(mut model: Model, text: &str) -> Model {
    // Comments that are not valid JSON are ignored.
    let history: Vec<serde_json::Value> = text
        .lines()
        .filter_map(|line| line.strip_prefix(ADAPTED))
        .filter_map(|line| serde_json::from_str(line).ok())
        .collect();
    if !history.is_empty() {
        model.description.provenance.settings["adapted"] = history.into();
    }
    model
}

/// The adaptations of a vessel as comments of its file, which [`with_history`] reads.
pub(super) fn history_text(model: &Model) -> String {
    let mut text = String::new();
    if let Some(history) = model.description.provenance.settings["adapted"].as_array() {
        text.push_str("# Numbers adapted by `hydroid adapt`; one line for each adaptation.\n");
        for entry in history {
            text.extend([ADAPTED, &entry.to_string(), "\n"]);
        }
    }
    text
}
