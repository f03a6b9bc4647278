//! TOML files whose mistakes are told with line, key and the nearest key that there is.

use std::io;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

/// Why a TOML file is refused; lines are counted from 1.
#[derive(Debug, thiserror::Error)]
pub enum TomlError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A key that there is not.
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
    /// A word that there is not.
    #[error("{}, line {line}: '{value}' is none of the words that this key takes{}; there are {}", path.display(), nearest.as_ref().map(|n| format!(", did you mean \"{n}\"?")).unwrap_or_default(), known.join(", "))]
    UnknownValue {
        /// The file.
        path: PathBuf,
        /// Line of the word.
        line: usize,
        /// The word.
        value: String,
        /// The nearest word that there is, if one is near.
        nearest: Option<String>,
        /// The words that there are.
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
}

/// Reads a file.
///
/// # Errors
/// See [`TomlError`].
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T, TomlError> {
    let text =
        std::fs::read_to_string(path).map_err(|source| TomlError::Read { path: path.to_owned(), source })?;
    parse(&text, path)
}

/// Reads text; `path` is what messages call it.
///
/// # Errors
/// See [`TomlError`].
pub fn parse<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, TomlError> {
    toml::from_str(text).map_err(|error| explain(text, path, &error))
}

fn explain(text: &str, path: &Path, error: &toml::de::Error) -> TomlError {
    let path = path.to_owned();
    let start = error.span().unwrap_or(0..0).start;
    let line = text.bytes().take(start).filter(|byte| *byte == b'\n').count() + 1;
    let message = error.message();
    // serde says: unknown field `a`, expected one of `b`, `c`; and the same of a variant.
    for what in ["unknown field ", "unknown variant "] {
        let Some((unknown, expected)) =
            message.strip_prefix(what).and_then(|rest| rest.split_once(", expected "))
        else {
            continue;
        };
        let word = quoted(unknown).next().unwrap_or(unknown).to_owned();
        let known: Vec<String> = quoted(expected).map(str::to_owned).collect();
        let nearest = nearest(&word, known.iter().map(String::as_str));
        return if what == "unknown field " {
            TomlError::UnknownKey { path, line, key: word, nearest, known }
        } else {
            TomlError::UnknownValue { path, line, value: word, nearest, known }
        };
    }
    TomlError::Syntax { path, line, message: message.lines().collect::<Vec<_>>().join("; ") }
}

/// What stands between backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// The candidate nearest to a misspelt word, if one is near enough to be what was meant.
pub fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<String> {
    candidates
        .map(|candidate| (strsim::jaro_winkler(&word.to_lowercase(), &candidate.to_lowercase()), candidate))
        .filter(|(similarity, _)| *similarity > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate.to_owned())
}
