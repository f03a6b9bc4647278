//! Training by each method.

use std::ops::ControlFlow;
use std::sync::Arc;

use hydroid_core::model::committee::Committee;
use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::predict::Predictor;
use web_time::Instant;

use super::{
    Candidate, GateOption, IdentifyError, Job, Keyword, Method, Parts, SindyOptions, data_summary, equations,
    grey_box, networks as recurrent, output_ranges, recursive,
};
use crate::boat::Boat;
use crate::committee;
use crate::evaluate::{self, DesignRange, EvaluateError, evaluate_each};
use crate::grey_box::GreyBox;
use crate::log::{Channel, Note, Trajectory, noise_level};
use crate::model::{Body, Description, Members, Model, MovedTogether, Port, Provenance, Reading};
use crate::progress::{self, Progress};
use crate::sindy::{SearchError, SearchResult, noise_ratio, refit, subsample};
use crate::train;

/// Record of a training.
#[derive(Clone, Debug)]
pub enum Training {
    /// A search for sparse equations.
    Equations(Arc<SearchResult>),
    /// Equations with recursive least squares.
    Recursive(Arc<SearchResult>),
    /// A committee.
    Committee(Arc<committee::Chosen>),
    /// The numbers of a vessel file.
    GreyBox(Arc<GreyBox>),
    /// A network, recurrent or a direct predictor.
    Network(Arc<train::Trained>),
}

impl Training {
    /// The search for equations; none for networks.
    pub fn found(&self) -> Option<&Arc<SearchResult>> {
        match self {
            Self::Equations(found) | Self::Recursive(found) => Some(found),
            Self::Network(_) | Self::Committee(_) | Self::GreyBox(_) => None,
        }
    }

    /// The training of a network; none for equations.
    pub fn network(&self) -> Option<&Arc<train::Trained>> {
        match self {
            Self::Network(trained) => Some(trained),
            Self::Equations(_) | Self::Recursive(_) | Self::Committee(_) | Self::GreyBox(_) => None,
        }
    }

    /// Short description.
    pub fn about(&self) -> &'static str {
        match self {
            Self::Recursive(_) => "equations with online adaptation",
            Self::Committee(_) => "difference equations, some of which learn along a run",
            Self::GreyBox(_) => "physical equations with numbers estimated from the logs",
            Self::Equations(_) if self.has_past() => "equations with past values",
            Self::Equations(_) => "memoryless equations",
            Self::Network(trained) => match trained.model {
                train::TrainedNetwork::Recurrent(_) => "recurrent network",
                train::TrainedNetwork::Direct(_) => "feed-forward network, all steps of a horizon at once",
                train::TrainedNetwork::Affine(_) => "control-affine network",
            },
        }
    }

    /// Description of the search or training for the result line.
    pub fn effort(&self) -> String {
        match self {
            Self::Equations(found) | Self::Recursive(found) => {
                let tried = found.trials.len();
                if tried == 1 {
                    "from one setting".to_owned()
                } else {
                    format!("chosen among {tried} settings")
                }
            }
            Self::Committee(chosen) => format!(
                "chosen among {} candidates by cross-validation and fitted on all training and validation runs",
                chosen.candidates
            ),
            Self::GreyBox(found) => {
                format!("{} numbers estimated in {} iterations", found.estimates.len(), found.steps)
            }
            Self::Network(trained) => format!(
                "epoch {} of {}{}{}",
                trained.best_epoch,
                trained.history.len(),
                if trained.restarts.len() > 1 {
                    format!(", the best of {} restarts", trained.restarts.len())
                } else {
                    String::new()
                },
                match &trained.refit {
                    Some(refit) if refit.is_taken() => ", then refitted on all runs",
                    _ => "",
                }
            ),
        }
    }

    fn has_past(&self) -> bool {
        self.found().is_some_and(|found| found.trials.iter().any(|trial| !trial.structure.past.is_empty()))
    }

    /// Order of complexity: memoryless equations, equations with past values, adaptive equations, networks.
    pub(super) fn complexity(&self) -> (u8, bool) {
        let kind = match self {
            Self::Equations(_) | Self::GreyBox(_) => 0,
            Self::Recursive(_) | Self::Committee(_) => 1,
            Self::Network(_) => 2,
        };
        (kind, self.has_past())
    }
}

impl Candidate {
    /// The search that found its equations; none for networks.
    pub fn found(&self) -> Option<&SearchResult> {
        self.training.found().map(Arc::as_ref)
    }
}

pub(super) struct Trained {
    pub(super) model: Model,
    pub(super) training: Training,
    pub(super) train_seconds: f64,
    /// Score of the search on the validation runs.
    pub(super) score: f64,
    /// For each fold, the model that was fitted without it; empty without cross-validation.
    pub(super) left_out: Vec<Model>,
}

/// Called with the completed fraction of a method and the progress of the training of a network.
pub(super) type OnProgress<'a> = &'a mut dyn FnMut(f64, Option<&train::Status>) -> ControlFlow<()>;

/// Trains by one method. `before` are the earlier models. For networks, `(spent_s, left)` is the training time of the
/// earlier networks and the number of networks that remain, this one included.
pub(super) fn train_by(
    method: Method,
    job: &Job,
    parts: &Parts<'_>,
    before: &[Trained],
    networks: (f64, usize),
    notes: &mut Vec<Note>,
    tell: OnProgress<'_>,
) -> Result<Trained, IdentifyError> {
    let clock = Instant::now();
    // The best equations so far are the base model of networks and the initial model of adaptation.
    let equations =
        before.iter().filter(|t| matches!(t.training, Training::Equations(_)) && t.score.is_finite());
    let sparse = equations.min_by(|a, b| a.score.total_cmp(&b.score)).and_then(|t| t.training.found());
    let of_search = |found: &SearchResult| {
        let mut record = serde_json::json!({
            "chosen": found.trials[found.chosen],
            "refinement": found.refinement,
            "asked": job.sindy,
            "horizon": job.horizon,
        });
        if let Some(ratios) = &found.noise_ratio {
            record["noise_ratio"] = serde_json::json!(ratios);
        }
        record
    };
    let score = |found: &SearchResult| found.trials[found.chosen].validation.unwrap_or(f64::INFINITY);
    let mut left_out = Vec::new();
    let (model, training, score) = match method {
        Method::Sindy | Method::Lagged => {
            let progress = &mut |fraction| tell(fraction, None);
            let (found, fits) = match method {
                Method::Lagged => (equations::lagged(job, parts, progress)?, Vec::new()),
                _ if parts.folds.is_some() => stable_equations(job, parts, notes, progress)?,
                _ => (equations::memoryless(job, parts, progress)?, Vec::new()),
            };
            let body = Body::Equations(Arc::new(found.fit.equations.clone()));
            let mut model = describe(job, parts, method, body, of_search(&found));
            if let Some(ensemble) = &found.ensemble {
                model.members = Members::new(&ensemble.members);
            }
            let with = |equations| Model {
                body: Body::Equations(Arc::new(equations)),
                members: Members::default(),
                ..model.clone()
            };
            left_out = fits.into_iter().map(with).collect();
            let score = score(&found);
            (model, Training::Equations(found), score)
        }
        Method::Recursive => {
            let describe = |found: &SearchResult, equations: Equations| {
                describe(job, parts, method, Body::Equations(Arc::new(equations)), of_search(found))
            };
            let progress = &mut |fraction| tell(fraction, None);
            let (found, model) = recursive::recursive_model(job, parts, sparse, describe, progress)?;
            let score = score(&found);
            (model, Training::Recursive(found), score)
        }
        Method::Committee => {
            let progress = &mut |fraction| tell(fraction, None);
            let validation: &[&Trajectory] = if parts.folds.is_some() { &[] } else { &parts.validation };
            let chosen = committee::choose_with_validation(&parts.train, validation, job.horizon, progress)?;
            let told = serde_json::json!({
                "candidates": chosen.candidates,
                "cross_validated_nrmse": chosen.error,
                "cross_validated_nrmse_frozen": chosen.constant_error,
                "cross_validated_nrmse_of_the_best": chosen.best_error,
                "horizon": job.horizon,
            });
            let body = Body::Committee(Arc::new(chosen.committee.clone()));
            let mut model = describe(job, parts, method, body, told);
            let Provenance { training, validation, .. } = &mut model.description.provenance;
            training.extend_from_slice(validation);
            if parts.folds.is_some() {
                let with = |committee: &Committee| {
                    let body = Body::Committee(Arc::new(committee.clone()));
                    Model { body, ..model.clone() }
                };
                left_out = chosen.left_out.iter().map(with).collect();
            }
            let score = chosen.error;
            (model, Training::Committee(Arc::new(chosen)), score)
        }
        Method::GreyBox => {
            let describe = |body, settings| describe(job, parts, method, body, settings);
            let (model, found, fits) =
                grey_box::train(job, parts, describe, notes, &mut |fraction| tell(fraction, None))?;
            left_out = fits;
            (model, Training::GreyBox(Arc::new(found)), f64::INFINITY)
        }
        Method::Lstm | Method::Gru | Method::Rnn | Method::Direct | Method::Affine => {
            let base = sparse.map(|found| Arc::new(found.fit.equations.clone()));
            let watch = &mut |status: &train::Status| tell(status.fraction, Some(status));
            let (settings, trained) = recurrent::train(job, parts, method, base, networks, notes, watch)?;
            let told = recurrent::provenance(job, &settings, &trained);
            let mut model = describe(job, parts, method, Body::from(trained.model.clone()), told);
            if !trained.members.is_empty() {
                model.members = Members::new(&trained.members);
            }
            if trained.refit.as_ref().is_some_and(train::Refit::is_taken) {
                let Provenance { training, validation, .. } = &mut model.description.provenance;
                training.extend_from_slice(validation);
            }
            let score = trained.validation;
            (model, Training::Network(Arc::new(trained)), score)
        }
    };
    Ok(Trained { model, training, train_seconds: clock.elapsed().as_secs_f64(), score, left_out })
}

/// Largest number of samples for the choice of settings and for the fits without a fold.
const DRAFT_SAMPLES: usize = 300_000;

/// Equations that are fitted to all runs, and for each fold those fitted without it. A change of mode that was searched for is
/// dropped if its equations diverge on runs that were left out, and those without it less often.
fn stable_equations(
    job: &Job,
    parts: &Parts<'_>,
    notes: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<(Arc<SearchResult>, Vec<Equations>), IdentifyError> {
    let found = cross_validated_equations(job, parts, &mut |f| progress(0.5 * f))?;
    let is_free = matches!(job.sindy.gate, None | Some(GateOption::Keyword(Keyword::Auto)));
    let has_gate = found.0.trials[found.0.chosen].structure.gate.is_some();
    let count = if is_free && has_gate { diverged(job, parts, &found.1)? } else { 0 };
    if count == 0 {
        return Ok(found);
    }
    let sindy = SindyOptions { gate: Some(GateOption::Keyword(Keyword::None)), ..job.sindy.clone() };
    let plain = Job { sindy, ..job.clone() };
    match cross_validated_equations(&plain, parts, &mut |f| progress(0.5 + 0.5 * f)) {
        Ok(other) if diverged(job, parts, &other.1)? < count => {
            notes.push(Note::info(format!(
                "a change of mode was left out of the equations, because {count} rollouts with it diverge on runs that were left out"
            )));
            Ok(other)
        }
        Err(IdentifyError::Sindy(SearchError::Cancelled(cancelled))) => {
            Err(SearchError::Cancelled(cancelled).into())
        }
        _ => Ok(found),
    }
}

/// Number of rollouts that diverge, on each fold by the equations without it.
fn diverged(job: &Job, parts: &Parts<'_>, left_out: &[Equations]) -> Result<usize, IdentifyError> {
    let folds = parts.folds.map(|folds| folds.runs(&job.split.train)).unwrap_or_default();
    let session = |fold: usize| -> Box<dyn Predictor> {
        Box::new(EquationsSession::new(Arc::new(left_out[fold].clone())))
    };
    let mut sessions: Vec<_> = folds.iter().map(|(fold, _)| session(*fold)).collect();
    let runs: Vec<&Trajectory> = folds.iter().map(|(_, run)| *run).collect();
    let options = evaluate::Options {
        warm_up: sessions.iter().map(|session| session.warm_up()).max().unwrap_or(1),
        origin_stride: job.origin_stride,
        ..equations::quick(job, parts)
    };
    match evaluate_each("sindy", &mut sessions, &parts.ranges, &runs, &options, &mut progress::silent()) {
        Ok(errors) => Ok(errors.diverged),
        Err(EvaluateError::Cancelled(cancelled)) => Err(SearchError::Cancelled(cancelled).into()),
        // Runs that are too short are judged later.
        Err(_) => Ok(0),
    }
}

/// Equations with the settings of a search, fitted to all runs, and for each fold those fitted without it.
fn cross_validated_equations(
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<(Arc<SearchResult>, Vec<Equations>), IdentifyError> {
    let Some(folds) = parts.folds else { return Err(IdentifyError::NoRuns { what: "validate" }) };
    let [train, validation] = folds.search(&job.split.train);
    let draft = |runs: &[&Trajectory]| subsample(runs, DRAFT_SAMPLES, (10 * job.horizon).max(3_000));
    let train = draft(&train);
    let train: Vec<&Trajectory> = train.iter().collect();
    let part = Parts {
        training_ranges: output_ranges(&train),
        train,
        validation,
        test: Vec::new(),
        folds: None,
        draft: true,
        ..parts.clone()
    };
    let found = equations::memoryless(job, &part, &mut |f| progress(0.8 * f))?;
    let ranges = &parts.training_ranges;
    let mut left_out = Vec::new();
    for fold in 0..folds.folds() {
        progress::report(progress, 0.8 + 0.1 * fold as f64 / folds.folds() as f64)
            .map_err(SearchError::Cancelled)?;
        let runs = folds.without(fold, &job.split.train);
        let runs: Vec<&Trajectory> = runs.iter().map(AsRef::as_ref).collect();
        let runs = draft(&runs);
        let runs: Vec<&Trajectory> = runs.iter().collect();
        let (fit, _) = refit(&found, &runs, ranges, (0, job.seed), equations::DRAFT_REFINE_SAMPLES)?;
        left_out.push(fit.equations);
    }
    let (fit, ensemble) = refit(
        &found,
        &parts.train,
        ranges,
        (job.sindy.members.unwrap_or(super::options::MEMBERS), job.seed),
        equations::REFINE_SAMPLES,
    )?;
    progress::report(progress, 1.0).map_err(SearchError::Cancelled)?;
    let mut found = Arc::unwrap_or_clone(found);
    (found.fit, found.ensemble) = (fit, ensemble);
    if found.noise_ratio.is_some() {
        let ratios = noise_ratio(&parts.train, &found.grid, Some(&found.fit)).ok();
        found.noise_ratio = ratios.filter(|ratios| equations::is_explained(ratios));
    }
    Ok((Arc::new(found), left_out))
}

fn describe(
    job: &Job,
    parts: &Parts<'_>,
    method: Method,
    body: Body,
    mut settings: serde_json::Value,
) -> Model {
    if !parts.given.is_empty() {
        settings["ranges_given"] = serde_json::json!(parts.given);
    }
    let run = parts.train[0];
    let noise = noise_level(&parts.train);
    let noise = |channel: &Channel| {
        let output = run.outputs.channels().iter().position(|output| output.name == channel.name);
        output.map(|i| noise[i]).filter(|std| *std > 0.0)
    };
    let port = |((channel, &range), &training_range): ((&Channel, &DesignRange), &DesignRange)| Port {
        channel: channel.clone(),
        range,
        training_range: parts.given.contains(&channel.name).then_some(training_range),
        noise: noise(channel),
        rate_limit: None,
    };
    let ports = |channels: &[Channel],
                 ranges: &[DesignRange],
                 training_ranges: &[DesignRange]|
     -> Vec<Port> { channels.iter().zip(ranges).zip(training_ranges).map(port).collect() };
    let names = |runs: &[Trajectory]| runs.iter().map(|run| run.name.clone()).collect();
    let mut inputs: Vec<Port> =
        ports(run.inputs.channels(), &parts.inputs, &data_summary::input_ranges(&parts.train));
    for (port, &rate) in inputs.iter_mut().zip(&parts.rate_limits) {
        port.rate_limit = rate;
    }
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            boat: boat(job),
            name: method.name().to_owned(),
            dt: run.dt,
            outputs: ports(run.outputs.channels(), &parts.ranges, &parts.training_ranges),
            inputs,
            reading: reading(job, run.dt),
            provenance: Provenance {
                hydroid: env!("CARGO_PKG_VERSION").to_owned(),
                seed: job.seed,
                training: names(&job.split.train),
                moved_together: MovedTogether::of(&parts.train),
                validation: names(&job.split.validation),
                settings,
                ..Provenance::default()
            },
        },
        body,
        members: Members::default(),
        learning: None,
    }
}

/// The boat; the commands of a vessel file have its neutral values and limits, where they are not stated.
fn boat(job: &Job) -> Boat {
    let mut boat = job.boat.clone();
    for command in job.vessel.iter().flat_map(|vessel| &vessel.craft.commands) {
        let input = boat.inputs.entry(command.name.clone()).or_default();
        // They are in the unit of the model.
        if input.scale.is_none() && input.unit.is_none() {
            input.neutral.get_or_insert(command.neutral);
            input.limits.get_or_insert(command.limits);
        }
    }
    boat
}

/// The reading of the training logs with an explicit sample time.
fn reading(job: &Job, dt: f64) -> Reading {
    let mut reading = job.reading.clone();
    // Models of the motion over ground need no heading.
    reading.selection.heading = None;
    reading.options.dt = Some(dt);
    reading
}
