//! The model file: one safetensors file with a JSON description in its metadata.
//!
//! Reading never executes code and never panics: all numbers and shapes are checked before use. A vessel is a TOML
//! file.

pub(super) mod ensemble;
mod tensors;

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use hydroid_core::model::CraftModelError;
use safetensors::tensor::{SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::kinds::{Encoded, Structure, parse_vessel, read_vessel};
use super::{Description, Model, TrialErrors};
use crate::atomic::{self, WriteError};
use crate::craft::CraftFileError;

pub(super) use tensors::{Tensor, network_tensors, numbers, tensor, weights};

const KEY: &str = "hydroid";

const VERSION: u32 = 3;

/// Oldest version that is read. In version 2, roles of inputs are not stored; they are found as for any model.
const OLDEST: u32 = 2;

/// Largest size of a model file \[bytes\].
const LARGEST: u64 = 1 << 30;

/// Error of reading a model file.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum ModelError {
    #[error("cannot read model {}: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error(
        "{} is not a hydroid model, or it is damaged or cut short ({reason}). Give a .safetensors file that `hydroid identify` wrote (if it is one, make it again), or a vessel's .toml file",
        path.display()
    )]
    NotAModel { path: PathBuf, reason: String },
    #[error(
        "{} is a safetensors file, but not a hydroid model: its metadata has no 'hydroid' entry",
        path.display()
    )]
    Foreign { path: PathBuf },
    #[error("{} was written by an older version of hydroid; identify again", path.display())]
    Older { path: PathBuf },
    #[error(
        "{} was written in model format {found}, and this version of hydroid reads format {VERSION}: use a newer version",
        path.display()
    )]
    Version { path: PathBuf, found: u64 },
    #[error("the model in {} is inconsistent: {reason}. Identify again with `hydroid identify`", path.display())]
    Inconsistent { path: PathBuf, reason: String },
    #[error(transparent)]
    Craft(#[from] CraftFileError),
    #[error("the vessel {} cannot be used as a model: {source}", path.display())]
    Plant { path: PathBuf, source: CraftModelError },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    version: u32,
    description: Description,
    structure: Structure,
}

/// Writes a model file atomically; a vessel as TOML. Equal models give equal bytes.
///
/// # Errors
/// If the file cannot be written.
pub fn write(model: &Model, path: &Path) -> Result<(), WriteError> {
    atomic::write(path, |out| out.write_all(&encode(model)?))
}

/// Content of a model's file.
///
/// # Errors
/// If the parts of the model are inconsistent.
pub fn encode(model: &Model) -> io::Result<Vec<u8>> {
    let (structure, tensors) = match model.body.kind().encode(model).map_err(io::Error::other)? {
        Encoded::Tensors(structure, tensors) => (structure, tensors),
        Encoded::Text(text) => return Ok(text.into_bytes()),
    };
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

/// Reads a model file, a vessel file (`.toml`), or a vessel by name ([`built_in`](crate::craft::built_in)).
///
/// # Errors
/// If the file cannot be read, is not a model, or is inconsistent.
pub fn read(path: &Path) -> Result<Model, ModelError> {
    if let Some(vessel) = read_vessel(path) {
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

/// The text of a vessel file: by its name, or TOML with at least one key. The first eight bytes of a safetensors file are the length of its
/// header, at most 100 MB, and contain zeros, which no text does.
fn vessel_text<'a>(bytes: &'a [u8], path: &Path) -> Option<&'a str> {
    if bytes.iter().take(8).any(|byte| *byte == 0) {
        return None;
    }
    let text = std::str::from_utf8(bytes).ok()?;
    let is_named = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
    let is_text = || toml::from_str::<toml::Table>(text).is_ok_and(|table| !table.is_empty());
    (is_named || is_text()).then_some(text)
}

/// Reads a model from the bytes of a file, or a vessel from the text of its file; `path` is for messages only.
///
/// # Errors
/// If the bytes are not a model, or are inconsistent.
pub fn decode(bytes: &[u8], path: &Path) -> Result<Model, ModelError> {
    if let Some(text) = vessel_text(bytes, path) {
        return parse_vessel(text, path);
    }
    let not_a_model = |reason: String| ModelError::NotAModel { path: path.to_owned(), reason };
    let inconsistent = |reason: String| ModelError::Inconsistent { path: path.to_owned(), reason };
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| not_a_model(e.to_string()))?;
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| not_a_model(e.to_string()))?;
    let json = metadata
        .metadata()
        .as_ref()
        .and_then(|m| m.get(KEY))
        .ok_or_else(|| ModelError::Foreign { path: path.to_owned() })?;
    // The version is checked first, because other formats may differ in everything else.
    let value: serde_json::Value = serde_json::from_str(json).map_err(|e| not_a_model(e.to_string()))?;
    match value.get("version").and_then(serde_json::Value::as_u64) {
        Some(found) if (OLDEST.into()..=VERSION.into()).contains(&found) => {}
        Some(found) if found < u64::from(OLDEST) => return Err(ModelError::Older { path: path.to_owned() }),
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
    for port in &description.inputs {
        if port.rate_limit.is_some_and(|rate| !(rate.is_finite() && rate * description.dt > 0.0)) {
            let name = &port.channel.name;
            return Err(inconsistent(format!("the rate limit of '{name}' is not a positive number")));
        }
    }
    let names: Vec<&str> = description.inputs.iter().map(|port| port.channel.name.as_str()).collect();
    description.boat.check(&names).map_err(|error| inconsistent(error.to_string()))?;
    for port in &description.inputs {
        let range = [port.range.low, port.range.high];
        let value = description.boat.value(&port.channel, Some(range));
        value.map_err(|error| inconsistent(error.to_string()))?;
    }
    if description.outputs.is_empty() {
        return Err(inconsistent(String::from("it has no outputs")));
    }
    if description.bands.as_ref().is_some_and(|bands| !bands.is_valid(description.outputs.len())) {
        return Err(inconsistent(String::from("its prediction bands do not fit its outputs")));
    }
    if !description.trial_errors.iter().all(TrialErrors::is_valid) {
        return Err(inconsistent(String::from("its errors of trials are not positive numbers")));
    }
    if !description.provenance.moved_together.iter().all(|one| one.is_valid(description.inputs.len())) {
        return Err(inconsistent(String::from(
            "its sums of inputs that did not move apart do not fit its inputs",
        )));
    }
    let (outputs, dt) = (description.outputs.len(), description.dt);
    if description
        .current
        .as_ref()
        .is_some_and(|current| !current.options(&description.outputs, dt).are_valid(outputs))
    {
        return Err(inconsistent(String::from("its estimate of the current has invalid options")));
    }
    head.structure.read(&tensors, description).map_err(inconsistent)
}
