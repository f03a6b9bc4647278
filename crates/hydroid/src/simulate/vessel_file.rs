//! A vessel from a TOML file.

use std::fs;
use std::path::{Path, PathBuf};

use hydroid_core::vessel::{InvalidParams, VesselParams};

use crate::toml_file::{self, TomlError};

/// Why a vessel's file is refused; lines are counted from 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VesselFileError {
    /// The file cannot be read or is not what it should be.
    #[error(transparent)]
    File(#[from] TomlError),
    /// Parameters that describe no vessel.
    #[error("{}{}: {source}", path.display(), line.map(|l| format!(", line {l}")).unwrap_or_default())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Line of the parameter, where it can be told.
        line: Option<usize>,
        /// What is absurd.
        source: InvalidParams,
    },
}

/// A built-in vessel by its name: `simple`, `hydrofoil`, `hydrofoil-low-speed`.
pub fn built_in(name: &str) -> Option<VesselParams> {
    match name {
        "simple" => Some(VesselParams::simple()),
        "hydrofoil" => Some(VesselParams::hydrofoil()),
        "hydrofoil-low-speed" => Some(VesselParams::hydrofoil_low_speed()),
        _ => None,
    }
}

/// A vessel from a TOML file, validated. [`vessel_toml`] shows what such a file looks like.
///
/// # Errors
/// See [`VesselFileError`].
pub fn load_vessel(path: impl AsRef<Path>) -> Result<VesselParams, VesselFileError> {
    let path = path.as_ref();
    let text =
        fs::read_to_string(path).map_err(|source| TomlError::Read { path: path.to_owned(), source })?;
    parse_vessel(&text, path)
}

/// A vessel from TOML text, validated; `path` is what messages call it.
///
/// # Errors
/// See [`VesselFileError`].
pub fn parse_vessel(text: &str, path: &Path) -> Result<VesselParams, VesselFileError> {
    let params: VesselParams = toml_file::parse(text, path)?;
    match params.validate() {
        Ok(()) => Ok(params),
        Err(source) => {
            Err(VesselFileError::Invalid { path: path.to_owned(), line: field_line(text, &source), source })
        }
    }
}

/// A vessel as TOML text that [`load_vessel`] reads back: a start for a file of one's own.
///
/// # Errors
/// What the TOML writer says; it has nothing to say against any [`VesselParams`].
pub fn vessel_toml(params: &VesselParams) -> Result<String, toml::ser::Error> {
    toml::to_string(params)
}

/// Line of the parameter that an [`InvalidParams`] names, where the file has a table for what holds it (or
/// spells the whole path before the equals sign).
fn field_line(text: &str, error: &InvalidParams) -> Option<usize> {
    let field = error.field()?;
    let (table, key) = field.rsplit_once('.')?;
    let mut current = "";
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        if let Some(header) = line.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            current = header.trim();
        } else if let Some((name, _)) = line.split_once('=') {
            let name = name.trim();
            if (current == table && name == key) || (current.is_empty() && name == field) {
                return Some(k + 1);
            }
        }
    }
    None
}
