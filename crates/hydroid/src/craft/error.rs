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
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum CraftFileError {
    #[error(transparent)]
    File(#[from] TomlError),
    #[error(
        "{}: this form of vessel files, with the tables [propeller], [rudder] and [commands], is not read any more. Write each command as [[command]] with name, unit and limits, the propeller as [[thruster]] with law = \"linear\", order = {{ COMMAND = 1.0 }}, position = [0.0, 0.0], forward = 1.0 and lag, and the rudder as [[rudder]] with order, law and gain; `hydroid simulate hydrofoil --print-vessel` prints an example. The other tables stay",
        path.display()
    )]
    Former { path: PathBuf },
    /// The numbers describe no vessel.
    #[error("{}{}: {source}", path.display(), line_text(*line))]
    Invalid { path: PathBuf, line: Option<usize>, source: InvalidCraft },
    /// A missing key, a name that the file does not define, or a value out of range.
    #[error("{}: {message}", path.display())]
    Content {
        path: PathBuf,
        /// Place, reason and remedy.
        message: String,
    },
}
