//! `hydroid control`.

mod service;
mod setup;

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, bail, ensure};
use hydroid::atomic::{self, Lock};
use hydroid::closed_loop::{
    self, Conditions, ControlMethod, ControllerOptions, Metrics, MonteCarlo, Run, Scenario, Summary,
    TunedAutopilot, tune_autopilot,
};
use hydroid::model::{self, Model};
use hydroid::plant::check_station;
use hydroid_report::ClosedLoopReport;
use serde::Serialize;
use serde_json::{Value, json};

use super::Outcome;
use crate::args::{Control, Global};
use crate::ui;

#[derive(Serialize)]
struct Document<'a, T> {
    #[serde(flatten)]
    result: &'a T,
    controller: &'a Value,
    tuning: Option<&'a TunedAutopilot>,
    plant: &'a str,
    task: &'a Value,
    conditions: &'a Conditions,
}

pub fn run(args: &Control, global: Global) -> anyhow::Result<Outcome> {
    setup::check_options(args)?;
    service::check_options(args)?;
    let kind = setup::kind(args.controller.controller);
    let model = args.model.as_deref().map(|path| model(args, kind, path)).transpose()?;
    let plant = match &args.plant {
        Some(path) => model::read(path)?,
        None => model.clone().with_context(|| setup::no_model(kind))?,
    };
    ensure!(kind == ControlMethod::Autopilot || model.is_some(), setup::no_model(kind));
    let dt = setup::sample_time(args, model.as_ref(), &plant)?;
    let model = model.map(|model| model.at_step(dt)).transpose()?;
    let plant = Arc::new(plant.at_step(dt)?);
    let size = setup::Size::of(args, &plant, model.as_ref())?;
    let setup::Route { task, pace, origin_deg } = setup::task(&args.task, &size)?;
    let scene = setup::scenario(args, Arc::clone(&plant), &task, &pace, size.scale, dt)?;
    if scene.track.is_station {
        let limits: Vec<[f64; 2]> = scene.limits.iter().map(|limits| [limits.low, limits.high]).collect();
        check_station(&plant, &limits)?;
    }
    let from_s = setup::from_s(args, &scene)?;
    let conditions = setup::conditions(&args.disturbances);
    let mut steering = setup::steering(args, kind, &scene, size.scale)?;
    if args.adaptation.adapt {
        let Some(model) = model.as_ref().filter(|_| kind != ControlMethod::Autopilot) else {
            bail!("--adapt needs a controller that predicts with a model; pid does not: leave --adapt out");
        };
        steering.adapt = Some(setup::adaptation(&args.adaptation, model)?);
        let reading = &model.description.reading;
        let of = (args.model.as_deref().unwrap_or(Path::new("")), model);
        let files = &args.adaptation.training_log;
        let training =
            crate::logs::training_logs(files, args.adaptation.training_time.0, of, reading, global)?;
        steering.rehearsal = training.replayed.into();
    }
    // Built before any simulation, so that a model that it cannot invert is refused early.
    let mut tuned = None;
    let model = model.map(Arc::new);
    if kind == ControlMethod::Autopilot {
        let base = model.clone().unwrap_or_else(|| Arc::clone(&plant));
        let inputs = setup::inputs(args, &base, &scene)?;
        let own = Scenario { plant: base.into(), ..scene.clone() };
        let bar = ui::Bar::new("tuning the PID", global);
        let found = tune_autopilot(&own, &inputs, pace.cruise, from_s, &mut bar.callback())?;
        steering.autopilot = Some(found.gains.clone());
        tuned = Some(found);
    } else {
        steering.model = model;
    }
    if let (Some(stream), Some(file)) = (&args.stream, &args.model) {
        let model = steering.model.clone().unwrap_or(plant);
        let controller = setup::description(args, &steering);
        let task = json!({ "path": task, "pace": pace, "dt_s": scene.dt_s, "tolerance_m": scene.tolerance, "limits": format!("{:?}", scene.limits), "origin_deg": origin_deg });
        return service::run(
            args,
            global,
            &service::Steered {
                stream,
                file,
                model: &model,
                scene: &scene,
                steering: &steering,
                controller: &controller,
                task: &task,
                origin_deg,
            },
        );
    }
    let task = json!({ "path": task, "pace": pace, "duration_s": scene.duration_s, "dt_s": scene.dt_s, "tolerance_m": scene.tolerance, "scale": size.scale, "response": size.response });
    let prepared =
        Prepared { steering: &steering, scene: &scene, conditions: &conditions, from_s, tuned, task: &task };
    simulate(args, global, &prepared)
}

/// All that a simulated run needs.
struct Prepared<'a> {
    steering: &'a ControllerOptions,
    scene: &'a Scenario,
    conditions: &'a Conditions,
    from_s: f64,
    tuned: Option<TunedAutopilot>,
    task: &'a Value,
}

fn simulate(args: &Control, global: Global, prepared: &Prepared<'_>) -> anyhow::Result<Outcome> {
    let Prepared { steering, scene, conditions, from_s, ref tuned, task } = *prepared;
    let mut controller = steering
        .controller(conditions.seed)
        .context("this controller cannot be used with this model and vessel")?;
    let _lock = match &args.output {
        Some(folder) => {
            atomic::probe(folder)?;
            Some(Lock::new(folder)?)
        }
        None => None,
    };
    let many =
        (args.monte_carlo.runs != 1).then(|| monte_carlo(args, steering, scene, conditions, from_s, global));
    let many = many.transpose()?;
    // The track is that of the first trial.
    let shown = many.as_ref().and_then(|many| many.trials.first()).map_or(*conditions, |o| o.conditions);
    let bar = ui::Bar::new("simulating the closed loop", global);
    let run = closed_loop::run(scene, &shown, controller.as_mut(), &mut bar.callback())?;
    drop(bar);
    let metrics = Metrics::of(&run, from_s);
    let controller = setup::description(args, steering);
    let result = match &many {
        Some(many) => serde_json::to_value(many)?,
        None => serde_json::to_value(&metrics)?,
    };
    let document = Document {
        result: &result,
        controller: &controller,
        tuning: tuned.as_ref(),
        plant: scene.plant.name(),
        task,
        conditions,
    };
    if let Some(folder) = &args.output {
        let files = OutputFiles { args, steering, scene, run: &run, metrics: &metrics };
        files.write(folder, many.as_ref(), tuned.as_ref(), &document)?;
    }
    if global.json {
        super::print_json(&document)?;
    } else {
        if let Some(tuned) = tuned {
            print_tuning(tuned);
        }
        match &many {
            Some(many) => print_trials(many),
            None => print_metrics(&metrics),
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

/// The model of the controller.
fn model(args: &Control, kind: ControlMethod, path: &Path) -> anyhow::Result<Model> {
    let model = model::read(path)?;
    let Some(deviation) = args.adaptation.estimate_current else { return Ok(model) };
    ensure!(
        kind != ControlMethod::Autopilot,
        "--estimate-current needs a controller that predicts with a model; pid does not: leave it out"
    );
    Ok(model.with_current(deviation)?)
}

fn monte_carlo(
    args: &Control,
    steering: &ControllerOptions,
    scene: &Scenario,
    conditions: &Conditions,
    from_s: f64,
    global: Global,
) -> anyhow::Result<MonteCarlo> {
    ensure!(
        args.monte_carlo.runs <= 1_000_000,
        "--runs {}: the largest number is 1000000",
        args.monte_carlo.runs
    );
    let bar = ui::Bar::new("trials", global);
    let spread = setup::variation(&args.monte_carlo, &scene.plant);
    Ok(closed_loop::monte_carlo(
        steering,
        scene,
        conditions,
        &spread,
        args.monte_carlo.runs,
        from_s,
        &mut bar.callback(),
    )?)
}

struct OutputFiles<'a> {
    args: &'a Control,
    steering: &'a ControllerOptions,
    scene: &'a Scenario,
    run: &'a Run,
    metrics: &'a Metrics,
}

impl OutputFiles<'_> {
    fn write<T: Serialize>(
        &self,
        folder: &Path,
        fleet: Option<&MonteCarlo>,
        tuned: Option<&TunedAutopilot>,
        document: &Document<'_, T>,
    ) -> anyhow::Result<()> {
        let Self { args, steering, scene, run, metrics } = self;
        atomic::write(&folder.join("track.csv"), |out| run.write_csv(out))?;
        let mut text = serde_json::to_string_pretty(document)?;
        text.push('\n');
        atomic::write(&folder.join("control.json"), |out| out.write_all(text.as_bytes()))?;
        let title = format!("Closed loop of {}: {}", scene.plant.name(), steering.method.name());
        let page = hydroid_report::closed_loop(&ClosedLoopReport {
            title: &title,
            command: &ui::command_line(),
            facts: &setup::facts(args, steering, scene),
            path: &scene.track.path,
            run,
            metrics,
            trials: fleet,
            tuned,
        })?;
        atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
        Ok(())
    }
}

fn print_metrics(m: &Metrics) {
    outln!("position      {:>9.4} m    RMS distance from the reference after {} s", m.rms_position, m.from_s);
    outln!("cross-track   {:>9.4} m    RMS, maximum {:.4} m", m.rms_cross_track, m.max_cross_track);
    outln!("speed         {:>9.4} m/s  RMS", m.rms_speed);
    match m.settled_after {
        Some(after) => outln!("settled after {after:>9.1} s"),
        None => outln!("settled after         - "),
    }
    outln!("saturated     {:>9.1} %    of {:.1} s", 100.0 * m.saturated, m.duration_s);
    let (median, max) = (m.us_per_command.median, m.us_per_command.max);
    outln!("command       {median:>9.1} us   median, maximum {max:.1} us");
    let status: Vec<String> = m.status.iter().map(|(name, count)| format!("{name} {count}")).collect();
    outln!("status        {}", status.join(", "));
    if m.arrived == Some(false) {
        outln!("the end of the path was not reached");
    }
    if m.diverged {
        outln!("the simulation diverged: the state of the vessel is not finite");
    }
    if m.violations > 0 {
        outln!("{} commands beyond their limits", m.violations);
    }
}

fn print_trials(f: &MonteCarlo) {
    outln!("{} trials: {} on track, {} diverged", f.runs, f.held, f.diverged);
    outln!(
        "commands beyond their limits: {}; samples off track without a status: {}",
        f.violations,
        f.undetected_losses
    );
    outln!("{:<24} {:>10} {:>10} {:>10}", "", "median", "95 %", "max");
    let line = |name: &str, s: &Summary| {
        outln!("{name:<24} {:>10.4} {:>10.4} {:>10.4}", s.median, s.p95, s.max);
    };
    line("position [m], RMS", &f.rms_position);
    line("cross-track [m], RMS", &f.rms_cross_track);
    line("cross-track [m], maximum", &f.max_cross_track);
    line("speed [m/s], RMS", &f.rms_speed);
}

fn print_tuning(tuned: &TunedAutopilot) {
    let best = &tuned.best;
    outln!(
        "tuned on {} separate seeds, best of {} candidates: omega {:.2} rad/s, look-ahead {:.2} m, integral {:.2} m/s, speed gain {:.3} of full ahead per m/s, exponent {}; score {:.4}",
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
