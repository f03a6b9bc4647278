//! `hydroid manoeuvre`.

use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use hydroid::atomic::{self, Lock};
use hydroid::manoeuvre::{self, Comparison, Figure, Options, Trial, TrialKind, TrialOptions, Trials};
use hydroid::model::{self, Model};
use hydroid::plant::InputMap;
use hydroid_report::{ComparisonReport, ManoeuvreReport};
use serde_json::{Value, json};

use super::Outcome;
use crate::args::{Global, Manoeuvre, TrialName, ZigzagAngles};
use crate::{logs, ui};

pub fn run(args: &Manoeuvre, global: Global) -> anyhow::Result<Outcome> {
    let model = model::read(&args.plant)?;
    if !args.logs.is_empty() {
        return compare(args, &model, global);
    }
    let map = InputMap::with(&model, &args.push, &args.turn)?;
    let kinds = kinds(args, &map)?;
    let options = options(args)?;
    let _lock = lock(args)?;
    let bar = ui::Bar::new("trials", global);
    let Some(trials) = manoeuvre::trials(&model, &map, &kinds, &options, &mut bar.callback())? else {
        bail!("cancelled");
    };
    drop(bar);
    let document = document(args, &model, &trials)?;
    if let Some(folder) = &args.output {
        write(folder, args, &model, &trials, &document)?;
    }
    if global.json {
        super::print_json(&document)?;
    } else {
        print(&model, &trials);
        if let Some(folder) = &args.output {
            outln!("{}: trials.json, tracks.csv, report.html", folder.display());
        }
    }
    let passed = |figure: &Figure| figure.criterion.is_none_or(|criterion| criterion.passed);
    let sound = trials.trials.iter().flat_map(|trial| &trial.figures).all(passed);
    Ok(if sound { Outcome::Done } else { Outcome::Missed })
}

/// Checks that the folder of -o can be written, and keeps other runs from it.
fn lock(args: &Manoeuvre) -> anyhow::Result<Option<Lock>> {
    let Some(folder) = &args.output else { return Ok(None) };
    atomic::probe(folder)?;
    Ok(Some(Lock::new(folder)?))
}

/// The trials of logs beside their predictions.
fn compare(args: &Manoeuvre, model: &Model, global: Global) -> anyhow::Result<Outcome> {
    let reading = logs::reading(model.description.reading.clone(), &args.log)?;
    let (_, prepared) =
        logs::prepare(&args.logs, &reading).with_context(|| logs::cannot_use(&args.plant, model))?;
    ui::print_notes(&prepared.notes, global);
    let model = logs::with_step_of(model.clone(), &prepared.runs)?;
    model.check(&prepared.runs)?;
    let model = logs::with_current(model, None, &prepared.runs)?;
    let _lock = lock(args)?;
    let all = manoeuvre::compare(&model, &prepared.runs)?;
    let document = json!({ "plant": args.plant, "comparisons": all });
    if let Some(folder) = &args.output {
        write_comparisons(folder, &model, &all, &document)?;
    }
    if global.json {
        super::print_json(&document)?;
        return Ok(Outcome::Done);
    }
    for comparison in &all {
        print_comparison(comparison);
    }
    if all.is_empty() {
        outln!(
            "the logs contain no trial: no turn by 90 deg or more under constant commands, and no zigzag of three commands or more"
        );
    }
    if let Some(folder) = &args.output {
        outln!("{}: comparisons.json, tracks.csv, report.html", folder.display());
    }
    Ok(Outcome::Done)
}

fn write_comparisons(
    folder: &Path,
    model: &Model,
    comparisons: &[Comparison],
    document: &Value,
) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(document)?;
    text.push('\n');
    atomic::write(&folder.join("comparisons.json"), |out| out.write_all(text.as_bytes()))?;
    atomic::write(&folder.join("tracks.csv"), |out| manoeuvre::write_comparisons_csv(comparisons, out))?;
    let command = ui::command_line();
    let page = hydroid_report::comparisons(&ComparisonReport { command: &command, model, comparisons })?;
    atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
    Ok(())
}

fn print_comparison(comparison: &Comparison) {
    let Comparison { run, at_s, trial, current: [north, east], members, .. } = comparison;
    let title = trial.title();
    let fitted = if comparison.in_training { " (the model was fitted to this run)" } else { "" };
    let water = if *north == 0.0 && *east == 0.0 {
        String::new()
    } else {
        format!(", in an estimated current of {north:.2}, {east:.2} m/s (north, east)")
    };
    outln!("{run}, {at_s:.1} s: {title}{water}{fitted}");
    let intervals = if *members > 0 { "   5 % to 95 % of the members" } else { "" };
    outln!("  {:<28} {:>11} {:>11} {:<6}{intervals}", "", "measured", "predicted", "");
    for (measured, predicted) in comparison.measured.iter().zip(&comparison.predicted) {
        if let Some(value) = measured.value {
            let (name, unit) = measured.name_and_unit();
            let other = predicted.value.map_or_else(|| String::from("-"), |value| format!("{value:.2}"));
            let interval =
                predicted.interval.map(|[low, high]| format!("   {low:.2} to {high:.2}")).unwrap_or_default();
            let line = format!("  {name:<28} {value:>11.2} {other:>11} {unit:<6}{interval}");
            outln!("{}", line.trim_end());
        }
    }
}

fn kinds(args: &Manoeuvre, map: &InputMap) -> anyhow::Result<Vec<TrialKind>> {
    let full = map.steering().full;
    let unit = map.steering().unit;
    let relative = |stated: f64, option: &str| -> anyhow::Result<f64> {
        ensure!(stated > 0.0, "{option} {stated}: the steering must be greater than 0; both sides are tried");
        ensure!(
            stated <= full * (1.0 + 1e-9),
            "{option} {stated}: hard over is {full:.4} {unit} for this vessel: give at most that"
        );
        Ok((stated / full).min(1.0))
    };
    let usual = if unit == "deg" { full.min(35.0) } else { full };
    let hard = relative(args.steering.unwrap_or(usual), "--steering")?;
    let all = [
        TrialName::TurningCircle,
        TrialName::Zigzag,
        TrialName::PullOut,
        TrialName::Spiral,
        TrialName::Acceleration,
        TrialName::Stopping,
    ];
    let chosen = if args.trial.is_empty() { &all[..] } else { &args.trial };
    let mut kinds = Vec::new();
    for trial in chosen {
        match trial {
            TrialName::TurningCircle => {
                kinds.extend([hard, -hard].map(|steering| TrialKind::TurningCircle { steering }));
            }
            TrialName::Zigzag => {
                let usual = [10.0, 20.0].map(|angle| ZigzagAngles { steering: angle, heading_deg: angle });
                let usual = usual.into_iter().filter(|angles| angles.steering <= full).collect::<Vec<_>>();
                ensure!(
                    !(args.zigzag.is_empty() && usual.is_empty()),
                    "hard over is {full:.4} {unit} for this vessel, less than a zigzag 10/10 needs: give smaller angles, as in --zigzag 5/5"
                );
                for angles in if args.zigzag.is_empty() { &usual } else { &args.zigzag } {
                    let steering = relative(angles.steering, "--zigzag")?;
                    let heading_deg = angles.heading_deg;
                    kinds.extend(
                        [steering, -steering].map(|steering| TrialKind::Zigzag { steering, heading_deg }),
                    );
                }
            }
            TrialName::PullOut => kinds.push(TrialKind::PullOut { steering: hard }),
            TrialName::Spiral => kinds.push(TrialKind::Spiral { steering: hard, steps: 24 }),
            TrialName::Acceleration => kinds.push(TrialKind::Acceleration),
            TrialName::Stopping => kinds.push(TrialKind::Stopping),
        }
    }
    Ok(kinds)
}

fn options(args: &Manoeuvre) -> anyhow::Result<TrialOptions> {
    let percent = args.propulsion.unwrap_or(85.0);
    ensure!(
        percent > 0.0 && percent <= 100.0,
        "--propulsion {percent}: give percent of full ahead, greater than 0 and at most 100"
    );
    if let Some(length) = args.length {
        ensure!(length.is_finite() && length > 0.0, "--length {length}: give metres, greater than 0");
    }
    let [north, east] = args.current.0;
    ensure!(north.is_finite() && east.is_finite(), "--current: give two velocities in m/s, north and east");
    Ok(TrialOptions {
        approach: Options { propulsion: 0.01 * percent, speed_m_s: args.speed },
        longest_s: args.longest.0,
        current: args.current.0,
        length_m: args.length,
    })
}

fn document(args: &Manoeuvre, model: &Model, trials: &Trials) -> anyhow::Result<Value> {
    let mut document = serde_json::to_value(trials)?;
    document["plant"] = json!(args.plant);
    document["kind"] = json!(model.kind());
    document["steering"] = json!(trials.inputs.steering());
    document["length_m"] = json!(args.length);
    document["current"] = json!(args.current.0);
    for (value, trial) in document["trials"].as_array_mut().into_iter().flatten().zip(&trials.trials) {
        value["title"] = json!(trial.kind.title(&trials.inputs));
    }
    Ok(document)
}

fn write(
    folder: &Path,
    args: &Manoeuvre,
    model: &Model,
    trials: &Trials,
    document: &Value,
) -> anyhow::Result<()> {
    let mut text = serde_json::to_string_pretty(document)?;
    text.push('\n');
    atomic::write(&folder.join("trials.json"), |out| out.write_all(text.as_bytes()))?;
    atomic::write(&folder.join("tracks.csv"), |out| trials.write_csv(out))?;
    let vessel = model.is_vessel().then(|| format!(" of {}", model.description.name));
    let title = format!("Manoeuvring trials{}", vessel.unwrap_or_default());
    let page = hydroid_report::manoeuvres(&ManoeuvreReport {
        title: &title,
        command: &ui::command_line(),
        model,
        trials,
        length_m: args.length,
    })?;
    atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
    Ok(())
}

fn print(model: &Model, trials: &Trials) {
    outln!("{}", manoeuvre_approach(model, trials));
    for trial in &trials.trials {
        outln!("");
        outln!("{}{}", trial.kind.title(&trials.inputs), members(trial));
        for figure in &trial.figures {
            let (name, unit) = figure.name_and_unit();
            let value =
                figure.value.map_or_else(|| String::from("not reached"), |value| format!("{value:.2}"));
            let interval =
                figure.interval.map(|[low, high]| format!("   {low:.2} to {high:.2}")).unwrap_or_default();
            let criterion = figure
                .criterion
                .map(|c| format!("   limit {:.2}: {}", c.limit, if c.passed { "passed" } else { "missed" }))
                .unwrap_or_default();
            let mark = if figure.extrapolated && figure.value.is_some() { " *" } else { "" };
            let line = format!("  {name:<28} {value:>11} {unit:<6}{interval}{criterion}");
            outln!("{}{mark}", line.trim_end());
        }
        if let Some(stable) = trial.directionally_stable {
            outln!("  {}", if stable { "directionally stable" } else { "not directionally stable" });
        }
        print_limits(trial);
    }
}

fn print_limits(trial: &Trial) {
    if let Some(t_s) = trial.diverged_s {
        outln!("  the motion diverges after {t_s:.1} s");
    }
    for outside in &trial.outside {
        outln!(
            "  * the model extrapolates from {:.1} s on: {} goes from {:.3} to {:.3}, and from {:.3} to {:.3} in training",
            outside.from_s,
            outside.name,
            outside.reached[0],
            outside.reached[1],
            outside.range[0],
            outside.range[1]
        );
    }
}

fn members(trial: &Trial) -> String {
    match trial.members {
        0 => String::new(),
        members => format!(" (intervals: 5 % to 95 % of {members} members)"),
    }
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
    format!("approach: {:.3} m/s through the water with {}", trials.approach_speed_m_s, commands.join(", "))
}
