//! The model file: one safetensors file with a JSON description in its metadata.
//!
//! A vessel with given parameters is no such file but a TOML file, as `hydroid simulate` takes it.
//!
//! Reading one never runs code and never panics: every number and shape is checked before it is used.

mod affine;
mod direct;
mod equations;
mod members;
mod recurrent;
mod tensors;

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use hydroid_core::model::PlantModelError;
use safetensors::tensor::{SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::{Body, Description, Model, plant};
use crate::atomic::{self, WriteError};
use crate::simulate::VesselFileError;

/// Key of the description in the metadata of the file.
const KEY: &str = "hydroid";

/// Version of the description that this program writes and reads.
const VERSION: u32 = 1;

/// Files larger than this are not models; guards against reading a log or a disk image into memory.
const LARGEST: u64 = 1 << 30;

/// Why a model file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The file cannot be opened or read.
    #[error("cannot read model {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The file is not a whole safetensors file.
    #[error(
        "{} is not a hydroid model, or it is damaged or cut short ({reason}). Give a .safetensors file that `hydroid identify` wrote (if it is one, make it again), or a vessel's .toml file",
        path.display()
    )]
    NotAModel {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A safetensors file of another program.
    #[error(
        "{} is a safetensors file, but not a hydroid model: its metadata has no 'hydroid' entry",
        path.display()
    )]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The description is of a version that this program does not know.
    #[error(
        "{} was written in model format {found}; this program reads format {VERSION}. Use the version of hydroid that wrote it, or identify again",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Version found.
        found: u64,
    },
    /// The description and the numbers contradict each other.
    #[error("the model in {} contradicts itself: {reason}. Make it again with `hydroid identify`", path.display())]
    Inconsistent {
        /// The file.
        path: PathBuf,
        /// The contradiction.
        reason: String,
    },
    /// A vessel's file that is none.
    #[error(transparent)]
    Vessel(VesselFileError),
    /// A vessel that cannot be a model.
    #[error("the vessel {} cannot be used as a model: {source}", path.display())]
    Plant {
        /// The file, or the name.
        path: PathBuf,
        /// Why.
        source: PlantModelError,
    },
}

/// The JSON in the metadata.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    version: u32,
    description: Description,
    structure: Structure,
}

/// The structure that gives the tensors their meaning, by kind.
#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum Structure {
    /// Sparse equations of motion.
    SparseEquations(equations::Structure),
    /// A recurrent network.
    Recurrent(recurrent::Structure),
    /// A direct predictor.
    Direct(direct::Structure),
    /// A control-affine network.
    ControlAffine(affine::Structure),
}

/// Writes a model file, whole or not at all; of a vessel its TOML file. The same model gives the same bytes.
///
/// # Errors
/// If the file cannot be written.
pub fn write(model: &Model, path: &Path) -> Result<(), WriteError> {
    atomic::write(path, |out| out.write_all(&encode(model)?))
}

/// The bytes of a model's file.
///
/// # Errors
/// If the parts of the model contradict each other.
pub fn encode(model: &Model) -> io::Result<Vec<u8>> {
    let (structure, tensors) = match &model.body {
        Body::Equations(equations) => equations::Structure::write(model, equations)
            .map(|(structure, tensors)| (Structure::SparseEquations(structure), tensors)),
        Body::Recurrent(recurrent) => recurrent::Structure::write(recurrent)
            .map(|(structure, tensors)| (Structure::Recurrent(structure), tensors)),
        Body::Direct(direct) => direct::Structure::write(model, direct)
            .map(|(structure, tensors)| (Structure::Direct(structure), tensors)),
        Body::Affine(affine) => affine::Structure::write(affine)
            .map(|(structure, tensors)| (Structure::ControlAffine(structure), tensors)),
        Body::Plant(vessel) => {
            return plant::encode(model, vessel).map(String::into_bytes).map_err(io::Error::other);
        }
    }
    .map_err(io::Error::other)?;
    let head = Head { version: VERSION, description: model.description.clone(), structure };
    let json = serde_json::to_string(&head)?;
    let views = tensors
        .iter()
        .map(|(name, dtype, shape, bytes)| Ok((name, TensorView::new(*dtype, shape.clone(), bytes)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(io::Error::other)?;
    let metadata = HashMap::from([(KEY.to_owned(), json)]);
    safetensors::serialize(views, Some(metadata)).map_err(io::Error::other)
}

/// Reads a model file: one that `hydroid identify` wrote, or a vessel's, which ends in `.toml`. The name of a built-in
/// vessel ([`built_in`](crate::simulate::built_in)) stands for it.
///
/// # Errors
/// If it cannot be read, is not a model, or contradicts itself.
pub fn read(path: &Path) -> Result<Model, ModelError> {
    if let Some(vessel) = plant::read(path) {
        return vessel;
    }
    let unreadable = |source| ModelError::Read { path: path.to_owned(), source };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if metadata.is_dir() {
        return Err(ModelError::NotAModel { path: path.to_owned(), reason: String::from("it is a folder") });
    }
    if !metadata.is_file() {
        let reason = String::from("it is a device or a pipe");
        return Err(ModelError::NotAModel { path: path.to_owned(), reason });
    }
    if metadata.len() > LARGEST {
        let reason = format!("{} bytes are too many for a model", metadata.len());
        return Err(ModelError::NotAModel { path: path.to_owned(), reason });
    }
    decode(&std::fs::read(path).map_err(unreadable)?, path)
}

/// Reads a model from the bytes of a file; `path` is for messages only.
///
/// # Errors
/// If the bytes are not a model, or contradict themselves.
pub fn decode(bytes: &[u8], path: &Path) -> Result<Model, ModelError> {
    let not_a_model = |reason: String| ModelError::NotAModel { path: path.to_owned(), reason };
    let inconsistent = |reason: String| ModelError::Inconsistent { path: path.to_owned(), reason };
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| not_a_model(e.to_string()))?;
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| not_a_model(e.to_string()))?;
    let json = metadata
        .metadata()
        .as_ref()
        .and_then(|m| m.get(KEY))
        .ok_or_else(|| ModelError::Foreign { path: path.to_owned() })?;
    // The version is read before the rest, which another version may have changed.
    let value: serde_json::Value = serde_json::from_str(json).map_err(|e| not_a_model(e.to_string()))?;
    match value.get("version").and_then(serde_json::Value::as_u64) {
        Some(found) if found == u64::from(VERSION) => {}
        Some(found) => return Err(ModelError::Version { path: path.to_owned(), found }),
        None => return Err(not_a_model(String::from("its description has no version"))),
    }
    let head: Head = serde_json::from_value(value).map_err(|e| not_a_model(e.to_string()))?;
    let description = head.description;
    for port in description.outputs.iter().chain(&description.inputs) {
        let range = port.range;
        if !(range.low.is_finite() && range.high.is_finite() && range.low < range.high) {
            return Err(inconsistent(format!("the range of '{}' is empty", port.channel.name)));
        }
    }
    if description.outputs.is_empty() {
        return Err(inconsistent(String::from("it has no outputs")));
    }
    match head.structure {
        Structure::SparseEquations(structure) => structure.read(&tensors, description),
        Structure::Recurrent(structure) => structure.read(&tensors, description),
        Structure::Direct(structure) => structure.read(&tensors, description),
        Structure::ControlAffine(structure) => structure.read(&tensors, description),
    }
    .map_err(inconsistent)
}
