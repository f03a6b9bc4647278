//! Closed loops on the true plants: what is known in closed form, what must not depend on threads, and what must never happen.

use std::sync::Arc;

use hydroid::adapt;
use hydroid::model::Model;
use hydroid::progress::silent;
use hydroid::steer::{
    Conditions, Course, Helm, Kind, Metrics, Pace, Scene, Sight, Spread, SteerError, Steering, Task, Timing,
    Voyage, Wind, fleet, sail, tune,
};
use hydroid_core::control::cem::PlannerSettings;
use hydroid_core::control::{Limits, Status};
use hydroid_core::vessel::VesselParams;
use proptest::prelude::*;

fn circle(vessel: &VesselParams, radius: f64, speed: f64) -> Scene {
    let course = Course::new(&Task::Circle { radius }, &Pace::cruise(speed)).unwrap();
    Scene { start: [0.0, -0.5], ..Scene::new(vessel.clone(), course) }
}

fn by(kind: Kind, vessel: &VesselParams, model: &VesselParams) -> Steering {
    let mut steering = Steering::new(kind, vessel, 0.1);
    steering.model = Some(Arc::new(Model::of_vessel(model, 0.1).unwrap()));
    steering
}

fn sailed(steering: &Steering, scene: &Scene, conditions: &Conditions) -> Voyage {
    let mut helm = steering.helm(conditions.seed).unwrap();
    sail(scene, conditions, helm.as_mut(), &mut silent()).unwrap()
}

/// Those of docs/control.md: true parameters, the hydrofoil's circles.
#[test]
fn true_parameters_hold_the_circles_as_closely_as_the_documentation_says() {
    let vessel = VesselParams::hydrofoil();
    let steering = by(Kind::FeedbackLinearization, &vessel, &vessel);
    for (radius, speed, noisy) in [(15.0, 1.5, 0.0036), (25.0, 2.5, 0.0056), (30.0, 4.0, 0.0035)] {
        let scene = circle(&vessel, radius, speed);
        let clean = Conditions { noise: 0.0, ..Conditions::calm(0) };
        let metrics = Metrics::of(&sailed(&steering, &scene, &clean), 40.0);
        assert!(metrics.rms_position < 1e-5 && metrics.held, "{}", metrics.rms_position);
        let mut all: Vec<f64> = (1..=5)
            .map(|seed| Metrics::of(&sailed(&steering, &scene, &Conditions::calm(seed)), 40.0).rms_position)
            .collect();
        all.sort_by(f64::total_cmp);
        println!("{speed} m/s: {:.5} m", all[2]);
        assert!((all[2] - noisy).abs() < 1e-4, "{speed} m/s: {}", all[2]);
    }
}

/// Commands nothing at all.
struct Adrift;

impl Helm for Adrift {
    fn lead(&self) -> f64 {
        0.0
    }

    fn timing(&self) -> Timing {
        Timing::Clock
    }

    fn reset(&mut self) {}

    fn command(&mut self, _: &Sight<'_>, command: &mut [f64; 2]) -> Status {
        command.fill(0.0);
        Status::Tracking
    }
}

#[test]
fn a_vessel_adrift_goes_with_the_current() {
    let vessel = VesselParams::simple();
    let scene = Scene { duration_s: 300.0, start: [0.0; 2], ..circle(&vessel, 50.0, 0.01) };
    let run = |current| {
        let conditions = Conditions { noise: 0.0, current, ..Conditions::calm(0) };
        sail(&scene, &conditions, &mut Adrift, &mut silent()).unwrap()
    };
    let (still, moved) = (run([0.0; 2]), run([0.3, -0.1]));
    for (a, b) in still.moments.iter().zip(&moved.moments) {
        // As through still water, and with the water.
        assert!((b.state.x - a.state.x - 0.3 * a.t).abs() < 1e-9);
        assert!((b.state.y - a.state.y + 0.1 * a.t).abs() < 1e-9);
    }
    let last = moved.moments.last().unwrap();
    let (sin, cos) = last.state.psi.sin_cos();
    let north = last.measured[0] * cos - last.measured[1] * sin;
    assert!((north - 0.3).abs() < 1e-3, "velocities are told over ground: {north}");
}

/// Linear drag: a force `F` ahead drives the simple vessel at `F / 77.55` m/s.
#[test]
fn wind_pushes_a_vessel_to_the_speed_at_which_drag_holds_it() {
    let vessel = VesselParams::simple();
    let path = Task::Waypoints { points: vec![[0.0, 0.0], [100.0, 0.0]], radius: None };
    let course = Course::new(&path, &Pace::cruise(0.01)).unwrap();
    let scene = Scene { duration_s: 60.0, ..Scene::new(vessel, course) };
    let wind = Wind { force: [40.0, 0.0], ..Wind::CALM };
    let conditions = Conditions { noise: 0.0, wind, ..Conditions::calm(0) };
    let voyage = sail(&scene, &conditions, &mut Adrift, &mut silent()).unwrap();
    let u = voyage.moments.last().unwrap().state.u;
    assert!((u - 40.0 / 77.55).abs() < 1e-6, "{u}");
}

#[test]
fn a_delay_shifts_what_commands_do_by_as_much() {
    struct Step(u32);
    impl Helm for Step {
        fn lead(&self) -> f64 {
            0.0
        }
        fn timing(&self) -> Timing {
            Timing::Clock
        }
        fn reset(&mut self) {
            self.0 = 0;
        }
        fn command(&mut self, _: &Sight<'_>, command: &mut [f64; 2]) -> Status {
            self.0 += 1;
            *command = [if self.0 > 50 { 100.0 } else { 0.0 }, 0.0];
            Status::Tracking
        }
    }
    let vessel = VesselParams::simple();
    let scene = Scene { duration_s: 20.0, start: [0.0; 2], ..circle(&vessel, 50.0, 1e-9) };
    let run = |delay_s| {
        let conditions = Conditions { noise: 0.0, delay_s, ..Conditions::calm(0) };
        sail(&scene, &conditions, &mut Step(0), &mut silent()).unwrap()
    };
    let between = Conditions { delay_s: 0.25, ..Conditions::calm(0) };
    let refused = sail(&scene, &between, &mut Step(0), &mut silent()).unwrap_err();
    assert!(refused.to_string().contains("give 0.2 or 0.3"), "{refused}");
    let (prompt, late) = (run(0.0), run(0.4));
    for (a, b) in prompt.moments.iter().zip(&late.moments[4..]) {
        assert!((a.state.u - b.state.u).abs() < 1e-9, "{} s", a.t);
    }
}

#[test]
fn many_voyages_do_not_depend_on_the_number_of_threads() {
    let vessel = VesselParams::hydrofoil();
    let scene = Scene { duration_s: 30.0, ..circle(&vessel, 15.0, 1.5) };
    let steering = by(Kind::Backstepping, &vessel, &vessel);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let about = Conditions::calm(3);
        let mut all = pool
            .install(|| fleet(&steering, &scene, &about, &Spread::default(), 12, 10.0, &mut silent()))
            .unwrap();
        for outing in &mut all.outings {
            outing.metrics.us_per_command = hydroid::steer::Times { median: 0.0, max: 0.0 };
        }
        all
    };
    let one = run(1);
    assert_eq!(one, run(3));
    assert_eq!((one.runs, one.violations, one.unsaid), (12, 0, 0));
    let masses: Vec<f64> = one.outings.iter().map(|o| o.conditions.mass).collect();
    assert!(masses.iter().all(|m| (0.8..=1.2).contains(m)) && masses[0] != masses[1]);
}

/// A vessel with 20 % more mass: what it learns under way is steered by, law or plan, and takes most of the error away.
#[test]
fn what_is_learned_on_the_way_is_steered_by() {
    let vessel = VesselParams::hydrofoil();
    let mut wrong = vessel.clone();
    // A third less drag than there is.
    wrong.drag.quadratic[0][0] *= 0.6;
    wrong.drag.linear[0][0] *= 0.6;
    let scene = circle(&vessel, 15.0, 1.5);
    for kind in [Kind::FeedbackLinearization, Kind::CrossEntropy] {
        let mut steering = by(kind, &vessel, &wrong);
        steering.planner = PlannerSettings { candidates: 40, elites: 6, iterations: 2, ..steering.planner };
        let frozen = Metrics::of(&sailed(&steering, &scene, &Conditions::calm(1)), 40.0);
        let model = steering.model.clone().unwrap();
        let options = adapt::Options {
            method: adapt::Method::Kalman,
            kalman: adapt::Kalman::of_plants(),
            ..adapt::Options::default()
        };
        steering.adapt = Some(options.guarded(&model));
        let adapted = Metrics::of(&sailed(&steering, &scene, &Conditions::calm(1)), 40.0);
        println!("{kind:?}: {:.4} m frozen, {:.4} m adapted", frozen.rms_position, adapted.rms_position);
        assert!(adapted.held && adapted.rms_position < 0.6 * frozen.rms_position);
    }
}

#[test]
fn the_autopilot_is_tuned_on_seeds_of_its_own_and_holds_a_lawn_mower() {
    let vessel = VesselParams::simple();
    let task = Task::LawnMower { leg: 30.0, spacing: 24.0, legs: 2, radius: 12.0 };
    let course = Course::new(&task, &Pace::cruise(1.5)).unwrap();
    let scene = Scene::new(vessel.clone(), course);
    let tuned = tune(&scene, 1.5, 10.0, &mut silent()).unwrap();
    assert!(tuned.seeds.iter().all(|seed| *seed > 1_000_000));
    let [gain, time] = tuned.nomoto;
    // Sway and yaw at 1.5 m/s are linear; their coefficients as an independent implementation has them, the rudder in 10 N s.
    let rates = |[v, r]: [f64; 2]| {
        let u = 1.5;
        [
            -1.045_321 * v + (0.239_673 - 0.517_485 * u) * r - 0.016_632 * u * 0.1,
            0.669_519 * v - (2.063_346 + 0.128_064 * u) * r + 0.245_695 * u * 0.1,
        ]
    };
    let (mut motion, mut turned) = ([0.0; 2], Vec::new());
    for _ in 0..100_000 {
        let [dv, dr] = rates(motion);
        motion = [motion[0] + 1e-4 * dv, motion[1] + 1e-4 * dr];
        turned.push(motion[1]);
    }
    let risen = turned.iter().position(|r| *r >= 0.632 * motion[1]).unwrap() as f64 * 1e-4;
    assert!(
        (gain / motion[1] - 1.0).abs() < 0.01 && (time - risen).abs() < 0.02,
        "{gain} {time} {motion:?} {risen}"
    );
    let mut steering = Steering::new(Kind::Autopilot, &vessel, 0.1);
    steering.autopilot = Some(tuned.settings);
    let voyage = sailed(&steering, &scene, &Conditions::calm(1));
    let metrics = Metrics::of(&voyage, 10.0);
    println!("cross-track {:.3} m, speed {:.4} m/s", metrics.rms_cross_track, metrics.rms_speed);
    assert!(metrics.held && metrics.arrived == Some(true) && metrics.rms_cross_track < 0.15);
    assert_eq!(tuned, tune(&scene, 1.5, 10.0, &mut silent()).unwrap());
}

/// The time from which errors count leaves something to count.
#[test]
fn a_short_course_counts_from_its_middle_on_and_none_from_its_end() {
    let vessel = VesselParams::simple();
    let task = Task::Waypoints { points: vec![[0.0, 0.0], [9.0, 0.0]], radius: None };
    let course = Course::new(&task, &Pace::cruise(1.5)).unwrap();
    let scene = Scene { duration_s: 120.0, ..Scene::new(vessel.clone(), course) };
    assert!((scene.usual_from_s() - 3.0).abs() < 0.1, "{}", scene.usual_from_s());
    let steering = by(Kind::FeedbackLinearization, &vessel, &vessel);
    let voyage = sailed(&steering, &scene, &Conditions::calm(0));
    let metrics = Metrics::of(&voyage, scene.usual_from_s());
    assert!(metrics.held && metrics.rms_position.is_finite(), "{metrics:?}");
    assert!(!Metrics::of(&voyage, 60.0).held);
    let late = fleet(&steering, &scene, &Conditions::calm(0), &Spread::default(), 2, 120.0, &mut silent());
    assert!(matches!(late, Err(SteerError::From { .. })));
    assert!((circle(&vessel, 15.0, 1.5).usual_from_s() - 40.0).abs() < 1e-9);
}

#[test]
fn what_cannot_steer_says_why() {
    let vessel = VesselParams::hydrofoil();
    let learns = adapt::Options::of(&Model::of_vessel(&vessel, 0.1).unwrap());
    assert_eq!((learns.method, learns.kalman), (adapt::Method::Kalman, adapt::Kalman::of_plants()));
    let refused = |steering: &Steering| steering.helm(0).err().map(|error| error.to_string()).unwrap();
    let bare = Steering::new(Kind::FeedbackLinearization, &vessel, 0.1);
    assert!(matches!(bare.helm(0).err(), Some(SteerError::NoModel { .. })));
    let other = by(Kind::CrossEntropy, &vessel, &VesselParams::simple());
    assert!(refused(&other).contains("identify with --inputs PP_cmd,RD_ang"), "{}", refused(&other));
    let mut needless = by(Kind::Autopilot, &vessel, &vessel);
    needless.autopilot = None;
    assert!(refused(&needless).contains("without a model"));
    let scene = Scene { dt_s: 0.015, ..circle(&vessel, 15.0, 1.5) };
    let mut helm = by(Kind::FeedbackLinearization, &vessel, &vessel).helm(0).unwrap();
    let wrong = |conditions: &Conditions, helm: &mut dyn Helm| {
        sail(&scene, conditions, helm, &mut silent()).err().map(|error| error.to_string()).unwrap()
    };
    assert!(wrong(&Conditions::calm(0), helm.as_mut()).contains("whole number of integration steps"));
    let heavy = Conditions { mass: -1.0, ..Conditions::calm(0) };
    assert!(wrong(&heavy, helm.as_mut()).contains("mass"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever the weather, limits and start: commands are numbers within their limits, and what is lost says so.
    #[test]
    fn commands_keep_their_limits_and_failures_have_a_status(
        kind in 0usize..4, seed in 0u64..1000, tight in 0.1..1.0f64, rate in 0.05..5.0f64,
        current in (-1.0..1.0f64, -1.0..1.0f64), wind in (-60.0..60.0f64, -60.0..60.0f64),
        mass in 0.6..1.6f64, delay in 0usize..6, start in (-5.0..5.0f64, -5.0..5.0f64), speed in 0.3..5.0f64,
    ) {
        let vessel = VesselParams::hydrofoil();
        let kind = [Kind::FeedbackLinearization, Kind::Backstepping, Kind::CrossEntropy, Kind::Autopilot][kind];
        let mut scene = circle(&vessel, 12.0, speed);
        scene.duration_s = 20.0;
        scene.start = start.into();
        scene.limits = [
            Limits::between([-130.0 * tight, 350.0 * tight]).with_rate(200.0 * rate),
            Limits::between([-0.5 * tight, 0.4 * tight]).with_rate(rate),
        ];
        let mut steering = Steering::new(kind, &vessel, 0.1);
        if kind == Kind::Autopilot {
            let easy = circle(&vessel, 12.0, 1.5);
            steering.autopilot = Some(gains(&easy));
        } else {
            steering = by(kind, &vessel, &vessel);
        }
        steering.limits = scene.limits;
        steering.planner = PlannerSettings { candidates: 20, elites: 4, iterations: 2, horizon: 10, ..steering.planner };
        let conditions = Conditions {
            seed, noise: 1.0, current: current.into(), mass, delay_s: 0.1 * delay as f64,
            wind: Wind { force: wind.into(), gust: 20.0, gust_s: 3.0 },
        };
        let metrics = Metrics::of(&sailed(&steering, &scene, &conditions), 10.0);
        prop_assert_eq!((metrics.violations, metrics.unsaid), (0, 0));
        prop_assert!(!metrics.diverged);
    }
}

/// Gains that nobody has tuned.
fn gains(scene: &Scene) -> hydroid_core::control::AutopilotSettings {
    use hydroid_core::control::{AutopilotSettings, HeadingGains, SpeedGains};
    use hydroid_core::guidance::LineOfSightSettings;
    AutopilotSettings {
        line_of_sight: LineOfSightSettings { lookahead: 4.0, integral: 0.1 },
        heading: HeadingGains::nomoto(1.0, 0.5, 1.0, 1.0, 1.5),
        speed: SpeedGains { proportional: 60.0, integral: 8.0, drag: [20.0, 18.0] },
        steerage: 0.2,
        tolerance: scene.tolerance,
    }
}
