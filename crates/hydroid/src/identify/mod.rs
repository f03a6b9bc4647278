//! From runs to a judged model: fit on training runs, choose on validation runs, judge on test runs.

mod apart;
mod overview;
mod settings;
mod verdict;
mod wording;

use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::evaluate::{self, DesignRange, EvaluateError, Evaluation, evaluate};
use crate::log::{Note, Split, Trajectory};
use crate::model::{Body, Description, Members as Ensemble, Model, Port, Provenance, Reading};
use crate::progress::Progress;
use crate::sindy::{
    ExpressionError, Found, Judge, Regression, SearchError, UnknownLibrary, discover, search,
};

pub use overview::{ChannelSummary, overview, ranges};
pub use settings::{GateSetting, GivenGate, Lags, Members, SindySettings, Word};
pub use verdict::{Grade, Verdict, verdicts};

/// A way to a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// A search for sparse equations of motion.
    Sindy,
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
    /// Seed of the run. The search for equations draws nothing; it is kept for the methods that do.
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
    /// The search that found its equations.
    pub fn found(&self) -> &Found {
        match &self.training {
            Training::Sindy(found) => found,
        }
    }
}

/// How a model came about, by method.
#[derive(Clone, Debug)]
pub enum Training {
    /// A search for sparse equations.
    Sindy(Box<Found>),
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

/// Why nothing was identified.
#[derive(Debug, thiserror::Error)]
pub enum IdentifyError {
    /// A library that there is not.
    #[error(transparent)]
    Library(UnknownLibrary),
    /// A text that is no term or constraint.
    #[error("{key}: {error}")]
    Expression {
        /// The setting.
        key: &'static str,
        /// What is wrong, and where.
        error: ExpressionError,
    },
    /// A term or constraint that cannot be used.
    #[error("'{text}' cannot be used: {why}")]
    Constraint {
        /// As given.
        text: String,
        /// Why, and what would do.
        why: String,
    },
    /// A setting is of a channel that there is not.
    #[error("{key}: there is no {what} '{name}'{hint} There are {known}")]
    NoChannel {
        /// The setting.
        key: &'static str,
        /// Output or input.
        what: &'static str,
        /// As given.
        name: String,
        /// The nearest name.
        hint: String,
        /// The names that there are.
        known: String,
    },
    /// A gate that is given splits nothing.
    #[error(
        "gate {gate}: only {:.1} % of the training samples are {side} it, too few for equations of that mode. Move the gate, give runs that visit both modes, or let it be found (--gate auto)",
        100.0 * share
    )]
    ModeNotVisited {
        /// As given.
        gate: String,
        /// The mode.
        side: &'static str,
        /// Its share of the samples.
        share: f64,
    },
    /// A part of the split has no runs.
    #[error("there are no {0} runs: give more logs, or name some with --{0}")]
    NoRuns(&'static str),
    /// The same samples would be learned from and judged on.
    #[error(
        "'{first}' and '{second}' hold the same measurements, in whole or in part: a model judged on what it was fitted to or chosen on is judged by nobody. Name each log once"
    )]
    SameRun {
        /// One run.
        first: String,
        /// The other.
        second: String,
    },
    /// A setting that makes no sense.
    #[error("the {what} of {value} cannot be used: it must be {needed}")]
    Setting {
        /// Which.
        what: &'static str,
        /// As given.
        value: String,
        /// What would do.
        needed: &'static str,
    },
    /// No equations.
    #[error(transparent)]
    Sindy(#[from] SearchError),
    /// The runs cannot be evaluated.
    #[error("the {part} runs cannot be evaluated: {error}")]
    Evaluate {
        /// Validation or test.
        part: &'static str,
        /// Why.
        error: EvaluateError,
    },
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
    let mut candidates = Vec::new();
    for (i, &method) in methods.iter().enumerate() {
        let mut share = |f: f64| progress((i as f64 + f) / methods.len() as f64);
        candidates.push(candidate(method, job, &parts, &mut share)?);
    }
    let best = (0..candidates.len())
        .filter(|&i| candidates[i].test.diverged == 0 && candidates[i].validation.diverged == 0)
        .min_by(|&a, &b| candidates[a].validation.score().total_cmp(&candidates[b].validation.score()));
    let shown: &Candidate = &candidates[best.unwrap_or(0)];
    let verdicts = verdicts(&shown.test);
    let mut warnings = job.split.notes.clone();
    warnings.extend(verdict::warnings(shown, &verdicts, &overview(&job.split), &job.split.test));
    Ok(Identified { candidates, best, verdicts, warnings })
}

/// Runs by their use, and the ranges of the training runs.
struct Parts<'a> {
    train: Vec<&'a Trajectory>,
    validation: Vec<&'a Trajectory>,
    test: Vec<&'a Trajectory>,
    ranges: Vec<DesignRange>,
}

/// Trains and judges by one method.
fn candidate(
    method: Method,
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<Candidate, IdentifyError> {
    let Parts { validation, test, ranges, .. } = parts;
    let clock = Instant::now();
    // The final evaluations take about a fifth of the time.
    let (training, body, settings) = match method {
        Method::Sindy => equations(job, parts, &mut |f| progress(0.8 * f))?,
    };
    let train_seconds = clock.elapsed().as_secs_f64();
    let mut model = describe(job, parts, body, settings);
    let Training::Sindy(found) = &training;
    if let Some(ensemble) = &found.ensemble {
        model.members = Ensemble::new(&ensemble.members);
    }
    let full = evaluate::Options {
        horizon: job.horizon,
        origin_stride: job.origin_stride,
        ..evaluate::Options::default()
    };
    let mut session = model.session();
    let mut judge = |part, runs: &[&Trajectory], from: f64| {
        let mut report = |f: f64| progress(from + 0.1 * f);
        evaluate(&model.description.name, session.as_mut(), ranges, runs, &full, &mut report).map_err(
            |error| match error {
                EvaluateError::Cancelled(c) => IdentifyError::Sindy(SearchError::Cancelled(c)),
                error => IdentifyError::Evaluate { part, error },
            },
        )
    };
    let validation = judge("validation", validation, 0.8)?;
    let test = judge("test", test, 0.9)?;
    Ok(Candidate { model, training, train_seconds, validation, test })
}

/// A search for equations: how it went, what it found, and its settings for the model file.
fn equations(
    job: &Job,
    parts: &Parts<'_>,
    progress: Progress<'_>,
) -> Result<(Training, Body, serde_json::Value), IdentifyError> {
    let longest = parts.validation.iter().map(|run| run.len()).max().unwrap_or(0);
    let quick = evaluate::Options {
        horizon: job.horizon,
        origin_stride: (longest / SEARCH_ORIGINS).max(job.origin_stride),
        ..evaluate::Options::default()
    };
    let (dt, train) = (parts.train[0].dt, &parts.train);
    // Windows of a fifth of the horizon average the noise and blur no actuator.
    let regression = Regression::Weak { intervals: settings::intervals(0.2 * job.horizon as f64).max(4) };
    let (lags, gate) = (job.sindy.lags(train[0])?, job.sindy.gate(train)?);
    let share = &mut |f: f64| progress(0.3 * f);
    let libraries = job.sindy.libraries(train[0])?;
    let rules = job.sindy.rules(train[0], &libraries)?;
    let structures = discover(train, &settings::reference(&libraries), regression, &lags, &gate, share)
        .map_err(SearchError::Cancelled)?;
    let mut grid = job.sindy.grid(dt, job.horizon, &libraries, &structures);
    grid.constraints = rules;
    let inputs = overview::input_ranges(train);
    let judge = Judge {
        validation: &parts.validation,
        outputs: &parts.ranges,
        inputs: &inputs,
        options: evaluate::Options { warm_up: grid.warm_up(train[0]), ..quick },
        seed: job.seed,
        members: job.sindy.members.0,
    };
    let found = search(train, &judge, &grid, &mut |f| progress(0.3 + 0.7 * f))?;
    let settings = serde_json::json!({
        "chosen": found.trials[found.chosen],
        "asked": job.sindy,
        "horizon": job.horizon,
    });
    let body = Body::Equations(std::sync::Arc::new(found.fit.equations.clone()));
    Ok((Training::Sindy(Box::new(found)), body, settings))
}

fn describe(job: &Job, parts: &Parts<'_>, body: Body, settings: serde_json::Value) -> Model {
    let run = parts.train[0];
    let port =
        |(channel, &range): (&crate::log::Channel, &DesignRange)| Port { channel: channel.clone(), range };
    let input_ranges = overview::input_ranges(&parts.train);
    let names = |runs: &[Trajectory]| runs.iter().map(|run| run.name.clone()).collect();
    let name = match body {
        Body::Equations(_) => "sindy",
    };
    Model {
        description: Description {
            name: name.to_owned(),
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
