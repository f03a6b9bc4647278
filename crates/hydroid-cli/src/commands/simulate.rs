//! `hydroid simulate`.

mod model;

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use hydroid::atomic::{self, Lock};
use hydroid::excitation::{Circle, Excitation, LawnMower, LowSpeed, Turn};
use hydroid::log::{self, ChannelSpec, Selection};
use hydroid::simulate::{self, Options, Simulated};
use hydroid_core::vessel::{Command, VesselParams};
use serde_json::json;

use super::Outcome;
use crate::args::{Global, Simulate};
use crate::{outputs, ui};

pub fn run(args: &Simulate, global: Global) -> anyhow::Result<Outcome> {
    let written = [("-o", args.output.as_deref()), ("--figure", args.figure.as_deref())];
    // Names of vessels precede files here, and an excitation without an extension is the name of one.
    let plant = Some(Path::new(&args.plant)).filter(|_| simulate::built_in(&args.plant).is_none());
    let file = Some(Path::new(&args.excitation)).filter(|path| path.extension().is_some());
    let read: Vec<&Path> = plant.into_iter().chain(file).collect();
    outputs::check(&written, &read)?;
    if is_model(&args.plant) {
        return model::run(args, global);
    }
    for (option, given) in [
        ("--start", args.start.is_some()),
        ("--process-noise", args.process_noise != 0.0),
        ("--figure", args.figure.is_some()),
        ("--push", !args.push.is_empty()),
        ("--turn", !args.turn.is_empty()),
    ] {
        ensure!(!given, "{option} needs an identified model (.safetensors): '{}' is a vessel", args.plant);
    }
    let vessel = vessel(&args.plant)?;
    if args.print_vessel {
        if global.json {
            super::print_json(&vessel)?;
            return Ok(Outcome::Done);
        }
        ui::write_out(format_args!("{}", simulate::vessel_toml(&vessel)?));
        return Ok(Outcome::Done);
    }
    let (excitation, label) = excitation(args, &vessel)?;
    let duration_s =
        args.duration.or_else(|| excitation.natural_duration_s(args.dt.unwrap_or(0.1))).unwrap_or(7_200.0);
    let path = args
        .output
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{}-{label}-seed{}.csv", vessel.name, args.seed)));
    if global.json && path == Path::new("-") {
        bail!("--json and -o - both write to standard output: name a file with -o");
    }
    let options = Options {
        duration_s,
        dt_s: args.dt.unwrap_or(0.1),
        step_s: args.step.unwrap_or(0.01),
        seed: args.seed,
        noise_scale: args.noise,
        current: args.current.map_or([0.0; 2], |current| current.0),
        ..Options::new(vessel, excitation)
    };
    let _lock = lock(&path)?;
    let record = record(&options, global)?;
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
            "seed": args.seed,
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
            args.seed
        );
    }
    Ok(Outcome::Done)
}

/// Keeps other runs from a file; standard output has no lock.
fn lock(path: &Path) -> anyhow::Result<Option<Lock>> {
    Ok(if path == Path::new("-") { None } else { Some(Lock::new(path)?) })
}

/// Whether a plant is the file of an identified model, or of a vessel with any set of actuators.
fn is_model(plant: &str) -> bool {
    let path = Path::new(plant);
    if simulate::built_in(plant).is_some() {
        return false;
    }
    let is_toml = |extension: &OsStr| extension.eq_ignore_ascii_case("toml");
    match path.extension() {
        Some(extension) if is_toml(extension) => {
            std::fs::read_to_string(path).is_ok_and(|text| hydroid::craft::is_craft(&text))
        }
        extension => extension.is_some(),
    }
}

pub fn record(options: &Options, global: Global) -> anyhow::Result<Simulated> {
    let bar = ui::Bar::new("simulating", global);
    Ok(simulate::simulate(options, &mut bar.callback())?)
}

pub fn vessel(name: &str) -> anyhow::Result<VesselParams> {
    if let Some(vessel) = simulate::built_in(name) {
        return Ok(vessel);
    }
    match name {
        file if Path::new(file).extension().is_some() => Ok(simulate::load_vessel(file)?),
        other => bail!(
            "'{other}' is not a plant: write simple, hydrofoil, hydrofoil-low-speed, or the name of a vessel file (.toml) or of an identified model (.safetensors); `hydroid simulate hydrofoil --print-vessel` prints a template"
        ),
    }
}

fn excitation(args: &Simulate, vessel: &VesselParams) -> anyhow::Result<(Excitation, String)> {
    let kind = args.excitation.as_str();
    let lawn_mower = args.leg.is_some() || args.spacing.is_some() || !args.leg_speeds.is_empty();
    for (option, given, kinds) in [
        (
            "--leg, --spacing, --leg-speeds and --sharp-turns",
            lawn_mower || args.sharp_turns,
            &["lawn-mower"][..],
        ),
        ("--radius", args.radius.is_some(), &["circle"]),
        ("--speed", args.speed.is_some(), &["circle", "low-speed", "lawn-mower"]),
    ] {
        if given && !kinds.contains(&kind) {
            bail!("{option} cannot be used with --excitation {kind}: it needs {}", kinds.join(", "));
        }
    }
    let excitation = match kind {
        "mixed" => Excitation::Mixed,
        "low-speed" => {
            Excitation::LowSpeed(args.speed.map_or_else(LowSpeed::default, |ceiling| LowSpeed { ceiling }))
        }
        "lawn-mower" => Excitation::LawnMower(LawnMower {
            leg: args.leg,
            spacing: args.spacing,
            turn: if args.sharp_turns { Turn::Sharp { speed: args.speed } } else { Turn::Arc },
            speeds: args.leg_speeds.clone(),
        }),
        "circle" => Excitation::Circle(Circle { radius: args.radius, speed: args.speed }),
        file if Path::new(file).extension().is_some() => {
            let rows = commands(Path::new(file), vessel)?;
            return Ok((Excitation::Given(rows), String::from("commands")));
        }
        other => bail!(
            "'{other}' is not an excitation: write mixed, low-speed, lawn-mower, circle, or the name of a CSV file with time and the two commands"
        ),
    };
    Ok((excitation, kind.to_owned()))
}

/// Commands from a CSV file with time and the two commands of the vessel.
fn commands(path: &Path, vessel: &VesselParams) -> anyhow::Result<Vec<(f64, Command)>> {
    let raw = log::read(path)?;
    let [propeller, rudder] = [&vessel.commands.propeller, &vessel.commands.rudder];
    let spec = |name: &str| vec![ChannelSpec::named(name)];
    let selection =
        Selection { outputs: spec(&propeller.name), inputs: spec(&rudder.name), ..Selection::default() };
    let table = log::rows(&raw, &selection).with_context(|| {
        format!(
            "{} must have a time column and the commands '{}' and '{}'",
            path.display(),
            propeller.name,
            rudder.name
        )
    })?;
    Ok(table.into_iter().map(|(t, row)| (t, Command { pp: row[0], rd: row[1] })).collect())
}
