//! A vessel from a TOML file.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use hydroid_core::vessel::{InvalidParams, VesselParams};

use super::record::nearest;

/// Why a vessel's file is refused; lines are counted from 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VesselFileError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A key that a vessel does not have.
    #[error("{}, line {line}: unknown key {key}{}; there are {}", path.display(), nearest.as_ref().map(|n| format!(", did you mean {n}?")).unwrap_or_default(), known.join(", "))]
    UnknownKey {
        /// The file.
        path: PathBuf,
        /// Line of the key.
        line: usize,
        /// The key.
        key: String,
        /// The nearest key that there is, if one is near.
        nearest: Option<String>,
        /// The keys that there are.
        known: Vec<String>,
    },
    /// Not TOML, a missing key, or a value of the wrong kind.
    #[error("{}, line {line}: {message}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Where.
        line: usize,
        /// What is wrong.
        message: String,
    },
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

/// A vessel from a TOML file, validated. [`vessel_toml`] shows what such a file looks like.
///
/// # Errors
/// See [`VesselFileError`].
pub fn load_vessel(path: impl AsRef<Path>) -> Result<VesselParams, VesselFileError> {
    let path = path.as_ref();
    let text =
        fs::read_to_string(path).map_err(|source| VesselFileError::Read { path: path.to_owned(), source })?;
    parse_vessel(&text, path)
}

/// A vessel from TOML text, validated; `path` is what messages call it.
///
/// # Errors
/// See [`VesselFileError`].
pub fn parse_vessel(text: &str, path: &Path) -> Result<VesselParams, VesselFileError> {
    let params: VesselParams = toml::from_str(text).map_err(|error| explain(text, path, &error))?;
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

fn explain(text: &str, path: &Path, error: &toml::de::Error) -> VesselFileError {
    let path = path.to_owned();
    let span = error.span().unwrap_or(0..0);
    let line = line_of(text, span.start);
    let message = error.message();
    // serde says: unknown field `a`, expected one of `b`, `c`.
    if let Some((unknown, expected)) =
        message.strip_prefix("unknown field ").and_then(|rest| rest.split_once(", expected "))
    {
        let key = quoted(unknown).next().unwrap_or(unknown).to_owned();
        let known: Vec<String> = quoted(expected).map(str::to_owned).collect();
        let nearest = nearest(&key, known.iter().map(String::as_str));
        return VesselFileError::UnknownKey { path, line, key, nearest, known };
    }
    VesselFileError::Syntax { path, line, message: message.lines().collect::<Vec<_>>().join("; ") }
}

/// What stands between backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

fn line_of(text: &str, offset: usize) -> usize {
    text.bytes().take(offset).filter(|byte| *byte == b'\n').count() + 1
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
