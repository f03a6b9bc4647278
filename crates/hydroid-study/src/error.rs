//! Why a study could not be made.

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

/// Why a study could not be made.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The experiments cannot be read.
    #[error("cannot read the experiments in {}: {source}; `hydroid thesis --write-experiments FOLDER` writes those that are built in", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file that is no TOML.
    #[error(transparent)]
    Toml(#[from] TomlError),
    /// A table that says what cannot be.
    #[error("{}, line {line}: '{name}' cannot be: {message}", path.display())]
    Entry {
        /// The file.
        path: PathBuf,
        /// Where its table begins.
        line: usize,
        /// The table.
        name: String,
        /// What is wrong.
        message: String,
    },
    /// Something is named that is not there.
    #[error("{whose} names the {what} '{name}', which there is not{}; there are {}", nearest.as_ref().map(|n| format!(", did you mean '{n}'?")).unwrap_or_default(), known.join(", "))]
    Unknown {
        /// Who names it.
        whose: String,
        /// Record, model or experiment.
        what: &'static str,
        /// The name.
        name: String,
        /// The nearest that there is.
        nearest: Option<String>,
        /// Those that there are.
        known: Vec<String>,
    },
    /// A model without seeds.
    #[error("the model '{model}' has no seeds: give one at least")]
    NoSeeds {
        /// The model.
        model: String,
    },
    /// A folder without experiments.
    #[error(
        "there is no experiment: `hydroid thesis --write-experiments FOLDER` writes those that are built in"
    )]
    Nothing,
    /// A file that was edited would be lost.
    #[error("{} is there and says something else: name a folder without it, or take it away", path.display())]
    Edited {
        /// The file.
        path: PathBuf,
    },
    /// Part of an experiment failed.
    #[error("the experiment '{name}': {error}")]
    In {
        /// The experiment.
        name: String,
        /// What failed.
        error: Box<StudyError>,
    },
    /// An experiment that cannot be made of what it was given.
    #[error("the experiment '{name}' cannot be made: {why}")]
    Cannot {
        /// The experiment.
        name: String,
        /// Why, and what helps.
        why: String,
    },
    /// A result that cannot be kept.
    #[error("{0}")]
    Result(String),
    /// A record cannot be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A regression cannot be made.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A model cannot be learned.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A model cannot be judged.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
    /// A model cannot be adapted.
    #[error(transparent)]
    Adapt(#[from] AdaptError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// The work was asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl StudyError {
    pub(super) fn missing(what: &'static str, name: &str) -> Self {
        let (whose, name) = (String::from("the study"), name.to_owned());
        Self::Unknown { whose, what, name, nearest: None, known: Vec::new() }
    }
}
