//! `hydroid adapt`.

pub(super) mod blackbox;
pub(super) mod stream;

use std::path::Path;

use anyhow::{Context, bail, ensure};
use hydroid::adapt::{self, Options, Rehearse, Report, ResolvedOptions};
use hydroid::atomic::Lock;
use hydroid::faults::Faults;
use hydroid::identify::{Grade, verdicts};
use hydroid::log::Note;
use hydroid::model::{self, Model};
use hydroid_live::black_box::adapt_recorded;

use super::{Outcome, evaluate, table};
use crate::args::{Adapt, Global};
use crate::{logs, outputs, ui};

pub fn run(args: &Adapt, global: Global) -> anyhow::Result<Outcome> {
    let model = model::read(&args.model)?;
    adapt::adaptable(&model).with_context(|| format!("{} cannot be adapted", args.model.display()))?;
    if let Some(path) = &args.black_box.replay {
        return blackbox::replay(args, global, model, path);
    }
    let Some(given_log) = &args.run else {
        bail!("the log is missing: give a file, or - for standard input")
    };
    let written = [
        ("-o", args.output.as_deref()),
        ("--state", args.stream.answers.state.as_deref()),
        ("--black-box", args.black_box.black_box.as_deref()),
    ];
    let read = args.guard.training_log.iter().chain([given_log, &args.model]);
    outputs::check(&written, &read.map(AsRef::as_ref).collect::<Vec<&Path>>())?;
    if let (Some(path), true) = (&args.output, model.is_vessel()) {
        ensure!(
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")),
            "{}: a vessel is written as a TOML file; give -o a name that ends in .toml",
            path.display()
        );
    }
    let mut reading = args.log.clone().over(model.description.reading.clone(), &model.description.boat)?;
    if args.stream.stream || given_log == Path::new("-") {
        let dt = args.log.dt.unwrap_or(model.description.dt);
        let model = model.at_step(dt)?;
        let model = args.options.estimate_current.map_or(Ok(model.clone()), |std| model.with_current(std))?;
        return stream::run(args, given_log, global, &model, reading);
    }
    ensure!(
        !args.stream.answers.is_given(),
        "--horizons, --state and --timing apply to a live stream: add --stream, or give - for standard input"
    );
    let (_, mut prepared) = logs::prepare(std::slice::from_ref(given_log), &mut reading, global)
        .with_context(|| logs::cannot_use(&args.model, &model))?;
    ui::print_notes(&prepared.notes, global);
    let model = logs::with_step_of(model, &prepared.runs)?;
    model.check(&prepared.runs)?;
    logs::with_current(model.clone(), args.options.estimate_current, &prepared.runs)?;
    ui::print_notes(model.outside(&prepared.runs).as_slice(), global);
    let mut options = options(args, &model)?;
    if let Some(faults) = &args.guard.inject {
        Faults { seed: args.guard.seed, ..faults.clone() }
            .inject(&mut prepared.runs)
            .context("--inject does not fit the log")?;
        // Faulty measurements are not a reference for errors.
        options.evaluate.against = hydroid::evaluate::Against::Truth;
    }
    let guard = &args.guard;
    let training = logs::training_logs(
        &guard.training_log,
        guard.training_time.0,
        (&args.model, &model),
        &reading,
        global,
    )?;
    let runs: Vec<_> = prepared.runs.iter().collect();
    let bar = ui::Bar::new("adapting", global);
    let black_box = blackbox::settings(args)?;
    let black_box = black_box.as_ref();
    let written = [&args.output, &args.black_box.black_box].into_iter().flatten();
    let _locks: Vec<Lock> = written.map(|path| Lock::new(path)).collect::<Result<_, _>>()?;
    let adapted = adapt_recorded(&model, &training, &runs, &options, black_box, &mut bar.callback())
        .context("the model cannot be adapted with this log")?;
    drop(bar);
    if let Some(path) = &args.output {
        model::write(&adapted.model, path)?;
    }
    let report = &adapted.report;
    if global.json {
        super::print_json(report)?;
    } else {
        print_report(report, args.output.as_deref());
    }
    let better = report.adapted.score() <= report.frozen.score();
    ui::print_notes(&warnings(report), global);
    Ok(if better && report.adapted.diverged == 0 { Outcome::Done } else { Outcome::Missed })
}

/// Options of the adaptation; options for other kinds of models are refused.
fn options(args: &Adapt, model: &Model) -> anyhow::Result<Options> {
    let mut options = args.options.options(model)?;
    options.evaluate = evaluate::options(args.evaluation, model.description.dt);
    let rehearses = model.recurrent().is_some() && !args.guard.training_log.is_empty();
    options.kalman.rehearsal = (rehearses && !args.guard.no_rehearsal).then(Rehearse::default);
    Ok(options)
}

const EVENTS_SHOWN: usize = 12;

fn warnings(report: &Report) -> Vec<Note> {
    let mut notes = Vec::new();
    let remedy = match report.settings {
        ResolvedOptions::LeastSquares(_) | ResolvedOptions::LastLayer(_) => {
            "keep the initial model; try a longer --forgetting or a larger --prior"
        }
        ResolvedOptions::Committee(_) => "keep the initial model",
        ResolvedOptions::Kalman(_) => {
            "keep the initial model; try a smaller --weight-variance or a larger --noise-factor"
        }
    };
    if report.adapted.score() > report.frozen.score() {
        notes.push(
            Note::warning("on this log the adapted model predicts worse than the frozen model")
                .with_remedy(remedy),
        );
    }
    let lost: Vec<String> = verdicts(&report.adapted, &[])
        .into_iter()
        .filter(|verdict| verdict.grade == Grade::NotIdentified)
        .map(|verdict| format!("'{}'", verdict.channel))
        .collect();
    if !lost.is_empty() {
        notes.push(
            Note::warning(format!(
                "adapted model: {} {} predicted no better than by persistence or the mean",
                lost.join(", "),
                if lost.len() == 1 { "is" } else { "are" }
            ))
            .with_remedy("do not use this model on this vessel"),
        );
    }
    notes
}

fn print_report(report: &Report, written: Option<&Path>) {
    let table = table::side_by_side(&report.frozen, report.frozen_filtered.as_ref(), &report.adapted);
    ui::write_out(format_args!("{table}\n"));
    if !report.parameters.is_empty() {
        outln!("{:<26} {:>12} {:>12} {:>8}", "parameter", "given", "learned", "change");
        for p in &report.parameters {
            let change = 100.0 * (p.learned / p.given - 1.0);
            outln!("{:<26} {:>12.5} {:>12.5} {change:>+6.1} % {}", p.path, p.given, p.learned, p.unit);
        }
        outln!("");
    }
    let (guard, times, coverage) = (report.guard, report.us_per_sample, report.coverage);
    outln!(
        "samples: {} used for learning ({} with reduced weight), {} rejected; {} rollbacks",
        guard.accepted + guard.inflated,
        guard.inflated,
        guard.rejected,
        guard.rolled_back
    );
    outln!(
        "coverage of the innovations: {:.0} % in the 80 % band, {:.0} % in the 95 % band",
        100.0 * coverage.of_80,
        100.0 * coverage.of_95
    );
    if guard.predicted_by.iter().any(|&n| n > 0) {
        let all = guard.predicted_by.iter().sum::<usize>() as f64;
        let [adapted, frozen, unguarded] = guard.predicted_by.map(|n| 100.0 * n as f64 / all);
        outln!(
            "guard: predictions by the adapted model {adapted:.1} %, reference model {frozen:.1} %, unguarded model {unguarded:.1} %; a measurement held back at {} samples",
            guard.touched
        );
        for event in report.events.iter().take(EVENTS_SHOWN) {
            outln!("  {:10.1} s  {}", event.t, event.text);
        }
        if report.events.len() > EVENTS_SHOWN {
            outln!("  .. and {} more (all with --json)", report.events.len() - EVENTS_SHOWN);
        }
    }
    outln!(
        "time per sample: median {:.1} us, 99th percentile {:.1} us, maximum {:.1} us",
        times.median,
        times.p99,
        times.max
    );
    if let Some(path) = written {
        outln!("adapted model: {}", path.display());
    }
}
