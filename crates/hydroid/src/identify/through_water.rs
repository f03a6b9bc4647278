//! Models of the motion through the water beside those of the motion over ground.

use serde::{Deserialize, Serialize};

use super::evaluation::{MIN_IMPROVEMENT, losses};
use super::training::{Trained, train_by};
use super::{Candidate, CrossValidation, IdentifyError, Job, Method, Parts};
use crate::committee::currents::{self, Currents};
use crate::evaluate::{self, EvaluateError, evaluate_each};
use crate::key::key;
use crate::log::{Note, Split, Trajectory};
use crate::model::{CurrentEstimate, MOTION};
use crate::progress::Progress;
use crate::sindy::SearchError;

/// Motion that the models predict.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
pub enum MotionOption {
    /// The better one of a cross-validation, if all runs have a heading
    #[default]
    Auto,
    /// The motion over ground
    OverGround,
    /// The motion through the water, with a current for each run
    ThroughWater,
}

/// Currents of the training runs, and what models of the motion through the water gain.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CurrentsFound {
    /// The current of each training run.
    pub runs: Vec<RunCurrent>,
    /// Standard deviation of the components over all runs \[m/s\].
    pub deviation_m_s: f64,
    /// Errors of the models over ground and through the water; empty if the currents promise no gain.
    pub methods: Vec<FrameErrors>,
}

/// The current of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunCurrent {
    /// The run.
    pub run: String,
    /// Component north \[m/s\].
    pub north_m_s: f64,
    /// Component east \[m/s\].
    pub east_m_s: f64,
    /// Standard deviations of the components \[m/s\].
    pub deviations_m_s: [f64; 2],
}

/// Mean NRMSE over horizons and outputs of the cross-validation, by frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FrameErrors {
    /// The method.
    pub method: String,
    /// Of the model of the motion over ground.
    pub over_ground: f64,
    /// Of the model of the motion through the water.
    pub through_water: f64,
    /// Whether the model of the motion through the water was taken.
    pub taken: bool,
}

/// Indices of surge, sway and yaw rate.
fn motion(run: &Trajectory) -> Result<[usize; 3], IdentifyError> {
    let of = |name: &'static str| {
        let place = run.outputs.channels().iter().position(|channel| channel.name == name);
        place.ok_or(IdentifyError::NoMotion { name })
    };
    let [u, v, r] = MOTION;
    Ok([of(u)?, of(v)?, of(r)?])
}

/// Indices of surge, sway and yaw rate, if the runs have what an estimate of their currents needs.
fn needs(job: &Job) -> Result<[usize; 3], IdentifyError> {
    let motion = motion(&job.split.train[0])?;
    match job.split.train.iter().chain(&job.split.test).find(|run| run.heading.is_none()) {
        Some(run) => Err(IdentifyError::NoHeading { run: run.name.clone() }),
        None => Ok(motion),
    }
}

/// Estimates the currents of the training runs: `None` if they cannot or need not be estimated.
pub(super) fn estimate(
    job: &Job,
    parts: &Parts<'_>,
    warnings: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<Option<Currents>, IdentifyError> {
    let demanded = job.motion == MotionOption::ThroughWater;
    let unused = job.motion == MotionOption::OverGround || parts.folds.is_none();
    if unused && !demanded {
        return Ok(None);
    }
    let motion = match needs(job) {
        Ok(motion) => motion,
        Err(error) if demanded => return Err(error),
        Err(error) => {
            if matches!(error, IdentifyError::NoHeading { .. }) {
                let message =
                    "the logs have no heading: a current, if there is one, is not told from the vessel";
                let remedy = format!("name the heading, as in {}", key("heading").is("psi [deg]"));
                warnings.push(Note::info(message).with_remedy(remedy));
            }
            return Ok(None);
        }
    };
    let found = currents::estimate(&parts.train, motion, job.horizon, progress);
    match found.map_err(SearchError::Cancelled)? {
        None if demanded => Err(IdentifyError::NoCurrents),
        found => Ok(found),
    }
}

/// Whether models of the motion through the water are worth a try: known currents must reduce the error of a regression
/// by [`MIN_IMPROVEMENT`].
pub(super) fn is_promising(job: &Job, found: &Currents) -> bool {
    let [over_ground, through_water] = found.errors;
    job.motion == MotionOption::ThroughWater || through_water < (1.0 - MIN_IMPROVEMENT) * over_ground
}

/// Trains the methods on the velocities through the water. The models of the folds were fitted without them, under these
/// currents.
pub(super) fn train<'a>(
    data_of: impl Fn(Method) -> (&'a Job, &'a Parts<'a>),
    methods: &[Method],
    found: &Currents,
    warnings: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<Vec<Trained>, IdentifyError> {
    let mut all: Vec<Trained> = Vec::new();
    for (i, &method) in methods.iter().enumerate() {
        let from = i as f64 / methods.len() as f64;
        let mut tell = |f: f64| progress(from + f / methods.len() as f64);
        match train_method(method, data_of(method), &all, found, warnings, &mut tell) {
            Ok(next) => all.push(next),
            Err(error) if error.is_method_specific() => {
                let message =
                    format!("no model of the motion through the water by the method {}", method.name());
                warnings.push(Note::warning(format!("{message}: {}", error.without_method())));
            }
            Err(error) => return Err(error),
        }
    }
    Ok(all)
}

/// The job with the velocities of its training runs through the water, under these currents.
pub(super) fn in_water(job: &Job, found: &Currents) -> Result<Job, IdentifyError> {
    let motion = motion(&job.split.train[0])?;
    let in_water = |(run, &current)| currents::through_water(run, motion, current);
    let train = job.split.train.iter().zip(&found.of).map(in_water).collect();
    let test = job.split.test.clone();
    Ok(job.with_split(Split { train, test, validation: Vec::new(), notes: Vec::new() }))
}

fn train_method(
    method: Method,
    (job, parts): (&Job, &Parts<'_>),
    before: &[Trained],
    found: &Currents,
    warnings: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<Trained, IdentifyError> {
    let motion = motion(parts.train[0])?;
    let job = in_water(job, found)?;
    let folds = CrossValidation::new(&job.split.train);
    let of_folds = folds.runs(&job.split.train);
    let parts = Parts {
        train: job.split.train.iter().collect(),
        validation: of_folds.iter().map(|(_, run)| *run).collect(),
        folds: Some(&folds),
        ..parts.clone()
    };
    let mut tell = |fraction: f64, _: Option<&_>| progress(fraction);
    let mut trained = train_by(method, &job, &parts, before, (0.0, 0), warnings, &mut tell)?;
    let current = estimate_of(&job, &parts, &trained, motion, found)?;
    for model in std::iter::once(&mut trained.model).chain(&mut trained.left_out) {
        model.description.current = Some(current.clone());
        model.description.reading.selection.heading.clone_from(&job.reading.selection.heading);
    }
    Ok(trained)
}

/// Options of the sessions of a model: errors over a window on left-out runs, under their currents.
fn estimate_of(
    job: &Job,
    parts: &Parts<'_>,
    trained: &Trained,
    motion: [usize; 3],
    found: &Currents,
) -> Result<CurrentEstimate, IdentifyError> {
    let folds = parts.folds.ok_or(IdentifyError::NoCurrents)?;
    let window = CurrentEstimate::window(job.horizon);
    let sessions = folds.runs(&job.split.train).into_iter().map(|(fold, _)| trained.left_out[fold].session());
    let mut sessions: Vec<_> = sessions.collect();
    let options = evaluate::Options {
        horizon: window,
        origin_stride: job.origin_stride,
        ..evaluate::Options::default()
    };
    let errors = evaluate_each(
        "through water",
        &mut sessions,
        &parts.ranges,
        &parts.validation,
        &options,
        &mut crate::progress::silent(),
    );
    let errors = match errors {
        Ok(errors) => errors,
        Err(EvaluateError::Cancelled(cancelled)) => return Err(SearchError::Cancelled(cancelled).into()),
        Err(error) => return Err(IdentifyError::Evaluate { part: "left-out", error }),
    };
    let deviations = motion.map(|c| errors.rmse[window - 1][c]);
    let initial_m_s = found.deviation();
    let sound = deviations.iter().chain([&initial_m_s]).all(|x| x.is_finite() && *x > 0.0);
    if !sound {
        return Err(IdentifyError::NoCurrents);
    }
    Ok(CurrentEstimate::new(motion, window, deviations, initial_m_s))
}

pub(super) fn describe(runs: &[Trajectory], found: &Currents) -> CurrentsFound {
    let of = |((run, current), covariance): ((&Trajectory, &[f64; 2]), &[f64; 3])| RunCurrent {
        run: run.name.clone(),
        north_m_s: current[0],
        east_m_s: current[1],
        deviations_m_s: [covariance[0].sqrt(), covariance[2].sqrt()],
    };
    CurrentsFound {
        runs: runs.iter().zip(&found.of).zip(&found.covariance).map(of).collect(),
        deviation_m_s: found.deviation(),
        methods: Vec::new(),
    }
}

/// Keeps the better frame of each method: over ground, unless the motion through the water reduces the error by more than
/// one standard error (one-standard-error rule: Breiman et al., *Classification and Regression Trees*, 1984, section
/// 3.4.3).
pub(super) fn choose(candidates: Vec<Candidate>, found: &mut CurrentsFound) -> Vec<Candidate> {
    let (water, mut ground): (Vec<Candidate>, Vec<Candidate>) =
        candidates.into_iter().partition(|candidate| candidate.model.description.current.is_some());
    for water in water {
        let name = &water.model.description.name;
        let Some(place) = ground.iter().position(|other| other.model.description.name == *name) else {
            ground.push(water);
            continue;
        };
        let [over_ground, through_water] =
            [&ground[place], &water].map(|candidate| candidate.validation.score());
        let diverges = |candidate: &Candidate| candidate.validation.diverged > 0;
        let [over, through] = [&ground[place], &water].map(losses);
        let taken = !diverges(&water) && (diverges(&ground[place]) || through.is_significantly_better(&over));
        found.methods.push(FrameErrors { method: name.clone(), over_ground, through_water, taken });
        if taken {
            ground[place] = water;
        }
    }
    ground
}

/// What was found, for the user; nothing if the currents promise no gain.
pub(super) fn note(found: &CurrentsFound, best: Option<&Candidate>) -> Option<Note> {
    let currents = found.runs.iter().map(|run| {
        let RunCurrent { run, north_m_s, east_m_s, deviations_m_s: [north, east] } = run;
        // Of a normal distribution, 90 % are within 1.645 standard deviations.
        let [north, east] = [north, east].map(|deviation| 1.645 * deviation);
        format!("{run} {north_m_s:.2} +- {north:.2} north, {east_m_s:.2} +- {east:.2} east")
    });
    let currents = currents.collect::<Vec<_>>().join("; ");
    let name = best.map(|best| best.model.description.name.as_str());
    let errors = found.methods.iter().find(|frame| Some(frame.method.as_str()) == name);
    let taken = best.is_some_and(|best| best.model.description.current.is_some());
    if errors.is_none() && !taken {
        return None;
    }
    let gain = errors.map_or_else(String::new, |FrameErrors { method, over_ground, through_water, taken }| {
        let is = if *taken { "predicts the motion through the water" } else { "stays over ground" };
        format!("the model {method} {is}: its cross-validated error is {through_water:.3} through the water and {over_ground:.3} over ground. ")
    });
    Some(Note::info(format!("{gain}Currents of the runs [m/s, intervals of 90 %]: {currents}")))
}
