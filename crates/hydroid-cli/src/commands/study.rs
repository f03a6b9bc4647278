//! `hydroid study`.

use std::fmt::Write as _;
use std::ops::ControlFlow;

use anyhow::Context;
use hydroid::log::{self, Trajectory};
use hydroid::{atomic, model};
use hydroid_study::guard::{self, Campaign, Case, DayResult};
use hydroid_study::{Status, Store};

use super::Outcome;
use crate::args::study::StudyKind;
use crate::args::{Global, GuardStudy, Study};
use crate::{logs, ui};

pub fn run(args: &Study, global: Global) -> anyhow::Result<Outcome> {
    match &args.campaign {
        StudyKind::Guard(args) => guard(args, global),
    }
}

fn guard(args: &GuardStudy, global: Global) -> anyhow::Result<Outcome> {
    atomic::probe(&args.output)?;
    let _lock = atomic::Lock::new(&args.output)?;
    let bar = ui::Bar::new("campaign", global);
    let watch = |status: &Status<'_>| {
        bar.set_message(status.what);
        bar.set_fraction(status.fraction);
        if ui::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let cases = if args.model.is_empty() {
        let store = Store::new(args.output.join("cache"), hydroid_study::program());
        guard::built_in(args.quick, &store, &watch)?
    } else {
        args.model.iter().map(|path| case(path, args)).collect::<anyhow::Result<_>>()?
    };
    let campaign = guard::campaign(&cases, args.seeds.0.clone(), !args.no_clean, &watch)?;
    drop(bar);
    atomic::write(&args.output.join("days.csv"), |out| out.write_all(table(&campaign).as_bytes()))?;
    let summary = guard::summary(&campaign);
    if global.json {
        super::print_json(&serde_json::json!({ "summary": summary, "days": campaign }))?;
    } else {
        outln!("{summary}");
        outln!("{}", args.output.join("days.csv").display());
    }
    Ok(if summary.exceeded() { Outcome::Missed } else { Outcome::Done })
}

fn case(path: &std::path::Path, args: &GuardStudy) -> anyhow::Result<Case> {
    let model = model::read(path)?;
    let reading = &model.description.reading;
    let mut runs: Vec<Trajectory> = Vec::new();
    for given in &args.logs {
        let raw = log::read(given)?;
        let prepared = log::prepare(&[raw], &reading.selection, &reading.options)
            .with_context(|| logs::cannot_use(path, &model))?;
        runs.extend(prepared.runs);
    }
    model.check(&runs)?;
    Ok(Case::new(path.display().to_string(), model, &runs))
}

/// A text as a cell of a CSV file.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

fn table(campaign: &Campaign) -> String {
    let mut text = String::from(
        "seed,case,kind,log,faults,reference,unguarded,guarded,excess_unguarded,excess_guarded,false_alarms,sound,spikes,spikes_found,jumps,jumps_found,stuck,stuck_found\n",
    );
    for day in campaign.bad.iter().chain(&campaign.clean) {
        let DayResult {
            errors: [reference, alone, guarded], excess, false_alarms, spikes, jumps, stuck, ..
        } = day;
        let seed = day.seed.map(|seed| seed.to_string()).unwrap_or_default();
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "{seed},{},{},{},{},{reference},{alone},{guarded},{},{},",
            quoted(&day.case),
            day.kind,
            quoted(&day.log),
            quoted(&day.faults),
            excess[0],
            excess[1],
        );
        let counts =
            [false_alarms[1], false_alarms[0], spikes[0], spikes[1], jumps[0], jumps[1], stuck[0], stuck[1]];
        let counts: Vec<String> = counts.iter().map(ToString::to_string).collect();
        text.push_str(&counts.join(","));
        text.push('\n');
    }
    text
}
