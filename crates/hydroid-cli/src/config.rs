//! The configuration file `hydroid.toml`. `args::file` reads the sections `[adapt]` and `[control]`.

use std::path::{Path, PathBuf};

use anyhow::Context;
use hydroid::identify::{GivenRanges, MotionOption, NetworkOptions, RateLimitOption, SindyOptions};
use hydroid::log::{ChannelSpec, CommandTiming, InputDelay, Wind};
use hydroid::toml_file;
use serde::Deserialize;
use serde::de::IgnoredAny;

use crate::args::{Duration, Horizon};

/// Default name.
pub const DEFAULT: &str = "hydroid.toml";

/// The sections of the file; all keys are optional.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
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
    pub ranges: GivenRanges,
    pub adapt: IgnoredAny,
    pub control: IgnoredAny,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Log {
    pub time: Option<String>,
    pub outputs: Vec<ChannelSpec>,
    pub inputs: Vec<ChannelSpec>,
    pub wind: Option<Wind>,
    pub heading: Option<ChannelSpec>,
    pub dt: Option<f64>,
    pub max_gap_s: Option<f64>,
    pub command_timing: CommandTiming,
    pub input_delay: Delay,
    pub keep_towed: bool,
}

/// An input delay: a number of samples, or the text of the command line.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub enum Delay {
    Samples(i64),
    Text(InputDelay),
}

impl Default for Delay {
    fn default() -> Self {
        Self::Samples(0)
    }
}

impl<'de> Deserialize<'de> for Horizon {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "a number of samples (100) or a time (\"10s\")")]
        enum Written {
            Samples(usize),
            Text(String),
        }
        match Written::deserialize(deserializer)? {
            Written::Samples(n) => Ok(Self::Samples(n)),
            Written::Text(text) => text.parse().map_err(serde::de::Error::custom),
        }
    }
}

impl<'de> Deserialize<'de> for Duration {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "a number of seconds (90) or a time (\"5m\")")]
        enum Written {
            Seconds(f64),
            Text(String),
        }
        match Written::deserialize(deserializer)? {
            Written::Seconds(seconds) => seconds.to_string().parse().map_err(serde::de::Error::custom),
            Written::Text(text) => text.parse().map_err(serde::de::Error::custom),
        }
    }
}

/// Logs of training, validation and test; paths are relative to the file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Split {
    pub train: Vec<PathBuf>,
    pub validate: Vec<PathBuf>,
    pub test: Vec<PathBuf>,
}

/// Options of the run.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Identify {
    pub motion: MotionOption,
    pub rate_limit: RateLimitOption,
    pub horizon: Option<Horizon>,
    pub origin_stride: Option<usize>,
    pub seed: Option<u64>,
    pub budget: Option<Duration>,
}

pub fn read(path: &Path) -> anyhow::Result<Config> {
    let mut config: Config = toml_file::read(path).context("the configuration file cannot be used")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let Split { train, validate, test } = &mut config.split;
    for file in train.iter_mut().chain(validate).chain(test) {
        *file = folder.join(&*file);
    }
    Ok(config)
}
