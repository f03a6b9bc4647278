//! `hydroid identify`.

use std::path::{Path, PathBuf};

use anyhow::bail;
use hydroid::excitation::Excitation;
use hydroid::identify::{self, Identified, Job, Members, Networks, Refine, SindySettings};
use hydroid::log::{InputDelay, Note, Split, split_named};
use hydroid::model::{self, Reading};
use hydroid::simulate::Options;
use hydroid::{atomic, log};
use hydroid_core::vessel::VesselParams;
use hydroid_report::Context;
use serde_json::json;

use super::leftovers::{kept, model_file, resumable, stale};
use super::{Outcome, simulate, table};
use crate::args::{Global, Identify, LogArgs};
use crate::config::{self, Config};
use crate::{logs, ui};

/// Default of the longest horizon \[samples\].
const HORIZON: usize = 100;

/// Durations of the made-up logs \[s\]: an hour to train on, ten minutes each to validate and test on.
const DEMO_S: [(&str, f64); 3] = [("train", 3_600.0), ("validate", 600.0), ("test", 600.0)];

pub fn run(args: &Identify, global: Global) -> anyhow::Result<Outcome> {
    let existed = args.output.exists();
    // A folder that cannot be written is better known before the work than after.
    atomic::probe(&args.output)?;
    identify_into(args, global).inspect_err(|_| {
        if !existed {
            // Only an empty folder goes; what is in it, if anything, is whole.
            let _ = std::fs::remove_dir(&args.output);
        }
    })
}

fn identify_into(args: &Identify, global: Global) -> anyhow::Result<Outcome> {
    let config = match &args.config {
        Some(file) => config::read(file)?,
        None if Path::new(config::DEFAULT).exists() => {
            ui::tell(&[Note::info(format!("settings from {} in this folder", config::DEFAULT))], global);
            config::read(Path::new(config::DEFAULT))?
        }
        None => Config::default(),
    };
    let seed = args.seed.or(config.identify.seed).unwrap_or(0);
    let Config { log, split, identify, mut sindy, network, lstm, gru, rnn, direct, affine, mut ranges } =
        config;
    let budget = args.budget.or(identify.budget).map(|budget| budget.0);
    let checkpoints = Some(args.output.clone());
    let mut networks = Networks {
        all: network,
        lstm,
        gru,
        rnn,
        direct,
        affine,
        budget_s: budget,
        checkpoints,
        resume: args.resume,
    };
    said_of_networks(args, &mut networks);
    for said in &args.ranges {
        if args.ranges.iter().filter(|other| other.name == said.name).count() > 1 {
            bail!("--range gives '{}' twice: say which of the two it is", said.name);
        }
        ranges.insert(said.name.clone(), said.range.clone());
    }
    let pick = |said: &[PathBuf], configured: Vec<PathBuf>| {
        if said.is_empty() { configured } else { said.to_vec() }
    };
    let mut files = Files {
        note: None,
        train: pick(&args.logs, split.train),
        validate: pick(&args.validate, split.validate),
        test: pick(&args.test, split.test),
    };
    if files.train.is_empty() {
        if !(files.validate.is_empty() && files.test.is_empty()) {
            bail!("there are logs to validate or test on, but none to train on: name them first");
        }
        if args.log != LogArgs::default() {
            bail!("there are options for reading a log, but no log: name the logs first");
        }
        files = demonstration(&args.output, seed, global)?;
    }
    let reading = logs::reading(logs::configured(log), &args.log)?;
    let (split, reading, notes) = files.split(&reading)?;
    ui::tell(&notes, global);
    said(args, &mut sindy);
    let dt = split.train.first().map_or(1.0, |run| run.dt);
    let horizon = args.horizon.or(identify.horizon).map_or(HORIZON, |horizon| horizon.samples(dt));
    let job = Job {
        methods: args.methods.iter().map(|&method| method.into()).collect(),
        split,
        reading,
        horizon,
        origin_stride: args.origin_stride.or(identify.origin_stride).unwrap_or(1),
        seed,
        ranges,
        sindy,
        networks,
    };
    let bar = ui::Bar::new("identifying", global);
    let identified = identify::identify_watched(&job, &mut bar.stages());
    drop(bar);
    let mut identified = identified.map_err(|error| resumable(error.into(), &job))?;
    identified.warnings.extend(stale(&args.output, &job, &identified)?);
    ui::tell(&identified.warnings, global);
    let page = page(&files, &job, &identified, &notes).map_err(|error| resumable(error, &job))?;
    let summary = write(&args.output, &identified, &notes, &page).map_err(|error| resumable(error, &job))?;
    // All that they were for is written.
    for file in kept(&job) {
        let _ = std::fs::remove_file(file);
    }
    if global.json {
        super::print_json(&summary)?;
    } else {
        show(&args.output, &identified);
    }
    Ok(if identified.sound() { Outcome::Done } else { Outcome::Missed })
}

/// What the command line says about networks goes before the file, for all of them.
fn said_of_networks(args: &Identify, networks: &mut Networks) {
    let (epochs, restarts) =
        (args.epochs.and_then(|n| usize::try_from(n).ok()), args.restarts.map(usize::from));
    let Networks { all, lstm, gru, rnn, direct, affine, .. } = networks;
    for settings in [all, lstm, gru, rnn, direct, affine] {
        settings.epochs = epochs.or(settings.epochs);
        settings.restarts = restarts.or(settings.restarts);
    }
}

/// What the command line says about the equations goes before the file.
fn said(args: &Identify, sindy: &mut SindySettings) {
    // A library by name and one by degree are the same setting in two ways.
    if args.library.is_some() {
        sindy.degree = None;
        sindy.signed_squares = None;
    } else if args.degree.is_some() {
        sindy.library = None;
    }
    sindy.library = args.library.clone().or(sindy.library.take());
    sindy.degree = args.degree.or(sindy.degree);
    for (said, setting) in [(&args.terms, &mut sindy.terms), (&args.constraints, &mut sindy.constraints)] {
        if !said.is_empty() {
            setting.clone_from(said);
        }
    }
    sindy.dissipative = args.dissipative.then_some(true).or(sindy.dissipative);
    sindy.for_control |= args.for_control;
    sindy.lag = args.lag.clone().unwrap_or_else(|| std::mem::take(&mut sindy.lag));
    sindy.gate = args.gate.clone().unwrap_or_else(|| std::mem::take(&mut sindy.gate));
    sindy.huber = args.huber.or(sindy.huber);
    if args.refine || args.no_refine {
        sindy.refine = Refine::Asked(args.refine);
    }
    sindy.members = args.members.map_or(sindy.members, |n| Members(n.into()));
    sindy.threshold = args.threshold.or(sindy.threshold);
    sindy.window_s = args.window.or(sindy.window_s);
    sindy.ridge = args.ridge.or(sindy.ridge);
}

/// Log files by their use.
struct Files {
    /// What the user should know of them.
    note: Option<Note>,
    train: Vec<PathBuf>,
    validate: Vec<PathBuf>,
    test: Vec<PathBuf>,
}

impl Files {
    /// Reads all files together, so that they share channels and step, and sorts the runs by use.
    fn split(&self, reading: &Reading) -> anyhow::Result<(Split, Reading, Vec<Note>)> {
        let all: Vec<PathBuf> = self.train.iter().chain(&self.validate).chain(&self.test).cloned().collect();
        let (raw, prepared) = logs::prepare(&all, reading)?;
        let mut steps = Vec::new();
        let mut notes: Vec<Note> = self.note.clone().into_iter().chain(prepared.notes).collect();
        for log in &raw {
            let inspection = log::inspect(log, &reading.selection, &reading.options)?;
            steps.extend(inspection.clock.map(|clock| clock.step_s));
            for note in inspection.notes {
                // What the preparation told already, perhaps with another step in brackets, is not said twice.
                let start = |note: &Note| note.message.split(" (").next().unwrap_or_default().to_owned();
                let said = notes.iter().any(|other| start(other) == start(&note));
                if note.is_warning() && !said {
                    notes.push(note);
                }
            }
        }
        let mut reading = Reading { selection: prepared.selection, ..reading.clone() };
        reading.options.input_delay = in_seconds(reading.options.input_delay, &steps)?;
        let [mut train, mut validate, mut test] = [(); 3].map(|()| Vec::new());
        for (run, source) in prepared.runs.into_iter().zip(prepared.sources) {
            if source < self.train.len() {
                train.push(run);
            } else if source < self.train.len() + self.validate.len() {
                validate.push(run);
            } else {
                test.push(run);
            }
        }
        Ok((split_named(train, validate, test)?, reading, notes))
    }
}

/// A delay in samples is one of these logs: a model keeps it in seconds, for logs of any rate.
fn in_seconds(delay: InputDelay, steps: &[f64]) -> anyhow::Result<InputDelay> {
    let (InputDelay::Samples(n), Some(&step)) = (delay, steps.first()) else { return Ok(delay) };
    if n == 0 {
        return Ok(delay);
    }
    if steps.iter().any(|other| (other / step - 1.0).abs() > 0.01) {
        bail!(
            "the logs have different steps, so that --input-delay {n} means different times: write it in seconds, as in --input-delay 0.3s"
        );
    }
    Ok(InputDelay::Seconds(n as f64 * step))
}

/// Without a log: three runs of the built-in hydrofoil.
fn demonstration(folder: &Path, seed: u64, global: Global) -> anyhow::Result<Files> {
    let mut files = Vec::new();
    for (index, (name, duration_s)) in DEMO_S.into_iter().enumerate() {
        let options = Options {
            duration_s,
            seed: seed.wrapping_mul(DEMO_S.len() as u64).wrapping_add(index as u64),
            ..Options::new(VesselParams::hydrofoil(), Excitation::Mixed)
        };
        let record = simulate::record(&options, global)?;
        let path = folder.join(format!("hydrofoil-{name}.csv"));
        atomic::write(&path, |out| record.write_csv(out))?;
        files.push(path);
    }
    let note = Note::info(format!(
        "no log was given: simulated the built-in hydrofoil (1 h to train on, 10 min each to validate and test on, seed {seed}); the logs are in {}",
        folder.display()
    ));
    let [train, validate, test] = files.try_into().unwrap_or_default();
    Ok(Files { note: Some(note), train: vec![train], validate: vec![validate], test: vec![test] })
}

/// The page, as text.
fn page(files: &Files, job: &Job, identified: &Identified, notes: &[Note]) -> anyhow::Result<String> {
    let all = files.train.iter().chain(&files.validate).chain(&files.test);
    let sources: Vec<String> = all.map(|file| file.display().to_string()).collect();
    let context = Context {
        title: if files.note.is_some() {
            String::from("Identification: the built-in hydrofoil, simulated")
        } else {
            title(&sources)
        },
        command: ui::command_line(),
        sources,
        notes: notes.to_vec(),
        seed: job.seed,
        ..Context::default()
    };
    Ok(hydroid_report::identification(identified, &job.split, &context)?)
}

/// A heading from the folder of the logs: the vessel's name more often than not.
fn title(sources: &[String]) -> String {
    let folder = sources.first().and_then(|source| Path::new(source).parent()?.file_name()?.to_str());
    folder.map_or_else(|| String::from("Identification"), |name| format!("Identification: {name}"))
}

/// Writes model, page and summary; gives the summary.
fn write(
    folder: &Path,
    identified: &Identified,
    notes: &[Note],
    page: &str,
) -> anyhow::Result<serde_json::Value> {
    let mut models = Vec::new();
    for candidate in &identified.candidates {
        let file = model_file(folder, &candidate.model.description.name);
        model::write(&candidate.model, &file)?;
        models.push(json!({
            "kind": candidate.model.kind(),
            "name": candidate.model.description.name,
            "file": file,
            "weights": candidate.model.weights(),
            "refinement": candidate.found().map(|found| &found.refinement),
            "train_seconds": candidate.train_seconds,
            "training": candidate.training.network().map(|trained| json!({
                "epochs": trained.history.len(),
                "best_epoch": trained.best_epoch,
                "restart": trained.restart,
                "restarts": trained.restarts,
                "ending": trained.ending,
                "refit": trained.refit.as_ref().map(|refit| refit.outcome),
                "history": trained.history,
            })),
            "validation": candidate.validation,
            "test": candidate.test,
        }));
    }
    let summary = json!({
        "models": models,
        "best": identified.best.map(|i| identified.candidates[i].model.description.name.clone()),
        "verdicts": identified.verdicts,
        "ranges": identified.ranges,
        "warnings": notes.iter().chain(&identified.warnings).collect::<Vec<_>>(),
    });
    atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
    let text = serde_json::to_string_pretty(&summary)?;
    atomic::write(&folder.join("identify.json"), |out| writeln!(out, "{text}"))?;
    Ok(summary)
}

/// Which design ranges were stated and which were taken from the training runs, where they decide something.
fn show_ranges(identified: &Identified) {
    let networks = identified.candidates.iter().any(|candidate| candidate.model.is_network());
    if !networks && identified.ranges.iter().all(|range| !range.given) {
        return;
    }
    outln!("\ndesign ranges:");
    for channel in &identified.ranges {
        outln!(
            "  {:<12} {:>10.4} to {:<10.4} {:<6} {}",
            channel.channel.name,
            channel.range.low,
            channel.range.high,
            channel.channel.unit,
            if channel.given { "as given" } else { "of the training runs" }
        );
    }
}

fn show(folder: &Path, identified: &Identified) {
    for candidate in &identified.candidates {
        let model = &candidate.model;
        outln!(
            "{}: {} {}, {} in {:.2} s",
            model.description.name,
            model.weights(),
            if model.is_network() { "weights" } else { "coefficients" },
            candidate.training.effort(),
            candidate.train_seconds
        );
        let refinement = candidate.found().map(|found| &found.refinement);
        if let Some(text) = refinement.and_then(|refinement| refinement.describe(model.description.dt)) {
            outln!("  coefficients {text}");
        }
        // Where a model that learns starts from is for `inspect`: it has all terms, and they do not stay.
        if model.learning.is_some() {
            outln!("  equations that keep learning on the way; what follows was predicted while learning");
        } else {
            let equations = model.equations().map(|motion| motion.equations_text()).unwrap_or_default();
            for line in equations.into_iter().chain(model.network_text()) {
                outln!("  {line}");
            }
        }
        outln!("\non the test runs:");
        ui::write_out(format_args!("{}", table::errors(&candidate.test)));
    }
    show_ranges(identified);
    let best = identified.best.map(|best| identified.candidates[best].model.description.name.as_str());
    match best {
        Some(name) => outln!("\nbest on the validation runs: {name}; on the test runs it is"),
        None => outln!("\nno model is called best; the first of them is"),
    }
    table::show_verdicts(&identified.verdicts);
    outln!("\nwritten to {}: models, report.html, identify.json", folder.display());
}
