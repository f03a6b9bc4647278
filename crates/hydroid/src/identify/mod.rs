//! From runs to a judged model: fit on training runs, choose on validation runs, judge on test runs.

mod apart;
mod equations;
mod error;
mod overview;
mod recursive;
mod settings;
mod twins;
mod verdict;
mod wording;

use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::evaluate::{self, DesignRange, EvaluateError, Evaluation, evaluate};
use crate::log::{Note, Split, Trajectory};
use crate::model::{Body, Description, Members as Ensemble, Model, Port, Provenance, Reading};
use crate::progress::Progress;
use crate::sindy::{Found, SearchError};
use hydroid_core::model::sparse::Equations;

pub use error::IdentifyError;
pub use overview::{ChannelSummary, overview, ranges};
pub use settings::{GateSetting, GivenGate, Lags, Members, SindySettings, Word};
pub use verdict::{Grade, Verdict, verdicts};

/// A way to a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// A search for sparse equations of motion.
    Sindy,
    /// The same with outputs and inputs of some time ago among the variables.
    Lagged,
    /// Equations that keep learning by recursive least squares at several paces: those of another search where
    /// they have a lag or a change of mode, else equations with all terms.
    Recursive,
}

impl Method {
    /// Its name in tables and model files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sindy => "sindy",
            Self::Lagged => "lagged",
            Self::Recursive => "recursive",
        }
    }
}

/// What to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Methods to try, each once; the model with the least validation error is called best.
    pub methods: Vec<Method>,
    /// Runs by their use.
    pub split: Split,
    /// How they were read; goes into the model file.
    pub reading: Reading,
    /// Longest horizon \[samples\].
    pub horizon: usize,
    /// Samples between two origins of the final evaluations.
    pub origin_stride: usize,
    /// Seed of the run: of the stability screen's rollouts and of the ensemble's draws.
    pub seed: u64,
    /// Settings of the search for equations.
    pub sindy: SindySettings,
}

/// A model with what it took and what it can do.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The model.
    pub model: Model,
    /// How it came about.
    pub training: Training,
    /// Time for fitting and choosing \[s\].
    pub train_seconds: f64,
    /// Errors on the validation runs.
    pub validation: Evaluation,
    /// Errors on the test runs.
    pub test: Evaluation,
}

impl Candidate {
    /// Whether its equations may also be of the past.
    pub fn has_past(&self) -> bool {
        self.found().trials.iter().any(|trial| !trial.structure.past.is_empty())
    }

    /// The search that found its equations.
    pub fn found(&self) -> &Found {
        self.training.found()
    }
}

/// How a model came about.
#[derive(Clone, Debug)]
pub enum Training {
    /// A search for sparse equations.
    Equations(Arc<Found>),
    /// Equations with all terms of a library, which learn at several paces.
    Recursive(Arc<Found>),
}

impl Training {
    /// The search.
    pub fn found(&self) -> &Arc<Found> {
        match self {
            Self::Equations(found) | Self::Recursive(found) => found,
        }
    }
}

/// The result of a job.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The models, in the order of the methods asked for.
    pub candidates: Vec<Candidate>,
    /// The best; none where every model diverged somewhere on validation or test runs.
    pub best: Option<usize>,
    /// What each output of the best model (the first, if there is none) is worth on the test runs.
    pub verdicts: Vec<Verdict>,
    /// What the user should know about data and models.
    pub warnings: Vec<Note>,
}

/// Validation windows per run in the search; more change no choice.
const SEARCH_ORIGINS: usize = 200;

/// Runs a job.
///
/// # Errors
/// If the runs cannot be fitted or evaluated, or the work was interrupted.
pub fn identify(job: &Job, progress: Progress<'_>) -> Result<Identified, IdentifyError> {
    job.sindy.check()?;
    for (what, value) in [("horizon", job.horizon), ("origin stride", job.origin_stride)] {
        if value == 0 {
            let needed = "at least 1 sample";
            return Err(IdentifyError::Setting { what, value: value.to_string(), needed });
        }
    }
    let [train, validation, test] = [&job.split.train, &job.split.validation, &job.split.test]
        .map(|runs| runs.iter().collect::<Vec<&Trajectory>>());
    for (runs, part) in [(&train, "train"), (&validation, "validate"), (&test, "test")] {
        if runs.is_empty() {
            return Err(IdentifyError::NoRuns(part));
        }
    }
    apart::check([&train, &validation, &test])?;
    let mut methods = Vec::new();
    for &method in &job.methods {
        if !methods.contains(&method) {
            methods.push(method);
        }
    }
    if methods.is_empty() {
        let (what, value, needed) = ("list of methods", String::from("nothing"), "one method at least");
        return Err(IdentifyError::Setting { what, value, needed });
    }
    let ranges = ranges(&train);
    let parts = Parts { train, validation, test, ranges };
    let mut trained: Vec<Trained> = Vec::new();
    for (i, &method) in methods.iter().enumerate() {
        let share = |f: f64| 0.8 * (i as f64 + f) / methods.len() as f64;
        let next = train_by(method, job, &parts, &trained, &mut |f| progress(share(f)))?;
        trained.push(next);
    }
    let candidates = judged(job, &parts, trained, &mut |f| progress(0.8 + 0.2 * f))?;
    let best = best(&candidates);
    let shown: &Candidate = &candidates[best.unwrap_or(0)];
    let verdicts = verdicts(&shown.test);
    let mut warnings = job.split.notes.clone();
    warnings.extend(verdict::spikes(&parts.train, &job.sindy));
    let data = overview(&job.split);
    warnings.extend(verdict::warnings(shown, &verdicts, &data, &job.split.test));
    warnings.extend(twins::warnings(shown, &data, &job.split.train));
    Ok(Identified { candidates, best, verdicts, warnings })
}

/// A more complex method must lower the validation error by this share at least to be called best.
const WORTH: f64 = 0.02;

/// The model with the least validation error, the simpler of two that differ by less than [`WORTH`]. The test
/// runs have no say in which it is; where its rollouts diverge on them, no model is called best.
fn best(candidates: &[Candidate]) -> Option<usize> {
    let mut order: Vec<usize> =
        (0..candidates.len()).filter(|&i| candidates[i].validation.diverged == 0).collect();
    order.sort_by_key(|&i| {
        let candidate = &candidates[i];
        (matches!(candidate.training, Training::Recursive(_)), candidate.has_past())
    });
    let score = |i: usize| candidates[i].validation.score();
    let best =
        order.into_iter().reduce(|best, i| if score(i) < (1.0 - WORTH) * score(best) { i } else { best });
    best.filter(|&i| candidates[i].test.diverged == 0)
}

/// Runs by their use, and the ranges of the training runs.
struct Parts<'a> {
    train: Vec<&'a Trajectory>,
    validation: Vec<&'a Trajectory>,
    test: Vec<&'a Trajectory>,
    ranges: Vec<DesignRange>,
}

/// A model that waits to be judged.
struct Trained {
    model: Model,
    training: Training,
    train_seconds: f64,
    /// Score of the search on the validation runs.
    score: f64,
}

/// Trains by one method; `before` are the models of the methods before it.
fn train_by(
    method: Method,
    job: &Job,
    parts: &Parts<'_>,
    before: &[Trained],
    progress: Progress<'_>,
) -> Result<Trained, IdentifyError> {
    let clock = Instant::now();
    let done = |model, training, score| Trained {
        model,
        training,
        train_seconds: clock.elapsed().as_secs_f64(),
        score,
    };
    match method {
        Method::Sindy | Method::Lagged => {
            let found = match method {
                Method::Lagged => equations::lagged(job, parts, progress)?,
                _ => equations::memoryless(job, parts, progress)?,
            };
            let settings = serde_json::json!({
                "chosen": found.trials[found.chosen],
                "asked": job.sindy,
                "horizon": job.horizon,
            });
            let body = Body::Equations(Arc::new(found.fit.equations.clone()));
            let mut model = describe(job, parts, method, body, settings);
            if let Some(ensemble) = &found.ensemble {
                model.members = Ensemble::new(&ensemble.members);
            }
            let score = found.trials[found.chosen].validation.unwrap_or(f64::INFINITY);
            Ok(done(model, Training::Equations(found), score))
        }
        Method::Recursive => {
            let describe = |found: &Found, equations: Equations| {
                let settings = serde_json::json!({
                    "chosen": found.trials[found.chosen],
                    "asked": job.sindy,
                    "horizon": job.horizon,
                });
                describe(job, parts, method, Body::Equations(Arc::new(equations)), settings)
            };
            let equations = before.iter().filter(|t| matches!(t.training, Training::Equations(_)));
            let sparse = equations.min_by(|a, b| a.score.total_cmp(&b.score)).map(|t| t.training.found());
            let (found, model) = recursive::learning(job, parts, sparse, describe, progress)?;
            let score = found.trials[found.chosen].validation.unwrap_or(f64::INFINITY);
            Ok(done(model, Training::Recursive(found), score))
        }
    }
}

/// Judges all models on the same windows: the warm-up is that of the model that needs most.
fn judged(
    job: &Job,
    parts: &Parts<'_>,
    trained: Vec<Trained>,
    progress: Progress<'_>,
) -> Result<Vec<Candidate>, IdentifyError> {
    let warm_up = trained.iter().map(|t| t.model.session().warm_up()).max().unwrap_or(1);
    let options = evaluate::Options {
        horizon: job.horizon,
        origin_stride: job.origin_stride,
        warm_up,
        ..evaluate::Options::default()
    };
    let count = trained.len() as f64;
    let mut candidates = Vec::new();
    for Trained { model, training, train_seconds, .. } in trained {
        let start = candidates.len() as f64;
        let mut judge = |part, runs: &[&Trajectory], from: f64| {
            let mut report = |f: f64| progress((start + from + 0.5 * f) / count);
            // A session of its own: one that learns must not have seen the other runs.
            let mut session = model.session();
            let name = &model.description.name;
            evaluate(name, session.as_mut(), &parts.ranges, runs, &options, &mut report).map_err(|error| {
                match error {
                    EvaluateError::Cancelled(c) => IdentifyError::Sindy(SearchError::Cancelled(c)),
                    error => IdentifyError::Evaluate { part, error },
                }
            })
        };
        let validation = judge("validation", &parts.validation, 0.0)?;
        let test = judge("test", &parts.test, 0.5)?;
        candidates.push(Candidate { model, training, train_seconds, validation, test });
    }
    Ok(candidates)
}

fn describe(job: &Job, parts: &Parts<'_>, method: Method, body: Body, settings: serde_json::Value) -> Model {
    let run = parts.train[0];
    let port =
        |(channel, &range): (&crate::log::Channel, &DesignRange)| Port { channel: channel.clone(), range };
    let input_ranges = overview::input_ranges(&parts.train);
    let names = |runs: &[Trajectory]| runs.iter().map(|run| run.name.clone()).collect();
    Model {
        description: Description {
            name: method.name().to_owned(),
            dt: run.dt,
            outputs: run.outputs.channels().iter().zip(&parts.ranges).map(port).collect(),
            inputs: run.inputs.channels().iter().zip(&input_ranges).map(port).collect(),
            reading: reading(job, run.dt),
            provenance: Provenance {
                hydroid: env!("CARGO_PKG_VERSION").to_owned(),
                seed: job.seed,
                training: names(&job.split.train),
                validation: names(&job.split.validation),
                settings,
            },
        },
        body,
        members: Ensemble::default(),
        learning: None,
    }
}

/// The reading of the training logs with their step written out: a model has one step, whatever the log.
fn reading(job: &Job, dt: f64) -> Reading {
    let mut reading = job.reading.clone();
    reading.options.dt = Some(dt);
    reading
}

/// Whether an identification met what it must to be of use; the criterion of the exit status.
impl Identified {
    /// Every output is predicted better than by trivial means, and nothing diverged.
    pub fn sound(&self) -> bool {
        self.best.is_some() && self.verdicts.iter().all(|v| v.grade != Grade::NotIdentified)
    }
}
