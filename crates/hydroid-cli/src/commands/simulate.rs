//! `hydroid simulate`.

mod model;

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::bail;
use hydroid::atomic::{self, Lock};
use hydroid::config::{Drive, Plan, Plant, PlantKind};
use hydroid::craft;
use hydroid::simulate::{self, Options, Simulated};
use serde_json::json;

use super::Outcome;
use crate::args::{Global, Simulate};
use crate::{outputs, ui};

pub fn run(args: &Simulate, global: Global) -> anyhow::Result<Outcome> {
    let written = [("-o", args.output.as_deref()), ("--figure", args.figure.as_deref())];
    // Names of vessels precede files here, and an excitation without an extension is one of a kind.
    let plant = Some(Path::new(&args.plant)).filter(|_| craft::built_in(&args.plant).is_none());
    let file = Some(Path::new(&args.excitation)).filter(|path| path.extension().is_some());
    let read: Vec<&Path> = plant.into_iter().chain(file).collect();
    outputs::check(&written, &read)?;
    let plant = Plant::read(&args.plant)?;
    if args.figure.is_some() && matches!(plant.kind, PlantKind::Vessel(_)) {
        bail!("--figure needs an identified model (.safetensors): '{}' is a vessel", args.plant);
    }
    if args.print_vessel {
        if global.json {
            super::print_json(&plant.vessel_json()?)?;
        } else {
            ui::write_out(format_args!("{}", plant.vessel_text()?));
        }
        return Ok(Outcome::Done);
    }
    match args.settings.plan(&plant, &Drive::read(&args.excitation)?)? {
        Plan::Vessel { options, label } => vessel(args, &options, &label, global),
        Plan::Model(plan) => model::run(args, &plan, global),
    }
}

fn vessel(args: &Simulate, options: &Options, label: &str, global: Global) -> anyhow::Result<Outcome> {
    let path = args.output.clone().unwrap_or_else(|| {
        PathBuf::from(format!("{}-{label}-seed{}.csv", options.vessel.name, args.settings.seed))
    });
    if global.json && path == Path::new("-") {
        bail!("--json and -o - both write to standard output: name a file with -o");
    }
    let _lock = lock(&path)?;
    let record = record(options, global)?;
    if path == Path::new("-") {
        let mut out = io::stdout().lock();
        match record.write_csv(&mut out).and_then(|()| out.flush()) {
            // A closed pipe (`| head`) is not an error.
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => return Err(error.into()),
            _ => return Ok(Outcome::Done),
        }
    }
    atomic::write(&path, |out| record.write_csv(out))?;
    let speeds = record.states().iter().map(|s| s.u);
    let (low, high) = speeds.fold((f64::NAN, f64::NAN), |(a, b), u| (a.min(u), b.max(u)));
    if global.json {
        super::print_json(&json!({
            "file": path,
            "vessel": options.vessel.name,
            "excitation": label,
            "samples": record.len(),
            "dt": record.dt_s(),
            "duration_s": record.len() as f64 * record.dt_s(),
            "seed": args.settings.seed,
            "u_min": low,
            "u_max": high,
        }))?;
    } else {
        outln!(
            "{}: {} samples of {} s, {} under {label}, u from {low:.2} to {high:.2} m/s, seed {}",
            path.display(),
            record.len(),
            record.dt_s(),
            options.vessel.name,
            args.settings.seed
        );
    }
    Ok(Outcome::Done)
}

/// Keeps other runs from a file; standard output has no lock.
fn lock(path: &Path) -> anyhow::Result<Option<Lock>> {
    Ok(if path == Path::new("-") { None } else { Some(Lock::new(path)?) })
}

pub fn record(options: &Options, global: Global) -> anyhow::Result<Simulated> {
    let bar = ui::Bar::new("simulating", global);
    Ok(simulate::simulate(options, &mut bar.callback())?)
}
