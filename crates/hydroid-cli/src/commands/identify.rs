//! `hydroid identify`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use hydroid::atomic::{self, Lock};
use hydroid::craft::CraftFile;
use hydroid::excitation::Excitation;
use hydroid::grey_box::GreyBox;
use hydroid::identify::{
    self, Candidate, EnsembleSize, IdentifyResult, Job, NetworkTrainingOptions, RefineOption, SindyOptions,
    Training,
};
use hydroid::log;
use hydroid::log::{ChannelSpec, InputDelay, Note, Split, Trajectory, split_named};
use hydroid::model::{self, Reading};
use hydroid::simulate::Options;
use hydroid_core::vessel::VesselParams;
use hydroid_report::Context;
use serde_json::json;

use super::previous_output::{checkpoints, model_file, move_stale_models, with_resume_hint};
use super::{Outcome, simulate, table};
use crate::args::{Global, Identify, LogArgs};
use crate::config::{self, Config};
use crate::{logs, ui};

/// Default longest horizon \[samples\].
const HORIZON: usize = 100;

/// Durations of the simulated demonstration logs \[s\].
const DEMONSTRATION_S: [(&str, f64); 3] = [("train", 3_600.0), ("validate", 600.0), ("test", 600.0)];

pub fn run(args: &Identify, global: Global) -> anyhow::Result<Outcome> {
    let existed = args.output.exists();
    // Fails early if the folder cannot be written.
    atomic::probe(&args.output)?;
    let lock = Lock::new(&args.output)?;
    let result = identify_into(args, global);
    drop(lock);
    result.inspect_err(|_| {
        if !existed {
            // Removes the folder only if it is empty.
            let _ = std::fs::remove_dir(&args.output);
        }
    })
}

/// The demonstration, unless a log was forgotten.
fn without_logs(args: &Identify, files: &Files, seed: u64, global: Global) -> anyhow::Result<Files> {
    if !(files.validate.is_empty() && files.test.is_empty()) {
        bail!("training logs are missing: name them before --validate and --test");
    }
    if args.log != LogArgs::default() {
        bail!("options for reading logs are given, but no log: name at least one");
    }
    let default = || Some(PathBuf::from(config::DEFAULT)).filter(|file| file.exists());
    if let Some(file) = args.config.clone().or_else(default) {
        bail!(
            "{} names no training logs, and none are given: add them as [split] train = [\"a.csv\"] or on the command line. The demonstration without a log uses no configuration",
            file.display()
        );
    }
    demonstration(&args.output, seed, global)
}

fn identify_into(args: &Identify, global: Global) -> anyhow::Result<Outcome> {
    let config = match &args.config {
        Some(file) => config::read(file)?,
        None if Path::new(config::DEFAULT).exists() => {
            ui::print_notes(
                &[Note::info(format!("options from {} in the current folder", config::DEFAULT))],
                global,
            );
            config::read(Path::new(config::DEFAULT))?
        }
        None => Config::default(),
    };
    let seed = args.seed.or(config.identify.seed).unwrap_or(0);
    let Config {
        log, split, identify, mut sindy, network, lstm, gru, rnn, direct, affine, mut ranges, ..
    } = config;
    let mut networks = NetworkTrainingOptions {
        all: network,
        lstm,
        gru,
        rnn,
        direct,
        affine,
        budget_s: args.budget.or(identify.budget).map(|budget| budget.0),
        checkpoints: Some(args.output.clone()),
        resume: args.resume,
    };
    apply_network_args(args, &mut networks);
    for given in &args.ranges {
        if args.ranges.iter().filter(|other| other.name == given.name).count() > 1 {
            bail!("--range names '{}' twice: give one range for each channel", given.name);
        }
        ranges.insert(given.name.clone(), given.range.clone());
    }
    let pick = |given: &[PathBuf], configured: Vec<PathBuf>| {
        if given.is_empty() { configured } else { given.to_vec() }
    };
    let mut files = Files {
        note: None,
        train: pick(&args.logs, split.train),
        validate: pick(&args.validate, split.validate),
        test: pick(&args.test, split.test),
    };
    if files.train.is_empty() {
        files = without_logs(args, &files, seed, global)?;
    }
    let vessel = args.vessel.as_deref().map(vessel).transpose()?;
    let mut reading = logs::reading(logs::from_config(log), &args.log)?;
    if let Some(vessel) = &vessel {
        select(vessel, &mut reading);
    }
    let mut methods: Vec<identify::Method> = args.methods.iter().map(|&method| method.into()).collect();
    methods.extend(vessel.as_ref().map(|_| identify::Method::GreyBox));
    let cross_validated =
        files.validate.is_empty() && methods.iter().all(|method| method.is_cross_validated());
    let (split, reading, notes) = files.split(&reading, cross_validated)?;
    ui::print_notes(&notes, global);
    apply_equation_args(args, &mut sindy);
    let dt = split.train.first().map_or(1.0, |run| run.dt);
    let horizon = args.horizon.or(identify.horizon).map_or(HORIZON, |horizon| horizon.samples(dt));
    let job = Job {
        methods,
        origin_stride: args
            .origin_stride
            .or(identify.origin_stride)
            .unwrap_or_else(|| origin_stride(&split, cross_validated)),
        split,
        reading,
        horizon,
        seed,
        ranges,
        motion: args.motion.unwrap_or(identify.motion),
        rate_limits: args.rate_limit.clone().unwrap_or(identify.rate_limit),
        sindy,
        networks,
        vessel,
    };
    let bar = ui::Bar::new("identifying", global);
    let identified = identify::identify_with_stages(&job, &mut bar.stage_callback());
    drop(bar);
    let mut identified = identified.map_err(|error| with_resume_hint(error.into(), &job))?;
    identified.warnings.extend(move_stale_models(&args.output, &job, &identified)?);
    ui::print_notes(&identified.warnings, global);
    let page = page(&files, &job, &identified, &notes).map_err(|error| with_resume_hint(error, &job))?;
    let summary =
        write(&args.output, &identified, &notes, &page).map_err(|error| with_resume_hint(error, &job))?;
    for file in checkpoints(&job) {
        let _ = std::fs::remove_file(file);
    }
    if global.json {
        super::print_json(&summary)?;
    } else {
        show(&args.output, &identified);
    }
    Ok(if identified.is_usable() { Outcome::Done } else { Outcome::Missed })
}

/// A vessel file with any set of actuators.
fn vessel(path: &Path) -> anyhow::Result<CraftFile> {
    let model = model::read(path)?;
    let file = model.craft_file().with_context(|| {
        format!(
            "{} has one propeller and one rudder of the built-in vessels, whose numbers `hydroid adapt` learns: for --vessel, describe its commands and actuators in tables [[command]], [[thruster]] and [[rudder]] (an example is vessels/otter.toml)",
            path.display()
        )
    })?;
    Ok(file.clone())
}

/// The channels of a vessel, where the options name none.
fn select(vessel: &CraftFile, reading: &mut Reading) {
    let selection = &mut reading.selection;
    if selection.outputs.is_empty() {
        selection.outputs = ["u", "v", "r"].map(ChannelSpec::named).to_vec();
    }
    if selection.inputs.is_empty() {
        selection.inputs = vessel.craft.commands.iter().map(|c| ChannelSpec::named(&c.name)).collect();
    }
}

/// Origins of a cross-validation: more of them change the errors in the third digit only.
const CROSS_VALIDATION_ORIGINS: usize = 10_000;

/// Every sample is an origin of the evaluation on test runs; in a cross-validation, the origins are spread over all runs.
fn origin_stride(split: &Split, cross_validated: bool) -> usize {
    let samples: usize = split.train.iter().map(Trajectory::len).sum();
    if cross_validated { (samples / CROSS_VALIDATION_ORIGINS).max(1) } else { 1 }
}

fn apply_network_args(args: &Identify, networks: &mut NetworkTrainingOptions) {
    let (epochs, restarts) =
        (args.epochs.and_then(|n| usize::try_from(n).ok()), args.restarts.map(usize::from));
    let NetworkTrainingOptions { all, lstm, gru, rnn, direct, affine, .. } = networks;
    for settings in [all, lstm, gru, rnn, direct, affine] {
        settings.epochs = epochs.or(settings.epochs);
        settings.restarts = restarts.or(settings.restarts);
    }
}

fn apply_equation_args(args: &Identify, sindy: &mut SindyOptions) {
    if args.library.is_some() {
        sindy.degree = None;
        sindy.signed_squares = None;
    } else if args.degree.is_some() {
        sindy.library = None;
    }
    sindy.library = args.library.clone().or(sindy.library.take());
    sindy.degree = args.degree.or(sindy.degree);
    for (given, setting) in [(&args.terms, &mut sindy.terms), (&args.constraints, &mut sindy.constraints)] {
        if !given.is_empty() {
            setting.clone_from(given);
        }
    }
    sindy.dissipative = args.dissipative.then_some(true).or(sindy.dissipative);
    sindy.for_control |= args.for_control;
    sindy.lag = args.lag.clone().unwrap_or_else(|| std::mem::take(&mut sindy.lag));
    sindy.gate = args.gate.clone().unwrap_or_else(|| std::mem::take(&mut sindy.gate));
    sindy.huber = args.huber.or(sindy.huber);
    if args.refine || args.no_refine {
        sindy.refine = RefineOption::Fixed(args.refine);
    }
    sindy.members = args.members.map_or(sindy.members, |n| EnsembleSize(n.into()));
    sindy.threshold = args.threshold.or(sindy.threshold);
    sindy.window_s = args.window.or(sindy.window_s);
    sindy.ridge = args.ridge.or(sindy.ridge);
}

struct Files {
    /// Origin of simulated files.
    note: Option<Note>,
    train: Vec<PathBuf>,
    validate: Vec<PathBuf>,
    test: Vec<PathBuf>,
}

impl Files {
    /// Reads all files together, with common channels and sample time, and splits the runs. All runs but named test runs
    /// are training runs of a cross-validation.
    fn split(&self, reading: &Reading, cross_validated: bool) -> anyhow::Result<(Split, Reading, Vec<Note>)> {
        let all: Vec<PathBuf> = self.train.iter().chain(&self.validate).chain(&self.test).cloned().collect();
        let (raw, prepared) = logs::prepare(&all, reading)?;
        let mut steps = Vec::new();
        let mut notes: Vec<Note> = self.note.clone().into_iter().chain(prepared.notes).collect();
        for log in &raw {
            let inspection = log::inspect(log, &reading.selection, &reading.options)?;
            steps.extend(inspection.clock.map(|clock| clock.step_s));
            for note in inspection.notes {
                // Skips notes of the preparation; those may differ in the step in brackets.
                let start = |note: &Note| note.message.split(" (").next().unwrap_or_default().to_owned();
                let known = notes.iter().any(|other| start(other) == start(&note));
                if note.is_warning() && !known {
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
        let split = if cross_validated {
            Split { train, validation: Vec::new(), test, notes: Vec::new() }
        } else {
            split_named(train, validate, test)?
        };
        Ok((split, reading, notes))
    }
}

/// Converts an input delay from samples to seconds, so that the model applies to logs of any rate.
fn in_seconds(delay: InputDelay, steps: &[f64]) -> anyhow::Result<InputDelay> {
    let (InputDelay::Samples(n), Some(&step)) = (delay, steps.first()) else { return Ok(delay) };
    if n == 0 {
        return Ok(delay);
    }
    if steps.iter().any(|other| (other / step - 1.0).abs() > 0.01) {
        bail!(
            "the logs have different sample times, so that --input-delay {n} is ambiguous: write it in seconds, as in --input-delay 0.3s"
        );
    }
    Ok(InputDelay::Seconds(n as f64 * step))
}

fn demonstration(folder: &Path, seed: u64, global: Global) -> anyhow::Result<Files> {
    let mut files = Vec::new();
    for (index, (name, duration_s)) in DEMONSTRATION_S.into_iter().enumerate() {
        let options = Options {
            duration_s,
            seed: seed.wrapping_mul(DEMONSTRATION_S.len() as u64).wrapping_add(index as u64),
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

fn page(files: &Files, job: &Job, identified: &IdentifyResult, notes: &[Note]) -> anyhow::Result<String> {
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

/// Title of the report: the folder of the logs, often the name of the vessel.
fn title(sources: &[String]) -> String {
    let folder = sources.first().and_then(|source| Path::new(source).parent()?.file_name()?.to_str());
    folder.map_or_else(|| String::from("Identification"), |name| format!("Identification: {name}"))
}

fn write(
    folder: &Path,
    identified: &IdentifyResult,
    notes: &[Note],
    page: &str,
) -> anyhow::Result<serde_json::Value> {
    let mut models = Vec::new();
    for candidate in &identified.candidates {
        let name = &candidate.model.description.name;
        let file = match candidate.model.craft() {
            Some(_) => folder.join(format!("{name}.toml")),
            None => model_file(folder, name),
        };
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
        "cross_validated": identified.cross_validation.is_some(),
        "best": identified.best.map(|i| identified.candidates[i].model.description.name.clone()),
        "verdicts": identified.verdicts,
        "ranges": identified.ranges,
        "currents": identified.currents,
        "warnings": notes.iter().chain(&identified.warnings).collect::<Vec<_>>(),
    });
    atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
    let text = serde_json::to_string_pretty(&summary)?;
    atomic::write(&folder.join("identify.json"), |out| writeln!(out, "{text}"))?;
    Ok(summary)
}

fn show_ranges(identified: &IdentifyResult) {
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
            if channel.given { "given" } else { "range of the training runs" }
        );
    }
}

/// The runs on which a model is judged.
fn judged_on(candidate: &Candidate) -> &'static str {
    if candidate.test.is_some() {
        "the test runs"
    } else {
        "runs that were left out (cross-validation; the model is fitted to all of them)"
    }
}

fn show_estimates(found: &GreyBox) {
    outln!("  {:<28} {:>12} {:>12} {:>11}", "number", "given", "estimate", "+- 1 sigma");
    for estimated in &found.estimates {
        outln!(
            "  {:<28} {:>12.5} {:>12.5} {:>11.2e} {}{}",
            estimated.parameter.path,
            estimated.given,
            estimated.value,
            estimated.deviation,
            estimated.parameter.unit,
            if estimated.informed { "" } else { "  (not determined by the logs)" }
        );
    }
}

fn show(folder: &Path, identified: &IdentifyResult) {
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
        // `inspect` prints the initial equations, which contain all terms of the library.
        if model.learning.is_some() {
            outln!("  equations that adapt online; the errors below include this adaptation");
        } else {
            if let Training::GreyBox(found) = &candidate.training {
                show_estimates(found);
            }
            let equations = model.equations().map(|motion| motion.equations_text()).unwrap_or_default();
            for line in equations.into_iter().chain(model.network_text()) {
                outln!("  {line}");
            }
        }
        outln!("\non {}:", judged_on(candidate));
        ui::write_out(format_args!("{}", table::errors(candidate.judged())));
    }
    show_ranges(identified);
    let shown = identified.best.unwrap_or(0);
    let on = judged_on(&identified.candidates[shown]);
    let best = identified.best.map(|best| identified.candidates[best].model.description.name.as_str());
    match (best, &identified.cross_validation) {
        (Some(name), None) => outln!("\nbest model on the validation runs: {name}; its grades on {on}:"),
        (Some(name), Some(_)) => outln!("\nbest model in the cross-validation: {name}; its grades on {on}:"),
        (None, _) => outln!("\nno best model; grades of the first model on {on}:"),
    }
    table::show_verdicts(&identified.verdicts);
    outln!("\nwritten to {}: models, report.html, identify.json", folder.display());
}
