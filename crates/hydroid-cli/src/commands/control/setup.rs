//! Conversion of the arguments of `hydroid control` to the types of the library.

use std::time::Duration;

use anyhow::{bail, ensure};
use hydroid::adapt::{self, Method};
use hydroid::closed_loop::{
    Conditions, ControlMethod, ControllerOptions, Dispersion, Scenario, SpeedOptions, Task, Timing, Track,
    Wind,
};
use hydroid::model::Model;
use hydroid_core::control::AdaptiveAugmentationOptions;
use hydroid_core::control::cem::PlannerOptions;
use hydroid_core::vessel::VesselParams;
use serde_json::{Value, json};

use crate::args::{
    AdaptationArgs, Control, ControllerArgs, ControllerKind, DisturbanceArgs, Learner, MonteCarloArgs,
    TaskArgs, TaskKind, TimingKind,
};

pub(super) const fn kind(controller: ControllerKind) -> ControlMethod {
    match controller {
        ControllerKind::Fl => ControlMethod::FeedbackLinearization,
        ControllerKind::Backstepping => ControlMethod::Backstepping,
        ControllerKind::Cem => ControlMethod::CrossEntropy,
        ControllerKind::Pid => ControlMethod::Autopilot,
    }
}

/// Sample time of the loop \[s\].
pub(super) fn sample_time(args: &Control, model: Option<&Model>) -> anyhow::Result<f64> {
    let Some(model) = model.filter(|model| model.plant().is_none()) else {
        return Ok(args.controller.dt.unwrap_or(0.1));
    };
    let own = model.description.dt;
    if let Some(dt) = args.controller.dt {
        ensure!(
            (dt / own - 1.0).abs() < 1e-3,
            "the sample time of the model is {own} s, and the controller has the same: leave --dt {dt} out"
        );
    }
    Ok(own)
}

pub(super) fn task(args: &TaskArgs) -> anyhow::Result<(Task, SpeedOptions)> {
    let lawn = args.leg.is_some() || args.spacing.is_some() || args.legs.is_some();
    let by_points = matches!(args.task, TaskKind::Waypoints | TaskKind::Legs);
    ensure!(!lawn || args.task == TaskKind::LawnMower, "--leg, --spacing and --legs need --task lawn-mower");
    ensure!(args.points.is_none() || by_points, "--points needs --task waypoints or --task legs");
    ensure!(
        args.radius.is_none() || args.task != TaskKind::Legs,
        "--task legs has sharp corners: leave --radius out, or use --task waypoints"
    );
    let radius = args.radius.unwrap_or(15.0);
    let points = || match &args.points {
        Some(points) => Ok(points.0.clone()),
        None => {
            bail!("waypoints are missing: give them as --points '0,0;60,0;60,40' (north,east in metres)")
        }
    };
    let task = match args.task {
        TaskKind::Circle => Task::Circle { radius },
        TaskKind::LawnMower => Task::LawnMower {
            leg: args.leg.unwrap_or(60.0),
            spacing: args.spacing.unwrap_or(2.0 * radius),
            legs: args.legs.unwrap_or(4),
            radius,
        },
        TaskKind::Waypoints => Task::Waypoints { points: points()?, radius: Some(radius) },
        TaskKind::Legs => Task::Waypoints { points: points()?, radius: None },
    };
    if let (Some(turn), TaskKind::Circle) = (args.turn_speed, args.task) {
        bail!("--task circle has one speed: use --speed {turn} and leave --turn-speed out");
    }
    Ok((task, SpeedOptions { cruise: args.speed, turn: args.turn_speed, acceleration: args.acceleration }))
}

pub(super) fn scenario(
    args: &Control,
    vessel: &VesselParams,
    task: &Task,
    pace: &SpeedOptions,
    dt_s: f64,
) -> anyhow::Result<Scenario> {
    let mut scenario = Scenario::new(vessel.clone(), Track::new(task, pace)?);
    for (limits, (rate, what)) in
        scenario.limits.iter_mut().zip(args.controller.rate_limits.0.into_iter().zip(["propeller", "rudder"]))
    {
        ensure!(rate > 0.0, "--rate-limits: the limit of the {what} is {rate}; it must be greater than 0");
        limits.rate = rate;
    }
    (scenario.dt_s, scenario.start, scenario.tolerance) =
        (dt_s, args.task.start.0, args.controller.tolerance);
    scenario.duration_s = args.task.duration.map_or(scenario.duration_s, |duration| duration.0);
    Ok(scenario)
}

pub(super) fn from_s(args: &Control, scene: &Scenario) -> anyhow::Result<f64> {
    let from_s = args.controller.evaluate_from.map_or_else(|| scene.default_from_s(), |from| from.0);
    scene.check_from(from_s)?;
    Ok(from_s)
}

pub(super) fn conditions(args: &DisturbanceArgs) -> Conditions {
    let [gust, gust_s] = args.gusts.0;
    Conditions {
        seed: args.seed,
        noise: args.noise,
        current: args.current.0,
        wind: Wind { force: args.wind.0, gust, gust_s },
        mass: args.mass,
        delay_s: args.delay,
        onset_s: args.onset.map_or(0.0, |onset| onset.0),
    }
}

pub(super) fn variation(args: &MonteCarloArgs) -> Dispersion {
    let default = Dispersion::default();
    Dispersion {
        mass: args.mass_variation.unwrap_or(default.mass),
        current: args.current_variation.unwrap_or(default.current),
        wind: args.wind_variation.unwrap_or(default.wind),
    }
}

/// Refuses options without effect: those of other controllers, and Monte Carlo options without `--runs`.
pub(super) fn check_options(args: &Control) -> anyhow::Result<()> {
    let (given, kind) = (&args.controller, args.controller.controller);
    for (option, is_given, of, owner) in [
        ("--bandwidth", given.bandwidth.is_some(), ControllerKind::Fl, "fl"),
        ("--integral", given.integral.is_some(), ControllerKind::Fl, "fl"),
        ("--adaptive-augmentation", given.adaptive_augmentation, ControllerKind::Fl, "fl"),
        ("--rate", given.rate.is_some(), ControllerKind::Backstepping, "backstepping"),
        ("--horizon", given.horizon.is_some(), ControllerKind::Cem, "cem"),
        ("--candidates", given.candidates.is_some(), ControllerKind::Cem, "cem"),
        ("--iterations", given.iterations.is_some(), ControllerKind::Cem, "cem"),
        ("--gauss-newton-steps", given.gauss_newton_steps.is_some(), ControllerKind::Cem, "cem"),
        ("--cost-weights", given.cost_weights.is_some(), ControllerKind::Cem, "cem"),
        ("--plan-time", given.plan_time.is_some(), ControllerKind::Cem, "cem"),
    ] {
        ensure!(!is_given || kind == of, "{option} needs --controller {owner}: leave it out");
    }
    ensure!(
        kind == ControllerKind::Cem || given.reference.is_none_or(|timing| timing == TimingKind::Time),
        "--reference needs --controller cem: fl and backstepping track a trajectory in time, pid follows the path"
    );
    let monte_carlo = &args.monte_carlo;
    for (option, is_given) in [
        ("--mass-variation", monte_carlo.mass_variation.is_some()),
        ("--current-variation", monte_carlo.current_variation.is_some()),
        ("--wind-variation", monte_carlo.wind_variation.is_some()),
    ] {
        ensure!(
            !is_given || monte_carlo.runs != 1,
            "{option} applies to Monte Carlo trials: add --runs, or set the value of a single run by --mass, --current, --wind"
        );
    }
    Ok(())
}

/// Largest product of candidates and horizon: 80 MB for each command.
const MAX_SAMPLES: usize = 10_000_000;

pub(super) fn steering(
    args: &Control,
    kind: ControlMethod,
    scene: &Scenario,
) -> anyhow::Result<ControllerOptions> {
    let given = &args.controller;
    let mut steering = ControllerOptions::new(kind, &scene.vessel, scene.dt_s);
    (steering.limits, steering.tolerance) = (scene.limits, scene.tolerance);
    steering.lead = given.lead.unwrap_or(steering.lead);
    ensure!(
        kind != ControlMethod::Autopilot || given.lead.is_none_or(|lead| lead == 0.0),
        "--lead: pid controls the vessel's origin; leave --lead out"
    );
    steering.bandwidth = Some(given.bandwidth.map_or([1.5, 0.7], |bandwidth| bandwidth.0));
    steering.integral = given.integral.unwrap_or(0.0);
    steering.learned = given.adaptive_augmentation.then(AdaptiveAugmentationOptions::default);
    steering.rate = Some(given.rate.unwrap_or(1.0));
    if let (ControlMethod::CrossEntropy, Some(TimingKind::Path)) = (kind, given.reference) {
        steering.timing = Timing::Path;
    }
    let default = steering.planner;
    let (candidates, horizon) =
        (given.candidates.unwrap_or(default.candidates), given.horizon.unwrap_or(default.horizon));
    ensure!(candidates > 0, "--candidates 0: at least one candidate is needed");
    ensure!(
        candidates.saturating_mul(horizon) <= MAX_SAMPLES,
        "--candidates {candidates} times --horizon {horizon} is more than {MAX_SAMPLES}: reduce one of them"
    );
    let gauss_newton_steps = given.gauss_newton_steps.unwrap_or(default.gauss_newton_steps);
    ensure!(
        gauss_newton_steps == 0
            || horizon.saturating_mul(scene.limits.len()) <= PlannerOptions::MAX_GAUSS_NEWTON_COMMANDS,
        "--horizon {horizon}: Gauss-Newton steps solve for all commands of a plan, at most {}; use a shorter horizon, or --gauss-newton-steps 0",
        PlannerOptions::MAX_GAUSS_NEWTON_COMMANDS
    );
    steering.planner = PlannerOptions {
        horizon,
        candidates,
        elites: (candidates / 10).max(2),
        iterations: given.iterations.unwrap_or(default.iterations),
        gauss_newton_steps,
        ..default
    };
    [steering.cost.position, steering.cost.heading, steering.cost.speed] = cost_weights(given);
    if let Some(ms) = given.plan_time {
        ensure!(
            ms > 0.0 && ms < 1e6,
            "--plan-time {ms}: the time limit in milliseconds must be greater than 0"
        );
        steering.budget = Some(Duration::from_secs_f64(1e-3 * ms));
    }
    Ok(steering)
}

fn cost_weights(given: &ControllerArgs) -> [f64; 3] {
    given.cost_weights.map_or([1.0, 0.2, 0.2], |weights| weights.0)
}

/// Options of the online adaptation: the defaults of `hydroid adapt`.
pub(super) fn adaptation(args: &AdaptationArgs, model: &Model) -> anyhow::Result<adapt::Options> {
    adapt::adaptable(model)?;
    let mut options = adapt::Options::of(model);
    let (equations, direct) = (model.equations().is_some(), model.direct().is_some());
    ensure!(
        !direct || args.learner != Some(Learner::Kalman),
        "direct predictors adapt by least squares: leave --learner kalman out"
    );
    ensure!(
        equations || direct || args.learner != Some(Learner::LeastSquares),
        "--learner least-squares needs equations or a direct predictor: this is a model of kind '{}'; leave it out",
        model.kind()
    );
    if args.learner == Some(Learner::Kalman) {
        options.method = Method::Kalman;
    }
    Ok(if args.no_guard { options } else { options.guarded(model) })
}

pub(super) fn description(args: &Control, steering: &ControllerOptions) -> Value {
    let mut description = json!({
        "kind": steering.method,
        "model": args.model,
        "lead_m": steering.lead,
        "reference": steering.timing,
        "adapt": steering.adapt.is_some(),
    });
    match steering.method {
        ControlMethod::FeedbackLinearization => {
            description["bandwidth"] = json!(steering.bandwidth);
            description["integral"] = json!(steering.integral);
            description["adaptive_augmentation"] = json!(steering.learned.is_some());
        }
        ControlMethod::Backstepping => description["rate_per_s"] = json!(steering.rate),
        ControlMethod::CrossEntropy => {
            let p = &steering.planner;
            description["horizon"] = json!(p.horizon);
            description["candidates"] = json!(p.candidates);
            description["iterations"] = json!(p.iterations);
            description["gauss_newton_steps"] = json!(p.gauss_newton_steps);
            description["cost_weights"] = json!(cost_weights(&args.controller));
        }
        ControlMethod::Autopilot => {}
    }
    description
}

pub(super) fn facts(args: &Control, steering: &ControllerOptions, scene: &Scenario) -> Vec<(String, String)> {
    let words = match steering.method {
        ControlMethod::FeedbackLinearization if steering.learned.is_some() => {
            "feedback linearization of a point ahead of the vessel, with adaptive augmentation"
        }
        ControlMethod::FeedbackLinearization => "feedback linearization of a point ahead of the vessel",
        ControlMethod::Backstepping => "backstepping of a point ahead of the vessel",
        ControlMethod::CrossEntropy => "model predictive control by the cross-entropy method",
        ControlMethod::Autopilot => "line of sight, PID on the heading, PI on the speed",
    };
    let mut facts: Vec<(String, String)> = Vec::new();
    let mut add = |name: &str, value: String| facts.push((name.to_owned(), value));
    add("Controller", words.to_owned());
    if let (Some(model), Some(path)) = (&steering.model, &args.model) {
        let adapted = if steering.adapt.is_some() { ", adapted online" } else { "" };
        add("Model", format!("{} ({}){adapted}", path.display(), model.kind()));
    }
    add("Plant", scene.vessel.name.clone());
    let task = match args.task.task {
        TaskKind::Circle => "circle",
        TaskKind::LawnMower => "lawn-mower",
        TaskKind::Waypoints => "waypoints",
        TaskKind::Legs => "straight legs",
    };
    let turn = args.task.turn_speed.map(|turn| format!(", {turn} m/s in turns")).unwrap_or_default();
    add("Task", format!("{task}, {} m/s{turn}", args.task.speed));
    let d = &args.disturbances;
    let [[north, east], [to_north, to_east], [gust, gust_s]] = [d.current.0, d.wind.0, d.gusts.0];
    let onset = d.onset.map(|onset| format!(" (from {} s on)", onset.0)).unwrap_or_default();
    add(
        "Conditions",
        format!(
            "noise × {}, current {north}, {east} m/s, wind {to_north}, {to_east} N, gusts {gust} N ({gust_s} s), mass × {}{onset}, delay {} s, seed {}",
            d.noise, d.mass, d.delay, d.seed
        ),
    );
    facts
}
