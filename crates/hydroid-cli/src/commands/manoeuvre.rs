//! `hydroid manoeuvre`.

use anyhow::{Context as _, bail};
use hydroid::atomic::{self, Lock};
use hydroid::log::Note;
use hydroid::manoeuvre::{self, Comparison, ComparisonError, LeftOut, Trial, Trials};
use hydroid::model::{self, Model};
use hydroid_report::{ComparisonReport, ManoeuvreReport};
use serde_json::json;

use super::Outcome;
use crate::args::{Global, Manoeuvre};
use crate::{logs, ui};

pub fn run(args: &Manoeuvre, global: Global) -> anyhow::Result<Outcome> {
    let model = model::read(&args.plant)?;
    if !args.logs.is_empty() {
        return compare(args, &model, global);
    }
    let plan = args.settings.plan(&model)?;
    let _lock = lock(args)?;
    let bar = ui::Bar::new("trials", global);
    let Some(trials) = plan.run(&model, &mut bar.callback())? else {
        bail!("cancelled");
    };
    drop(bar);
    let document = trials.document(&args.plant.display().to_string(), &model);
    if let Some(folder) = &args.output {
        let command = ui::command_line();
        let report = ManoeuvreReport { command: &command, model: &model, trials: &trials };
        report.write(folder, &document)?;
    }
    if global.json {
        super::print_json(&document)?;
    } else {
        print(&model, &trials);
        if let Some(folder) = &args.output {
            outln!("{}: trials.json, tracks.csv, report.html", folder.display());
        }
    }
    Ok(if trials.passed() { Outcome::Done } else { Outcome::Missed })
}

/// Checks that the folder of -o can be written, and keeps other runs from it.
fn lock(args: &Manoeuvre) -> anyhow::Result<Option<Lock>> {
    let Some(folder) = &args.output else { return Ok(None) };
    atomic::probe(folder)?;
    Ok(Some(Lock::new(folder)?))
}

/// The trials of logs beside their predictions.
fn compare(args: &Manoeuvre, model: &Model, global: Global) -> anyhow::Result<Outcome> {
    let model = &args.settings.for_logs(model.clone())?;
    let mut reading = args.log.clone().over(model.description.reading.clone(), &model.description.boat)?;
    let (_, prepared) = logs::prepare(&args.logs, &mut reading, global)
        .with_context(|| logs::cannot_use(&args.plant, model))?;
    ui::print_notes(&prepared.notes, global);
    let model = model.clone().for_runs(&prepared.runs)?;
    let _lock = lock(args)?;
    let bar = ui::Bar::new("trials", global);
    let all = manoeuvre::compare(&model, &prepared.runs, &mut bar.callback())?;
    drop(bar);
    let scale = model.description.boat.particulars.scale;
    let mut document = json!({ "plant": args.plant, "comparisons": all });
    if let Some(scale) = scale.filter(|scale| *scale != 1.0) {
        document["scale"] = json!(scale);
        ui::print_notes(
            &[Note::info(format!(
                "figures are those of the ship, by Froude's law: lengths {scale} times, times and speeds {:.4} times those of the log",
                scale.sqrt()
            ))],
            global,
        );
    }
    if let Some(folder) = &args.output {
        let command = ui::command_line();
        let report = ComparisonReport { command: &command, model: &model, comparisons: &all };
        report.write(folder, &document)?;
    }
    let is_valid = all.iter().all(|comparison| comparison.tracks[1].not_valid.is_none());
    let outcome = if is_valid { Outcome::Done } else { Outcome::Missed };
    if global.json {
        super::print_json(&document)?;
        return Ok(outcome);
    }
    for comparison in &all {
        print_comparison(comparison);
    }
    if all.is_empty() {
        outln!(
            "the logs contain no trial: no turn by 90 deg or more under constant commands, and no zigzag of three commands or more, from a straight course"
        );
    }
    if let Some(folder) = &args.output {
        outln!("{}: comparisons.json, tracks.csv, report.html", folder.display());
    }
    Ok(outcome)
}

fn print_comparison(comparison: &Comparison) {
    let Comparison { run, at_s, trial, current: [north, east], members, outside, .. } = comparison;
    let title = trial.title();
    let fitted = if comparison.in_training { " (the model was fitted to a run of this name)" } else { "" };
    let water = if *north == 0.0 && *east == 0.0 {
        String::new()
    } else {
        let of = if comparison.current_of_turn { "of the turn itself" } else { "estimated before it" };
        format!(", in a current of {north:.2}, {east:.2} m/s (north, east), {of}")
    };
    outln!("{run}, {at_s:.1} s: {title}{water}{fitted}");
    let intervals = manoeuvre::interval_words(&comparison.predicted, *members);
    let intervals = intervals.map(|words| format!(" interval: {words}")).unwrap_or_default();
    outln!("  measured path: {}", comparison.path_words());
    outln!("  approach: {:.3} m/s over ground", comparison.approach.speed_m_s);
    for doubt in &comparison.doubts {
        outln!("  doubtful: {doubt}");
    }
    outln!("  {:<28} {:>19} {:>11} {:<6} {:<18}{intervals}", "", "measured", "predicted", "", "E, U");
    for (measured, predicted) in comparison.measured.iter().zip(&comparison.predicted) {
        if let Some(value) = measured.value {
            let (name, unit) = measured.name_and_unit();
            let other =
                predicted.value.map_or_else(|| predicted.missing().to_owned(), |value| format!("{value:.2}"));
            let interval = predicted.interval;
            let interval =
                interval.map(|[low, high]| format!("   {low:.2} to {high:.2}{}", predicted.left_out_text()));
            let none = predicted.no_interval.as_ref().map(|reason| format!("   no interval: {reason}"));
            let interval = interval.or(none).unwrap_or_default();
            let half =
                measured.interval.map(|[low, high]| format!("{value:.2} +- {:.2}", 0.5 * (high - low)));
            let value = half.unwrap_or_else(|| format!("{value:.2}"));
            let error = comparison.errors.iter().find(|error| error.name == measured.name);
            let error = error.map(|ComparisonError { error, uncertainty, .. }| match uncertainty {
                Some(uncertainty) => format!("{error:.2}, {uncertainty:.2}"),
                None => format!("{error:.2}, unknown"),
            });
            let error = error.unwrap_or_default();
            let line = format!("  {name:<28} {value:>19} {other:>11} {unit:<6} {error:<18}{interval}");
            let mark = if predicted.extrapolated && predicted.value.is_some() { " *" } else { "" };
            outln!("{}{mark}", line.trim_end());
        } else if let Some(reason) = &measured.not_valid {
            let (name, _) = measured.name_and_unit();
            outln!("  {name:<28} not measured: {reason}");
        }
    }
    for outside in outside {
        outln!("  * {outside}");
    }
}

fn print(model: &Model, trials: &Trials) {
    outln!("{}", manoeuvre_approach(model, trials));
    for note in &trials.notes {
        outln!("{note}");
    }
    for trial in &trials.trials {
        outln!("");
        outln!("{}{}", trial.kind.title(&trials.inputs), members(trial));
        for figure in &trial.figures {
            let (name, unit) = figure.name_and_unit();
            let unit = if figure.value.is_some() { unit } else { "" };
            let value = figure.value.map_or_else(|| figure.missing().to_owned(), fixed);
            let interval = figure
                .interval
                .map(|[low, high]| format!("   {} to {}{}", fixed(low), fixed(high), figure.left_out_text()));
            let none = figure.no_interval.as_ref().map(|reason| format!("   no interval: {reason}"));
            let interval = interval.or(none).unwrap_or_default();
            let criterion = figure
                .criterion
                .map(|c| format!("   limit {:.2}: {}", c.limit, c.words()))
                .or_else(|| Some(format!("   limit {:.2}: not judged", figure.not_judged?)))
                .unwrap_or_default();
            let mark = if figure.extrapolated && figure.value.is_some() { " *" } else { "" };
            let line = format!("  {name:<28} {value:>11} {unit:<6}{interval}{criterion}");
            outln!("{}{mark}", line.trim_end());
        }
        if let Some(stable) = trial.directionally_stable {
            outln!("  {}", if stable { "directionally stable" } else { "not directionally stable" });
        }
        if let Some(reason) = &trial.stability_not_decided {
            outln!("  directional stability is not decided: {reason}");
        }
        print_limits(trial);
    }
    for LeftOut { trial, reason } in &trials.left_out {
        outln!("\n{trial}: left out, because {reason}");
    }
}

fn print_limits(trial: &Trial) {
    if let Some(reason) = &trial.not_valid {
        outln!("  not valid {reason}");
    }
    for outside in &trial.outside {
        outln!("  * {outside}");
    }
}

fn members(trial: &Trial) -> String {
    let words = manoeuvre::interval_words(&trial.figures, trial.members);
    words.map(|words| format!(" (intervals: {words})")).unwrap_or_default()
}

/// A number with two decimals, without a negative zero.
fn fixed(value: f64) -> String {
    let text = format!("{value:.2}");
    if text == "-0.00" { "0.00".to_owned() } else { text }
}

fn manoeuvre_approach(model: &Model, trials: &Trials) -> String {
    let commands: Vec<String> = model
        .description
        .inputs
        .iter()
        .zip(&trials.approach_command)
        .map(|(port, value)| {
            let (value, unit) = match port.channel.unit.as_str() {
                "rad" => (value.to_degrees(), "deg"),
                "1" => (*value, ""),
                unit => (*value, unit),
            };
            format!("{} {value:.2} {unit}", port.channel.name).trim_end().to_owned()
        })
        .collect();
    let reason = trials.no_propulsion.as_ref().map(|reason| format!(" ({reason})")).unwrap_or_default();
    format!(
        "approach: {:.3} m/s through the water with {}{reason}",
        trials.approach_speed_m_s,
        commands.join(", ")
    )
}
