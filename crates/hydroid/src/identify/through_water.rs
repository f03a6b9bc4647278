//! Models of the motion through the water beside those of the motion over ground.

use std::ops::ControlFlow;

use super::evaluation::MIN_IMPROVEMENT;
use super::training::{Trained, train_by};
use super::{Candidate, CrossValidation, IdentifyError, Job, Method, Parts};
use crate::committee::currents::{self, Currents};
use crate::evaluate::{self, EvaluateError, evaluate_each};
use crate::log::{Note, Split, Trajectory};
use crate::model::{CurrentEstimate, MOTION};
use crate::progress::Progress;
use crate::sindy::SearchError;

/// Currents of the training runs, and what models of the motion through the water gain.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct CurrentsFound {
    /// The current of each training run.
    pub runs: Vec<RunCurrent>,
    /// Standard deviation of the components over all runs \[m/s\].
    pub deviation_m_s: f64,
    /// Errors of the models over ground and through the water.
    pub methods: Vec<FrameErrors>,
}

/// The current of a run.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
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
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
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

/// Checks before the training that currents can be estimated.
pub(super) fn check(job: &Job) -> Result<(), IdentifyError> {
    motion(&job.split.train[0])?;
    match job.split.train.iter().chain(&job.split.test).find(|run| run.heading.is_none()) {
        Some(run) => Err(IdentifyError::NoHeading { run: run.name.clone() }),
        None => Ok(()),
    }
}

/// Trains the methods on the velocities through the water, under currents that are estimated once from all training runs.
/// The models of the folds were fitted without them, under these currents.
pub(super) fn train(
    job: &Job,
    parts: &Parts<'_>,
    methods: &[Method],
    warnings: &mut Vec<Note>,
    progress: Progress<'_>,
) -> Result<(Vec<Trained>, Option<CurrentsFound>), IdentifyError> {
    let motion = motion(parts.train[0])?;
    let cancelled = |cancelled| IdentifyError::Sindy(SearchError::Cancelled(cancelled));
    let found = currents::estimate(&parts.train, motion, job.horizon, &mut |f| progress(0.2 * f));
    let Some(found) = found.map_err(cancelled)? else {
        let message = "the runs are too short to estimate the current: models are over ground";
        warnings.push(Note::warning(message));
        return Ok((Vec::new(), None));
    };
    let in_water = |(run, &current)| currents::through_water(run, motion, current);
    let runs = job.split.train.iter().zip(&found.of).map(in_water).collect();
    let job = Job { split: Split { train: runs, ..job.split.clone() }, ..job.clone() };
    let folds = CrossValidation::new(&job.split.train);
    let of_folds = folds.runs(&job.split.train);
    let parts = Parts {
        train: job.split.train.iter().collect(),
        validation: of_folds.iter().map(|(_, run)| *run).collect(),
        folds: Some(&folds),
        ..parts.clone()
    };
    let mut all: Vec<Trained> = Vec::new();
    for (i, &method) in methods.iter().enumerate() {
        let from = 0.2 + 0.8 * i as f64 / methods.len() as f64;
        let mut tell = |f: f64, _: Option<&_>| progress(from + 0.8 * f / methods.len() as f64);
        let mut next = match train_by(method, &job, &parts, &all, (0.0, 0), warnings, &mut tell) {
            Ok(next) => next,
            Err(error) if error.is_method_specific() => {
                let message =
                    format!("no model of the motion through the water by the method {}", method.name());
                warnings.push(Note::warning(format!("{message}: {}", error.without_method())));
                continue;
            }
            Err(error) => return Err(error),
        };
        let Some(current) = estimate_of(&job, &parts, &next, motion, &found)? else { continue };
        for model in std::iter::once(&mut next.model).chain(&mut next.left_out) {
            model.description.current = Some(current.clone());
            model.description.reading.selection.heading.clone_from(&job.reading.selection.heading);
        }
        all.push(next);
    }
    if let ControlFlow::Break(()) = progress(1.0) {
        return Err(cancelled(crate::progress::Cancelled));
    }
    Ok((all, Some(describe(&job.split.train, &found))))
}

/// Options of the sessions of a model: errors over a window on left-out runs, under their currents.
fn estimate_of(
    job: &Job,
    parts: &Parts<'_>,
    trained: &Trained,
    motion: [usize; 3],
    found: &Currents,
) -> Result<Option<CurrentEstimate>, IdentifyError> {
    let Some(folds) = parts.folds else { return Ok(None) };
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
    Ok(sound.then(|| CurrentEstimate::new(motion, window, deviations, initial_m_s)))
}

fn describe(runs: &[Trajectory], found: &Currents) -> CurrentsFound {
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

/// Keeps the better frame of each method: the motion through the water must reduce the error by [`MIN_IMPROVEMENT`].
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
        let taken = !diverges(&water)
            && (diverges(&ground[place]) || through_water < (1.0 - MIN_IMPROVEMENT) * over_ground);
        found.methods.push(FrameErrors { method: name.clone(), over_ground, through_water, taken });
        if taken {
            ground[place] = water;
        }
    }
    ground
}

/// What was found, for the user.
pub(super) fn note(found: &CurrentsFound, best: Option<&Candidate>) -> Note {
    let currents = found.runs.iter().map(|run| {
        let RunCurrent { run, north_m_s, east_m_s, deviations_m_s: [north, east] } = run;
        // Of a normal distribution, 90 % are within 1.645 standard deviations.
        let [north, east] = [north, east].map(|deviation| 1.645 * deviation);
        format!("{run} {north_m_s:.2} +- {north:.2} north, {east_m_s:.2} +- {east:.2} east")
    });
    let currents = currents.collect::<Vec<_>>().join("; ");
    let name = best.map(|best| best.model.description.name.as_str());
    let errors = found.methods.iter().find(|frame| Some(frame.method.as_str()) == name);
    let gain = errors.map_or_else(String::new, |FrameErrors { method, over_ground, through_water, taken }| {
        let is = if *taken { "predicts the motion through the water" } else { "stays over ground" };
        format!("the model {method} {is}: its cross-validated error is {through_water:.3} through the water and {over_ground:.3} over ground. ")
    });
    Note::info(format!("{gain}Currents of the runs [m/s, intervals of 90 %]: {currents}"))
}
