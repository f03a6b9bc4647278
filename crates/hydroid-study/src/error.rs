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
    #[error("cannot read the experiments in {}: {source}; `hydroid thesis --write-experiments FOLDER` writes the built-in ones", path.display())]
    Folder { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Toml(#[from] TomlError),
    #[error("{}, line {line}: '{name}' is invalid: {message}", path.display())]
    Entry { path: PathBuf, line: usize, name: String, message: String },
    #[error("{whose}: unknown {what} '{name}'{}; known: {}", nearest.as_ref().map(|n| format!(", did you mean '{n}'?")).unwrap_or_default(), known.join(", "))]
    Unknown {
        whose: String,
        /// Kind: record, model or experiment.
        what: &'static str,
        name: String,
        nearest: Option<String>,
        known: Vec<String>,
    },
    #[error("the model '{model}' has no seeds: give at least one")]
    NoSeeds { model: String },
    #[error("the {whose} has no measures: give at least one `[[claim.measures]]`")]
    NoMeasures { whose: String },
    #[error("there are no experiments: `hydroid thesis --write-experiments FOLDER` writes the built-in ones")]
    Nothing,
    #[error("{} exists with other content: name another folder, or remove the file", path.display())]
    Edited { path: PathBuf },
    #[error("the experiment '{name}': {error}")]
    In { name: String, error: Box<StudyError> },
    #[error("the experiment '{name}' cannot be run: {why}")]
    Cannot { name: String, why: String },
    /// A result cannot be stored.
    #[error("{0}")]
    Result(String),
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    #[error(transparent)]
    Adapt(#[from] AdaptError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Figure(#[from] FigureError),
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl StudyError {
    pub(super) fn missing(what: &'static str, name: &str) -> Self {
        let (whose, name) = (String::from("the study"), name.to_owned());
        Self::Unknown { whose, what, name, nearest: None, known: Vec::new() }
    }
}
