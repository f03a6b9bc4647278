//! `hydroid simulate` with an identified model.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use hydroid::atomic;
use hydroid::log::{self, ChannelSpec, Selection, Trajectory};
use hydroid::manoeuvre::Track;
use hydroid::model::{self, Model};
use hydroid::plant::{Commands, InputMap, Record, RecordOptions, current_before, member_tracks, record};
use serde_json::json;

use super::super::{Outcome, print_json};
use crate::args::{Global, Simulate};
use crate::{logs, ui};

pub(super) fn run(args: &Simulate, global: Global) -> anyhow::Result<Outcome> {
    let path = Path::new(&args.plant);
    let model = model::read(path)?;
    check_options(args, &model)?;
    if args.print_vessel
        && let Some(file) = model.craft_file()
    {
        ui::write_out(format_args!("{}", file.text()));
        return Ok(Outcome::Done);
    }
    let dt = args.dt.unwrap_or(model.description.dt);
    let model = model.at_step(dt)?;
    let commands = match Path::new(&args.excitation).extension() {
        Some(_) => given(Path::new(&args.excitation), &model, args, global)?,
        None => Given::Mixed,
    };
    let options = RecordOptions {
        commands: match &commands {
            Given::Mixed => Commands::Mixed { duration_s: args.duration.unwrap_or(7_200.0) },
            Given::Rows(rows) => Commands::Given(rows.clone()),
            Given::Log { run, from } => Commands::Run { run, from: *from },
        },
        seed: args.seed,
        noise: args.noise,
        process_noise: args.process_noise,
        current: match (&args.current, &commands) {
            (Some(current), _) => current.0,
            (None, Given::Log { run, from }) => current_before(&model, run, *from),
            (None, Given::Mixed | Given::Rows(_)) => [0.0; 2],
        },
    };
    // Commands of a file need no map.
    let map = match commands {
        Given::Mixed => Some(InputMap::with(&model, &args.push, &args.turn)?),
        Given::Rows(_) | Given::Log { .. } => None,
    };
    let output = args.output.clone().unwrap_or_else(|| {
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        PathBuf::from(format!("{stem}-simulated-seed{}.csv", args.seed))
    });
    let _lock = super::lock(&output)?;
    let simulated = record(&model, map.as_ref(), &options)?;
    let measured = match &commands {
        Given::Log { run, from } => Track::measured(run, *from, run.len() - 1),
        Given::Mixed | Given::Rows(_) => None,
    };
    if let Some(file) = &args.figure {
        let members = member_tracks(&model, &options, &simulated.commands)?;
        let measured = measured.as_ref().map(|track| track.eta.as_slice());
        let figure = hydroid_report::simulated_track(&simulated.eta, &members, measured)?;
        atomic::write(file, |out| out.write_all(figure.as_bytes()))?;
    }
    if output == Path::new("-") {
        ensure!(!global.json, "--json and -o - both write to standard output: name a file with -o");
        let mut out = io::stdout().lock();
        match simulated.write_csv(&mut out).and_then(|()| out.flush()) {
            // A closed pipe (`| head`) is not an error.
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => return Err(error.into()),
            _ => return Ok(Outcome::Done),
        }
    }
    atomic::write(&output, |out| simulated.write_csv(out))?;
    report(args, &output, &simulated, measured.as_ref(), options.current, global)?;
    Ok(Outcome::Done)
}

fn report(
    args: &Simulate,
    output: &Path,
    simulated: &Record,
    measured: Option<&Track>,
    current: [f64; 2],
    global: Global,
) -> anyhow::Result<()> {
    let duration_s = simulated.len() as f64 * simulated.dt;
    let distances: Vec<f64> = measured
        .map(|track| {
            let pairs = track.eta.iter().zip(&simulated.eta);
            pairs.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).collect()
        })
        .unwrap_or_default();
    let last = distances.last().copied();
    let most = distances.iter().copied().reduce(f64::max);
    if global.json {
        return print_json(&json!({
            "file": output,
            "model": args.plant,
            "excitation": args.excitation,
            "samples": simulated.len(),
            "dt": simulated.dt,
            "duration_s": duration_s,
            "seed": args.seed,
            "figure": args.figure,
            "current": current,
            "distance_at_end_m": last,
            "max_distance_m": most,
        }));
    }
    outln!("{}: {} samples of {} s, seed {}", output.display(), simulated.len(), simulated.dt, args.seed);
    if current != [0.0; 2] {
        outln!("current: {:.3}, {:.3} m/s (north, east)", current[0], current[1]);
    }
    if let (Some(last), Some(most)) = (last, most) {
        outln!("distance from the measured path: {last:.2} m after {duration_s:.1} s, at most {most:.2} m");
    }
    if let Some(file) = &args.figure {
        outln!("{}: tracks", file.display());
    }
    Ok(())
}

/// Commands of the simulation.
enum Given {
    Mixed,
    Rows(Vec<f64>),
    /// A log with the outputs of the model, up to the end of the simulation.
    Log {
        run: Trajectory,
        from: usize,
    },
}

fn given(file: &Path, model: &Model, args: &Simulate, global: Global) -> anyhow::Result<Given> {
    let reading = &model.description.reading;
    let raw = log::read(file)?;
    let prepared = log::prepare(std::slice::from_ref(&raw), &reading.selection, &reading.options);
    if let Ok(prepared) = prepared {
        ui::print_notes(&prepared.notes, global);
        let model = logs::with_current(model.clone(), None, &prepared.runs)?;
        model.check(&prepared.runs)?;
        let time_s = args.start.map_or(0.0, |start| start.0);
        let begin = prepared.runs.first().map_or(0.0, |run| run.t0);
        let sample = |run: &Trajectory| ((begin + time_s - run.t0) / run.dt).round();
        let holds = |run: &&Trajectory| (0.0..(run.len() as f64 - 1.0)).contains(&sample(run));
        let Some(run) = prepared.runs.iter().find(holds) else {
            bail!("--start {time_s}: {} has no samples there, or too few after it", file.display());
        };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index of the run")]
        let from = sample(run) as usize;
        let end = match args.duration {
            Some(duration) => from.saturating_add(samples(duration, run.dt)?).min(run.len()),
            None => run.len(),
        };
        return Ok(Given::Log { run: run.slice(0, end), from });
    }
    ensure!(
        args.start.is_none(),
        "--start needs a log with the outputs of the model: {} has only commands",
        file.display()
    );
    // A table has outputs and inputs: the first input, and the others.
    let mut inputs: Vec<ChannelSpec> = reading.selection.inputs.clone();
    let first = inputs.drain(..inputs.len().min(1)).collect::<Vec<_>>();
    if inputs.is_empty() {
        inputs.extend(
            first.iter().map(|spec| ChannelSpec { name: format!("{} again", spec.name), ..spec.clone() }),
        );
    }
    let selection = Selection { outputs: first, inputs, ..Selection::default() };
    let names = || model.description.inputs.iter().map(|port| port.channel.name.as_str()).collect::<Vec<_>>();
    let rows = log::rows(&raw, &selection).with_context(|| {
        format!(
            "{} must have a time column and the inputs of the model, {}",
            file.display(),
            names().join(", ")
        )
    })?;
    let count = model.description.inputs.len();
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { bail!("{}: no rows", file.display()) };
    let dt = model.description.dt;
    let steps = samples(args.duration.unwrap_or(last.0 - first.0 + dt), dt)?;
    let mut held = Vec::with_capacity(steps * count);
    let mut row = 0;
    for k in 0..steps {
        let t = first.0 + k as f64 * dt + 1e-6 * dt;
        while row + 1 < rows.len() && rows[row + 1].0 <= t {
            row += 1;
        }
        held.extend_from_slice(&rows[row].1[..count]);
    }
    if let Some(k) = held.iter().position(|value| !value.is_finite()) {
        let name = names()[k % count].to_owned();
        bail!("{}: a command of '{name}' is missing: fill the cell, or leave the row out", file.display());
    }
    Ok(Given::Rows(held))
}

fn samples(duration_s: f64, dt: f64) -> anyhow::Result<usize> {
    let samples = (duration_s / dt).round();
    ensure!(
        (1.0..=5e7).contains(&samples),
        "the duration {duration_s} s must hold between one and 50 million samples of {dt} s"
    );
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by the check")]
    Ok(samples as usize)
}

fn check_options(args: &Simulate, model: &Model) -> anyhow::Result<()> {
    let identified = !model.is_vessel();
    for (option, given) in
        [("--dt", args.dt.is_some() && identified), ("--print-vessel", args.print_vessel && identified)]
    {
        ensure!(!given, "{option} needs a vessel: '{}' is an identified model", args.plant);
    }
    for (option, given) in [
        ("--step", args.step.is_some()),
        ("--leg", args.leg.is_some()),
        ("--spacing", args.spacing.is_some()),
        ("--leg-speeds", !args.leg_speeds.is_empty()),
        ("--sharp-turns", args.sharp_turns),
        ("--radius", args.radius.is_some()),
        ("--speed", args.speed.is_some()),
    ] {
        ensure!(
            !given,
            "{option} needs a vessel with one propeller and one rudder: '{}' has inputs of its own",
            args.plant
        );
    }
    ensure!(
        args.excitation == "mixed" || Path::new(&args.excitation).extension().is_some(),
        "--excitation {} needs a vessel with one propeller and one rudder: with '{}' write mixed, or the name of a CSV file with time and its inputs",
        args.excitation,
        args.plant
    );
    Ok(())
}
