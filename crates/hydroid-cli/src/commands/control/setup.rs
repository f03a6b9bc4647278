//! Conversion of the arguments of `hydroid control` to the types of the library.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, bail, ensure};
use hydroid::adapt::{self, Method};
use hydroid::closed_loop::{
    Conditions, ControlMethod, ControllerOptions, Dispersion, Scale, Scenario, SpeedOptions, Task, Timing,
    Track, TruePlant, Waypoints, Wind,
};
use hydroid::log::units::Unit;
use hydroid::manoeuvre::{Approach, Options, Response};
use hydroid::model::Model;
use hydroid::plant::{InputMap, Simulation};
use hydroid::toml_file::nearest;
use hydroid_core::actuator::Limits;
use hydroid_core::control::AdaptiveAugmentationOptions;
use hydroid_core::control::cem::PlannerOptions;
use serde_json::{Value, json};

use crate::args::{
    AdaptationArgs, Control, ControllerArgs, ControllerKind, DisturbanceArgs, Learner, MonteCarloArgs,
    NamedNumber, NamedRange, TaskArgs, TaskKind, TimingKind,
};

pub(super) const fn kind(controller: ControllerKind) -> ControlMethod {
    match controller {
        ControllerKind::Fl => ControlMethod::FeedbackLinearization,
        ControllerKind::Backstepping => ControlMethod::Backstepping,
        ControllerKind::Cem => ControlMethod::CrossEntropy,
        ControllerKind::Pid => ControlMethod::Autopilot,
    }
}

/// What a controller without a model needs.
pub(super) fn no_model(kind: ControlMethod) -> String {
    format!(
        "the model is missing: {} needs a .safetensors file of `hydroid identify`, a vessel file (.toml), or hydrofoil, hydrofoil-low-speed, simple, as in `hydroid control hydrofoil --controller {}`",
        kind.name(),
        kind.name()
    )
}

/// Sample time of the loop \[s\].
pub(super) fn sample_time(args: &Control, model: Option<&Model>, plant: &Model) -> anyhow::Result<f64> {
    let identified = model.into_iter().chain([plant]).find(|model| !model.is_vessel());
    let Some(identified) = identified else { return Ok(args.controller.dt.unwrap_or(0.1)) };
    let own = identified.description.dt;
    if let Some(dt) = args.controller.dt {
        ensure!(
            (dt / own - 1.0).abs() < 1e-3,
            "the sample time of the model is {own} s, and the controller has the same: leave --dt {dt} out"
        );
    }
    Ok(own)
}

/// Size of a vessel, from which the defaults follow.
pub(super) struct Size {
    pub(super) scale: Scale,
    /// Of an identified model.
    pub(super) response: Option<Response>,
}

impl Size {
    /// The size of the vessel, from simulated tests of the model at the speed of the task. Plants with given parameters have
    /// the size of the boat for which the defaults were chosen.
    pub(super) fn of(args: &Control, plant: &Model, model: Option<&Model>) -> anyhow::Result<Self> {
        if plant.plant().is_some() {
            return Ok(Self { scale: Scale::BOAT, response: None });
        }
        let model = model.unwrap_or(plant);
        let tests = || -> anyhow::Result<Response> {
            let inputs = InputMap::with(model, &args.controller.push, &args.controller.turn)?;
            let options = Options { propulsion: 0.5, speed_m_s: args.task.speed };
            let approach = Approach::new(model, &inputs, Simulation::new(model)?, &options)?;
            Ok(Response::about(&approach, &inputs)?)
        };
        let response = tests().context(
            "the defaults of task and controller follow from simulated tests of the model on a straight course and in a turn, which failed",
        )?;
        Ok(Self { scale: Scale::of(&response), response: Some(response) })
    }
}

/// The inputs that push and turn a vessel, within the limits of a scenario.
pub(super) fn inputs(args: &Control, model: &Model, scene: &Scenario) -> anyhow::Result<InputMap> {
    let mut model = model.clone();
    for (port, limits) in model.description.inputs.iter_mut().zip(&scene.limits) {
        (port.range.low, port.range.high) = (limits.low, limits.high);
    }
    let mut inputs = InputMap::with(&model, &args.controller.push, &args.controller.turn)?;
    for (neutral, limits) in inputs.neutral.iter_mut().zip(&scene.limits) {
        *neutral = limits.rest;
    }
    Ok(inputs)
}

/// Sets the limits, the values at rest and the limits of the rates that are stated.
fn state_limits(given: &ControllerArgs, scene: &mut Scenario) -> anyhow::Result<()> {
    let commands = scene.plant.commands();
    let place = |option: &str, name: &str| {
        let known = || commands.iter().map(|channel| channel.name.as_str());
        commands.iter().position(|channel| channel.name == name).with_context(|| {
            let nearest =
                nearest(name, known()).map(|n| format!(", did you mean '{n}'?")).unwrap_or_default();
            let known = known().collect::<Vec<_>>().join(", ");
            format!("{option}: the plant has no command '{name}'{nearest}; its commands are {known}")
        })
    };
    for NamedRange { name, range } in &given.limit {
        let index = place("--limit", name)?;
        let scale = match &range.unit {
            None => 1.0,
            Some(unit) => {
                let wrong = || format!("--limit {name}: the unit [{unit}]");
                let own = Unit::parse(&commands[index].unit).with_context(wrong)?;
                Unit::parse(unit).and_then(|unit| unit.to(&own)).with_context(wrong)?
            }
        };
        let (low, high) = (scale * range.low, scale * range.high);
        let limits = &mut scene.limits[index];
        (limits.low, limits.high, limits.rest) = (low, high, limits.rest.clamp(low, high));
    }
    for NamedNumber { name, number } in &given.neutral {
        let index = place("--neutral", name)?;
        let Limits { low, high, .. } = scene.limits[index];
        ensure!(
            (low..=high).contains(number),
            "--neutral {name}={number}: the limits of '{name}' are {low} and {high}; give a value between them, or other limits with --limit"
        );
        scene.limits[index].rest = *number;
    }
    for NamedNumber { name, number } in &given.rate_limit {
        let index = place("--rate-limit", name)?;
        ensure!(*number > 0.0, "--rate-limit {name}={number}: the limit of a rate must be greater than 0");
        scene.limits[index].rate = *number;
    }
    Ok(())
}

/// Path, speed, and origin of way-points that are latitudes and longitudes \[deg\].
pub(super) struct Route {
    pub(super) task: Task,
    pub(super) pace: SpeedOptions,
    pub(super) origin_deg: Option<[f64; 2]>,
}

pub(super) fn task(args: &TaskArgs, size: &Size) -> anyhow::Result<Route> {
    let lawn = args.leg.is_some() || args.spacing.is_some() || args.legs.is_some();
    let station = args.task == TaskKind::Station;
    let by_points = matches!(args.task, TaskKind::Waypoints | TaskKind::Legs);
    ensure!(!lawn || args.task == TaskKind::LawnMower, "--leg, --spacing and --legs need --task lawn-mower");
    ensure!(
        args.points.is_none() || by_points || station,
        "--points needs --task waypoints, --task legs or --task station"
    );
    ensure!(args.waypoints.is_none() || by_points, "--waypoints needs --task waypoints or --task legs");
    ensure!(args.heading.is_none_or(f64::is_finite), "--heading: give degrees, clockwise from north");
    ensure!(args.heading.is_none() || station, "--heading needs --task station");
    for (option, is_given) in [
        ("--speed", args.speed.is_some()),
        ("--turn-speed", args.turn_speed.is_some()),
        ("--radius", args.radius.is_some()),
        ("--acceleration", args.acceleration.is_some()),
    ] {
        ensure!(!(is_given && station), "{option}: a station has no speed and no turns: leave it out");
    }
    ensure!(
        args.radius.is_none() || args.task != TaskKind::Legs,
        "--task legs has sharp corners: leave --radius out, or use --task waypoints"
    );
    let Size { scale, response } = size;
    let radius = args.radius.unwrap_or(15.0 * scale.radius);
    let cruise = args.speed.or(response.map(|response| response.speed_m_s)).unwrap_or(1.5);
    if let Some(Response { turning_radius_m, speed_m_s, .. }) = response.as_ref().filter(|_| !station) {
        ensure!(
            radius > *turning_radius_m || args.turn_speed.is_some_and(|turn| turn < *speed_m_s),
            "--radius {radius}: at {speed_m_s:.2} m/s, the model turns with a radius of {turning_radius_m:.1} m with the steering hard over: give a larger --radius, or a --turn-speed below {speed_m_s:.2}"
        );
    }
    let mut origin_deg = None;
    let mut points = || match (&args.points, &args.waypoints) {
        (Some(points), _) => Ok(points.0.clone()),
        (None, Some(file)) => {
            let waypoints = Waypoints::read(file)?;
            origin_deg = waypoints.origin_deg;
            Ok(waypoints.points)
        }
        (None, None) => bail!(
            "waypoints are missing: give them as --points '0,0;60,0;60,40' (north,east in metres), or as a CSV or GPX file with --waypoints"
        ),
    };
    let task = match args.task {
        TaskKind::Circle => Task::Circle { radius },
        TaskKind::LawnMower => Task::LawnMower {
            leg: args.leg.unwrap_or(60.0 * scale.radius),
            spacing: args.spacing.unwrap_or(2.0 * radius),
            legs: args.legs.unwrap_or(4),
            radius,
        },
        TaskKind::Waypoints => Task::Waypoints { points: points()?, radius: Some(radius) },
        TaskKind::Legs => Task::Waypoints { points: points()?, radius: None },
        TaskKind::Station => {
            let position = match args.points.as_ref().map(|points| &points.0[..]) {
                None => [0.0; 2],
                Some([point]) => *point,
                Some(points) => bail!(
                    "--points has {} points: a station is one point, as in --points 20,-5 (north,east in metres)",
                    points.len()
                ),
            };
            Task::Station { position, heading: args.heading.unwrap_or(0.0).to_radians() }
        }
    };
    if let (Some(turn), TaskKind::Circle) = (args.turn_speed, args.task) {
        bail!("--task circle has one speed: use --speed {turn} and leave --turn-speed out");
    }
    let acceleration = args.acceleration.unwrap_or_else(|| match response {
        // A tenth of the acceleration at full ahead.
        Some(response) => 0.1 * response.surge_gain_m_s / response.surge_time_s,
        None => 0.2,
    });
    let pace = SpeedOptions { cruise, turn: args.turn_speed, acceleration };
    Ok(Route { task, pace, origin_deg })
}

pub(super) fn scenario(
    args: &Control,
    plant: Arc<Model>,
    task: &Task,
    pace: &SpeedOptions,
    scale: Scale,
    dt_s: f64,
) -> anyhow::Result<Scenario> {
    let mut scenario = Scenario::new(plant, Track::new(task, pace)?);
    state_limits(&args.controller, &mut scenario)?;
    scenario.dt_s = dt_s;
    scenario.start = args.task.start.map_or([0.0, -0.5 * scale.radius], |start| start.0);
    scenario.tolerance = args.controller.tolerance.unwrap_or(2.0 * scale.radius);
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
        process_noise: args.process_noise,
        current: args.current.0,
        wind: Wind { force: args.wind.0, gust, gust_s },
        mass: args.mass,
        delay_s: args.delay,
        onset_s: args.onset.map_or(0.0, |onset| onset.0),
    }
}

/// Dispersion of the conditions. An identified model has no forces and no mass.
pub(super) fn variation(args: &MonteCarloArgs, plant: &TruePlant) -> Dispersion {
    let default = Dispersion::default();
    let default = match plant {
        TruePlant::Vessel(_) => default,
        TruePlant::Model(_) => Dispersion { mass: 0.0, wind: 0.0, ..default },
    };
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
        ("--hold", given.hold.is_some(), ControllerKind::Cem, "cem"),
        ("--candidates", given.candidates.is_some(), ControllerKind::Cem, "cem"),
        ("--iterations", given.iterations.is_some(), ControllerKind::Cem, "cem"),
        ("--gauss-newton-steps", given.gauss_newton_steps.is_some(), ControllerKind::Cem, "cem"),
        ("--cost-weights", given.cost_weights.is_some(), ControllerKind::Cem, "cem"),
        ("--plan-time", given.plan_time.is_some(), ControllerKind::Cem, "cem"),
    ] {
        ensure!(!is_given || kind == of, "{option} needs --controller {owner}: leave it out");
    }
    ensure!(
        kind == ControllerKind::Cem || args.task.task != TaskKind::Station,
        "--task station needs --controller cem: fl, backstepping and pid steer along a path"
    );
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
    scale: Scale,
) -> anyhow::Result<ControllerOptions> {
    let given = &args.controller;
    let mut steering = ControllerOptions::new(kind, &scene.plant, scene.dt_s).scaled(scale);
    (steering.limits, steering.tolerance) = (scene.limits.clone(), scene.tolerance);
    steering.lead = given.lead.unwrap_or(steering.lead);
    ensure!(
        kind != ControlMethod::Autopilot || given.lead.is_none_or(|lead| lead == 0.0),
        "--lead: pid controls the vessel's origin; leave --lead out"
    );
    steering.bandwidth = given.bandwidth.map_or(steering.bandwidth, |bandwidth| Some(bandwidth.0));
    steering.integral = given.integral.unwrap_or(0.0);
    steering.learned = given.adaptive_augmentation.then(AdaptiveAugmentationOptions::default);
    steering.rate = given.rate.or(steering.rate);
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
    let hold = given.hold.unwrap_or(default.hold);
    ensure!(
        candidates.saturating_mul(horizon).saturating_mul(hold) <= 10 * MAX_SAMPLES,
        "--candidates {candidates} times --horizon {horizon} times --hold {hold} is more than {}: reduce one of them",
        10 * MAX_SAMPLES
    );
    steering.planner = PlannerOptions {
        horizon,
        hold,
        candidates,
        elites: (candidates / 10).max(2),
        iterations: given.iterations.unwrap_or(default.iterations),
        gauss_newton_steps,
        ..default
    };
    if let Some(weights) = given.cost_weights {
        [steering.cost.position, steering.cost.heading, steering.cost.speed] = weights.0;
    }
    if let Some(ms) = given.plan_time {
        ensure!(
            ms > 0.0 && ms < 1e6,
            "--plan-time {ms}: the time limit in milliseconds must be greater than 0"
        );
        steering.budget = Some(Duration::from_secs_f64(1e-3 * ms));
    }
    Ok(steering)
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
            description["hold"] = json!(p.hold);
            description["candidates"] = json!(p.candidates);
            description["iterations"] = json!(p.iterations);
            description["gauss_newton_steps"] = json!(p.gauss_newton_steps);
            description["cost_weights"] =
                json!([steering.cost.position, steering.cost.heading, steering.cost.speed]);
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
    let plant = args.plant.as_ref().or(args.model.as_ref());
    let kind = match &scene.plant {
        TruePlant::Vessel(_) => String::new(),
        TruePlant::Model(model) => {
            format!(
                " ({}, {})",
                model.kind(),
                plant.map(|path| path.display().to_string()).unwrap_or_default()
            )
        }
    };
    add("Plant", format!("{}{kind}", scene.plant.name()));
    let task = match args.task.task {
        TaskKind::Circle => "circle",
        TaskKind::LawnMower => "lawn-mower",
        TaskKind::Waypoints => "waypoints",
        TaskKind::Legs => "straight legs",
        TaskKind::Station => "station",
    };
    let turn = args.task.turn_speed.map(|turn| format!(", {turn} m/s in turns")).unwrap_or_default();
    let speed =
        if scene.track.is_station { String::new() } else { format!(", {:.3} m/s{turn}", scene.track.cruise) };
    add("Task", format!("{task}{speed}"));
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
