//! Settings as data, for the command line, its file `hydroid.toml` and other front ends.
//!
//! [`Config`] has the sections of the file, all optional. [`Config::with`] reads it with options over it, and [`Config::job`]
//! prepares logs and makes the [`Job`](crate::identify::Job) of [`identify`](crate::identify::identify). [`Simulate`] has the
//! settings of a simulated log, [`Manoeuvre`] those of manoeuvring trials, and [`control`] those of a closed loop.

mod adapt;
pub mod control;
mod error;
mod identify;
mod job;
mod log;
mod manoeuvre;
mod quantity;
#[cfg(feature = "arguments")]
pub mod schema;
mod simulate;
pub mod value;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::{DeserializeOwned, IgnoredAny};
use serde::{Deserialize, Serialize};

use crate::boat::{Boat, BoatError};
use crate::identify::{GivenRanges, NetworkOptions, SindyOptions};
use crate::log::Channel;
use crate::model::{Model, Reading};
use crate::toml_file::{self, TomlError};
use crate::written;

pub use crate::identify::default_horizon;
pub use adapt::Adapt;
pub use error::{ConfigError, SettingError};
pub use identify::Identify;
pub use job::{Logs, default_origin_stride};
pub use log::Log;
pub use manoeuvre::{Manoeuvre, TrialName, TrialPlan, ZigzagAngles};
pub use quantity::{Duration, Horizon};
pub use simulate::{Drive, ModelPlan, Plan, Plant, PlantKind, Simulate};

/// Default name of the file.
pub const FILE: &str = "hydroid.toml";

/// The sections of the file. `[adapt]`, `[control]`, `[live]` and `[ros]` are read by their commands.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(missing_docs, reason = "each section is documented with its type")]
pub struct Config {
    pub boat: Boat,
    pub log: Log,
    pub split: Split,
    pub identify: Identify,
    pub sindy: SindyOptions,
    pub network: NetworkOptions,
    pub lstm: NetworkOptions,
    pub gru: NetworkOptions,
    pub rnn: NetworkOptions,
    pub direct: NetworkOptions,
    pub affine: NetworkOptions,
    #[serde(deserialize_with = "written::table")]
    pub ranges: GivenRanges,
    /// Options of reading over those of the section.
    #[serde(skip)]
    pub given_log: Log,
    pub adapt: IgnoredAny,
    pub control: IgnoredAny,
    pub live: IgnoredAny,
    pub ros: IgnoredAny,
}

impl Config {
    /// A file with options over it, which are sections as in the file.
    ///
    /// # Errors
    /// If the file cannot be read, or a key or value is none of the options; the message names the line or the key.
    pub fn with(file: Option<&Path>, given: &impl Serialize) -> Result<Self, ConfigError> {
        let given = toml::Table::try_from(given)?;
        let options: Self = of_table(given.clone())?;
        let Some(file) = file else {
            return Ok(options);
        };
        // Its errors name lines, and its paths are relative to the file.
        let alone = read(file)?;
        let mut sections: toml::Table = toml_file::read(file)?;
        let has_split = given.contains_key("split");
        // A library replaces a degree, and the other way round.
        let is_given = |key: &str| given.get("sindy").is_some_and(|section| section.get(key).is_some());
        if let Some(toml::Value::Table(sindy)) = sections.get_mut("sindy") {
            if is_given("library") {
                sindy.remove("degree");
                sindy.remove("signed_squares");
            }
            if is_given("degree") || is_given("signed_squares") {
                sindy.remove("library");
            }
        }
        merge(&mut sections, given);
        let merged: Self = of_table(sections)?;
        let split = if has_split { merged.split } else { alone.split };
        Ok(Self { split, log: alone.log, given_log: options.log, ..merged })
    }

    /// How logs are read.
    ///
    /// # Errors
    /// If an input in `[log]` contradicts `[boat.inputs]`.
    pub fn reading(&self) -> Result<Reading, BoatError> {
        let mut boat = self.boat.clone();
        self.identify.state(&mut boat)?;
        let in_file = self.log.clone().over(Reading::default(), &boat)?;
        self.given_log.clone().over(in_file, &boat)
    }
}

fn of_table<T: DeserializeOwned>(table: toml::Table) -> Result<T, ConfigError> {
    serde_path_to_error::deserialize(table).map_err(|error| {
        let key = Some(error.path().to_string()).filter(|key| key != ".");
        ConfigError::Option { key, error: Box::new(error.into_inner()) }
    })
}

/// Puts the values of a table over those of another one.
fn merge(into: &mut toml::Table, from: toml::Table) {
    for (key, value) in from {
        match (into.get_mut(&key), value) {
            (Some(toml::Value::Table(known)), toml::Value::Table(value)) => merge(known, value),
            (_, value) => drop(into.insert(key, value)),
        }
    }
}

/// Files of training, validation and test; in a file, paths are relative to it.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(missing_docs, reason = "see Logs")]
pub struct Split {
    pub train: Vec<PathBuf>,
    pub validate: Vec<PathBuf>,
    pub test: Vec<PathBuf>,
}

/// A model with stated neutral values and limits of inputs, in place of those that it contains. They are in the unit of the
/// input of the [boat](crate::boat::Input).
///
/// # Errors
/// If there is no such input, or the values contradict each other.
pub(crate) fn with_values(
    mut model: Model,
    neutral: &BTreeMap<String, f64>,
    limits: &GivenRanges,
) -> Result<Model, BoatError> {
    let d = &mut model.description;
    for name in neutral.keys().chain(limits.keys()) {
        let port = d.inputs.iter().find(|port| port.channel.name == *name);
        let channel = port.map_or_else(|| Channel::new(name.as_str(), ""), |port| port.channel.clone());
        let limits = limits.get(name).map(|range| ([range.low, range.high], range.unit.as_deref()));
        d.boat.state_values(&channel, neutral.get(name).copied(), limits)?;
    }
    let names: Vec<&str> = d.inputs.iter().map(|port| port.channel.name.as_str()).collect();
    d.boat.check(&names)?;
    for (port, value) in model.description.inputs.iter().zip(crate::plant::input_values(&model)?) {
        let [low, high] = value.limits;
        let is_apart = high < port.range.low || low > port.range.high;
        if value.is_commanded && limits.contains_key(&value.name) && is_apart {
            let range = [port.range.low, port.range.high];
            return Err(BoatError::Apart { input: value.name, limits: value.limits, range });
        }
    }
    Ok(model)
}

/// Reads a file.
///
/// # Errors
/// If the file cannot be read, or has unknown keys or values; the message names the line.
pub fn read(path: &Path) -> Result<Config, TomlError> {
    let mut config: Config = toml_file::read(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let Split { train, validate, test } = &mut config.split;
    for file in train.iter_mut().chain(validate).chain(test) {
        *file = folder.join(&*file);
    }
    Ok(config)
}
