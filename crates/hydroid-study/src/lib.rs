//! A study: simulated records, models, experiments, figures, verdicts on claims, and a page.
//!
//! [`Plan`] is the study as data, [`Store`] caches results, and [`run`] computes them. A killed study continues where
//! it stopped and gives the same page: a result depends on its options, records and models only, and files are written
//! atomically. Only computing times differ between machines.

#![allow(missing_docs, clippy::missing_errors_doc, reason = "its users are the programs of hydroid")]

mod claim;
mod claims;
mod error;
mod error_k;
mod experiment;
mod outcome;
mod page;
mod palette;
#[doc(hidden)]
pub mod peak_memory;
mod plan;
pub mod recipe;
mod runner;
mod store;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use hydroid::atomic;
use outcome::{Outcome, Picture, Sheet};

pub use claim::{Bound, Claim, Measure, Reasons};
pub use claims::{Holds, Judged, Measured};
pub use error::StudyError;
pub use experiment::Kind;
pub use plan::{Drive, Experiment, ModelPlan, Plan, Record};
pub use runner::{Learned, LoadedRecord, Runner};
pub use store::{Store, program};

/// Progress of a study.
#[derive(Clone, Copy, Debug)]
pub struct Status<'a> {
    pub experiment: &'a str,
    pub what: &'a str,
    /// Completed fraction of the task.
    pub fraction: f64,
    /// Share of the study before this experiment, by usual computing times.
    pub before: f64,
    /// Share of this experiment in the study.
    pub share: f64,
}

/// Progress callback, called from any thread; [`ControlFlow::Break`] stops the study.
pub type Watch<'a> = &'a (dyn Fn(&Status<'_>) -> ControlFlow<()> + Sync);

struct Done<'a> {
    name: &'a String,
    experiment: &'a Experiment,
    outcome: Outcome,
}

/// Summary of a study.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Path of the page.
    pub page: PathBuf,
    /// Whether this is the small version.
    pub quick: bool,
    /// Measured values, by experiment.
    pub measures: BTreeMap<String, BTreeMap<String, f64>>,
    /// Verdicts on the claims.
    pub claims: Vec<Judged>,
    /// Computing time of each experiment in this call \[s\].
    pub seconds: Vec<(String, f64)>,
}

/// Runs the experiments in `only`, or all, and writes `index.html`, `figures/*.svg`, `data/*.csv` and `*.json` into a
/// folder; results are stored in `cache`. `program` is a fingerprint of the program ([`program()`]), `command` the
/// command for one experiment without its name. A partial study writes a page named after its experiments.
///
/// # Errors
/// If a name is unknown, a result cannot be computed or written, or the study is cancelled.
pub fn run(
    plan: &Plan,
    only: &[String],
    folder: &Path,
    program: u64,
    command: &str,
    watch: Watch<'_>,
) -> Result<Summary, StudyError> {
    atomic::probe(folder)?;
    for name in only {
        if !plan.experiments.iter().any(|(known, _)| known == name) {
            let known: Vec<String> = plan.experiments.iter().map(|(name, _)| name.clone()).collect();
            let nearest = hydroid::toml_file::nearest(name, known.iter().map(String::as_str));
            let (whose, what) = (String::from("the command"), "experiment");
            return Err(StudyError::Unknown { whose, what, name: name.clone(), nearest, known });
        }
    }
    let store = Store::new(folder.join("cache"), program);
    let mut runner = Runner::new(plan, &store, watch);
    let chosen: Vec<&(String, Experiment)> =
        plan.experiments.iter().filter(|(name, _)| only.is_empty() || only.contains(name)).collect();
    let all: f64 = chosen.iter().map(|(name, _)| plan::usual_time(name)).sum::<f64>().max(f64::MIN_POSITIVE);
    let mut before = 0.0;
    let (mut done, mut seconds) = (Vec::new(), Vec::new());
    for (name, experiment) in &chosen {
        let share = plan::usual_time(name) / all;
        runner.place = (before, share);
        before += share;
        runner.at.clone_from(name);
        let clock = Instant::now();
        let outcome = experiment.run.run(&runner).map_err(|error| match error {
            StudyError::Cancelled(_) | StudyError::Cannot { .. } => error,
            error => StudyError::In { name: name.clone(), error: Box::new(error) },
        })?;
        seconds.push((name.clone(), clock.elapsed().as_secs_f64()));
        done.push(Done { name, experiment, outcome });
    }
    let outcomes: BTreeMap<&str, &Outcome> =
        done.iter().map(|done| (done.name.as_str(), &done.outcome)).collect();
    let claims = claims::judge(&plan.claims, &outcomes);
    let measures = done.iter().map(|done| (done.name.clone(), done.outcome.measures.clone())).collect();
    for done in &done {
        files(done, folder)?;
    }
    // A partial study does not overwrite the page of the whole study.
    let page = match only {
        [] => {
            json(&folder.join("data/claims.json"), &claims)?;
            folder.join("index.html")
        }
        some => folder.join(format!("{}.html", some.join("+"))),
    };
    let html = page::write(plan, &done, &claims, command)?;
    atomic::write(&page, |out| out.write_all(html.as_bytes()))?;
    Ok(Summary { page, quick: plan.quick, measures, claims, seconds })
}

#[derive(Serialize)]
struct Numbers<'a> {
    experiment: &'a Experiment,
    measures: &'a BTreeMap<String, f64>,
    remarks: &'a [String],
    tables: Vec<&'a Sheet>,
}

fn files(done: &Done<'_>, folder: &Path) -> Result<(), StudyError> {
    for shown in &done.outcome.pictures {
        let svg = match &shown.picture {
            Picture::Chart(chart) => chart.file()?,
            Picture::Drawing(svg) => svg.clone(),
        };
        let path = folder.join("figures").join(format!("{}_{}.svg", done.name, shown.name));
        atomic::write(&path, |out| out.write_all(svg.as_bytes()))?;
    }
    let tables = done.outcome.tables.iter().map(|tabled| &tabled.sheet);
    for sheet in done.outcome.sheets.iter().chain(tables) {
        let path = folder.join("data").join(format!("{}_{}.csv", done.name, sheet.name));
        atomic::write(&path, |out| out.write_all(sheet.csv().as_bytes()))?;
    }
    let sheets: Vec<&Sheet> =
        done.outcome.sheets.iter().chain(done.outcome.tables.iter().map(|t| &t.sheet)).collect();
    let numbers = Numbers {
        experiment: done.experiment,
        measures: &done.outcome.measures,
        remarks: &done.outcome.remarks,
        tables: sheets,
    };
    json(&folder.join("data").join(format!("{}.json", done.name)), &numbers)
}

fn json(path: &Path, value: &impl Serialize) -> Result<(), StudyError> {
    let text = serde_json::to_string_pretty(value).map_err(|error| StudyError::Result(error.to_string()))?;
    atomic::write(path, |out| writeln!(out, "{text}"))?;
    Ok(())
}
