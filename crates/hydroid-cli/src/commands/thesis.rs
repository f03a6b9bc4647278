//! `hydroid thesis`.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use hydroid_live::program::interrupt;
use hydroid_study::{Holds, Plan, Status, Summary};

use super::Outcome;
use crate::args::{Global, Thesis};
use crate::ui;

pub fn run(args: &Thesis, global: Global) -> anyhow::Result<Outcome> {
    if let Some(folder) = &args.write_experiments {
        Plan::write(folder)?;
        outln!("{}: files of experiments, records, models and claims", folder.display());
        return Ok(Outcome::Done);
    }
    let plan = match &args.experiments {
        Some(folder) => Plan::read(folder, args.quick)?,
        None => Plan::built_in(args.quick)?,
    };
    if args.list {
        list(&plan, global)?;
        return Ok(Outcome::Done);
    }
    let program = if args.ignore_build { 0 } else { hydroid_study::program() };
    let clock = Instant::now();
    let bar = ui::Bar::new("study", global);
    // Several threads report progress.
    let last = Mutex::new(String::new());
    let report = |status: &Status<'_>| {
        let fraction = status.done as f64 / status.of.max(1) as f64;
        let text = format!("{}: {}", status.experiment, status.what);
        if let Ok(mut last) = last.lock()
            && *last != text
        {
            bar.set_message(&text);
            *last = text;
        }
        bar.set_fraction(fraction);
        if interrupt::interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let summary = hydroid_study::run(&plan, &args.only, &args.output, program, &command(args), &report)?;
    drop(bar);
    if global.json {
        super::print_json(&summary)?;
    } else {
        show(&summary, clock.elapsed().as_secs_f64());
    }
    Ok(Outcome::Done)
}

/// The command of one experiment, without its name.
fn command(args: &Thesis) -> String {
    let mut command = String::from("hydroid thesis");
    if args.quick {
        command.push_str(" --quick");
    }
    if let Some(folder) = &args.experiments {
        command.extend([" --experiments ", &folder.display().to_string()]);
    }
    if args.output != Path::new("report") {
        command.extend([" -o ", &args.output.display().to_string()]);
    }
    command
}

fn list(plan: &Plan, global: Global) -> anyhow::Result<()> {
    if global.json {
        let named: Vec<_> = plan
            .experiments
            .iter()
            .map(|(name, experiment)| serde_json::json!({ "name": name, "title": experiment.title }))
            .collect();
        return super::print_json(&named);
    }
    for (name, experiment) in &plan.experiments {
        outln!("{name:12} {}", experiment.title);
    }
    Ok(())
}

fn show(summary: &Summary, seconds: f64) {
    for claim in &summary.claims {
        let sign = match claim.verdict {
            Holds::Reproduced => "+",
            Holds::InPart => "o",
            Holds::NotReproduced => "-",
            Holds::NotMeasured => "?",
        };
        let figure = claim.figure.map_or_else(|| String::from("–"), |figure| format!("{figure:.3}"));
        outln!("{sign} {:14} {figure:<9} {}", claim.verdict.word(), claim.claim);
    }
    let mut slow: Vec<_> = summary.seconds.iter().filter(|(_, seconds)| *seconds >= 0.1).collect();
    slow.sort_by(|a, b| b.1.total_cmp(&a.1));
    let words: Vec<String> = slow.iter().map(|(name, seconds)| format!("{name} {seconds:.1} s")).collect();
    outln!("\n{seconds:.1} s{}{}", if words.is_empty() { "" } else { ": " }, words.join(", "));
    outln!("{}", summary.page.display());
}
