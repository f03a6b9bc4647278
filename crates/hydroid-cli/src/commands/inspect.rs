//! `hydroid inspect`.

mod black_box;
mod lacks;
mod recording;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::bail;
use hydroid::boat::{Boat, Property};
use hydroid::log::inspect::{Confidence, DelayEstimate};
use hydroid::log::{self, Inspection, Trajectory};
use hydroid::manoeuvre::{Recognised, recognise};
use hydroid::model::{self, Description, Model, NamedEquations, Port, Reading};
use hydroid::plant::{find_roles, input_values};
use hydroid::recording::{Proposal, Survey, is_recording, survey};
use hydroid_core::craft::CraftParameter;
use hydroid_core::model::recurrent::{BaseModel, Scaling, Tensor};
use hydroid_live::black_box::{BlackBox, is_black_box};
use serde::Serialize;
use serde_json::json;

use super::Outcome;
use crate::args::{Global, Inspect};
use crate::{logs, ui};

pub fn run(args: &Inspect, global: Global) -> anyhow::Result<Outcome> {
    if args.latex && global.json {
        bail!("--latex and --json exclude each other: --json contains the LaTeX, too");
    }
    if args.write_config.is_some()
        && let Some(file) = args.files.iter().find(|file| file.extension().is_some_and(|ext| ext == "toml"))
    {
        let file = file.display();
        bail!("{file} is no log: if it is the file to be written, give it as --write-config={file}");
    }
    let reading_of_all = args.log.clone().over(Reading::default(), &Boat::default())?;
    let names: Vec<String> = args.files.iter().map(|file| file.display().to_string()).collect();
    reading_of_all.selection.parts.check_names(&names)?;
    let mut documents = Vec::new();
    let mut all_runs = Vec::new();
    // Recordings of one vessel have one file of configuration, from the first of them.
    let mut write_config = args.write_config.as_deref();
    for (file, name) in args.files.iter().zip(&names) {
        let mut reading = reading_of_all.clone();
        reading.selection.parts = reading.selection.parts.of_log(name);
        if is_black_box(file) {
            if args.latex {
                bail!("{} is a black box: --latex prints the equations of models", file.display());
            }
            let summary = BlackBox::read(file)?.summary();
            if global.json {
                documents.push(black_box::json(file, &summary)?);
            } else {
                black_box::show(file, &summary, global);
            }
        } else if is_model(file) {
            let model = model::read(file)?;
            if args.latex {
                ui::write_out(format_args!("{}", latex(file, &model)?));
            } else if global.json {
                documents.push(model_json(file, &model));
            } else {
                show_model(file, &model);
            }
        } else {
            if args.latex {
                bail!("{} is a log: --latex prints the equations of models", file.display());
            }
            let is_recording = is_recording(file)?;
            if is_recording || args.write_config.is_some() {
                let survey = survey(file, reading.selection.time.as_deref())?;
                let proposal = survey.proposal();
                let written = write_config.take();
                if let Some(path) = written {
                    recording::write_config(path, &survey, &proposal)?;
                }
                if global.json {
                    documents.push(recording::json(&survey, &proposal)?);
                } else {
                    recording::show(&survey, &proposal, global);
                    if let Some(path) = written {
                        outln!("written to {}", path.display());
                    }
                }
                let is_table = matches!(&survey.topics[..], [topic] if !topic.fields.is_empty());
                if args.write_config.is_some() || reading.selection.outputs.is_empty() && !is_table {
                    continue;
                }
            }
            let ((inspection, runs), mut notes) = if is_recording {
                let (mut read, notes) = logs::read(&[file], &mut reading.clone(), global)?;
                (log::inspect_owned(read.remove(0), &reading.selection, &reading.options)?, notes)
            } else {
                (log::inspect_file(file, &reading.selection, &reading.options)?, Vec::new())
            };
            notes.extend(inspection.notes.iter().cloned());
            // A table without velocities may have sensors from which they are computed.
            let proposal = (!is_recording && runs.is_empty() && reading.selection.outputs.is_empty())
                .then(|| recording::of_table(file, &inspection, &reading))
                .flatten();
            if global.json {
                documents.push(log_json(&inspection, &runs, proposal.as_ref())?);
            } else {
                show_log(&inspection);
                show_trials(&trials(&runs));
                // Logs are identified together: what one of them lacks, another one may have.
                if args.files.len() == 1 {
                    lacks::show(&runs);
                }
                ui::print_notes(&notes, global);
                if let Some((_, proposal)) = &proposal {
                    recording::show_proposal(proposal);
                }
            }
            all_runs.extend(runs);
        }
    }
    if args.files.len() > 1 && !all_runs.is_empty() && !global.json {
        outln!("\nall logs together:");
        lacks::show(&all_runs);
    }
    if let Some(path) = &args.plan {
        lacks::write_plan(path, &all_runs, global)?;
    }
    if global.json {
        print_documents(&documents)?;
    }
    Ok(Outcome::Done)
}

fn log_json(
    inspection: &Inspection,
    runs: &[Trajectory],
    proposal: Option<&(Survey, Proposal)>,
) -> anyhow::Result<serde_json::Value> {
    let mut document = serde_json::to_value(inspection)?;
    document["trials"] = json!(trials(runs));
    document["excitation"] = lacks::json(runs);
    if let Some((survey, proposal)) = proposal {
        document["proposal"] = json!(proposal);
        document["config"] = json!(proposal.to_toml(&survey.path));
    }
    Ok(document)
}

fn print_documents(documents: &[serde_json::Value]) -> anyhow::Result<()> {
    match documents {
        [one] => super::print_json(one),
        many => super::print_json(&many),
    }
}

/// A manoeuvring trial in a log.
#[derive(Serialize)]
struct TrialInLog {
    title: String,
    from_s: f64,
    to_s: f64,
    #[serde(flatten)]
    trial: Recognised,
}

/// The manoeuvring trials in a log.
fn trials(runs: &[Trajectory]) -> Vec<TrialInLog> {
    let of = |run: &Trajectory| -> Vec<TrialInLog> {
        let time = |sample: usize| run.t0 + sample as f64 * run.dt;
        let mut boat = Boat::default();
        boat.find(run.inputs.channels());
        let found = recognise(run, &boat).into_iter().map(|trial| TrialInLog {
            title: trial.title(),
            from_s: time(trial.executes[0]),
            to_s: time(trial.end),
            trial,
        });
        found.collect()
    };
    runs.iter().flat_map(of).collect()
}

fn show_trials(trials: &[TrialInLog]) {
    for (i, trial) in trials.iter().enumerate() {
        let head = if i == 0 { "trials" } else { "" };
        outln!("{head:<10} {:.1} to {:.1} s: {}", trial.from_s, trial.to_s, trial.title);
    }
}

/// Whether a file is a vessel or safetensors file, by its extension or its header (eight bytes of length, then JSON).
fn is_model(path: &Path) -> bool {
    if path.extension().is_some_and(|e| ["safetensors", "toml"].iter().any(|of| e.eq_ignore_ascii_case(of))) {
        return true;
    }
    // A pipe can be read only once.
    if !path.metadata().is_ok_and(|m| m.is_file()) {
        return false;
    }
    let mut head = [0; 9];
    File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok()
        && head[8] == b'{'
        && head[4..8] == [0; 4]
}

fn latex(file: &Path, model: &Model) -> anyhow::Result<String> {
    if let Some(motion) = model.equations() {
        return Ok(motion.equations_latex() + &motion.units_latex() + &motion.coefficients_latex());
    }
    if model.craft().is_some() {
        bail!(
            "{} is a vessel: its equations are in the documentation of hydroid_core::craft",
            file.display()
        );
    }
    if model.committee().is_some() {
        bail!(
            "{} is a committee of difference equations: `hydroid inspect --json` lists their terms and coefficients; --methods sindy identifies equations of motion",
            file.display()
        );
    }
    let Some(base) = model.base_equations() else {
        bail!(
            "{} is a network without equations: use `hydroid inspect` without --latex, or identify equations by --methods sindy",
            file.display()
        );
    };
    Ok(format!(
        "% Base equations of the model; a network corrects their prediction.\n{}{}",
        base.equations_latex(),
        base.units_latex()
    ))
}

fn model_json(file: &Path, model: &Model) -> serde_json::Value {
    let mut document = json!({
        "file": file,
        "kind": model.kind(),
        "weights": model.weights(),
        "description": model.description,
    });
    let equations = |motion: NamedEquations<'_>| {
        json!({
            "equations": motion.equations_text(),
            "latex": motion.equations_latex(),
            "latex_units": motion.units_latex(),
            "latex_coefficients": motion.coefficients_latex(),
            "coefficients": motion.coefficients(),
            "correlation": motion.correlations(),
            "jacobian": motion.jacobian_text(),
        })
    };
    if let Some(serde_json::Value::Object(parts)) = model.equations().map(equations) {
        document.as_object_mut().into_iter().for_each(|object| object.extend(parts.clone()));
    }
    if model.committee().is_some() {
        document["members"] = json!(model.named_members());
    }
    if let Some(craft) = model.craft() {
        let number = |(parameter, value): &(CraftParameter, f64)| {
            (parameter.path.clone(), json!({ "value": value, "unit": parameter.unit }))
        };
        document["numbers"] = craft.parameters().iter().map(number).collect::<serde_json::Map<_, _>>().into();
    }
    if let Some(recurrent) = model.recurrent() {
        document["network"] = json!({
            "text": model.network_text(),
            "network": recurrent.network,
            "feedback": recurrent.feedback,
            "wash_out": recurrent.wash_out,
            "wash_out_s": recurrent.wash_out as f64 * model.description.dt,
            "state": recurrent.network.state_len(),
            "scaling": scaling(&recurrent.scaling),
            "tensors": tensors(&recurrent.network.tensors()),
            "base": base(&recurrent.base),
            "base_equations": model.base_equations().map(equations),
        });
    }
    if let Some(direct) = model.direct() {
        document["network"] = json!({
            "text": model.network_text(),
            "network": direct.network,
            "history": direct.history,
            "history_s": direct.history as f64 * model.description.dt,
            "horizon": direct.horizon,
            "horizon_s": direct.horizon as f64 * model.description.dt,
            "base": base(&direct.base),
            "base_equations": model.base_equations().map(equations),
            "members": model.members.len(),
            "scaling": scaling(&direct.scaling),
            "tensors": tensors(&direct.network.tensors()),
        });
    }
    if let Some(affine) = model.control_affine() {
        document["network"] = json!({
            "text": model.network_text(),
            "network": affine.network,
            "effectors": affine.effectors,
            "wash_out": affine.wash_out,
            "wash_out_s": affine.wash_out as f64 * model.description.dt,
            "scaling": scaling(&affine.scaling),
            "tensors": tensors(&affine.network.tensors()),
        });
    }
    document
}

fn base(of: &BaseModel) -> &'static str {
    match of {
        BaseModel::Nothing => "nothing",
        BaseModel::Hold => "hold",
        BaseModel::Equations(_) => "equations",
    }
}

fn scaling(of: &Scaling) -> serde_json::Value {
    json!({
        "output_mean": of.output_mean,
        "output_scale": of.output_scale,
        "input_mean": of.input_mean,
        "input_scale": of.input_scale,
        "correction_scale": of.correction_scale,
    })
}

fn tensors(of: &[Tensor]) -> serde_json::Value {
    of.iter().map(|t| json!({"name": t.name, "shape": t.shape()})).collect()
}

fn show_model(file: &Path, model: &Model) {
    let d = &model.description;
    if model.is_vessel() {
        outln!("{}: vessel '{}', {} parameters", file.display(), d.name, model.weights());
        show_ports(d);
        show_roles(model);
        outln!("parameters:");
        for line in model.plant_text() {
            outln!("  {line}");
        }
        return;
    }
    let numbers = if model.is_network() { "weights" } else { "coefficients" };
    outln!("{}: {} model '{}', {} {numbers}", file.display(), model.kind(), d.name, model.weights());
    outln!("sample time {} s", d.dt);
    show_ports(d);
    show_roles(model);
    if let Some(motion) = model.equations() {
        show_equations("equations", motion);
    }
    if model.committee().is_some() {
        model.network_text().iter().for_each(|line| outln!("{line}"));
    }
    show_network(model);
    let p = &d.provenance;
    let validation = if p.validation.is_empty() {
        String::new()
    } else {
        format!("; validation runs {}", p.validation.join(", "))
    };
    outln!(
        "identified by hydroid {} with seed {}; training runs {}{validation}",
        p.hydroid,
        p.seed,
        p.training.join(", ")
    );
    if let Some(current) = &d.current {
        let column = d.reading.selection.heading.as_ref().map_or("", |heading| &heading.column);
        outln!(
            "motion through the water: the current is estimated along a run with the heading `{column}`, from errors over {:.1} s; standard deviation of its components {:.3} m/s",
            current.window as f64 * d.dt,
            current.initial_m_s
        );
    }
    show_bands(d);
}

/// Half-widths of the prediction bands of 80 % at a quarter, half and the whole of the longest horizon.
fn show_bands(d: &Description) {
    let Some(bands) = &d.bands else { return };
    let (Some(level), Some(&last)) =
        (bands.levels.iter().position(|level| *level == 0.8), bands.horizons.last())
    else {
        return;
    };
    outln!("prediction bands of 80 %:");
    for horizon in [last / 4, last / 2, last].into_iter().filter(|horizon| *horizon > 0) {
        let width = |(c, port): (usize, &Port)| {
            format!(
                "{} ±{:.3e} {}",
                port.channel.name,
                bands.half_width(level, horizon, c),
                port.channel.unit
            )
        };
        let widths: Vec<String> = d.outputs.iter().enumerate().map(width).collect();
        outln!("{:>9.3} s  {}", horizon as f64 * d.dt, widths.join(", "));
    }
}

fn show_ports(d: &Description) {
    let stated = d.stated();
    for (what, ports) in [("output", &d.outputs), ("input", &d.inputs)] {
        for port in ports {
            // A given design range may differ from the range of the training data.
            let kind =
                if stated.contains(&port.channel.name.as_str()) { "design range" } else { "training range" };
            let trained = port
                .training_range
                .map(|seen| format!(", training range {:.4} to {:.4}", seen.low, seen.high));
            outln!(
                "{what:<7} {:<12} {:<8} {kind} {:.4} to {:.4}{}",
                port.channel.name,
                port.channel.unit,
                port.range.low,
                port.range.high,
                trained.unwrap_or_default()
            );
        }
    }
}

/// The role of each input, neutral value and limits of those that are commanded, and how they were found.
pub(super) fn show_roles(model: &Model) {
    let d = &model.description;
    let boat = find_roles(model);
    if d.inputs.is_empty() {
        return;
    }
    let width = d.inputs.iter().map(|port| port.channel.name.len()).max().unwrap_or(0);
    outln!("roles of the inputs of {}:", d.name);
    for port in &d.inputs {
        let name = &port.channel.name;
        let input = boat.inputs.get(name);
        let found = input.and_then(|input| input.found.get(&Property::Role));
        match (boat.role(name), found) {
            (Some(role), None) => outln!("  {name:<width$} {:<12} stated", role.name()),
            (Some(role), Some(found)) => outln!("  {name:<width$} {:<12} found: {found}", role.name()),
            (None, _) => outln!("  {name:<width$} {:<12} state it, as in --role {name}=setting", "unknown"),
        }
    }
    let values = input_values(model).unwrap_or_default();
    let raws = d.raw_inputs();
    let commanded: Vec<_> = values.iter().zip(&raws).filter(|(value, _)| value.is_commanded).collect();
    if commanded.is_empty() {
        return;
    }
    outln!("neutral values and limits:");
    for (value, raw) in commanded {
        outln!("  {:<width$} {}", value.name, value.describe_in_degrees(raw.as_ref()));
    }
}

fn show_equations(heading: &str, motion: NamedEquations<'_>) {
    let coefficients = motion.coefficients_text();
    let units = if coefficients.is_empty() { motion.units_text() } else { Vec::new() };
    for (heading, lines) in [
        (heading, motion.equations_text()),
        ("coefficients ± standard errors (block bootstrap)", coefficients),
        ("units of the coefficients", units),
        ("strongly correlated coefficients, which are only determined together", motion.correlations_text()),
    ] {
        if !lines.is_empty() {
            outln!("{heading}:");
        }
        for line in lines {
            outln!("  {line}");
        }
    }
}

fn show_network(model: &Model) {
    if !model.is_network() {
        return;
    }
    outln!("network:");
    for line in model.network_text() {
        outln!("  {line}");
    }
    outln!("scaling:");
    for line in model.scaling_text() {
        outln!("  {line}");
    }
    if let Some(base) = model.base_equations() {
        show_equations("base equations", base);
    }
    let settings = &model.description.provenance.settings;
    let number = |key: &str| settings[key].as_f64();
    if let (Some(best), Some(epochs)) = (number("best_epoch"), number("epochs")) {
        let figure =
            |name: &str, value: Option<f64>| value.map_or_else(String::new, |x| format!(", {name} {x:.4}"));
        outln!(
            "trained for {epochs} epochs, weights of epoch {best}{}{}",
            figure("loss", number("train_loss")),
            figure("validation NRMSE", number("validation"))
        );
    }
}

fn show_log(inspection: &Inspection) {
    let duration = inspection.duration_s.map_or_else(String::new, |s| format!(", {s:.1} s"));
    outln!("{}: {} rows{duration}", inspection.path, inspection.rows);
    if let Some(clock) = &inspection.clock {
        let kind = if clock.regular { "regular" } else { "irregular" };
        outln!(
            "clock: {kind}, step {} s (shortest {:.4}, longest {:.4}); {} gaps; {:.0} % of the rows repeat the previous row",
            clock.step_s,
            clock.shortest_s,
            clock.longest_s,
            inspection.jumps.len(),
            100.0 * inspection.repeated_rows
        );
    }
    outln!(
        "\n{:<26} {:<8} {:>11} {:>11} {:>11} {:>11} {:>8} {:>8}",
        "column",
        "unit",
        "min",
        "max",
        "mean",
        "std",
        "missing",
        "repeats"
    );
    for c in &inspection.columns {
        let number = |x: Option<f64>| x.map_or_else(|| String::from("-"), |x| format!("{x:.5}"));
        outln!(
            "{:<26} {:<8} {:>11} {:>11} {:>11} {:>11} {:>8} {:>6.0} %",
            c.name,
            c.unit,
            number(c.min),
            number(c.max),
            number(c.mean),
            number(c.std),
            c.missing,
            100.0 * c.repeated
        );
    }
    if !inspection.outputs.is_empty() {
        outln!("\noutputs:");
    }
    for o in &inspection.outputs {
        let noise = o.noise_std.map_or_else(String::new, |s| format!(" noise about {s:.4} {};", o.unit));
        let smooth =
            o.smoothing_window.map_or_else(String::new, |w| format!(" smoothed over about {w} samples"));
        outln!("  {:<12}{noise}{smooth}", o.name);
    }
    if !inspection.inputs.is_empty() {
        outln!("inputs:");
    }
    for i in &inspection.inputs {
        outln!(
            "  {:<12} {} levels, {:.1} changes per minute, {:.0} % of the time at a limit{}",
            i.name,
            i.levels,
            i.moves_per_minute,
            100.0 * i.at_limits,
            i.delay.as_ref().map_or_else(String::new, |d| format!(", {}", delay(d)))
        );
    }
    if let Some(d) = &inspection.input_delay {
        outln!("all inputs together: {}", delay(d));
    }
    outln!("");
}

fn delay(d: &DelayEstimate) -> String {
    let confidence = match d.confidence {
        Confidence::High => "high confidence",
        Confidence::Low => "low confidence",
        Confidence::None => "not identifiable",
    };
    format!("delay about {} samples ({confidence}, {} to {})", d.samples, d.range.0, d.range.1)
}
