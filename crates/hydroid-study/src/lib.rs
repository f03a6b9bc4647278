//! A whole study from a few files: records are simulated, models learned, figures drawn, claims judged, and all of it shown on
//! one page.
//!
//! [`Plan`] is the study as data, [`Store`] keeps what was made, [`run`] makes the rest. A study that was interrupted or killed
//! goes on where it stopped, and comes to the same page: each result depends on its settings, records and models alone, and is
//! written whole or not at all. What differs from machine to machine are times.

mod claims;
mod error;
pub mod error_k;
mod experiment;
mod outcome;
mod page;
mod palette;
mod peak_memory;
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
use runner::Runner;

pub use claims::{Holds, Judged};
pub use error::StudyError;
pub use experiment::Kind;
pub use plan::{Bound, Claim, Drive, Experiment, ModelPlan, Plan, Record};
pub use store::{Key, Store, program};

/// Where a study is.
#[derive(Clone, Copy, Debug)]
pub struct Told<'a> {
    /// The experiment at work.
    pub experiment: &'a str,
    /// What is done for it.
    pub what: &'a str,
    /// Fraction of that which is done.
    pub fraction: f64,
    /// Experiments that are done.
    pub done: usize,
    /// Experiments in all.
    pub of: usize,
}

/// Hears where a study is, from any thread; [`ControlFlow::Break`] asks it to stop.
pub type Watch<'a> = &'a (dyn Fn(&Told<'_>) -> ControlFlow<()> + Sync);

/// An experiment that was made.
struct Done<'a> {
    name: &'a String,
    experiment: &'a Experiment,
    outcome: Outcome,
}

/// What came of a study.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// The page.
    pub page: PathBuf,
    /// Whether it is the small version.
    pub quick: bool,
    /// The figures that were measured, by experiment.
    pub measures: BTreeMap<String, BTreeMap<String, f64>>,
    /// The claims that could be judged.
    pub claims: Vec<Judged>,
    /// Time that each experiment took this time \[s\].
    pub seconds: Vec<(String, f64)>,
}

/// Makes the experiments named in `only`, or all, in a folder: `index.html`, `figures/*.svg`, `data/*.csv` and `*.json`; what
/// can be used again is kept in `cache`. `program` is a fingerprint of what makes the results ([`program()`]), `command`
/// what makes one of them alone, but for its name. Of a part of the study the page has its name, and that of the whole stays.
///
/// # Errors
/// If something is named that is not there, a part cannot be made or written, or the work is stopped.
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
    let (mut done, mut seconds) = (Vec::new(), Vec::new());
    for (i, (name, experiment)) in chosen.iter().enumerate() {
        runner.place = (i, chosen.len());
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
    // Of a part of the study only that part is rewritten: the page of the whole stays.
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

/// All that is told of an experiment in numbers.
#[derive(Serialize)]
struct Numbers<'a> {
    experiment: &'a Experiment,
    measures: &'a BTreeMap<String, f64>,
    remarks: &'a [String],
    tables: Vec<&'a Sheet>,
}

/// The figures and the numbers of an experiment.
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
    let told = Numbers {
        experiment: done.experiment,
        measures: &done.outcome.measures,
        remarks: &done.outcome.remarks,
        tables: sheets,
    };
    json(&folder.join("data").join(format!("{}.json", done.name)), &told)
}

fn json(path: &Path, value: &impl Serialize) -> Result<(), StudyError> {
    let text = serde_json::to_string_pretty(value).map_err(|error| StudyError::Result(error.to_string()))?;
    atomic::write(path, |out| writeln!(out, "{text}"))?;
    Ok(())
}
