//! Errors of settings.

use crate::boat::BoatError;
use crate::craft::BUILT_IN;
use crate::log::LogError;
use crate::manoeuvre::ManoeuvreError;
use crate::model::{Mismatch, ModelError};
use crate::plant::PlantError;
use crate::simulate::SimulateError;
use crate::toml_file::TomlError;

/// Reason why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ConfigError {
    #[error(transparent)]
    File(#[from] TomlError),
    #[error(transparent)]
    Options(#[from] toml::ser::Error),
    /// A key or value among the options.
    #[error("{}{}", key.as_ref().map(|key| format!("{key}: ")).unwrap_or_default(), error.message())]
    Option { key: Option<String>, error: Box<toml::de::Error> },
}

/// Reason why settings of a simulation or of manoeuvring trials cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum SettingError {
    /// An option is out of range, or does not fit the plant.
    #[error("{0}")]
    Option(String),
    #[error(
        "'{name}' is not a plant: write {}, or the name of a vessel file (.toml) or of an identified model (.safetensors); `hydroid simulate hydrofoil --print-vessel` prints a template",
        BUILT_IN.join(", ")
    )]
    UnknownPlant { name: String },
    #[error("{file} must have a time column and {needed}: {source}")]
    Commands { file: String, needed: String, source: Box<LogError> },
    #[error(transparent)]
    Boat(#[from] BoatError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    #[error(transparent)]
    Manoeuvre(#[from] ManoeuvreError),
}
