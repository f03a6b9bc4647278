//! TOML files with errors that state line, key and the nearest known key.

use std::io;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

/// Error in a TOML file; lines are counted from 1.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum TomlError {
    #[error("cannot read {}: {source}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{}, line {line}: unknown key {key}{}; there are {}", path.display(), nearest.as_ref().map(|n| format!(", did you mean {n}?")).unwrap_or_default(), known.join(", "))]
    UnknownKey { path: PathBuf, line: usize, key: String, nearest: Option<String>, known: Vec<String> },
    #[error("{}, line {line}: '{value}' is not a value of this key{}; there are {}", path.display(), nearest.as_ref().map(|n| format!(", did you mean \"{n}\"?")).unwrap_or_default(), known.join(", "))]
    UnknownValue { path: PathBuf, line: usize, value: String, nearest: Option<String>, known: Vec<String> },
    /// Invalid TOML, missing key, or wrong type.
    #[error("{}, line {line}: {message}", path.display())]
    Syntax { path: PathBuf, line: usize, message: String },
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

/// Parses text; `path` is for messages.
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
    // serde reports: unknown field `a`, expected one of `b`, `c`; likewise for variants.
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

/// Text between backquotes.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// The candidate nearest to a misspelt word, if it is near.
pub fn nearest<'a>(word: &str, candidates: impl Iterator<Item = &'a str>) -> Option<String> {
    candidates
        .map(|candidate| (strsim::jaro_winkler(&word.to_lowercase(), &candidate.to_lowercase()), candidate))
        .filter(|(similarity, _)| *similarity > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate.to_owned())
}

/// A key as it is written in a file: quoted unless it is of letters, digits, `_` and `-`.
pub(crate) fn key(name: &str) -> String {
    let is_bare =
        !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
    if is_bare { name.to_owned() } else { toml::Value::from(name).to_string() }
}
