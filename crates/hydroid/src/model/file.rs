//! The model file: one safetensors file with a JSON description in its metadata.
//!
//! Reading one never runs code and never panics: every number and shape is checked before it is used.

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use hydroid_core::adapt::BlendSettings;
use hydroid_core::model::sparse::{Equations, EquationsError, Signal, Term};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::{Body, Description, Learning, MOST_MEMBERS, Members, Model};
use crate::atomic::{self, WriteError};

/// Key of the description in the metadata of the file.
const KEY: &str = "hydroid";

/// Tensor of the ensemble, `members x places`; a file without it has no ensemble.
const MEMBERS: &str = "members";
/// Tensor of the places that `members` has, counted in the table of coefficients row by row.
const PLACES: &str = "member_places";

/// Tensor of the triangle that a model which learns begins with.
const ROOT: &str = "root";

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
        "{} is not a hydroid model, or it is damaged or cut short ({reason}). Give a .safetensors file that `hydroid identify` wrote; if it is one, make it again",
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
    /// Tensor `coefficients`, `outputs x terms`, in physical units.
    SparseEquations {
        terms: Vec<Term>,
        /// Variables beyond outputs and inputs.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        signals: Vec<Signal>,
        substeps: usize,
        /// How sessions learn on the way; with it stands a tensor `root`, `terms x terms`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        learning: Option<BlendSettings>,
    },
}

/// Writes a model file, whole or not at all. The same model gives the same bytes.
///
/// # Errors
/// If the file cannot be written.
pub fn write(model: &Model, path: &Path) -> Result<(), WriteError> {
    atomic::write(path, |out| out.write_all(&encode(model)?))
}

fn encode(model: &Model) -> io::Result<Vec<u8>> {
    let Body::Equations(equations) = &model.body;
    let head = Head {
        version: VERSION,
        description: model.description.clone(),
        structure: Structure::SparseEquations {
            terms: equations.terms().to_vec(),
            signals: equations.signals().to_vec(),
            substeps: equations.substeps(),
            learning: model.learning.as_ref().map(|learning| learning.settings.clone()),
        },
    };
    let json = serde_json::to_string(&head)?;
    let bytes = |values: &[f64]| -> Vec<u8> { values.iter().flat_map(|c| c.to_le_bytes()).collect() };
    let coefficients = bytes(equations.coefficients());
    let (places, values) = model.members.parts();
    let values = bytes(values);
    let places: Vec<u32> = places
        .iter()
        .map(|&place| u32::try_from(place))
        .collect::<Result<_, _>>()
        .map_err(io::Error::other)?;
    let places: Vec<u8> = places.iter().flat_map(|place| place.to_le_bytes()).collect();
    let mut tensors =
        vec![("coefficients", Dtype::F64, vec![equations.outputs(), equations.terms().len()], &coefficients)];
    if !model.members.is_empty() {
        let count = places.len() / 4;
        tensors.push((MEMBERS, Dtype::F64, vec![model.members.len(), count], &values));
        tensors.push((PLACES, Dtype::U32, vec![count], &places));
    }
    let terms = equations.terms().len();
    let root = model.learning.as_ref().map(|learning| bytes(&learning.root));
    if let Some(root) = &root {
        tensors.push((ROOT, Dtype::F64, vec![terms, terms], root));
    }
    let views = tensors
        .into_iter()
        .map(|(name, dtype, shape, bytes)| Ok((name, TensorView::new(dtype, shape, bytes)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(io::Error::other)?;
    let metadata = HashMap::from([(KEY.to_owned(), json)]);
    safetensors::serialize(views, Some(metadata)).map_err(io::Error::other)
}

/// Reads a model file.
///
/// # Errors
/// If it cannot be read, is not a model, or contradicts itself.
pub fn read(path: &Path) -> Result<Model, ModelError> {
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
    let Structure::SparseEquations { terms, signals, substeps, learning } = head.structure;
    let (outputs, inputs) = (description.outputs.len(), description.inputs.len());
    let count = terms.len();
    let coefficients = numbers(&tensors, "coefficients", &[outputs, count]).map_err(inconsistent)?;
    let learning = match learning {
        Some(settings) => {
            let root = numbers(&tensors, ROOT, &[count, count]).map_err(inconsistent)?;
            Some(Learning { settings, root })
        }
        None => None,
    };
    let dt = description.dt;
    let equations = Equations::with_signals(terms, coefficients, outputs, inputs, signals, dt, substeps)
        .map_err(|e: EquationsError| inconsistent(e.to_string()))?;
    let members = members(&tensors, equations.coefficients().len()).map_err(inconsistent)?;
    let model = Model { description, body: Body::Equations(Arc::new(equations)), members, learning };
    if let Some(learning) = &model.learning {
        model.blended(learning).map_err(|e| inconsistent(e.to_string()))?;
    }
    Ok(model)
}

/// The ensemble, if the file has one.
fn members(tensors: &SafeTensors<'_>, count: usize) -> Result<Members, String> {
    let (values, places) = match (tensors.tensor(MEMBERS), tensors.tensor(PLACES)) {
        (Ok(values), Ok(places)) => (values, places),
        (Err(_), Err(_)) => return Ok(Members::default()),
        _ => return Err(format!("of '{MEMBERS}' and '{PLACES}' it has one tensor alone")),
    };
    let (&[members, width], &[length]) = (values.shape(), places.shape()) else {
        return Err(String::from("its ensemble is no table"));
    };
    if places.dtype() != Dtype::U32 || length != width || !(1..=MOST_MEMBERS).contains(&members) {
        return Err(format!(
            "its ensemble has {members} members of {width} coefficients and {length} places (at most {MOST_MEMBERS} members)"
        ));
    }
    let values = numbers(tensors, MEMBERS, &[members, width])?;
    let (chunks, _) = places.data().as_chunks::<4>();
    let places: Vec<u32> = chunks.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    Members::from_parts(&places, values, count)
}

fn numbers(tensors: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f64>, String> {
    let tensor = tensors.tensor(name).map_err(|_| format!("tensor '{name}' is missing"))?;
    if tensor.dtype() != Dtype::F64 || tensor.shape() != shape {
        return Err(format!(
            "tensor '{name}' is {:?} {:?}, the description says F64 {shape:?}",
            tensor.dtype(),
            tensor.shape()
        ));
    }
    let (chunks, _) = tensor.data().as_chunks::<8>();
    Ok(chunks.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}
