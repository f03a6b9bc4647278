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

use super::{Body, Description, Learning, Model};
use crate::atomic::{self, WriteError};

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
    let terms = equations.terms().len();
    let bytes = |numbers: &[f64]| numbers.iter().flat_map(|c| c.to_le_bytes()).collect::<Vec<u8>>();
    let coefficients = bytes(equations.coefficients());
    let root = model.learning.as_ref().map(|learning| bytes(&learning.root));
    let view = |rows, bytes| TensorView::new(Dtype::F64, vec![rows, terms], bytes).map_err(io::Error::other);
    let mut tensors = vec![("coefficients", view(equations.outputs(), &coefficients)?)];
    if let Some(root) = &root {
        tensors.push(("root", view(terms, root)?));
    }
    let metadata = HashMap::from([(KEY.to_owned(), json)]);
    safetensors::serialize(tensors, Some(metadata)).map_err(io::Error::other)
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
            let root = numbers(&tensors, "root", &[count, count]).map_err(inconsistent)?;
            Some(Learning { settings, root })
        }
        None => None,
    };
    let dt = description.dt;
    let equations = Equations::with_signals(terms, coefficients, outputs, inputs, signals, dt, substeps)
        .map_err(|e: EquationsError| inconsistent(e.to_string()))?;
    let model = Model { description, body: Body::Equations(Arc::new(equations)), learning };
    if let Some(learning) = &model.learning {
        model.blended(learning).map_err(|e| inconsistent(e.to_string()))?;
    }
    Ok(model)
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
