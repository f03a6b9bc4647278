//! Networks: options, shares of the time budget, training.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use hydroid_core::actuator::Map;
use hydroid_core::model::sparse::Equations;
use serde::{Deserialize, Serialize};

use super::evaluation::check_evaluable;
use super::formulation::{formulations, select_formulation};
use super::{IdentifyError, Job, Method, Parts};
use crate::key::key;
use crate::log::{Channel, Note, Trajectory};
use crate::train::{
    self, BaseKind, CellKind, Outcome, Precision, Refit, Schedule, TrainError, TrainOptions, Trained,
};

/// Options of networks; defaults are those of the train options of the cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NetworkOptions {
    /// Cells, or units, of each layer.
    pub hidden: Option<usize>,
    /// Layers of a vanilla network, hidden layers of a direct predictor.
    pub layers: Option<usize>,
    /// Length of the projection of an LSTM.
    pub projection: Option<usize>,
    /// Whether a linear output layer follows the cell.
    pub read_out: Option<bool>,
    /// Whether the outputs are fed back. If neither this nor `base` is given, short trainings decide.
    pub feedback: Option<bool>,
    /// Base model: `"nothing"`, `"hold"` (increments), or `"equations"` (of sindy or lagged in the same job).
    pub base: Option<BaseKind>,
    /// Wash-out at the start of a window \[s\].
    pub wash_out_s: Option<f64>,
    /// History of a direct predictor \[s\].
    pub history_s: Option<f64>,
    /// Length of the compared part of a window, or horizon of a direct predictor \[s\].
    pub window_s: Option<f64>,
    /// Time over which the state of a control-affine network is corrected towards the measurements of a window \[s\].
    pub settle_s: Option<f64>,
    /// Maximum number of passes over the training runs.
    pub epochs: Option<usize>,
    /// Windows per step of the optimizer.
    pub batch: Option<usize>,
    /// Peak step size; default 0.03, with a base model 0.01, for a direct predictor 0.002.
    pub learning_rate: Option<f64>,
    /// Schedule of the step size.
    pub schedule: Option<Schedule>,
    /// Decoupled weight decay.
    pub weight_decay: Option<f64>,
    /// Maximum norm of the gradient.
    pub clip: Option<f64>,
    /// Number of trainings from different initial weights.
    pub restarts: Option<usize>,
    /// Whether the selected network is refitted on training and validation runs together.
    pub refit: Option<bool>,
    /// Whether the restarts of a direct predictor form an ensemble for prediction bands.
    pub ensemble: Option<bool>,
    /// Precision of the training.
    pub precision: Option<Precision>,
    /// Epochs without a lower validation error after which a restart ends.
    pub patience: Option<usize>,
    /// Weight of the squared error of each output.
    pub channel_weights: Option<Vec<f64>>,
    /// Map of each input of a control-affine network; default: the sine for angles (rad, deg), the identity for others.
    pub maps: Option<Vec<Map>>,
}

impl NetworkOptions {
    fn apply(&self, into: &mut TrainOptions) {
        macro_rules! put {
            ($($field:ident)*) => { $(if let Some(value) = &self.$field { into.$field = value.clone(); })* };
        }
        put!(hidden read_out feedback base epochs batch learning_rate schedule weight_decay clip restarts);
        put!(refit precision ensemble);
        put!(channel_weights maps);
        into.layers = self.layers.or(into.layers);
        into.projection = self.projection.or(into.projection);
        into.wash_out_s = self.wash_out_s.or(into.wash_out_s);
        into.history_s = self.history_s.or(into.history_s);
        into.window_s = self.window_s.or(into.window_s);
        into.settle_s = self.settle_s.or(into.settle_s);
        into.patience = self.patience.or(into.patience);
    }
}

/// Options of all networks and of each kind; those of a kind take precedence.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NetworkTrainingOptions {
    /// All recurrent networks.
    pub all: NetworkOptions,
    /// LSTM networks.
    pub lstm: NetworkOptions,
    /// GRU networks.
    pub gru: NetworkOptions,
    /// Vanilla networks.
    pub rnn: NetworkOptions,
    /// Direct predictors.
    pub direct: NetworkOptions,
    /// Control-affine networks.
    pub affine: NetworkOptions,
    /// Time budget of all network trainings of the job \[s\].
    pub budget_s: Option<f64>,
    /// Folder of the checkpoints, one per network. The checkpoint of another job is renamed to `NAME.checkpoint.old`.
    pub checkpoints: Option<PathBuf>,
    /// Whether a checkpoint of this job is required; without one the job fails.
    pub resume: bool,
}

impl NetworkTrainingOptions {
    /// The options of a training, without a budget.
    pub fn settings(&self, cell: CellKind, seed: u64) -> TrainOptions {
        let mut settings = TrainOptions { seed, ..TrainOptions::of(cell) };
        for options in self.overrides(cell) {
            options.apply(&mut settings);
        }
        settings
    }

    /// Options of a training: one set if the formulation is given, else one for each formulation.
    fn choices(&self, cell: CellKind, seed: u64, run: &Trajectory) -> Vec<(TrainOptions, &'static str)> {
        let overrides = self.overrides(cell);
        let given = overrides.iter().any(|s| s.feedback.is_some() || s.base.is_some());
        let settings = with_default_maps(self.settings(cell, seed), run);
        let mut choices = formulations(&settings, given || cell == CellKind::Affine, run.inputs.width());
        if overrides.iter().all(|s| s.learning_rate.is_none()) {
            for (settings, _) in choices.iter_mut().filter(|(s, _)| s.cell.is_recurrent()) {
                settings.learning_rate = default_learning_rate(settings.base);
            }
        }
        choices
    }

    /// Options of a kind of network in increasing precedence. Direct and control-affine networks have only their own.
    fn overrides(&self, cell: CellKind) -> Vec<&NetworkOptions> {
        let all = cell.is_recurrent().then_some(&self.all);
        all.into_iter().chain([self.own(cell)]).collect()
    }

    fn own(&self, cell: CellKind) -> &NetworkOptions {
        match cell {
            CellKind::Lstm => &self.lstm,
            CellKind::Gru => &self.gru,
            CellKind::Rnn => &self.rnn,
            CellKind::Direct => &self.direct,
            CellKind::Affine => &self.affine,
        }
    }

    /// Checkpoint file of a method.
    pub fn checkpoint(&self, method: Method) -> Option<PathBuf> {
        self.checkpoints.as_ref().map(|folder| folder.join(format!("{}.checkpoint", method.name())))
    }

    /// Checks options and checkpoints of the methods before the first training.
    pub(super) fn check(
        &self,
        job: &Job,
        methods: &[Method],
        parts: &Parts<'_>,
    ) -> Result<(), IdentifyError> {
        if let Some(budget) = self.budget_s.filter(|budget| !(budget.is_finite() && *budget > 0.0)) {
            let (what, needed) = ("budget", "a positive number of seconds");
            return Err(IdentifyError::InvalidOption { what, value: budget.to_string(), needed });
        }
        let equations = methods.iter().any(|method| matches!(method, Method::Sindy | Method::Lagged));
        let run = parts.train[0];
        for &method in methods {
            let Some(cell) = method.cell() else { continue };
            let settings = with_default_maps(self.settings(cell, 0), run);
            let wrong = |error| IdentifyError::Train { method, error };
            settings.check(run.outputs.width()).map_err(wrong)?;
            // Runs without inputs are an error of this method only, reported by its training.
            let (inputs, outputs) = (run.inputs.width().max(1), run.outputs.width());
            let sizes = match cell {
                CellKind::Direct => settings.perceptron(inputs, outputs, settings.spans(run.dt)).map(|_| ()),
                CellKind::Affine => settings.control_affine(run.inputs.width(), outputs).map(|_| ()),
                CellKind::Lstm | CellKind::Gru | CellKind::Rnn => {
                    settings.network(inputs, outputs).map(|_| ())
                }
            };
            sizes.map_err(wrong)?;
            if settings.base == BaseKind::Equations && !equations {
                return Err(IdentifyError::NoBase { method });
            }
        }
        if self.resume { self.check_kept(job, methods, parts) } else { Ok(()) }
    }

    fn check_kept(&self, job: &Job, methods: &[Method], parts: &Parts<'_>) -> Result<(), IdentifyError> {
        let Some(folder) = &self.checkpoints else { return Ok(()) };
        let mut found = false;
        for &method in methods {
            let (Some(cell), Some(path)) = (method.cell(), self.checkpoint(method)) else { continue };
            if !path.exists() {
                continue;
            }
            found = true;
            let task = task(job, parts, None);
            let kept = self.choices(cell, job.seed, parts.train[0]).into_iter().map(|(settings, _)| {
                let [same_settings, same_data] = task.is_kept_in(&settings, &path);
                // The base equations of the training are unknown before the search.
                (same_settings, same_data || settings.base == BaseKind::Equations)
            });
            let reason = match kept.max().unwrap_or_default() {
                (true, true) => continue,
                (true, false) => {
                    "it belongs to a training on other data, with other ranges or with equations as the base"
                }
                (false, _) => "it belongs to a training with other settings, or is damaged",
            };
            let reason = format!("{reason}; resume with the original command, or remove {}", key("resume"));
            return Err(IdentifyError::Train { method, error: TrainError::Checkpoint { path, reason } });
        }
        if found { Ok(()) } else { Err(IdentifyError::NoCheckpoint { folder: folder.clone() }) }
    }
}

fn with_default_maps(mut settings: TrainOptions, run: &Trajectory) -> TrainOptions {
    if settings.cell == CellKind::Affine && settings.maps.is_empty() {
        let map = |channel: &Channel| match channel.unit.as_str() {
            "rad" | "deg" => Map::Sine,
            _ => Map::Identity,
        };
        settings.maps = run.inputs.channels().iter().map(map).collect();
    }
    settings
}

/// Default peak step size; at 0.03 the training of increments, whose gradients accumulate, diverges on real ships.
fn default_learning_rate(base: BaseKind) -> f64 {
    match base {
        BaseKind::Nothing => TrainOptions::default().learning_rate,
        BaseKind::Hold | BaseKind::Equations => 0.01,
    }
}

fn task<'a>(job: &Job, parts: &'a Parts<'_>, equations: Option<Arc<Equations>>) -> train::Job<'a> {
    train::Job {
        runs: &parts.train,
        validation: &parts.validation,
        outputs: &parts.ranges,
        inputs: &parts.inputs,
        horizon: job.horizon,
        equations,
    }
}

/// Warm-up of the model \[samples\]: the wash-out and the first predicted sample.
fn warm_up(settings: &TrainOptions, parts: &Parts<'_>, equations: Option<&Equations>) -> usize {
    if settings.cell == CellKind::Direct {
        return settings.spans(parts.train[0].dt).0.max(equations.map_or(1, Equations::warm_up));
    }
    let longest = parts.train.iter().map(|run| run.len()).max().unwrap_or(0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive, and it saturates")]
    let given = settings.wash_out_s.map(|s| (s / parts.train[0].dt).round().min(1e12) as usize);
    let wash_out = given.unwrap_or(100.min(longest / 8)).max(1);
    (wash_out + 1).max(equations.map_or(1, Equations::warm_up))
}

/// Trains a network; `left` networks, this one included, share the budget that remains after `spent_s`.
pub(super) fn train(
    job: &Job,
    parts: &Parts<'_>,
    method: Method,
    equations: Option<Arc<Equations>>,
    (spent_s, left): (f64, usize),
    notes: &mut Vec<Note>,
    watch: train::ProgressCallback<'_>,
) -> Result<(TrainOptions, Trained), IdentifyError> {
    let networks = &job.networks;
    let inputs = parts.train[0].inputs.width();
    let mut choices = networks.choices(method.cell().unwrap_or_default(), job.seed, parts.train[0]);
    for (settings, _) in &mut choices {
        if settings.base == BaseKind::Equations && equations.is_none() {
            return Err(IdentifyError::NoBase { method });
        }
        if inputs == 0 && !settings.feedback {
            return Err(IdentifyError::NoInputs { method });
        }
        // Unused time goes to the later trainings.
        settings.budget_s =
            networks.budget_s.map(|budget| ((budget - spent_s) / left.max(1) as f64).max(1e-3 * budget));
    }
    let equations = equations.filter(|_| choices.iter().any(|(s, _)| s.base == BaseKind::Equations));
    for (settings, _) in &choices {
        check_evaluable(job, parts, warm_up(settings, parts, equations.as_deref()))?;
    }
    let task = task(job, parts, equations);
    let checkpoint = networks.checkpoint(method);
    let (settings, done) = select_formulation(&task, choices, (method, checkpoint.as_deref()), notes, watch)?;
    let watch = &mut |status: &train::Status| {
        watch(&train::Status { fraction: done + (1.0 - done) * status.fraction, ..*status })
    };
    let kept = checkpoint.as_deref().filter(|file| file.exists());
    let wrong = |error| IdentifyError::Train { method, error };
    let trained = match (train::train(&task, &settings, checkpoint.as_deref(), watch), kept) {
        // Without --resume, the checkpoint of another training is renamed.
        (Err(TrainError::Checkpoint { reason, .. }), Some(file)) if !networks.resume => {
            notes.push(retire_checkpoint(file, &reason).map_err(wrong)?);
            train::train(&task, &settings, checkpoint.as_deref(), watch)
        }
        (Ok(trained), Some(file)) if !networks.resume => {
            notes.push(Note::info(format!(
                "{}: resumed from {}, an interrupted training of the same job; the result equals a training without interruption",
                method.name(),
                file.display()
            )));
            Ok(trained)
        }
        (result, _) => result,
    };
    let trained = trained.map_err(wrong)?;
    notes.extend(trained.refit.as_ref().map(|refit| of_refit(method, &trained, refit)));
    Ok((settings, trained))
}

fn of_refit(method: Method, trained: &Trained, refit: &Refit) -> Note {
    let name = method.name();
    match refit.outcome {
        Outcome::Taken => Note::info(format!(
            "{name}: refitted over {} epochs on training and validation runs together; the validation errors are those before the refit",
            trained.history.len()
        )),
        Outcome::Worse => Note::warning(format!(
            "{name}: the refit on training and validation runs together failed (error {:.3} on the validation runs, {:.3} before): the network before the refit is kept",
            refit.validation, trained.validation
        ))
        .with_remedy(format!("set a smaller learning_rate, or another {}", key("seed"))),
        Outcome::Budget => Note::warning(format!(
            "{name}: the time budget ended before the refit on training and validation runs together: the network before the refit is kept"
        ))
        .with_remedy(format!("set a longer {}", key("budget"))),
    }
}

fn retire_checkpoint(file: &Path, reason: &str) -> Result<Note, TrainError> {
    let old = file.with_extension("checkpoint.old");
    let renamed = std::fs::rename(file, &old);
    renamed.map_err(|source| TrainError::Checkpoint {
        path: file.to_owned(),
        reason: format!("it belongs to another training and cannot be renamed ({source}): move the file"),
    })?;
    // The text after the semicolon is the remedy for --resume.
    let why = reason.split(';').next().unwrap_or(reason);
    Ok(Note::info(format!(
        "{} cannot be resumed ({why}): it was renamed to {}",
        file.display(),
        old.display()
    )))
}

/// Training record for the model file: options that reproduce the training, without values that vary between runs.
pub(super) fn provenance(job: &Job, settings: &TrainOptions, trained: &Trained) -> serde_json::Value {
    let best = trained.history.get(trained.best_epoch.saturating_sub(1));
    serde_json::json!({
        "asked": TrainOptions { budget_s: None, epochs: trained.epochs, ..settings.clone() },
        "budget_s": job.networks.budget_s,
        "horizon": job.horizon,
        "epochs": trained.history.len(),
        "best_epoch": trained.best_epoch,
        "train_loss": best.map(|epoch| epoch.train_loss),
        "validation": trained.validation,
        "restart": trained.restart,
        "restarts": trained.restarts,
        "ending": trained.ending,
        "refit": trained.refit.as_ref().map(|refit| refit.outcome),
    })
}
