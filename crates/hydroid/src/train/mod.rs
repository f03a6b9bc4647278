//! Training of recurrent models on shore.

mod error;
mod settings;

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use hydroid_core::model::recurrent::Recurrent;
use hydroid_core::model::sparse::Equations;
use serde::{Deserialize, Serialize};

use crate::evaluate::DesignRange;
use crate::log::Trajectory;

pub use error::TrainError;
pub use settings::{BaseKind, CellKind, Precision, Schedule, Settings};

/// What to train on.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Runs to learn from.
    pub runs: &'a [&'a Trajectory],
    /// Runs by whose multi-step error the best weights are chosen.
    pub validation: &'a [&'a Trajectory],
    /// Design range of each output: it is mapped to -2..2 for the network.
    pub outputs: &'a [DesignRange],
    /// Design range of each input.
    pub inputs: &'a [DesignRange],
    /// Longest horizon of the validation's rollouts \[samples\].
    pub horizon: usize,
    /// Equations that the network corrects, for [`BaseKind::Equations`].
    pub equations: Option<Arc<Equations>>,
}

/// An epoch of the training of one restart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Epoch {
    /// Loss in the mean over the epoch's steps.
    pub train_loss: f64,
    /// Validation error after the epoch: the mean over channels and horizons of the NRMSE, as
    /// [`Evaluation::score`](crate::evaluate::Evaluation::score); infinite where a rollout diverged.
    pub validation: f64,
    /// Step size at the end of the epoch.
    pub learning_rate: f64,
}

/// Where a training is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// Epochs that are done.
    pub epoch: usize,
    /// Epochs that are planned.
    pub epochs: usize,
    /// Fraction of the whole that is done, 0 to 1.
    pub fraction: f64,
    /// Least loss of the last epoch over restarts; NaN before the first is done.
    pub train_loss: f64,
    /// Least validation error so far over restarts; NaN before the first epoch is done.
    pub validation: f64,
    /// Time that is left as far as one can tell \[s\].
    pub seconds_left: f64,
}

/// Hears where the training is, many times in an epoch; [`ControlFlow::Break`] asks it to stop.
pub type Watch<'a> = &'a mut dyn FnMut(&Status) -> ControlFlow<()>;

/// Why a training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// All epochs are done.
    Done,
    /// No restart got better for as many epochs as patience allows.
    Patience,
    /// The time was over before all epochs were done.
    Budget,
}

/// A model that was trained, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The model with the best weights of the best restart.
    pub model: Recurrent,
    /// The epochs of that restart.
    pub history: Vec<Epoch>,
    /// Which restart it was, from 0.
    pub restart: usize,
    /// Which epoch its weights are of, from 1.
    pub best_epoch: usize,
    /// Its validation error.
    pub validation: f64,
    /// Least validation error of each restart.
    pub restarts: Vec<f64>,
    /// Epochs that were planned: with a budget as many as fit it. This number as `epochs` without a budget repeats
    /// the training exactly if it ended with [`Ending::Done`].
    pub epochs: usize,
    /// Why it ended.
    pub ending: Ending,
    /// Samples of wash-out of a window.
    pub wash_out: usize,
    /// Samples compared of a window.
    pub window: usize,
    /// Time that it took \[s\].
    pub seconds: f64,
}

/// Trains a recurrent model.
///
/// With `checkpoint` the state is kept in that file as the training goes; if the file is there, the training goes
/// on from it. It stays when the training is done.
///
/// # Errors
/// If settings, runs or checkpoint cannot be used, everything diverged, or the work was interrupted.
pub fn train(
    job: &Job<'_>,
    settings: &Settings,
    checkpoint: Option<&Path>,
    watch: Watch<'_>,
) -> Result<Trained, TrainError> {
    let _ = (job, checkpoint, watch);
    settings.check(job.outputs.len())?;
    Err(TrainError::NoRuns { what: "training" })
}
