//! `hydroid identify`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use hydroid::atomic::{self, Lock};
use hydroid::config::{self, Config, Log, Logs};
use hydroid::craft::CraftFile;
use hydroid::excitation::Excitation;
use hydroid::grey_box::GreyBox;
use hydroid::identify::{self, Candidate, IdentifyResult, Job, SindyOptions, Training};
use hydroid::log::Note;
use hydroid::model;
use hydroid::simulate::Options;
use hydroid::sindy::SearchResult;
use hydroid_core::craft::Craft;
use hydroid_report::Context;
use serde::Serialize;
use serde_json::json;

use super::previous_output::{checkpoints, model_file, move_stale_models, with_resume_hint};
use super::{Outcome, simulate, table};
use crate::args::{Global, Identify};
use crate::{logs, ui};

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
    if !(files.logs.validate.is_empty() && files.logs.test.is_empty()) {
        bail!("training logs are missing: name them before --validate and --test");
    }
    if args.log != Log::default() {
        bail!("options for reading logs are given, but no log: name at least one");
    }
    let default = || Some(PathBuf::from(config::FILE)).filter(|file| file.exists());
    if let Some(file) = args.config.clone().or_else(default) {
        bail!(
            "{} names no training logs, and none are given: add them as [split] train = [\"a.csv\"] or on the command line. The demonstration without a log uses no configuration",
            file.display()
        );
    }
    demonstration(&args.output, seed, global)
}

/// Options of the command line as sections of the file.
#[derive(Serialize)]
struct Given<'a> {
    log: &'a Log,
    identify: &'a config::Identify,
    sindy: &'a SindyOptions,
}

/// The configuration file, with the options of the command line over it.
fn configuration(args: &Identify, global: Global) -> anyhow::Result<Config> {
    let in_folder = Path::new(config::FILE);
    let file = args.config.as_deref().or(Some(in_folder).filter(|file| file.exists()));
    if file == Some(in_folder) && args.config.is_none() {
        ui::print_notes(
            &[Note::info(format!("options from {} in the current folder", config::FILE))],
            global,
        );
    }
    let given = Given { log: &args.log, identify: &args.options, sindy: &args.sindy };
    let mut config = Config::with(file, &given).context("the configuration file cannot be used")?;
    for (name, range) in &args.ranges {
        if args.ranges.iter().filter(|(other, _)| other == name).count() > 1 {
            bail!("--ranges names '{name}' twice: give one range for each channel");
        }
        config.ranges.insert(name.clone(), range.clone());
    }
    apply_network_args(args, &mut config);
    Ok(config)
}

fn identify_into(args: &Identify, global: Global) -> anyhow::Result<Outcome> {
    let mut config = configuration(args, global)?;
    let seed = config.identify.seed.unwrap_or(0);
    let pick = |given: &[PathBuf], configured: &mut Vec<PathBuf>| {
        if given.is_empty() { std::mem::take(configured) } else { given.to_vec() }
    };
    let mut files = Files {
        note: None,
        logs: Logs {
            train: pick(&args.logs, &mut config.split.train),
            validate: pick(&args.validate, &mut config.split.validate),
            test: pick(&args.test, &mut config.split.test),
        },
    };
    if files.logs.train.is_empty() {
        files = without_logs(args, &files, seed, global)?;
    }
    let vessel = args.vessel.as_deref().map(vessel).transpose()?;
    let mut reading = config.reading()?;
    let all: Vec<&PathBuf> = files.logs.all().collect();
    let (raw, read) = logs::read(&all, &mut reading, global)?;
    let mut raw = raw.into_iter();
    let raw = files.logs.map(|_| raw.next().expect("one log for each file"));
    let (mut job, mut notes) = config.job(reading, &raw, vessel)?;
    drop(raw);
    notes.splice(0..0, read);
    notes.splice(0..0, files.note.clone());
    ui::print_notes(&notes, global);
    job.networks.checkpoints = Some(args.output.clone());
    job.networks.resume = args.resume;
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

/// A vessel file.
fn vessel(path: &Path) -> anyhow::Result<CraftFile> {
    let model = model::read(path)?;
    let file = model.craft_file().with_context(|| {
        format!("--vessel {}: this is an identified model: name a vessel file (.toml)", path.display())
    })?;
    Ok(file.clone())
}

fn apply_network_args(args: &Identify, config: &mut Config) {
    let (epochs, restarts) =
        (args.epochs.and_then(|n| usize::try_from(n).ok()), args.restarts.map(usize::from));
    let Config { network, lstm, gru, rnn, direct, affine, .. } = config;
    for settings in [network, lstm, gru, rnn, direct, affine] {
        settings.epochs = epochs.or(settings.epochs);
        settings.restarts = restarts.or(settings.restarts);
    }
}

struct Files {
    /// Origin of simulated files.
    note: Option<Note>,
    logs: Logs<PathBuf>,
}

fn demonstration(folder: &Path, seed: u64, global: Global) -> anyhow::Result<Files> {
    let mut files = Vec::new();
    for (index, (name, duration_s)) in DEMONSTRATION_S.into_iter().enumerate() {
        let options = Options {
            duration_s,
            seed: seed.wrapping_mul(DEMONSTRATION_S.len() as u64).wrapping_add(index as u64),
            ..Options::new(Craft::hydrofoil(), Excitation::Mixed)
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
    Ok(Files {
        note: Some(note),
        logs: Logs { train: vec![train], validate: vec![validate], test: vec![test] },
    })
}

fn page(files: &Files, job: &Job, identified: &IdentifyResult, notes: &[Note]) -> anyhow::Result<String> {
    let sources: Vec<String> = files.logs.all().map(|file| file.display().to_string()).collect();
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
    let mut summary = identified.summary(notes);
    for (i, candidate) in identified.candidates.iter().enumerate() {
        let name = &candidate.model.description.name;
        let file = match candidate.model.craft() {
            Some(_) => folder.join(format!("{name}.toml")),
            None => model_file(folder, name),
        };
        model::write(&candidate.model, &file)?;
        summary["models"][i]["file"] = json!(file);
    }
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
        if let Some(text) = candidate.found().and_then(SearchResult::explained) {
            outln!("  {text}");
        }
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
    outln!("");
    let shown = identified.candidates.get(identified.best.unwrap_or(0));
    if let Some(candidate) = shown {
        super::inspect::show_roles(&candidate.model);
    }
    let on = shown.map_or("the logs", judged_on);
    let best = identified.best.map(|best| identified.candidates[best].model.description.name.as_str());
    match (best, &identified.cross_validation, &identified.missing) {
        (_, _, Some(missing)) => outln!("\n{}", missing.describe()),
        (Some(name), None, None) => {
            outln!("\nbest model on the validation runs: {name}; its grades on {on}:");
        }
        (Some(name), Some(_), None) => {
            outln!("\nbest model in the cross-validation: {name}; its grades on {on}:");
        }
        (None, _, None) => outln!("\nno best model; grades of the first model on {on}:"),
    }
    table::show_verdicts(&identified.verdicts);
    if let Some(found) = &identified.for_trials {
        let name = |i: usize| identified.candidates[i].model.description.name.as_str();
        outln!("\nfor trials and control: {}", found.best.map_or("no model", name));
        for (i, reason) in found.not_valid.iter().enumerate() {
            if let Some(reason) = reason {
                outln!("  not {}, not valid: {reason}", name(i));
            }
        }
    }
    outln!("\nwritten to {}: models, report.html, identify.json", folder.display());
}
