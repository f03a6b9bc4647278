//! Closed loops on the true plants: closed-form results, independence of the number of threads, limits and statuses.

use std::sync::Arc;

use hydroid::adapt;
use hydroid::closed_loop::{
    self, AutopilotGains, ClosedLoopController, ClosedLoopError, Conditions, ControlMethod,
    ControllerOptions, Dispersion, Guidance, Measured, Metrics, ModelSession, Observation, Run, Sample,
    Scenario, SpeedOptions, Task, Timing, Track, Wind, monte_carlo, tune_autopilot,
};
use hydroid::log::Channel;
use hydroid::manoeuvre::Response;
use hydroid::model::Model;
use hydroid::plant::InputMap;
use hydroid::progress::silent;
use hydroid_core::actuator::Limits;
use hydroid_core::control::cem::PlannerOptions;
use hydroid_core::control::{AdaptiveAugmentationOptions, Status};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::{Pose, Reference};
use hydroid_core::memory::Memory;
use proptest::prelude::*;

fn circle(vessel: &Craft, radius: f64, speed: f64) -> Scenario {
    let track = Track::new(&Task::Circle { radius }, &SpeedOptions::cruise(speed)).unwrap();
    Scenario { start: [0.0, -0.5], ..Scenario::new(vessel.clone(), track) }
}

fn by(kind: ControlMethod, vessel: &Craft, model: &Craft) -> ControllerOptions {
    let mut control = ControllerOptions::new(kind, &vessel.clone().into(), 0.1);
    control.model = Some(Arc::new(Model::of_vessel(model, 0.1).unwrap()));
    control
}

fn simulated(control: &ControllerOptions, scenario: &Scenario, conditions: &Conditions) -> Run {
    let mut controller = control.controller(conditions.seed).unwrap();
    closed_loop::run(scenario, conditions, controller.as_mut(), &mut silent()).unwrap()
}

/// Metrics in docs/control.md for the true parameters.
#[test]
fn true_parameters_give_the_documented_errors_on_circles() {
    let vessel = Craft::hydrofoil();
    let control = by(ControlMethod::FeedbackLinearization, &vessel, &vessel);
    for (radius, speed, noisy) in [(15.0, 1.5, 0.0036), (25.0, 2.5, 0.0056), (30.0, 4.0, 0.0035)] {
        let scenario = circle(&vessel, radius, speed);
        let clean = Conditions { noise: 0.0, ..Conditions::calm(0) };
        let metrics = Metrics::of(&simulated(&control, &scenario, &clean), 40.0);
        assert!(metrics.rms_position < 1e-5 && metrics.held, "{}", metrics.rms_position);
        let mut all: Vec<f64> = (1..=5)
            .map(|seed| {
                Metrics::of(&simulated(&control, &scenario, &Conditions::calm(seed)), 40.0).rms_position
            })
            .collect();
        all.sort_by(f64::total_cmp);
        println!("{speed} m/s: {:.5} m", all[2]);
        assert!((all[2] - noisy).abs() < 1e-4, "{speed} m/s: {}", all[2]);
    }
}

struct ZeroCommand;

impl ClosedLoopController for ZeroCommand {
    fn lead(&self) -> f64 {
        0.0
    }

    fn timing(&self) -> Timing {
        Timing::Clock
    }

    fn reset(&mut self) {}

    fn visit_state(&mut self, _: &mut Memory<'_>) {}

    fn command(&mut self, _: &Observation<'_>, command: &mut [f64]) -> Status {
        command.fill(0.0);
        Status::Tracking
    }
}

#[test]
fn a_current_adds_to_the_pose_rate_only() {
    let vessel = Craft::simple();
    let scenario = Scenario { duration_s: 300.0, start: [0.0; 2], ..circle(&vessel, 50.0, 0.01) };
    let run = |current| {
        let conditions = Conditions { noise: 0.0, current, ..Conditions::calm(0) };
        closed_loop::run(&scenario, &conditions, &mut ZeroCommand, &mut silent()).unwrap()
    };
    let (still, moved) = (run([0.0; 2]), run([0.3, -0.1]));
    for (a, b) in still.samples.iter().zip(&moved.samples) {
        // Motion in still water plus the drift.
        assert!((b.eta[0] - a.eta[0] - 0.3 * a.t).abs() < 1e-9);
        assert!((b.eta[1] - a.eta[1] + 0.1 * a.t).abs() < 1e-9);
    }
    let last = moved.samples.last().unwrap();
    let (sin, cos) = last.eta[2].sin_cos();
    let measured = moved.measured(moved.samples.len() - 1);
    let north = measured[0] * cos - measured[1] * sin;
    assert!((north - 0.3).abs() < 1e-3, "velocities are over ground: {north}");
}

#[test]
fn conditions_set_in_at_their_time_and_the_velocity_over_ground_does_not_jump() {
    let vessel = Craft::simple();
    let control = by(ControlMethod::FeedbackLinearization, &vessel, &vessel);
    let scenario = Scenario { duration_s: 40.0, ..circle(&vessel, 20.0, 1.5) };
    let wind = Wind { force: [10.0, 5.0], ..Wind::CALM };
    let calm = Conditions { noise: 0.0, ..Conditions::calm(0) };
    let later = Conditions { current: [0.3, -0.2], mass: 1.2, wind, onset_s: 20.0, ..calm };
    let (still, moved) = (simulated(&control, &scenario, &calm), simulated(&control, &scenario, &later));
    let onset = 200;
    for (a, b) in still.samples.iter().zip(&moved.samples).take(onset + 1) {
        assert!((a.eta[0] - b.eta[0]).abs() < 1e-12 && (a.nu[0] - b.nu[0]).abs() < 1e-12, "{}", a.t);
    }
    // One sample later, the water has begun to move the vessel, by less than a tenth of its own velocity.
    let [a, b] = [&still, &moved].map(|run| run.samples[onset + 1].nu);
    let jump = (a[0] - b[0]).hypot(a[1] - b[1]);
    assert!(jump > 1e-4 && jump < 0.036, "{jump}");
    let [a, b] = [&still, &moved].map(|run| run.samples[onset + 100].eta);
    assert!((a[0] - b[0]).hypot(a[1] - b[1]) > 0.05);
}

/// Each law with the true vessel as the model, in a current that it does not know.
#[test]
fn control_laws_track_in_a_current_that_they_estimate() {
    let vessel = Craft::hydrofoil();
    let task = Task::LawnMower { leg: 40.0, spacing: 30.0, legs: 2, radius: 15.0 };
    let track = Track::new(&task, &SpeedOptions::cruise(2.0)).unwrap();
    let scenario = Scenario::new(vessel.clone(), track);
    let conditions = Conditions { current: [0.2, 0.3], ..Conditions::calm(3) };
    let planner = PlannerOptions { candidates: 40, elites: 4, iterations: 2, ..PlannerOptions::new(0) };
    for kind in
        [ControlMethod::FeedbackLinearization, ControlMethod::Backstepping, ControlMethod::CrossEntropy]
    {
        let over_ground = ControllerOptions { planner, ..by(kind, &vessel, &vessel) };
        let model = over_ground.model.as_ref().unwrap().with_current(0.3).unwrap();
        let in_water = ControllerOptions { model: Some(Arc::new(model)), ..over_ground.clone() };
        let [without, with] = [over_ground, in_water]
            .map(|control| Metrics::of(&simulated(&control, &scenario, &conditions), 20.0).rms_cross_track);
        println!("{}: {without:.4} m, {with:.4} m with the estimate", kind.name());
        assert!(with < 0.008 && with < 0.35 * without, "{}: {without}, {with}", kind.name());
    }
}

/// With linear drag a force `F` ahead drives the simple vessel at `F / 77.55` m/s.
#[test]
fn wind_drives_a_vessel_to_the_speed_at_which_drag_balances_it() {
    let vessel = Craft::simple();
    let path = Task::Waypoints { points: vec![[0.0, 0.0], [100.0, 0.0]], radius: None };
    let track = Track::new(&path, &SpeedOptions::cruise(0.01)).unwrap();
    let scenario = Scenario { duration_s: 60.0, ..Scenario::new(vessel, track) };
    let wind = Wind { force: [40.0, 0.0], ..Wind::CALM };
    let conditions = Conditions { noise: 0.0, wind, ..Conditions::calm(0) };
    let run = closed_loop::run(&scenario, &conditions, &mut ZeroCommand, &mut silent()).unwrap();
    let u = run.samples.last().unwrap().nu[0];
    assert!((u - 40.0 / 77.55).abs() < 1e-6, "{u}");
}

#[test]
fn a_delay_shifts_the_response() {
    struct Step(u32);
    impl ClosedLoopController for Step {
        fn lead(&self) -> f64 {
            0.0
        }
        fn timing(&self) -> Timing {
            Timing::Clock
        }
        fn reset(&mut self) {
            self.0 = 0;
        }
        fn visit_state(&mut self, _: &mut Memory<'_>) {}
        fn command(&mut self, _: &Observation<'_>, command: &mut [f64]) -> Status {
            self.0 += 1;
            command.copy_from_slice(&[if self.0 > 50 { 100.0 } else { 0.0 }, 0.0]);
            Status::Tracking
        }
    }
    let vessel = Craft::simple();
    let scenario = Scenario { duration_s: 20.0, start: [0.0; 2], ..circle(&vessel, 50.0, 1e-9) };
    let run = |delay_s| {
        let conditions = Conditions { noise: 0.0, delay_s, ..Conditions::calm(0) };
        closed_loop::run(&scenario, &conditions, &mut Step(0), &mut silent()).unwrap()
    };
    let between = Conditions { delay_s: 0.25, ..Conditions::calm(0) };
    let refused = closed_loop::run(&scenario, &between, &mut Step(0), &mut silent()).unwrap_err();
    assert!(refused.to_string().contains("give 0.2 or 0.3"), "{refused}");
    let (prompt, late) = (run(0.0), run(0.4));
    for (a, b) in prompt.samples.iter().zip(&late.samples[4..]) {
        assert!((a.nu[0] - b.nu[0]).abs() < 1e-9, "{} s", a.t);
    }
}

#[test]
fn monte_carlo_does_not_depend_on_the_number_of_threads() {
    let vessel = Craft::hydrofoil();
    let scenario = Scenario { duration_s: 30.0, ..circle(&vessel, 15.0, 1.5) };
    let control = by(ControlMethod::Backstepping, &vessel, &vessel);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let about = Conditions::calm(3);
        let mut all = pool
            .install(|| {
                monte_carlo(&control, &scenario, &about, &Dispersion::default(), 12, 10.0, &mut silent())
            })
            .unwrap();
        for trial in &mut all.trials {
            trial.metrics.us_per_command = closed_loop::Times { median: 0.0, max: 0.0 };
        }
        all
    };
    let one = run(1);
    assert_eq!(one, run(3));
    assert_eq!((one.runs, one.violations, one.undetected_losses), (12, 0, 0));
    let masses: Vec<f64> = one.trials.iter().map(|o| o.conditions.mass).collect();
    assert!(masses.iter().all(|m| (0.8..=1.2).contains(m)) && masses[0] != masses[1]);
}

/// A model with too little drag: the control law and the planner use the adapted model, which removes most of the
/// error.
#[test]
fn controllers_use_the_adapted_model() {
    let vessel = Craft::hydrofoil();
    let mut wrong = vessel.clone();
    // Drag too small by 40 %.
    wrong.hull.quadratic[0][0] *= 0.6;
    wrong.hull.linear[0][0] *= 0.6;
    let scenario = circle(&vessel, 15.0, 1.5);
    for kind in [ControlMethod::FeedbackLinearization, ControlMethod::CrossEntropy] {
        let mut control = by(kind, &vessel, &wrong);
        control.planner = PlannerOptions { candidates: 40, elites: 6, iterations: 2, ..control.planner };
        let frozen = Metrics::of(&simulated(&control, &scenario, &Conditions::calm(1)), 40.0);
        let model = control.model.clone().unwrap();
        let options = adapt::Options {
            method: adapt::Method::Kalman,
            kalman: adapt::KalmanOptions::of_plants(),
            ..adapt::Options::default()
        };
        control.adapt = Some(options.guarded(&model));
        let adapted = Metrics::of(&simulated(&control, &scenario, &Conditions::calm(1)), 40.0);
        println!("{kind:?}: {:.4} m frozen, {:.4} m adapted", frozen.rms_position, adapted.rms_position);
        assert!(adapted.held && adapted.rms_position < 0.6 * frozen.rms_position);
    }
}

#[test]
fn the_tuned_autopilot_holds_a_lawn_mower() {
    let vessel = Craft::simple();
    let task = Task::LawnMower { leg: 30.0, spacing: 24.0, legs: 2, radius: 12.0 };
    let track = Track::new(&task, &SpeedOptions::cruise(1.5)).unwrap();
    let scenario = Scenario::new(vessel.clone(), track);
    let inputs = InputMap::find(&Model::of_vessel(&vessel, 0.1).unwrap()).unwrap();
    let tuned = tune_autopilot(&scenario, &inputs, 1.5, 10.0, &mut silent()).unwrap();
    assert!(tuned.seeds.iter().all(|seed| *seed > 1_000_000));
    let Response { yaw_gain_rad_s: gain, yaw_time_s: time, .. } = tuned.response;
    // Sway and yaw at 1.5 m/s are linear; the coefficients (rudder in 10 N s) are from an independent implementation.
    let rates = |[v, r]: [f64; 2]| {
        let u = 1.5;
        [
            -1.045_321 * v + (0.239_673 - 0.517_485 * u) * r - 0.016_632 * u * 0.1,
            0.669_519 * v - (2.063_346 + 0.128_064 * u) * r + 0.245_695 * u * 0.1,
        ]
    };
    let (mut motion, mut rates_seen) = ([0.0; 2], Vec::new());
    for _ in 0..100_000 {
        let [dv, dr] = rates(motion);
        motion = [motion[0] + 1e-4 * dv, motion[1] + 1e-4 * dr];
        rates_seen.push(motion[1]);
    }
    let largest = rates_seen.iter().copied().fold(0.0, f64::max);
    let risen = rates_seen.iter().position(|r| *r >= 0.632 * largest).unwrap() as f64 * 1e-4;
    assert!(
        (gain / inputs.turn[1] / largest - 1.0).abs() < 0.005 && (time - risen).abs() < 0.1,
        "{gain} {time} {largest} {risen}"
    );
    let mut control = ControllerOptions::new(ControlMethod::Autopilot, &scenario.plant, 0.1);
    control.autopilot = Some(tuned.gains.clone());
    let run = simulated(&control, &scenario, &Conditions::calm(1));
    let metrics = Metrics::of(&run, 10.0);
    println!("cross-track {:.3} m, speed {:.4} m/s", metrics.rms_cross_track, metrics.rms_speed);
    assert!(metrics.held && metrics.arrived == Some(true) && metrics.rms_cross_track < 0.15);
    assert_eq!(tuned, tune_autopilot(&scenario, &inputs, 1.5, 10.0, &mut silent()).unwrap());
}

#[test]
fn the_default_evaluation_start_leaves_samples_on_a_short_track() {
    let vessel = Craft::simple();
    let task = Task::Waypoints { points: vec![[0.0, 0.0], [9.0, 0.0]], radius: None };
    let track = Track::new(&task, &SpeedOptions::cruise(1.5)).unwrap();
    let scenario = Scenario { duration_s: 120.0, ..Scenario::new(vessel.clone(), track) };
    assert!((scenario.default_from_s() - 3.0).abs() < 0.1, "{}", scenario.default_from_s());
    let control = by(ControlMethod::FeedbackLinearization, &vessel, &vessel);
    let run = simulated(&control, &scenario, &Conditions::calm(0));
    let metrics = Metrics::of(&run, scenario.default_from_s());
    assert!(metrics.held && metrics.rms_position.is_finite(), "{metrics:?}");
    assert!(!Metrics::of(&run, 60.0).held);
    let late = monte_carlo(
        &control,
        &scenario,
        &Conditions::calm(0),
        &Dispersion::default(),
        2,
        120.0,
        &mut silent(),
    );
    assert!(matches!(late, Err(ClosedLoopError::EvaluationStart { .. })));
    assert!((circle(&vessel, 15.0, 1.5).default_from_s() - 40.0).abs() < 1e-9);
}

/// A controller whose state is restored after 20 s gives the commands of the first one to the last bit.
#[test]
fn a_restored_controller_continues_identically() {
    let vessel = Craft::hydrofoil();
    let scenario = circle(&vessel, 15.0, 1.5);
    let model = Model::of_vessel(&vessel, 0.1).unwrap();
    let of = |kind| by(kind, &vessel, &vessel);
    let integral = ControllerOptions { integral: 0.5, ..of(ControlMethod::FeedbackLinearization) };
    let learned = Some(AdaptiveAugmentationOptions::default());
    let augmented = ControllerOptions { learned, ..of(ControlMethod::FeedbackLinearization) };
    let mut pid = ControllerOptions::new(ControlMethod::Autopilot, &vessel.clone().into(), 0.1);
    pid.autopilot = Some(gains(&scenario));
    let mut cem = of(ControlMethod::CrossEntropy);
    cem.planner.hold = 2;
    for control in [integral, augmented, of(ControlMethod::Backstepping), cem, pid] {
        let fresh = || {
            let law = control.law(3, None).unwrap();
            let guidance = Guidance::new(scenario.track.clone(), law.as_ref(), 0.1);
            (law, guidance)
        };
        let (mut law, mut guidance) = fresh();
        let (mut other, mut others) = fresh();
        let mut session = model.session();
        let mut commands = [[f64::NAN; 2]; 2];
        for k in 0..400 {
            let t = 0.1 * f64::from(k);
            let pose = scenario.track.path.at(1.45 * t + 0.3 * t.sin());
            let eta =
                [pose.position[0] + 0.2 * (0.9 * t).cos(), pose.position[1], pose.course + 0.1 * t.sin()];
            let nu = [1.5 + 0.1 * t.sin(), 0.02 * t.cos(), 0.1 + 0.02 * (0.7 * t).sin()];
            let mut outputs = vec![f64::NAN; session.outputs()];
            outputs[..3].copy_from_slice(&nu);
            session.observe(&outputs);
            let measured = Measured {
                eta,
                nu,
                outputs: &outputs,
                session: Some(ModelSession { predictor: session.as_ref(), weights: None }),
            };
            if k == 201 {
                let state = Memory::saved(|memory| {
                    law.visit_state(memory);
                    guidance.visit_state(memory);
                });
                let mut saved = Memory::Loading(&state);
                other.visit_state(&mut saved);
                others.visit_state(&mut saved);
                assert!(matches!(saved, Memory::Loading([])));
            }
            let guided = guidance.command(law.as_mut(), &measured, &mut commands[0]);
            guidance.advance();
            if k > 200 {
                assert_eq!(others.command(other.as_mut(), &measured, &mut commands[1]), guided);
                others.advance();
                assert_eq!(commands[0], commands[1], "{:?}, sample {k}", control.method);
            }
            session.advance(&commands[0]);
        }
        assert!(commands[0].iter().all(|c| c.is_finite()));
    }
}

#[test]
fn unsuitable_models_and_scenarios_are_refused() {
    let vessel = Craft::hydrofoil();
    let learns = adapt::Options::of(&Model::of_vessel(&vessel, 0.1).unwrap());
    assert_eq!((learns.method, learns.kalman), (adapt::Method::Kalman, adapt::KalmanOptions::of_plants()));
    let refused =
        |control: &ControllerOptions| control.controller(0).err().map(|error| error.to_string()).unwrap();
    let bare = ControllerOptions::new(ControlMethod::FeedbackLinearization, &vessel.clone().into(), 0.1);
    assert!(matches!(bare.controller(0).err(), Some(ClosedLoopError::NoModel { .. })));
    let other = by(ControlMethod::CrossEntropy, &vessel, &Craft::simple());
    assert!(refused(&other).contains("identify with inputs=\"PP_cmd,RD_ang\""), "{}", refused(&other));
    let mut needless = by(ControlMethod::Autopilot, &vessel, &vessel);
    needless.autopilot = None;
    assert!(refused(&needless).contains("uses no model"));
    let scenario = circle(&vessel, 15.0, 1.5);
    let mut controller = by(ControlMethod::FeedbackLinearization, &vessel, &vessel).controller(0).unwrap();
    let wrong = |conditions: &Conditions, controller: &mut dyn ClosedLoopController| {
        closed_loop::run(&scenario, conditions, controller, &mut silent())
            .err()
            .map(|error| error.to_string())
            .unwrap()
    };
    let heavy = Conditions { mass: -1.0, ..Conditions::calm(0) };
    assert!(wrong(&heavy, controller.as_mut()).contains("mass"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// For any disturbance, limits and start: commands stay within their limits, and a lost vessel has status `lost`.
    #[test]
    fn commands_keep_their_limits_and_failures_have_a_status(
        kind in 0usize..4, seed in 0u64..1000, tight in 0.1..1.0f64, rate in 0.05..5.0f64,
        current in (-1.0..1.0f64, -1.0..1.0f64), wind in (-60.0..60.0f64, -60.0..60.0f64),
        mass in 0.6..1.6f64, delay in 0usize..6, onset_s in prop_oneof![Just(0.0), 0.1..15.0f64], start in (-5.0..5.0f64, -5.0..5.0f64), speed in 0.3..5.0f64,
    ) {
        let vessel = Craft::hydrofoil();
        let kind = [ControlMethod::FeedbackLinearization, ControlMethod::Backstepping, ControlMethod::CrossEntropy, ControlMethod::Autopilot][kind];
        let mut scenario = circle(&vessel, 12.0, speed);
        scenario.duration_s = 20.0;
        scenario.start = start.into();
        scenario.limits = vec![
            Limits::between([-130.0 * tight, 350.0 * tight]).with_rate(200.0 * rate),
            Limits::between([-0.5 * tight, 0.4 * tight]).with_rate(rate),
        ];
        let mut control = ControllerOptions::new(kind, &scenario.plant, 0.1);
        if kind == ControlMethod::Autopilot {
            let easy = circle(&vessel, 12.0, 1.5);
            control.autopilot = Some(gains(&easy));
        } else {
            control = by(kind, &vessel, &vessel);
        }
        control.limits.clone_from(&scenario.limits);
        control.planner = PlannerOptions { candidates: 20, elites: 4, iterations: 2, horizon: 10, ..control.planner };
        let conditions = Conditions {
            seed, noise: 1.0, process_noise: 0.0, current: current.into(), mass, delay_s: 0.1 * delay as f64, onset_s,
            wind: Wind { force: wind.into(), gust: 20.0, gust_s: 3.0 },
        };
        let metrics = Metrics::of(&simulated(&control, &scenario, &conditions), 10.0);
        prop_assert_eq!((metrics.violations, metrics.undetected_losses), (0, 0));
        prop_assert!(!metrics.diverged);
    }
}

/// Untuned gains.
fn gains(scenario: &Scenario) -> AutopilotGains {
    use hydroid_core::control::{AutopilotOptions, HeadingGains, SpeedGains};
    use hydroid_core::guidance::LineOfSightOptions;
    let inputs = InputMap::find(&Model::of_vessel(&Craft::hydrofoil(), 0.1).unwrap()).unwrap();
    let options = AutopilotOptions {
        line_of_sight: LineOfSightOptions { lookahead: 4.0, integral: 0.1 },
        heading: HeadingGains::nomoto(1.0, 0.5, 1.0, 1.0, 1.5),
        speed: SpeedGains { proportional: 0.2, integral: 0.02, trim: [0.0, 0.1] },
        steerage: 0.2,
        tolerance: scenario.tolerance,
    };
    AutopilotGains { options, inputs }
}

/// A run with a constant error of 0.5 m.
fn constant_error(samples: usize) -> Run {
    let pose = Pose { position: [0.0; 2], course: 0.0, curvature: 0.0 };
    let reference = Reference::new(0.0, &pose, 1.0, 0.0);
    let sample = |k: usize| Sample {
        t: 0.1 * k as f64,
        eta: [0.0; 3],
        nu: [0.0; 3],
        reference,
        distance: 0.5,
        cross_track: -0.5,
        speed_error: 0.1,
        status: Status::Tracking,
        time_us: 1.0,
    };
    Run {
        samples: (0..samples).map(sample).collect(),
        inputs: vec![Channel::new("c", "")],
        outputs: Vec::new(),
        measured_outputs: 0,
        commands: vec![0.0; samples],
        measured: Vec::new(),
        truth: Vec::new(),
        dt_s: 0.1,
        limits: vec![Limits::between([-1.0, 1.0])],
        tolerance: 2.0,
        arrived: None,
        diverged: false,
    }
}

fn figures(m: &Metrics) -> [f64; 4] {
    [m.rms_position, m.rms_cross_track, m.rms_speed, m.max_cross_track]
}

#[test]
fn failed_runs_have_infinite_errors() {
    let sound = Metrics::of(&constant_error(100), 5.0);
    assert!(sound.held && (sound.rms_position - 0.5).abs() < 1e-12 && sound.max_cross_track == 0.5);
    let early = Metrics::of(&constant_error(20), 5.0);
    assert!(!early.held && figures(&early) == [f64::INFINITY; 4], "{early:?}");
    let told = serde_json::to_value(&early).unwrap();
    assert!(told["rms_position"].is_null() && told["max_cross_track"].is_null());
    let lost = Metrics::of(&Run { diverged: true, ..constant_error(100) }, 5.0);
    assert!(!lost.held && figures(&lost) == [f64::INFINITY; 4], "{lost:?}");
    let mut broken = constant_error(100);
    broken.samples[80].cross_track = f64::NAN;
    let broken = Metrics::of(&broken, 5.0);
    assert_eq!((broken.rms_cross_track, broken.max_cross_track), (f64::INFINITY, f64::INFINITY));
}
