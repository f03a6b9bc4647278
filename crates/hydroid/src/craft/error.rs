//! Errors in vessel files.

use std::path::PathBuf;

use hydroid_core::craft::InvalidCraft;

use crate::toml_file::TomlError;

fn line_text(line: Option<usize>) -> String {
    line.map(|line| format!(", line {line}")).unwrap_or_default()
}

/// Error in a vessel file; lines are counted from 1.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CraftFileError {
    /// The file cannot be read or parsed.
    #[error(transparent)]
    File(#[from] TomlError),
    /// The numbers describe no vessel.
    #[error("{}{}: {source}", path.display(), line_text(*line))]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Line of the invalid part, if known.
        line: Option<usize>,
        /// Reason.
        source: InvalidCraft,
    },
    /// A missing key, a name that the file does not define, or a value out of range.
    #[error("{}: {message}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Place, reason and remedy.
        message: String,
    },
}
