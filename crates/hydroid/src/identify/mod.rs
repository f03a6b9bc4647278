//! Identification: fit on training runs, selection on validation runs, evaluation on test runs; or cross-validation over
//! all runs.

mod collinearity;
mod conflict;
mod control_affine;
mod cross_validation;
mod data_summary;
mod design_range;
mod disguise;
mod enough;
mod equations;
mod error;
mod evaluation;
mod expressions;
mod formulation;
mod grey_box;
mod leakage;
mod method;
mod networks;
mod options;
mod purpose;
mod rate_limits;
mod recursive;
mod summary;
mod through_water;
mod training;
mod verdict;

use std::ops::ControlFlow;

use web_time::Instant;

use crate::boat::{Boat, Evidence, Role};
use crate::craft::CraftFile;
use crate::evaluate::{DesignRange, Evaluation};
use crate::log::{Note, Split, Trajectory, is_constant};
use crate::manoeuvre::trial_errors;
use crate::model::{Model, Reading};
use crate::plant::find_roles;
use crate::progress::Progress;
use crate::train;

pub use cross_validation::CrossValidation;
#[doc(hidden)]
pub(crate) use data_summary::input_ranges;
pub use data_summary::{ChannelSummary, data_summary, output_ranges};
pub use design_range::{ChannelRange, GivenRange, GivenRanges};
pub(crate) use enough::HORIZON;
pub use enough::{MissingData, default_horizon};
pub use error::IdentifyError;
pub use method::Method;
pub use networks::{NetworkOptions, NetworkTrainingOptions};
pub use options::{FixedGate, GateOption, Keyword, LagOption, SindyOptions};
pub use purpose::ForTrials;
pub use rate_limits::{GivenRate, RateLimitOption};
pub use through_water::{CurrentsFound, FrameErrors, MotionOption, RunCurrent};
pub use training::Training;
pub use verdict::{Grade, Verdict, verdicts};

use evaluation::{check_evaluable, check_horizon, evaluate_candidates, select_best};
use training::{Trained, train_by};

/// Data and options of an identification.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Methods; the model with the smallest validation error is the best one.
    pub methods: Vec<Method>,
    /// Runs for training, validation and test. Without validation runs, all methods must be
    /// [cross-validated](Method::is_cross_validated) over the training runs; test runs are optional then.
    pub split: Split,
    /// How the logs were read; stored in the model file.
    pub reading: Reading,
    /// Stated roles of inputs.
    pub boat: Boat,
    /// Longest horizon \[samples\].
    pub horizon: usize,
    /// Samples between two origins of the final evaluations.
    pub origin_stride: usize,
    /// Seed of the stability check, of the bootstrap and of the initial weights of networks.
    pub seed: u64,
    /// Stated design ranges of outputs and inputs; else the training ranges. They scale networks and define divergence.
    pub ranges: GivenRanges,
    /// The motion that the models predict. That through the water needs a heading of all runs, the outputs `u`, `v` and
    /// `r`, and a cross-validation.
    pub motion: MotionOption,
    /// Limits of the rates at which actuators follow their commands.
    pub rate_limits: RateLimitOption,
    /// Inputs that may be [outputs in disguise](IdentifyError::Disguise).
    pub allow_feedback: Vec<String>,
    /// Options of the search for equations.
    pub sindy: SindyOptions,
    /// Options of networks.
    pub networks: NetworkTrainingOptions,
    /// The vessel of the method grey-box.
    pub vessel: Option<CraftFile>,
}

impl Job {
    fn with_split(&self, split: Split) -> Self {
        Self {
            split,
            methods: self.methods.clone(),
            reading: self.reading.clone(),
            boat: self.boat.clone(),
            ranges: self.ranges.clone(),
            rate_limits: self.rate_limits.clone(),
            allow_feedback: self.allow_feedback.clone(),
            sindy: self.sindy.clone(),
            networks: self.networks.clone(),
            vessel: self.vessel.clone(),
            ..*self
        }
    }
}

/// Progress of a job.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// Completed fraction, 0 to 1.
    pub fraction: f64,
    /// The current method; none during the evaluation.
    pub method: Option<Method>,
    /// Progress of the training of a network.
    pub training: Option<&'a train::Status>,
}

/// Called with the progress of a job; [`ControlFlow::Break`] cancels the job.
pub type OnStage<'a> = &'a mut dyn FnMut(&Stage<'_>) -> ControlFlow<()>;

/// A model with its training record and its errors.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The model.
    pub model: Model,
    /// Record of the training.
    pub training: Training,
    /// Duration of fit and selection \[s\].
    pub train_seconds: f64,
    /// Errors on the validation runs. In a cross-validation, the errors on all folds, each predicted by the model of
    /// [`left_out`](Self::left_out) that was chosen and fitted without it.
    pub validation: Evaluation,
    /// Errors on the test runs, if there are any.
    pub test: Option<Evaluation>,
    /// For each fold of a cross-validation, the model without it.
    pub left_out: Vec<Model>,
}

impl Candidate {
    /// The errors that judge the model: those on the test runs, else those of the cross-validation.
    pub fn judged(&self) -> &Evaluation {
        self.test.as_ref().unwrap_or(&self.validation)
    }
}

/// Result of an identification.
#[derive(Clone, Debug)]
pub struct IdentifyResult {
    /// The models in the order of the methods. A method that failed is missing; a warning states the reason. None if the runs
    /// are too short for all methods.
    pub candidates: Vec<Candidate>,
    /// Index of the best model; none if every model diverged on validation or test runs, or [`missing`](Self::missing) says that
    /// the data do not suffice to judge one.
    pub best: Option<usize>,
    /// Grade of each output of the best model (of the first one if there is no best) on the test runs.
    pub verdicts: Vec<Verdict>,
    /// Notes for the user on data and models.
    pub warnings: Vec<Note>,
    /// Design ranges, outputs first, and whether they were stated.
    pub ranges: Vec<ChannelRange>,
    /// The folds, if the models were cross-validated.
    pub cross_validation: Option<CrossValidation>,
    /// Currents of the training runs, if models of the motion through the water were tried.
    pub currents: Option<CurrentsFound>,
    /// The model for trials and control, if there are trials.
    pub for_trials: Option<ForTrials>,
    /// The data that are missing for a judgement, if there are too few.
    pub missing: Option<MissingData>,
}

/// Validation windows per run in the search.
const SEARCH_ORIGINS: usize = 200;

/// Runs an identification.
///
/// # Errors
/// If the runs cannot be fitted or evaluated, or the work was interrupted.
pub fn identify(job: &Job, progress: Progress<'_>) -> Result<IdentifyResult, IdentifyError> {
    identify_with_stages(job, &mut |stage| progress(stage.fraction))
}

/// Runs an identification and reports its stages.
///
/// # Errors
/// As [`identify`]. The failure of one method is an error only if no other method gives a model.
pub fn identify_with_stages(job: &Job, watch: OnStage<'_>) -> Result<IdentifyResult, IdentifyError> {
    try_identify(job, watch).or_else(|error| IdentifyResult::without_model(job, error))
}

fn try_identify(job: &Job, watch: OnStage<'_>) -> Result<IdentifyResult, IdentifyError> {
    let [train, validation, test] = parts_of(&job.split);
    let cross = is_cross_validated(job);
    check(job)?;
    let methods = methods(job)?;
    let ranges = design_range::design_ranges(&job.ranges, &train)?;
    let folds = cross.then(|| CrossValidation::new(&job.split.train));
    let judged = folds.as_ref().map(|folds| folds.runs(&job.split.train));
    let validation = judged.map_or(validation, |judged| judged.into_iter().map(|(_, run)| run).collect());
    let parts = Parts { folds: folds.as_ref(), ..Parts::new([train, validation, test], &ranges) };
    check_horizon(job, &parts)?;
    disguise::check(&job.split.train, job.horizon, &job.allow_feedback)?;
    let mut warnings = job.split.notes.clone();
    warnings.extend(folds.as_ref().filter(|folds| folds.has_blocks()).map(|_| note_of_blocks()));
    let mut tell = |fraction: f64| watch(&Stage { fraction: 0.05 * fraction, method: None, training: None });
    let found = through_water::estimate(job, &parts, &mut warnings, &mut tell)?;
    let in_water = found.as_ref().filter(|found| through_water::is_promising(job, found));
    let mut tell =
        |fraction: f64| watch(&Stage { fraction: 0.05 + 0.05 * fraction, method: None, training: None });
    let rates = rate_limits::find(job, &parts, in_water, &mut warnings, &mut tell)?;
    // Models are fitted in the positions of the actuators, and evaluated in the commands. A vessel file has its own limits.
    let limited = rate_limits::limited(job, &rates);
    let job_in_positions = limited.as_ref().unwrap_or(job);
    let folds_in_positions = cross.then(|| CrossValidation::new(&job_in_positions.split.train));
    let parts_in_positions = parts.in_positions(job_in_positions, folds_in_positions.as_ref(), rates);
    job_in_positions.networks.check(job_in_positions, &methods, &parts_in_positions)?;
    let data_of = |method: Method| match method {
        Method::GreyBox => (job, &parts),
        _ => (job_in_positions, &parts_in_positions),
    };
    let over_ground = job.motion != MotionOption::ThroughWater;
    let end = if in_water.is_some() { 0.4 } else { 0.8 };
    let mut trained: Vec<Trained> = Vec::new();
    let mut failure = None;
    // Training time of the networks, failed ones included, for the shared time budget.
    let mut spent_s = 0.0;
    for (i, &method) in methods.iter().enumerate().filter(|_| over_ground) {
        let mut tell = |fraction: f64, training: Option<&train::Status>| {
            let fraction = 0.1 + (end - 0.1) * (i as f64 + fraction) / methods.len() as f64;
            watch(&Stage { fraction, method: Some(method), training })
        };
        let after = methods[i..].iter().filter(|method| method.cell().is_some()).count();
        let clock = Instant::now();
        let (job, parts) = data_of(method);
        match train_by(method, job, parts, &trained, (spent_s, after), &mut warnings, &mut tell) {
            Ok(next) => {
                spent_s += next.training.network().map_or(0.0, |trained| trained.seconds);
                trained.push(next);
            }
            Err(error) if error.is_method_specific() && methods.len() > 1 => {
                warnings.push(no_model(method.name(), &error));
                spent_s += method.cell().map_or(0.0, |_| clock.elapsed().as_secs_f64());
                failure = failure.or(Some(error));
            }
            Err(error) => return Err(error),
        }
    }
    if let Some(found) = in_water {
        let mut tell = |f: f64| watch(&Stage { fraction: 0.4 + 0.4 * f, method: None, training: None });
        trained.extend(through_water::train(data_of, &methods, found, &mut warnings, &mut tell)?);
    }
    // The warm-up of past values is known only now.
    trained.retain(|model| match check_evaluable(job, &parts, model.model.session().warm_up()) {
        Ok(()) => true,
        Err(error) => {
            warnings.push(no_model(&model.model.description.name, &error));
            failure.get_or_insert(error);
            false
        }
    });
    if trained.is_empty() {
        return Err(failure.unwrap_or(IdentifyError::NoCurrents));
    }
    let mut candidates = evaluate_candidates(job, &parts, trained, &mut |fraction| {
        watch(&Stage { fraction: 0.8 + 0.2 * fraction, method: None, training: None })
    })?;
    let mut currents = found.map(|found| through_water::describe(&job.split.train, &found));
    if let Some(found) = &mut currents {
        candidates = through_water::choose(candidates, found);
    }
    describe(&mut candidates, &parts.train, &parts_of(&job.split).concat());
    measure_trials(&mut candidates, folds.as_ref(), &job.split.train);
    let missing = MissingData::for_judgement(job, &candidates);
    let best = select_best(&candidates).filter(|_| missing.is_none());
    warnings.extend(missing.as_ref().map(MissingData::note));
    warnings
        .extend(currents.as_ref().and_then(|found| through_water::note(found, best.map(|i| &candidates[i]))));
    let shown: &Candidate = &candidates[best.unwrap_or(0)];
    let verdicts = verdicts(shown.judged(), &parts_of(&job.split).concat());
    warnings.extend(verdict::spikes(&parts.train, &job.sindy));
    warnings.extend(of_data(job, shown, &verdicts));
    Ok(IdentifyResult {
        for_trials: ForTrials::of(&mut candidates, &parts.train).filter(|_| missing.is_none()),
        candidates,
        best,
        verdicts,
        warnings,
        ranges,
        cross_validation: folds,
        currents,
        missing,
    })
}

/// Warnings of the data, and of what the model that is shown makes of them.
fn of_data(job: &Job, shown: &Candidate, verdicts: &[Verdict]) -> Vec<Note> {
    let runs = parts_of(&job.split).concat();
    let mut warnings = conflict::warnings(&runs, &shown.model.description.boat, job.horizon);
    let data = data_summary(&job.split);
    warnings.extend(verdict::warnings(shown, verdicts, &data, &job.split.test));
    warnings.extend(collinearity::warnings(shown, &data));
    warnings.extend(verdict::of_no_vessel(job, shown));
    warnings
}

/// Standard deviation of a measured shaft speed, relative to its mean, up to which it is that of one order.
const STEADY: f64 = 0.02;

/// Completes the descriptions of models by what their inputs do, and by the outputs that they do not predict; a constant input is
/// a setting, and so is a shaft speed that hardly varies.
fn describe(candidates: &mut [Candidate], train: &[&Trajectory], all: &[&Trajectory]) {
    for candidate in candidates {
        describe_one(candidate, train);
        candidate.model.description.provenance.not_identified =
            verdict::not_identified(candidate.judged(), all);
    }
}

fn describe_one(candidate: &mut Candidate, train: &[&Trajectory]) {
    let d = &mut candidate.model.description;
    for (c, port) in d.inputs.iter().enumerate() {
        let mut named = Boat::default();
        named.find(std::slice::from_ref(&port.channel));
        // Pulse widths are far from zero at rest.
        let is_shaft = named.role(&port.channel.name) == Some(Role::Propulsion) && port.channel.unit != "s";
        let is_steady = || {
            let values = || train.iter().flat_map(|run| run.inputs.column(c));
            let count = values().count() as f64;
            let mean = values().sum::<f64>() / count;
            let variance = values().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count;
            variance.sqrt() <= STEADY * mean.abs()
        };
        if is_constant(train.iter().map(|run| &run.inputs), c) || (is_shaft && is_steady()) {
            d.boat.found_role(&port.channel.name, Role::Setting, Evidence::Constant);
        }
    }
    candidate.model.description.boat = find_roles(&candidate.model);
}

/// Sets the errors of the models in the trials of the runs that were left out.
fn measure_trials(candidates: &mut [Candidate], folds: Option<&CrossValidation>, train: &[Trajectory]) {
    let Some(folds) = folds.map(|folds| folds.runs(train)) else { return };
    for candidate in candidates {
        let mut left_out = Vec::with_capacity(folds.len());
        for (fold, run) in &folds {
            let description = candidate.model.description.clone();
            left_out.push((Model { description, ..candidate.left_out[*fold].clone() }, *run));
        }
        candidate.model.description.trial_errors = trial_errors(&left_out);
    }
}

fn note_of_blocks() -> Note {
    let message =
        "one or two logs: the cross-validation leaves out contiguous blocks of them, one after another";
    Note::warning(message).with_remedy("three separate runs or more are a stricter test, because wind, load and sensors are the same within one run")
}

/// Whether the models are judged by a cross-validation.
fn is_cross_validated(job: &Job) -> bool {
    job.split.validation.is_empty() && job.methods.iter().all(|method| method.is_cross_validated())
}

/// Training, validation and test runs.
fn parts_of(split: &Split) -> [Vec<&Trajectory>; 3] {
    [&split.train, &split.validation, &split.test].map(|runs| runs.iter().collect())
}

/// Checks the options and that the runs are there and different.
fn check(job: &Job) -> Result<(), IdentifyError> {
    job.sindy.check()?;
    for (what, value) in [("horizon", job.horizon), ("origin stride", job.origin_stride)] {
        if value == 0 {
            let needed = "at least 1 sample";
            return Err(IdentifyError::InvalidOption { what, value: value.to_string(), needed });
        }
    }
    let [train, validation, test] = parts_of(&job.split);
    let cross = is_cross_validated(job);
    if job.motion == MotionOption::ThroughWater && !cross {
        return Err(IdentifyError::ThroughWater);
    }
    let needed = if cross { 1 } else { 3 };
    let named = [(&train, "train"), (&validation, "validate"), (&test, "test")];
    if let Some((_, part)) = named.into_iter().take(needed).find(|(runs, _)| runs.is_empty()) {
        return Err(IdentifyError::NoRuns { what: part });
    }
    if cross {
        // Every run is a part of its own.
        let single: Vec<&[&Trajectory]> = train.iter().map(std::slice::from_ref).chain([&test[..]]).collect();
        leakage::check(&single)
    } else {
        leakage::check(&[&train, &validation, &test])
    }
}

/// The requested methods without duplicates, equations before networks, which may use them as base model.
fn methods(job: &Job) -> Result<Vec<Method>, IdentifyError> {
    let mut methods = Vec::new();
    for &method in &job.methods {
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    if methods.is_empty() {
        let (what, value, needed) = ("list of methods", String::from("nothing"), "one method at least");
        return Err(IdentifyError::InvalidOption { what, value, needed });
    }
    methods.sort_by_key(|method| method.cell().is_some());
    Ok(methods)
}

fn no_model(method: &str, error: &IdentifyError) -> Note {
    Note::warning(format!("no model by the method {method}: {}", error.without_method()))
}

#[derive(Clone)]
struct Parts<'a> {
    train: Vec<&'a Trajectory>,
    /// Validation runs; the runs or blocks of all folds in a cross-validation.
    validation: Vec<&'a Trajectory>,
    test: Vec<&'a Trajectory>,
    /// Design ranges of the outputs.
    ranges: Vec<DesignRange>,
    /// Design ranges of the inputs.
    inputs: Vec<DesignRange>,
    /// Ranges of the outputs in the training runs.
    training_ranges: Vec<DesignRange>,
    /// Channels with a stated design range.
    given: Vec<String>,
    /// The folds of a cross-validation over the training runs.
    folds: Option<&'a CrossValidation>,
    /// Rate limits of the actuators whose positions are the inputs of the runs; empty if those are the commands.
    rate_limits: Vec<Option<f64>>,
    /// Whether only settings are searched for, and the equations fitted again.
    draft: bool,
}

impl<'a> Parts<'a> {
    fn new([train, validation, test]: [Vec<&'a Trajectory>; 3], all: &[ChannelRange]) -> Self {
        let of = |input: bool| all.iter().filter(|c| c.input == input).map(|c| c.range).collect();
        let given = all.iter().filter(|c| c.given).map(|c| c.channel.name.clone()).collect();
        let training_ranges = output_ranges(&train);
        Self {
            train,
            validation,
            test,
            ranges: of(false),
            inputs: of(true),
            training_ranges,
            given,
            folds: None,
            rate_limits: Vec::new(),
            draft: false,
        }
    }

    /// The training data of a job whose inputs are the positions of actuators with these rate limits.
    fn in_positions<'b>(
        &self,
        job: &'b Job,
        folds: Option<&'b CrossValidation>,
        rate_limits: Vec<Option<f64>>,
    ) -> Parts<'b> {
        let validation = match folds {
            Some(folds) => folds.runs(&job.split.train).into_iter().map(|(_, run)| run).collect(),
            None => job.split.validation.iter().collect(),
        };
        Parts {
            train: job.split.train.iter().collect(),
            validation,
            test: job.split.test.iter().collect(),
            ranges: self.ranges.clone(),
            inputs: self.inputs.clone(),
            training_ranges: self.training_ranges.clone(),
            given: self.given.clone(),
            folds,
            rate_limits,
            draft: self.draft,
        }
    }
}

impl IdentifyResult {
    /// Whether every output is predicted better than by the trivial predictions, and nothing diverged.
    pub fn is_usable(&self) -> bool {
        self.best.is_some() && self.verdicts.iter().all(|v| matches!(v.grade, Grade::Good | Grade::Usable))
    }
}
