//! Errors of settings.

use crate::log::LogError;
use crate::manoeuvre::ManoeuvreError;
use crate::model::{Mismatch, ModelError};
use crate::plant::PlantError;
use crate::simulate::{BUILT_IN, SimulateError, VesselFileError};

/// Reason why settings of a simulation or of manoeuvring trials cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// An option is out of range, or does not fit the plant.
    #[error("{0}")]
    Option(String),
    /// There is no such plant.
    #[error(
        "'{name}' is not a plant: write {}, or the name of a vessel file (.toml) or of an identified model (.safetensors); `hydroid simulate hydrofoil --print-vessel` prints a template",
        BUILT_IN.join(", ")
    )]
    UnknownPlant {
        /// The name.
        name: String,
    },
    /// A table lacks time or commands.
    #[error("{file} must have a time column and {needed}: {source}")]
    Commands {
        /// The file.
        file: String,
        /// Needed columns.
        needed: String,
        /// Reason.
        source: Box<LogError>,
    },
    /// The commands cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The file of a model cannot be read.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The file of a vessel cannot be read.
    #[error(transparent)]
    Vessel(#[from] VesselFileError),
    /// A log does not fit the model.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// The model cannot be simulated.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The vessel cannot be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The trials cannot be run.
    #[error(transparent)]
    Manoeuvre(#[from] ManoeuvreError),
}
