//! Vessel files (TOML).

use std::fs;
use std::path::{Path, PathBuf};

use hydroid_core::vessel::{InvalidParams, VesselParams};

use crate::toml_file::{self, TomlError};

/// Error in a vessel file; lines are counted from 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum VesselFileError {
    #[error(transparent)]
    File(#[from] TomlError),
    /// Invalid vessel parameters.
    #[error("{}{}: {source}", path.display(), line.map(|l| format!(", line {l}")).unwrap_or_default())]
    Invalid { path: PathBuf, line: Option<usize>, source: InvalidParams },
}

/// Names of the built-in vessels.
pub const BUILT_IN: [&str; 3] = ["simple", "hydrofoil", "hydrofoil-low-speed"];

/// A built-in vessel by its name, one of [`BUILT_IN`].
pub fn built_in(name: &str) -> Option<VesselParams> {
    match name {
        "simple" => Some(VesselParams::simple()),
        "hydrofoil" => Some(VesselParams::hydrofoil()),
        "hydrofoil-low-speed" => Some(VesselParams::hydrofoil_low_speed()),
        _ => None,
    }
}

/// Reads and validates a vessel file. [`vessel_toml`] writes one.
///
/// # Errors
/// See [`VesselFileError`].
pub fn load_vessel(path: impl AsRef<Path>) -> Result<VesselParams, VesselFileError> {
    let path = path.as_ref();
    let text =
        fs::read_to_string(path).map_err(|source| TomlError::Read { path: path.to_owned(), source })?;
    parse_vessel(&text, path)
}

/// Parses and validates a vessel; `path` is for messages.
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

/// A vessel as TOML text for [`load_vessel`].
///
/// # Errors
/// If the TOML writer fails.
pub fn vessel_toml(params: &VesselParams) -> Result<String, toml::ser::Error> {
    toml::to_string(params)
}

/// Line of the parameter of an [`InvalidParams`], if the file has a table for it or its whole path before `=`.
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
