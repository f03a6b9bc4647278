//! `hydroid inspect`.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::bail;
use hydroid::log::inspect::{Confidence, DelayEstimate};
use hydroid::log::{self, Inspection};
use hydroid::model::{self, Model, Reading};
use serde_json::json;

use super::Outcome;
use crate::args::{Global, Inspect};
use crate::{logs, ui};

pub fn run(args: &Inspect, global: Global) -> anyhow::Result<Outcome> {
    if args.latex && global.json {
        bail!("--latex and --json both say what to print: leave one out (--json has the LaTeX too)");
    }
    let reading = logs::reading(Reading::default(), &args.log)?;
    let mut documents = Vec::new();
    for file in &args.files {
        if is_model(file) {
            let model = model::read(file)?;
            if args.latex {
                ui::write_out(format_args!("{}{}", model.equations_latex(), model.units_latex()));
            } else if global.json {
                documents.push(model_json(file, &model));
            } else {
                show_model(file, &model);
            }
        } else {
            if args.latex {
                bail!("{} is a log: --latex prints the equations of models", file.display());
            }
            let inspection = log::inspect(&log::read(file)?, &reading.selection, &reading.options)?;
            if global.json {
                documents.push(serde_json::to_value(&inspection)?);
            } else {
                show_log(&inspection);
                ui::tell(&inspection.notes, global);
            }
        }
    }
    if global.json {
        // One file gives its document, several give a list of theirs.
        match documents.as_slice() {
            [one] => super::print_json(one)?,
            many => super::print_json(&many)?,
        }
    }
    Ok(Outcome::Done)
}

/// A safetensors file says so by its name, or by its head: eight bytes of length, then JSON.
fn is_model(path: &Path) -> bool {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("safetensors")) {
        return true;
    }
    // A pipe gives its bytes once: only the log reader may take them.
    if !path.metadata().is_ok_and(|m| m.is_file()) {
        return false;
    }
    let mut head = [0; 9];
    File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok()
        && head[8] == b'{'
        && head[4..8] == [0; 4]
}

fn model_json(file: &Path, model: &Model) -> serde_json::Value {
    json!({
        "file": file,
        "kind": model.kind(),
        "weights": model.weights(),
        "description": model.description,
        "equations": model.equations_text(),
        "latex": model.equations_latex(),
        "latex_units": model.units_latex(),
        "coefficients": model.coefficients(),
        "jacobian": model.jacobian_text(),
    })
}

fn show_model(file: &Path, model: &Model) {
    let d = &model.description;
    outln!("{}: {} model '{}', {} coefficients", file.display(), model.kind(), d.name, model.weights());
    outln!("sample time {} s", d.dt);
    for (what, ports) in [("output", &d.outputs), ("input", &d.inputs)] {
        for port in ports {
            outln!(
                "{what:<7} {:<12} {:<8} trained from {:.4} to {:.4}",
                port.channel.name,
                port.channel.unit,
                port.range.low,
                port.range.high
            );
        }
    }
    outln!("equations:");
    for equation in model.equations_text() {
        outln!("  {equation}");
    }
    outln!("units of the coefficients:");
    for line in model.units_text() {
        outln!("  {line}");
    }
    let p = &d.provenance;
    outln!(
        "made by hydroid {} with seed {} from {}, chosen on {}",
        p.hydroid,
        p.seed,
        p.training.join(", "),
        p.validation.join(", ")
    );
}

fn show_log(inspection: &Inspection) {
    let duration = inspection.duration_s.map_or_else(String::new, |s| format!(", {s:.1} s"));
    outln!("{}: {} rows{duration}", inspection.path, inspection.rows);
    if let Some(clock) = &inspection.clock {
        let kind = if clock.regular { "regular" } else { "irregular" };
        outln!(
            "clock: {kind}, step {} s (shortest {:.4}, longest {:.4}); {} longer gaps; {:.0} % of the rows repeat the one before",
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
            "  {:<12} {} levels, {:.1} moves a minute, {:.0} % of the time at a limit{}",
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
        Confidence::High => "sure",
        Confidence::Low => "uncertain",
        Confidence::None => "not to be told",
    };
    format!("delay about {} samples ({confidence}, {} to {})", d.samples, d.range.0, d.range.1)
}
