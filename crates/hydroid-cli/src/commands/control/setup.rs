//! What the command line says, as the library takes it.

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
    Control, ControllerKind, FleetArgs, HelmArgs, LearnArgs, Learner, SeaArgs, TaskArgs, TaskKind, TimingKind,
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
        return Ok(args.helm.dt.unwrap_or(0.1));
    };
    let own = model.description.dt;
    if let Some(dt) = args.helm.dt {
        ensure!(
            (dt / own - 1.0).abs() < 1e-3,
            "the model steps {own} s, and commands are made as often: leave --dt {dt} out"
        );
    }
    Ok(own)
}

pub(super) fn task(args: &TaskArgs) -> anyhow::Result<(Task, SpeedOptions)> {
    let lawn = args.leg.is_some() || args.spacing.is_some() || args.legs.is_some();
    let by_points = matches!(args.task, TaskKind::Waypoints | TaskKind::Legs);
    ensure!(
        !lawn || args.task == TaskKind::LawnMower,
        "--leg, --spacing and --legs are of --task lawn-mower"
    );
    ensure!(args.points.is_none() || by_points, "--points are of --task waypoints and legs");
    ensure!(
        args.radius.is_none() || args.task != TaskKind::Legs,
        "--task legs has corners without a radius: leave --radius out, or use --task waypoints"
    );
    let radius = args.radius.unwrap_or(15.0);
    let points = || match &args.points {
        Some(points) => Ok(points.0.clone()),
        None => {
            bail!("way-points are missing: give them as --points '0,0;60,0;60,40' (north,east in metres)")
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
        bail!("a circle is all turn: say --speed {turn} and leave --turn-speed out");
    }
    Ok((task, SpeedOptions { cruise: args.speed, turn: args.turn_speed, acceleration: args.acceleration }))
}

pub(super) fn scene(
    args: &Control,
    vessel: &VesselParams,
    task: &Task,
    pace: &SpeedOptions,
    dt_s: f64,
) -> anyhow::Result<Scenario> {
    let mut scene = Scenario::new(vessel.clone(), Track::new(task, pace)?);
    for (limits, (rate, what)) in
        scene.limits.iter_mut().zip(args.helm.rate_limits.0.into_iter().zip(["propeller", "rudder"]))
    {
        ensure!(rate > 0.0, "--rate-limits: that of the {what} is {rate}, and must be greater than 0");
        limits.rate = rate;
    }
    (scene.dt_s, scene.start, scene.tolerance) = (dt_s, args.task.start.0, args.helm.tolerance);
    scene.duration_s = args.task.duration.map_or(scene.duration_s, |duration| duration.0);
    Ok(scene)
}

/// From when on errors count \[s\].
pub(super) fn from_s(args: &Control, scene: &Scenario) -> anyhow::Result<f64> {
    let from_s = args.helm.from.map_or_else(|| scene.default_from_s(), |from| from.0);
    scene.check_from(from_s)?;
    Ok(from_s)
}

pub(super) const fn conditions(args: &SeaArgs) -> Conditions {
    let [gust, gust_s] = args.gusts.0;
    Conditions {
        seed: args.seed,
        noise: args.noise,
        current: args.current.0,
        wind: Wind { force: args.wind.0, gust, gust_s },
        mass: args.mass,
        delay_s: args.delay,
    }
}

pub(super) fn spread(args: &FleetArgs) -> Dispersion {
    let usual = Dispersion::default();
    Dispersion {
        mass: args.mass_spread.unwrap_or(usual.mass),
        current: args.current_spread.unwrap_or(usual.current),
        wind: args.wind_spread.unwrap_or(usual.wind),
    }
}

/// What is said of another controller than the one that steers, or of many voyages where there is one, is refused: it would
/// change nothing.
pub(super) fn check_meant(args: &Control) -> anyhow::Result<()> {
    let (given, kind) = (&args.helm, args.helm.controller);
    for (option, said, of, owner) in [
        ("--bandwidth", given.bandwidth.is_some(), ControllerKind::Fl, "fl"),
        ("--integral", given.integral.is_some(), ControllerKind::Fl, "fl"),
        ("--learned", given.learned, ControllerKind::Fl, "fl"),
        ("--rate", given.rate.is_some(), ControllerKind::Backstepping, "backstepping"),
        ("--horizon", given.horizon.is_some(), ControllerKind::Cem, "cem"),
        ("--candidates", given.candidates.is_some(), ControllerKind::Cem, "cem"),
        ("--iterations", given.iterations.is_some(), ControllerKind::Cem, "cem"),
        ("--descents", given.descents.is_some(), ControllerKind::Cem, "cem"),
        ("--prices", given.prices.is_some(), ControllerKind::Cem, "cem"),
        ("--plan-time", given.plan_time.is_some(), ControllerKind::Cem, "cem"),
    ] {
        ensure!(!said || kind == of, "{option} is of --controller {owner}: leave it out");
    }
    ensure!(
        kind == ControllerKind::Cem || given.reference.is_none_or(|timing| timing == TimingKind::Clock),
        "--reference is of --controller cem: fl and backstepping track the clock, pid follows the path"
    );
    let fleet = &args.fleet;
    for (option, said) in [
        ("--mass-spread", fleet.mass_spread.is_some()),
        ("--current-spread", fleet.current_spread.is_some()),
        ("--wind-spread", fleet.wind_spread.is_some()),
    ] {
        ensure!(
            !said || fleet.runs != 1,
            "{option} is of many voyages: give --runs, or leave it out and say what the one run meets (--mass, --current, --wind)"
        );
    }
    Ok(())
}

/// Numbers of all candidates of an iteration, of one command, at the most: 80 MB.
const MOST_DRAWN: usize = 10_000_000;

pub(super) fn steering(
    args: &Control,
    kind: ControlMethod,
    scene: &Scenario,
) -> anyhow::Result<ControllerOptions> {
    let given = &args.helm;
    let mut steering = ControllerOptions::new(kind, &scene.vessel, scene.dt_s);
    (steering.limits, steering.tolerance) = (scene.limits, scene.tolerance);
    steering.lead = given.lead.unwrap_or(steering.lead);
    ensure!(
        kind != ControlMethod::Autopilot || given.lead.is_none_or(|lead| lead == 0.0),
        "--lead: pid brings the vessel's origin on the path; leave --lead out"
    );
    steering.bandwidth = Some(given.bandwidth.map_or([1.5, 0.7], |bandwidth| bandwidth.0));
    steering.integral = given.integral.unwrap_or(0.0);
    steering.learned = given.learned.then(AdaptiveAugmentationOptions::default);
    steering.rate = Some(given.rate.unwrap_or(1.0));
    if let (ControlMethod::CrossEntropy, Some(TimingKind::Foot)) = (kind, given.reference) {
        steering.timing = Timing::Path;
    }
    let usual = steering.planner;
    let (candidates, horizon) =
        (given.candidates.unwrap_or(usual.candidates), given.horizon.unwrap_or(usual.horizon));
    ensure!(candidates > 0, "--candidates 0: one is needed at least");
    ensure!(
        candidates.saturating_mul(horizon) <= MOST_DRAWN,
        "--candidates {candidates} of --horizon {horizon} samples are more than a plan has room for: together (one times the other) they may be {MOST_DRAWN}; give fewer of either"
    );
    let descents = given.descents.unwrap_or(usual.gauss_newton_steps);
    ensure!(
        descents == 0
            || horizon.saturating_mul(scene.limits.len()) <= PlannerOptions::MAX_GAUSS_NEWTON_COMMANDS,
        "--horizon {horizon}: steps downhill solve for all commands of a plan, {} at the most; give a shorter horizon, or --descents 0",
        PlannerOptions::MAX_GAUSS_NEWTON_COMMANDS
    );
    steering.planner = PlannerOptions {
        horizon,
        candidates,
        elites: (candidates / 10).max(2),
        iterations: given.iterations.unwrap_or(usual.iterations),
        gauss_newton_steps: descents,
        ..usual
    };
    [steering.cost.position, steering.cost.heading, steering.cost.speed] = prices(given);
    if let Some(ms) = given.plan_time {
        ensure!(ms > 0.0 && ms < 1e6, "--plan-time {ms}: milliseconds greater than 0 are needed");
        steering.budget = Some(Duration::from_secs_f64(1e-3 * ms));
    }
    Ok(steering)
}

/// Of a metre, a radian, 1 m/s.
fn prices(given: &HelmArgs) -> [f64; 3] {
    given.prices.map_or([1.0, 0.2, 0.2], |prices| prices.0)
}

/// How a model learns in the loop: as `hydroid adapt` lets it, with the settings that are that command's default.
pub(super) fn learning(args: &LearnArgs, model: &Model) -> anyhow::Result<adapt::Options> {
    adapt::adaptable(model)?;
    let mut options = adapt::Options::of(model);
    let (equations, direct) = (model.equations().is_some(), model.direct().is_some());
    ensure!(
        !direct || args.learner != Some(Learner::Kalman),
        "--learner kalman is not for direct predictors: their last layer learns by least squares; leave it out"
    );
    ensure!(
        equations || direct || args.learner != Some(Learner::LeastSquares),
        "--learner least-squares is for equations and direct predictors: this is a model of kind '{}', which learns by the filter; leave it out",
        model.kind()
    );
    if args.learner == Some(Learner::Kalman) {
        options.method = Method::Kalman;
    }
    Ok(if args.no_guard { options } else { options.guarded(model) })
}

/// The controller as `control.json` has it.
pub(super) fn told(args: &Control, steering: &ControllerOptions) -> Value {
    let mut told = json!({
        "kind": steering.method,
        "model": args.model,
        "lead_m": steering.lead,
        "reference": steering.timing,
        "adapt": steering.adapt.is_some(),
    });
    match steering.method {
        ControlMethod::FeedbackLinearization => {
            told["bandwidth"] = json!(steering.bandwidth);
            told["integral"] = json!(steering.integral);
            told["learned"] = json!(steering.learned.is_some());
        }
        ControlMethod::Backstepping => told["rate_per_s"] = json!(steering.rate),
        ControlMethod::CrossEntropy => {
            let p = &steering.planner;
            told["horizon"] = json!(p.horizon);
            told["candidates"] = json!(p.candidates);
            told["iterations"] = json!(p.iterations);
            told["descents"] = json!(p.gauss_newton_steps);
            told["prices"] = json!(prices(&args.helm));
        }
        ControlMethod::Autopilot => {}
    }
    told
}

/// What the page says of controller, task and conditions.
pub(super) fn facts(args: &Control, steering: &ControllerOptions, scene: &Scenario) -> Vec<(String, String)> {
    let words = match steering.method {
        ControlMethod::FeedbackLinearization if steering.learned.is_some() => {
            "feedback linearization of a point ahead of the vessel, with a correction that is learned under way"
        }
        ControlMethod::FeedbackLinearization => "feedback linearization of a point ahead of the vessel",
        ControlMethod::Backstepping => "backstepping of a point ahead of the vessel",
        ControlMethod::CrossEntropy => "model predictive control by the cross-entropy method",
        ControlMethod::Autopilot => "line of sight, PID on the heading, PI on the speed",
    };
    let mut facts: Vec<(String, String)> = Vec::new();
    let mut tell = |name: &str, value: String| facts.push((name.to_owned(), value));
    tell("Controller", words.to_owned());
    if let (Some(model), Some(path)) = (&steering.model, &args.model) {
        let learns = if steering.adapt.is_some() { ", which learns on the way" } else { "" };
        tell("Model", format!("{} ({}){learns}", path.display(), model.kind()));
    }
    tell("Plant", scene.vessel.name.clone());
    let task = match args.task.task {
        TaskKind::Circle => "circle",
        TaskKind::LawnMower => "lawn-mower",
        TaskKind::Waypoints => "way-points",
        TaskKind::Legs => "straight legs",
    };
    let turn = args.task.turn_speed.map(|turn| format!(", {turn} m/s in turns")).unwrap_or_default();
    tell("Task", format!("{task}, {} m/s{turn}", args.task.speed));
    let sea = &args.sea;
    let [[north, east], [to_north, to_east], [gust, gust_s]] = [sea.current.0, sea.wind.0, sea.gusts.0];
    tell(
        "Conditions",
        format!(
            "noise × {}, current {north}, {east} m/s, wind {to_north}, {to_east} N, gusts {gust} N ({gust_s} s), mass × {}, delay {} s, seed {}",
            sea.noise, sea.mass, sea.delay, sea.seed
        ),
    );
    facts
}
