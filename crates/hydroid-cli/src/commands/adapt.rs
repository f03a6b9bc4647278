//! `hydroid adapt`.

mod stream;

use std::path::Path;

use anyhow::{Context, ensure};
use hydroid::adapt::{self, Gate, Options, Report};
use hydroid::identify::{Grade, verdicts};
use hydroid::log::{self, Note};
use hydroid::model;

use super::{Outcome, evaluate, table};
use crate::args::{Adapt, Global};
use crate::{logs, ui};

pub fn run(args: &Adapt, global: Global) -> anyhow::Result<Outcome> {
    let model = model::read(&args.model)?;
    // Said before the log is read: no log would change it.
    adapt::adaptable(&model).with_context(|| format!("{} cannot be adapted", args.model.display()))?;
    let reading = logs::reading(model.description.reading.clone(), &args.log)?;
    if args.stream.stream || args.run == Path::new("-") {
        return stream::run(args, global, &model, reading);
    }
    let given = &args.stream;
    ensure!(
        given.horizons.is_none() && given.state.is_none() && !given.timing,
        "--horizons, --state and --timing are of a live stream: add --stream, or give - for standard input"
    );
    let raw = log::read(&args.run)?;
    let prepared = log::prepare(&[raw], &reading.selection, &reading.options).with_context(|| {
        format!("a log for {}, which steps {} s, cannot be used", args.model.display(), model.description.dt)
    })?;
    ui::tell(&prepared.notes, global);
    model.check(&prepared.runs)?;
    ui::tell(model.outside(&prepared.runs).as_slice(), global);
    let options = options(args, model.description.dt);
    let runs: Vec<_> = prepared.runs.iter().collect();
    let bar = ui::Bar::new("adapting", global);
    let adapted = adapt::adapt(&model, &runs, &options, &mut bar.callback())
        .context("the log cannot be used to adapt the model")?;
    drop(bar);
    if let Some(path) = &args.output {
        model::write(&adapted.model, path)?;
    }
    let report = &adapted.report;
    if global.json {
        super::print_json(report)?;
    } else {
        show(report, args.output.as_deref());
    }
    let better = report.adapted.score() <= report.frozen.score();
    ui::tell(&doubts(report), global);
    Ok(if better && report.adapted.diverged == 0 { Outcome::Done } else { Outcome::Missed })
}

/// What the command line says, for a model that steps `dt` seconds.
fn options(args: &Adapt, dt: f64) -> Options {
    Options {
        forgetting_s: args.forgetting,
        window_s: args.window,
        prior_s: args.prior,
        leak: !args.no_leak,
        all_terms: args.all_terms,
        gate: if args.no_gate { Gate::OPEN } else { Gate::default() },
        evaluate: evaluate::options(args.judging, dt),
    }
}

/// What speaks against using what was learned.
fn doubts(report: &Report) -> Vec<Note> {
    let mut notes = Vec::new();
    let remedy = "keep the model as it was; try a longer --forgetting or a larger --prior";
    if report.adapted.score() > report.frozen.score() {
        notes.push(
            Note::warning("on this log the model that learned predicts worse than the one that did not")
                .with_remedy(remedy),
        );
    }
    let lost: Vec<String> = verdicts(&report.adapted)
        .into_iter()
        .filter(|verdict| verdict.grade == Grade::NotIdentified)
        .map(|verdict| format!("'{}'", verdict.channel))
        .collect();
    if !lost.is_empty() {
        notes.push(
            Note::warning(format!(
                "with what it learned, {} {} predicted no better than by keeping the last value or the mean",
                lost.join(", "),
                if lost.len() == 1 { "is" } else { "are" }
            ))
            .with_remedy("do not use these equations on this vessel as it is"),
        );
    }
    notes
}

fn show(report: &Report, written: Option<&Path>) {
    ui::write_out(format_args!("{}\n", table::side_by_side(&report.frozen, &report.adapted)));
    let (guard, times, coverage) = (report.guard, report.us_per_sample, report.coverage);
    outln!(
        "learned from {} rows ({} with less weight), rejected {}, rolled back {}",
        guard.accepted + guard.inflated,
        guard.inflated,
        guard.rejected,
        guard.rolled_back
    );
    outln!(
        "innovations inside their 80 % band: {:.0} %, 95 % band: {:.0} %",
        100.0 * coverage.of_80,
        100.0 * coverage.of_95
    );
    outln!(
        "{:.1} us for a sample (median), {:.1} (99 of 100), {:.1} (longest)",
        times.median,
        times.p99,
        times.max
    );
    if let Some(path) = written {
        outln!("adapted model: {}", path.display());
    }
}
