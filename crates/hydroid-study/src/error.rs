//! Errors of a study.

use std::io;
use std::path::PathBuf;

use hydroid::adapt::AdaptError;
use hydroid::atomic::WriteError;
use hydroid::evaluate::EvaluateError;
use hydroid::identify::IdentifyError;
use hydroid::progress::Cancelled;
use hydroid::simulate::SimulateError;
use hydroid::sindy::FitError;
use hydroid::toml_file::TomlError;
use hydroid_report::figure::FigureError;

/// Errors of a study.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The folder of experiments cannot be read.
    #[error("cannot read the experiments in {}: {source}; `hydroid thesis --write-experiments FOLDER` writes the built-in ones", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// A file is not valid TOML.
    #[error(transparent)]
    Toml(#[from] TomlError),
    /// A table has an invalid entry.
    #[error("{}, line {line}: '{name}' is invalid: {message}", path.display())]
    Entry {
        /// The file.
        path: PathBuf,
        /// Line of the table.
        line: usize,
        /// Name of the table.
        name: String,
        /// Reason.
        message: String,
    },
    /// A name is unknown.
    #[error("{whose}: unknown {what} '{name}'{}; known: {}", nearest.as_ref().map(|n| format!(", did you mean '{n}'?")).unwrap_or_default(), known.join(", "))]
    Unknown {
        /// Origin of the name.
        whose: String,
        /// Kind: record, model or experiment.
        what: &'static str,
        /// The name.
        name: String,
        /// The most similar known name.
        nearest: Option<String>,
        /// All known names.
        known: Vec<String>,
    },
    /// A model has no seeds.
    #[error("the model '{model}' has no seeds: give at least one")]
    NoSeeds {
        /// The model.
        model: String,
    },
    /// The folder contains no experiments.
    #[error("there are no experiments: `hydroid thesis --write-experiments FOLDER` writes the built-in ones")]
    Nothing,
    /// Writing would overwrite an edited file.
    #[error("{} exists with other content: name another folder, or remove the file", path.display())]
    Edited {
        /// The file.
        path: PathBuf,
    },
    /// Part of an experiment failed.
    #[error("the experiment '{name}': {error}")]
    In {
        /// The experiment.
        name: String,
        /// The error.
        error: Box<StudyError>,
    },
    /// An experiment cannot be run with its options.
    #[error("the experiment '{name}' cannot be run: {why}")]
    Cannot {
        /// The experiment.
        name: String,
        /// Cause and remedy.
        why: String,
    },
    /// A result cannot be stored.
    #[error("{0}")]
    Result(String),
    /// Simulation of a record fails.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A regression fails.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// Identification fails.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// Evaluation fails.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// Adaptation fails.
    #[error(transparent)]
    Adapt(#[from] AdaptError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The study was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl StudyError {
    pub(super) fn missing(what: &'static str, name: &str) -> Self {
        let (whose, name) = (String::from("the study"), name.to_owned());
        Self::Unknown { whose, what, name, nearest: None, known: Vec::new() }
    }
}
