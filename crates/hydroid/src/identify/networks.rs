//! Recurrent networks among the methods: their settings, their share of the time, their training.

use std::path::PathBuf;
use std::sync::Arc;

use hydroid_core::model::sparse::Equations;
use serde::{Deserialize, Serialize};

use super::{IdentifyError, Job, Method, Parts};
use crate::train::{self, BaseKind, CellKind, Precision, Schedule, Settings, TrainError, Trained};

/// Settings of networks; what is not given is the default of [`Settings::of`] the cell. See there for what each is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NetworkSettings {
    /// Cells of each layer.
    pub hidden: Option<usize>,
    /// Layers of a vanilla network.
    pub layers: Option<usize>,
    /// Length to which the LSTM's `h` is projected.
    pub projection: Option<usize>,
    /// Whether a linear read-out follows the cell.
    pub read_out: Option<bool>,
    /// Whether the network sees its outputs.
    pub feedback: Option<bool>,
    /// What it corrects: `"nothing"`, `"hold"` (it gives increments), or `"equations"` (those of the method sindy or
    /// lagged in the same job).
    pub base: Option<BaseKind>,
    /// Time that a window lets the hidden state find itself \[s\].
    pub wash_out_s: Option<f64>,
    /// Time over which a window compares predictions \[s\].
    pub window_s: Option<f64>,
    /// Passes over the training runs at the most.
    pub epochs: Option<usize>,
    /// Windows of one step of the optimizer.
    pub batch: Option<usize>,
    /// Peak step size.
    pub learning_rate: Option<f64>,
    /// How the step size goes.
    pub schedule: Option<Schedule>,
    /// Decoupled weight decay.
    pub weight_decay: Option<f64>,
    /// Longest gradient.
    pub clip: Option<f64>,
    /// Trainings from different first weights.
    pub restarts: Option<usize>,
    /// Precision of the training.
    pub precision: Option<Precision>,
    /// Epochs without a better validation error after which a restart gives up.
    pub patience: Option<usize>,
    /// Weight of each output's squared error.
    pub channel_weights: Option<Vec<f64>>,
}

impl NetworkSettings {
    fn put(&self, into: &mut Settings) {
        macro_rules! put {
            ($($field:ident)*) => { $(if let Some(value) = &self.$field { into.$field = value.clone(); })* };
        }
        put!(hidden read_out feedback base epochs batch learning_rate schedule weight_decay clip restarts precision);
        put!(channel_weights);
        into.layers = self.layers.or(into.layers);
        into.projection = self.projection.or(into.projection);
        into.wash_out_s = self.wash_out_s.or(into.wash_out_s);
        into.window_s = self.window_s.or(into.window_s);
        into.patience = self.patience.or(into.patience);
    }
}

/// What networks are told: all of them, and by cell, which goes before.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Networks {
    /// All of them.
    pub all: NetworkSettings,
    /// Those with LSTM cells.
    pub lstm: NetworkSettings,
    /// Those with GRU cells.
    pub gru: NetworkSettings,
    /// Vanilla ones.
    pub rnn: NetworkSettings,
    /// Time for the training of all networks of the job together \[s\].
    pub budget_s: Option<f64>,
    /// Folder in which interrupted trainings are kept, each in a file of its own.
    pub checkpoints: Option<PathBuf>,
    /// Whether trainings that were interrupted go on; else they begin anew.
    pub resume: bool,
}

impl Networks {
    /// The settings of a training, without a budget.
    pub fn settings(&self, cell: CellKind, seed: u64) -> Settings {
        let mut settings = Settings { seed, ..Settings::of(cell) };
        self.all.put(&mut settings);
        let own = match cell {
            CellKind::Lstm => &self.lstm,
            CellKind::Gru => &self.gru,
            CellKind::Rnn => &self.rnn,
        };
        own.put(&mut settings);
        settings
    }

    /// Where an interrupted training of a method is kept.
    pub fn checkpoint(&self, method: Method) -> Option<PathBuf> {
        self.checkpoints.as_ref().map(|folder| folder.join(format!("{}.checkpoint", method.name())))
    }

    /// Whether the methods' settings can be, before time is spent on any of them.
    pub(super) fn check(&self, methods: &[Method], parts: &Parts<'_>) -> Result<(), IdentifyError> {
        if let Some(budget) = self.budget_s.filter(|budget| !(budget.is_finite() && *budget > 0.0)) {
            let (what, needed) = ("budget", "a positive number of seconds");
            return Err(IdentifyError::Setting { what, value: budget.to_string(), needed });
        }
        let equations = methods.iter().any(|method| matches!(method, Method::Sindy | Method::Lagged));
        let run = parts.train[0];
        for &method in methods {
            let Some(cell) = method.cell() else { continue };
            let settings = self.settings(cell, 0);
            let wrong = |error| IdentifyError::Train { method, error };
            settings.check(run.outputs.width()).map_err(wrong)?;
            settings.network(run.inputs.width(), run.outputs.width()).map_err(wrong)?;
            if settings.base == BaseKind::Equations && !equations {
                return Err(IdentifyError::NoBase { method });
            }
        }
        Ok(())
    }
}

/// Trains a network. `left` is how many trainings of networks share what is left of the budget, this one among them,
/// and `spent_s` what those before it took.
pub(super) fn train(
    job: &Job,
    parts: &Parts<'_>,
    method: Method,
    equations: Option<Arc<Equations>>,
    (spent_s, left): (f64, usize),
    watch: train::Watch<'_>,
) -> Result<(Settings, Trained), IdentifyError> {
    let networks = &job.networks;
    let mut settings = networks.settings(method.cell().unwrap_or_default(), job.seed);
    if settings.base == BaseKind::Equations && equations.is_none() {
        return Err(IdentifyError::NoBase { method });
    }
    // A training that took less than its share leaves the rest to those after it.
    settings.budget_s =
        networks.budget_s.map(|budget| ((budget - spent_s) / left.max(1) as f64).max(1e-3 * budget));
    let equations = equations.filter(|_| settings.base == BaseKind::Equations);
    let task = train::Job {
        runs: &parts.train,
        validation: &parts.validation,
        outputs: &parts.ranges,
        inputs: &parts.inputs,
        horizon: job.horizon,
        equations,
    };
    let checkpoint = networks.checkpoint(method);
    if let Some(file) = checkpoint.as_ref().filter(|file| !networks.resume && file.exists()) {
        // Of another job, which this one takes the place of.
        std::fs::remove_file(file).map_err(|source| IdentifyError::Train {
            method,
            error: TrainError::Checkpoint { path: file.clone(), reason: source.to_string() },
        })?;
    }
    let trained = train::train(&task, &settings, checkpoint.as_deref(), watch)
        .map_err(|error| IdentifyError::Train { method, error })?;
    Ok((settings, trained))
}

/// What a model file says of its training: enough to make it again. Nothing that changes from run to run is in it.
pub(super) fn provenance(job: &Job, settings: &Settings, trained: &Trained) -> serde_json::Value {
    let best = trained.history.get(trained.best_epoch.saturating_sub(1));
    serde_json::json!({
        "asked": Settings { budget_s: None, epochs: trained.epochs, ..settings.clone() },
        "budget_s": job.networks.budget_s,
        "horizon": job.horizon,
        "epochs": trained.history.len(),
        "best_epoch": trained.best_epoch,
        "train_loss": best.map(|epoch| epoch.train_loss),
        "validation": trained.validation,
        "restart": trained.restart,
        "restarts": trained.restarts,
        "ending": trained.ending,
    })
}
