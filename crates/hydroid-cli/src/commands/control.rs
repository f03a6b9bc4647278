//! `hydroid control`.

mod setup;

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, bail, ensure};
use hydroid::atomic;
use hydroid::closed_loop::{
    self, Conditions, ControlMethod, ControllerOptions, Metrics, MonteCarlo, Run, Scenario, Summary,
    TunedAutopilot, monte_carlo, tune_autopilot,
};
use hydroid::model::{self, Model};
use hydroid_report::Steered;
use serde::Serialize;
use serde_json::{Value, json};

use super::Outcome;
use super::simulate;
use crate::args::{Control, Global};
use crate::ui;

/// What `--json` prints of one voyage.
#[derive(Serialize)]
struct Told<'a, T> {
    #[serde(flatten)]
    result: &'a T,
    controller: &'a Value,
    tuning: Option<&'a TunedAutopilot>,
    plant: &'a str,
    task: &'a Value,
    conditions: &'a Conditions,
}

pub fn run(args: &Control, global: Global) -> anyhow::Result<Outcome> {
    setup::check_meant(args)?;
    let vessel = simulate::vessel(&args.plant)?;
    let kind = setup::kind(args.helm.controller);
    let model = model(args, kind)?;
    let dt = setup::sample_time(args, model.as_ref())?;
    let model = model.map(|model| model.at_step(dt)).transpose()?;
    let (task, pace) = setup::task(&args.task)?;
    let scene = setup::scene(args, &vessel, &task, &pace, dt)?;
    let from_s = setup::from_s(args, &scene)?;
    let conditions = setup::conditions(&args.sea);
    let mut steering = setup::steering(args, kind, &scene)?;
    if args.learn.adapt {
        let Some(model) = &model else { bail!("--adapt is for controllers with a model: pid has none") };
        steering.adapt = Some(setup::learning(&args.learn, model)?);
        let reading = &model.description.reading;
        let of = (args.model.as_deref().unwrap_or(Path::new("")), model);
        let shore = &args.learn.shore;
        let shore = crate::logs::shore(shore, args.learn.shore_time.0, of, reading, global)?;
        steering.rehearsal = shore.walked.into();
    }
    steering.model = model.map(Arc::new);
    // A law that cannot invert the model says so before anything is done.
    let mut tuned = None;
    if kind == ControlMethod::Autopilot {
        let bar = ui::Bar::new("tuning the autopilot", global);
        let found = tune_autopilot(&scene, pace.cruise, from_s, &mut bar.callback())?;
        steering.autopilot = Some(found.settings);
        tuned = Some(found);
    }
    let mut controller = steering.controller(conditions.seed).context("this vessel cannot be steered so")?;
    if let Some(folder) = &args.output {
        atomic::probe(folder)?;
    }
    let many = (args.fleet.runs != 1).then(|| many(args, &steering, &scene, &conditions, from_s, global));
    let many = many.transpose()?;
    // Of many the first is shown sample by sample.
    let shown = many.as_ref().and_then(|many| many.trials.first()).map_or(conditions, |o| o.conditions);
    let bar = ui::Bar::new("steering", global);
    let run = closed_loop::run(&scene, &shown, controller.as_mut(), &mut bar.callback())?;
    drop(bar);
    let metrics = Metrics::of(&run, from_s);
    let controller = setup::told(args, &steering);
    let task = json!({ "path": task, "pace": pace, "duration_s": scene.duration_s, "dt_s": scene.dt_s, "tolerance_m": scene.tolerance });
    let result = match &many {
        Some(many) => serde_json::to_value(many)?,
        None => serde_json::to_value(&metrics)?,
    };
    let told = Told {
        result: &result,
        controller: &controller,
        tuning: tuned.as_ref(),
        plant: &vessel.name,
        task: &task,
        conditions: &conditions,
    };
    if let Some(folder) = &args.output {
        let made = Made { args, steering: &steering, scene: &scene, run: &run, metrics: &metrics };
        made.write(folder, many.as_ref(), tuned.as_ref(), &told)?;
    }
    if global.json {
        super::print_json(&told)?;
    } else {
        if let Some(tuned) = &tuned {
            show_tuning(tuned);
        }
        match &many {
            Some(many) => show_many(many),
            None => show(&metrics),
        }
        if let Some(folder) = &args.output {
            outln!("{}: track.csv, control.json, report.html", folder.display());
        }
    }
    let sound = match &many {
        Some(many) => many.held == many.runs && many.violations == 0,
        None => metrics.held && metrics.violations == 0,
    };
    Ok(if sound { Outcome::Done } else { Outcome::Missed })
}

/// The model, which every controller but one needs.
fn model(args: &Control, kind: ControlMethod) -> anyhow::Result<Option<Model>> {
    match (&args.model, kind) {
        (None, ControlMethod::Autopilot) => Ok(None),
        (Some(path), ControlMethod::Autopilot) => bail!(
            "{}: pid steers without a model: leave it out, or use --controller cem, fl or backstepping",
            path.display()
        ),
        (None, _) => bail!(
            "{} steers by a model: give a .safetensors file of `hydroid identify`, a vessel (.toml), or hydrofoil, hydrofoil-low-speed, simple; or use --controller pid, which has none",
            kind.name()
        ),
        (Some(path), _) => Ok(Some(model::read(path)?)),
    }
}

fn many(
    args: &Control,
    steering: &ControllerOptions,
    scene: &Scenario,
    conditions: &Conditions,
    from_s: f64,
    global: Global,
) -> anyhow::Result<MonteCarlo> {
    ensure!(args.fleet.runs <= 1_000_000, "--runs {}: a million at the most", args.fleet.runs);
    let bar = ui::Bar::new("voyages", global);
    let spread = setup::spread(&args.fleet);
    Ok(monte_carlo(steering, scene, conditions, &spread, args.fleet.runs, from_s, &mut bar.callback())?)
}

/// What goes into the folder.
struct Made<'a> {
    args: &'a Control,
    steering: &'a ControllerOptions,
    scene: &'a Scenario,
    run: &'a Run,
    metrics: &'a Metrics,
}

impl Made<'_> {
    fn write<T: Serialize>(
        &self,
        folder: &Path,
        fleet: Option<&MonteCarlo>,
        tuned: Option<&TunedAutopilot>,
        told: &Told<'_, T>,
    ) -> anyhow::Result<()> {
        let Self { args, steering, scene, run, metrics } = self;
        atomic::write(&folder.join("track.csv"), |out| run.write_csv(&scene.vessel, out))?;
        let mut text = serde_json::to_string_pretty(told)?;
        text.push('\n');
        atomic::write(&folder.join("control.json"), |out| out.write_all(text.as_bytes()))?;
        let title = format!("ControllerOptions {}: {}", scene.vessel.name, steering.method.name());
        let page = hydroid_report::steering(&Steered {
            title: &title,
            command: &ui::command_line(),
            facts: &setup::facts(args, steering, scene),
            vessel: &scene.vessel,
            path: &scene.track.path,
            run,
            metrics,
            fleet,
            tuned,
        })?;
        atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
        Ok(())
    }
}

fn show(m: &Metrics) {
    outln!(
        "position      {:>9.4} m    RMS distance from the reference, from {} s on",
        m.rms_position,
        m.from_s
    );
    outln!("cross-track   {:>9.4} m    RMS, at most {:.4} m", m.rms_cross_track, m.max_cross_track);
    outln!("speed         {:>9.4} m/s  RMS", m.rms_speed);
    match m.settled_after {
        Some(after) => outln!("settled after {after:>9.1} s"),
        None => outln!("settled after         - "),
    }
    outln!("saturated     {:>9.1} %    of {:.1} s", 100.0 * m.saturated, m.duration_s);
    let (median, max) = (m.us_per_command.median, m.us_per_command.max);
    outln!("command       {median:>9.1} us   median, {max:.1} us at most");
    let status: Vec<String> = m.status.iter().map(|(name, count)| format!("{name} {count}")).collect();
    outln!("status        {}", status.join(", "));
    if m.arrived == Some(false) {
        outln!("the end of the path was not reached");
    }
    if m.diverged {
        outln!("the state of the vessel stopped being a number");
    }
    if m.violations > 0 {
        outln!("{} commands were outside of their limits", m.violations);
    }
}

fn show_many(f: &MonteCarlo) {
    outln!("{} voyages: {} held their course, {} diverged", f.runs, f.held, f.diverged);
    outln!(
        "commands outside of their limits: {}; samples lost without a status that says so: {}",
        f.violations,
        f.undetected_losses
    );
    outln!("{:<24} {:>10} {:>10} {:>10}", "", "median", "95 %", "max");
    let line = |name: &str, s: &Summary| {
        outln!("{name:<24} {:>10.4} {:>10.4} {:>10.4}", s.median, s.p95, s.max);
    };
    line("position [m], RMS", &f.rms_position);
    line("cross-track [m], RMS", &f.rms_cross_track);
    line("cross-track [m], most", &f.max_cross_track);
    line("speed [m/s], RMS", &f.rms_speed);
}

fn show_tuning(tuned: &TunedAutopilot) {
    let best = &tuned.best;
    outln!(
        "tuned on {} seeds of its own, best of {}: omega {:.2} rad/s, look-ahead {:.2} m, integral {:.2} m/s, speed gain {:.1} N s/m, exponent {}; cross-track and speed error together {:.4}",
        tuned.seeds.len(),
        tuned.tried,
        best.omega,
        best.lookahead,
        best.sigma,
        best.proportional,
        best.exponent,
        tuned.score
    );
}
