//! Settings as data, for the command line, its file `hydroid.toml` and other front ends.
//!
//! [`Config`] has the sections of the file, all optional. [`Config::job`] prepares logs and makes the
//! [`Job`](crate::identify::Job) of [`identify`](crate::identify::identify). [`Simulate`] has the settings of a simulated
//! log, [`Manoeuvre`] those of manoeuvring trials, and [`control`] those of a closed loop.

pub mod control;
mod error;
mod job;
mod manoeuvre;
mod quantity;
#[cfg(feature = "arguments")]
pub mod schema;
mod simulate;
pub mod value;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::boat::{Boat, BoatError};
use crate::identify::{GivenRanges, MotionOption, NetworkOptions, RateLimitOption, SindyOptions};
use crate::log::{Channel, ChannelSpec, CommandTiming, InputDelay, PrepareOptions, Selection, Sensors, Wind};
use crate::model::{Model, Reading};
use crate::toml_file::{self, TomlError};
use crate::written;

pub use error::SettingError;
pub use job::{Logs, default_horizon, default_origin_stride};
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
    /// Limits of inputs that an option states in a unit, in place of those of the boat.
    #[serde(skip)]
    pub limit: GivenRanges,
    pub adapt: IgnoredAny,
    pub control: IgnoredAny,
    pub live: IgnoredAny,
    pub ros: IgnoredAny,
}

/// How logs are read: [`Selection`] and [`PrepareOptions`].
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[expect(missing_docs, reason = "see Selection and PrepareOptions")]
pub struct Log {
    pub time: Option<String>,
    #[serde(deserialize_with = "written::list")]
    pub outputs: Vec<ChannelSpec>,
    #[serde(deserialize_with = "written::list")]
    pub inputs: Vec<ChannelSpec>,
    #[serde(deserialize_with = "written::optional")]
    pub wind: Option<Wind>,
    pub heading: Option<ChannelSpec>,
    pub sensors: Option<Sensors>,
    pub dt: Option<f64>,
    #[serde(alias = "max_gap_s")]
    pub max_gap: Option<f64>,
    pub command_timing: Option<CommandTiming>,
    pub input_delay: Option<Delay>,
    pub keep_towed: bool,
}

impl Log {
    /// These options, and those of `base` where they are not given. The given inputs are raw values of `boat`.
    ///
    /// # Errors
    /// If an input contradicts the boat.
    pub fn over(mut self, base: Reading, boat: &Boat) -> Result<Reading, BoatError> {
        boat.read(&mut self.inputs)?;
        let Reading { selection, options } = base;
        let or =
            |given: Vec<ChannelSpec>, base: Vec<ChannelSpec>| if given.is_empty() { base } else { given };
        // Velocities of the log replace those that would be computed, and so does its heading.
        let replaced = selection.sensors.is_some() && !self.outputs.is_empty();
        let sensors = selection.sensors.filter(|_| !replaced);
        let heading = selection.heading.filter(|_| !replaced);
        let delay = self.input_delay.map(|delay| match delay {
            Delay::Samples(n) => InputDelay::Samples(n),
            Delay::Text(delay) => delay,
        });
        Ok(Reading {
            selection: Selection {
                time: self.time.or(selection.time),
                outputs: or(self.outputs, selection.outputs),
                inputs: or(self.inputs, selection.inputs),
                wind: self.wind.or(selection.wind),
                heading: self.heading.or(heading),
                sensors: self.sensors.or(sensors),
            },
            options: PrepareOptions {
                dt: self.dt.or(options.dt),
                max_gap_s: self.max_gap.or(options.max_gap_s),
                command_timing: self.command_timing.unwrap_or(options.command_timing),
                input_delay: delay.unwrap_or(options.input_delay),
                keep_towed: self.keep_towed || options.keep_towed,
            },
        })
    }
}

impl Config {
    /// How logs are read.
    ///
    /// # Errors
    /// If an input in `[log]` contradicts `[boat.inputs]`.
    pub fn reading(&self) -> Result<Reading, BoatError> {
        self.log.clone().over(Reading::default(), &self.boat)
    }
}

/// An input delay: a number of samples, or the text of the command line.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub enum Delay {
    /// A number of samples.
    Samples(i64),
    /// `"3"` samples or `"0.3s"`.
    Text(InputDelay),
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

/// Options of the run.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Identify {
    /// The motion that the models predict.
    pub motion: MotionOption,
    /// Limits of the rates of actuators.
    #[serde(deserialize_with = "written::value")]
    pub rate_limit: RateLimitOption,
    /// Longest horizon; default 100 samples.
    pub horizon: Option<Horizon>,
    /// Samples between two origins of the evaluations; default 1, and more in a cross-validation over long runs.
    pub origin_stride: Option<usize>,
    /// Seed; default 0.
    pub seed: Option<u64>,
    /// Limit of the time for the training of all networks; the result then depends on the machine.
    pub budget: Option<Duration>,
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
