//! `hydroid thesis`.

use std::collections::BTreeMap;
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
    let last = Mutex::new((String::new(), Progress::default()));
    let report = |status: &Status<'_>| {
        let text = format!("{}: {}", status.experiment, status.what);
        if let Ok(mut last) = last.lock() {
            let (shown, progress) = &mut *last;
            bar.set_fraction(progress.after(status));
            if *shown != text {
                bar.set_message(&text);
                *shown = text;
            }
        }
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

/// Progress of a study. The number of tasks of an experiment is not known before; each one takes a third of what
/// remains of the experiment, so that the fraction never falls.
#[derive(Default)]
struct Progress {
    experiment: String,
    tasks: BTreeMap<String, f64>,
}

impl Progress {
    fn after(&mut self, status: &Status<'_>) -> f64 {
        if self.experiment != status.experiment {
            status.experiment.clone_into(&mut self.experiment);
            self.tasks.clear();
        }
        let task = self.tasks.entry(status.what.to_owned()).or_default();
        *task = task.max(status.fraction);
        let remaining: f64 =
            self.tasks.values().map(|fraction| 1.0 - fraction.clamp(0.0, 1.0) / 3.0).product();
        status.before + status.share * (1.0 - remaining)
    }
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
        let figure = claim.deciding().and_then(|one| one.figure);
        let figure = figure.map_or_else(|| String::from("–"), |figure| format!("{figure:.3}"));
        outln!("{sign} {:14} {figure:<9} {}", claim.verdict.word(), claim.claim);
    }
    let mut slow: Vec<_> = summary.seconds.iter().filter(|(_, seconds)| *seconds >= 0.1).collect();
    slow.sort_by(|a, b| b.1.total_cmp(&a.1));
    let words: Vec<String> = slow.iter().map(|(name, seconds)| format!("{name} {seconds:.1} s")).collect();
    outln!("\n{seconds:.1} s{}{}", if words.is_empty() { "" } else { ": " }, words.join(", "));
    outln!("{}", summary.page.display());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_never_falls_and_stays_in_the_share_of_the_experiment() {
        let mut progress = Progress::default();
        let mut last = 0.0;
        let places = [("a", 0.0, 0.75), ("b", 0.75, 0.25)];
        for (experiment, before, share) in places {
            for (what, fraction) in [("x", 0.0), ("x", 0.5), ("y", 0.0), ("x", 1.0), ("y", 0.5), ("x", 0.0)] {
                let now = progress.after(&Status { experiment, what, fraction, before, share });
                assert!(now >= last && now >= before && now < before + share, "{experiment} {what} {now}");
                last = now;
            }
        }
    }
}
