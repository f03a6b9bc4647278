//! `hydroid simulate` with an identified model.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use anyhow::ensure;
use hydroid::atomic;
use hydroid::config::ModelPlan;
use hydroid::manoeuvre::Track;
use hydroid::plant::{Record, member_tracks};
use serde_json::json;

use super::super::{Outcome, print_json};
use crate::args::{Global, Simulate};
use crate::ui;

pub(super) fn run(args: &Simulate, plan: &ModelPlan, global: Global) -> anyhow::Result<Outcome> {
    ui::print_notes(&plan.notes, global);
    let output = args.output.clone().unwrap_or_else(|| {
        let stem = Path::new(&args.plant).file_stem().unwrap_or_default().to_string_lossy();
        PathBuf::from(format!("{stem}-simulated-seed{}.csv", args.settings.seed))
    });
    let _lock = super::lock(&output)?;
    let bar = ui::Bar::new("simulating", global);
    let simulated = plan.run(&mut bar.callback())?;
    drop(bar);
    let measured = plan.measured();
    if let Some(file) = &args.figure {
        let members = member_tracks(&plan.model, &plan.options(), &simulated.commands)?;
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
    report(args, &output, &simulated, measured.as_ref(), plan.current, global)?;
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
            "seed": args.settings.seed,
            "figure": args.figure,
            "current": current,
            "distance_at_end_m": last,
            "max_distance_m": most,
        }));
    }
    outln!(
        "{}: {} samples of {} s, seed {}",
        output.display(),
        simulated.len(),
        simulated.dt,
        args.settings.seed
    );
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
