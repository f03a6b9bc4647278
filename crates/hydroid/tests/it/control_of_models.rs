//! Closed loops in which an identified model is the plant.

use std::sync::Arc;

use hydroid::closed_loop::{
    self, ClosedLoopError, Conditions, ControlMethod, ControllerOptions, Metrics, Run, Scale, Scenario,
    SpeedOptions, Task, Track, TruePlant, tune_autopilot,
};
use hydroid::manoeuvre::{Approach, Options, Response};
use hydroid::model::Model;
use hydroid::plant::{InputMap, Simulation};
use hydroid::progress::silent;
use hydroid_core::craft::Craft;
use hydroid_core::model::sparse::Term;

use crate::manoeuvre::{equations, port};

/// A boat with two thrusters, whose pulses of 1100 to 1900 us stop at 1500, and another one across the bow if it is wanted:
/// `du/dt = a (L + R - 3000) - b u`, `dv/dt = -c v - u r + e B`, `dr/dt = d (L - R) - f r + g B`, scaled by `size`.
fn boat(size: f64, drag: f64, bow: bool) -> Model {
    let mut outputs =
        vec![port("u", "m/s", -1.0, 2.5), port("v", "m/s", -0.5, 0.5), port("r", "rad/s", -1.0, 1.0)];
    for port in &mut outputs {
        port.noise = Some(if port.channel.unit == "m/s" { 0.01 } else { 0.003 });
        if port.channel.unit == "m/s" {
            (port.range.low, port.range.high) = (size * port.range.low, size * port.range.high);
        }
    }
    let mut inputs = vec![port("L", "us", 1100.0, 1900.0), port("R", "us", 1100.0, 1900.0)];
    if bow {
        inputs.push(port("B", "us", 1100.0, 1900.0));
    }
    let n = 3 + inputs.len();
    let mut terms: Vec<Term> = (0..n).map(|v| Term::monomial(&[u16::try_from(v).unwrap()])).collect();
    terms.push(Term::monomial(&[]));
    terms.push(Term::monomial(&[0, 2]));
    let count = terms.len();
    let mut coefficients = vec![0.0; 3 * count];
    let mut set = |row: usize, term: usize, value: f64| coefficients[row * count + term] = value;
    let push = 1e-3 * size;
    set(0, 0, -drag);
    set(0, 3, push);
    set(0, 4, push);
    set(0, count - 2, -3000.0 * push);
    set(1, 1, -1.5);
    set(1, count - 1, -1.0);
    set(2, 2, -1.2);
    set(2, 3, 1e-3);
    set(2, 4, -1e-3);
    if bow {
        set(1, 5, 2e-4 * size);
        set(1, count - 2, -0.3 * size);
        set(2, 5, 1e-3);
        set(2, count - 2, -1.5);
    }
    equations(outputs, inputs, 0.1, terms, coefficients)
}

fn response(model: &Model) -> Response {
    let inputs = InputMap::find(model).unwrap();
    let half = Options { propulsion: 0.5, speed_m_s: None };
    let approach = Approach::new(model, &inputs, Simulation::new(model).unwrap(), &half).unwrap();
    Response::about(&approach, &inputs).unwrap()
}

fn lawn_mower(model: &Arc<Model>, plant: &Arc<Model>) -> (Scenario, Scale) {
    let response = response(model);
    let scale = Scale::of(&response);
    let radius = 15.0 * scale.radius;
    let task = Task::LawnMower { leg: 2.0 * radius, spacing: 2.0 * radius, legs: 2, radius };
    let track = Track::new(&task, &SpeedOptions::cruise(response.speed_m_s)).unwrap();
    let mut scenario = Scenario::new(Arc::clone(plant), track);
    // The way of a second: the laws have no integral, so that drag and current leave an offset.
    scenario.tolerance = response.speed_m_s;
    scenario.start = [0.0, -0.5 * scale.radius];
    (scenario, scale)
}

fn steered(control: &ControllerOptions, scenario: &Scenario, conditions: &Conditions) -> Run {
    let mut controller = control.controller(conditions.seed).unwrap();
    closed_loop::run(scenario, conditions, controller.as_mut(), &mut silent()).unwrap()
}

/// `K = 0.8 / 1.2 rad/s` and `T = 1 / 1.2 s` for thrusters that differ by all of their range.
#[test]
fn the_response_of_a_linear_boat_is_analytic() {
    for (size, drag) in [(1.0, 0.4), (3.0, 0.2)] {
        let response = response(&boat(size, drag, false));
        assert!((response.yaw_gain_rad_s / (0.8 / 1.2) - 1.0).abs() < 1e-3, "{response:?}");
        assert!((response.yaw_time_s - 1.0 / 1.2).abs() <= 0.1, "{response:?}");
        let surge = response.surge.unwrap();
        assert!((surge.gain_m_s * drag / (0.8 * size) - 1.0).abs() < 0.02, "{response:?}");
        assert!((surge.time_s * drag - 1.0).abs() < 0.1, "{response:?}");
        assert!((response.speed_m_s * drag / (0.4 * size) - 1.0).abs() < 1e-4, "{response:?}");
        // With the same yaw rate, the radius grows with the speed.
        let steady = response.speed_m_s / response.yaw_gain_rad_s;
        assert!((response.turning_radius_m / steady - 1.0).abs() < 0.5, "{response:?}");
    }
}

/// Each law, for the boat itself and one with 10 % more drag, of the size of a boat and of a ship.
#[test]
fn boats_with_two_and_three_thrusters_follow_a_lawn_mower() {
    for (size, drag, bow) in [(1.0, 0.4, false), (1.0, 0.4, true), (3.0, 0.3, false)] {
        let (model, plant) = (Arc::new(boat(size, drag, bow)), Arc::new(boat(size, 1.1 * drag, bow)));
        let (scenario, scale) = lawn_mower(&model, &plant);
        assert!(scenario.limits.iter().all(|limits| limits.rest == 1500.0));
        let from_s = scenario.default_from_s();
        for law in [
            ControlMethod::CrossEntropy,
            ControlMethod::FeedbackLinearization,
            ControlMethod::Backstepping,
            ControlMethod::Autopilot,
        ] {
            let mut control = ControllerOptions::new(law, &scenario.plant, scenario.dt_s).scaled(scale);
            control.tolerance = scenario.tolerance;
            if law == ControlMethod::Autopilot {
                let inputs = InputMap::find(&model).unwrap();
                let own = Scenario { plant: Arc::clone(&model).into(), ..scenario.clone() };
                let tuned = tune_autopilot(&own, &inputs, own.track.cruise, from_s, &mut silent()).unwrap();
                control.autopilot = Some(tuned.gains);
            } else {
                control.model = Some(Arc::clone(&model));
            }
            let current = [0.05 * scenario.track.cruise, -0.05 * scenario.track.cruise];
            let conditions = Conditions { current, onset_s: 0.5 * from_s, ..Conditions::calm(3) };
            let metrics = Metrics::of(&steered(&control, &scenario, &conditions), from_s);
            println!("{size} {bow} {}: {:.4} m of {:.2}", law.name(), metrics.rms_cross_track, scale.radius);
            assert!(metrics.held && metrics.violations == 0, "{size} {bow} {}: {metrics:?}", law.name());
            assert!(
                metrics.rms_cross_track < 0.2 * 5.5 * scale.radius,
                "{size} {bow} {}: {}",
                law.name(),
                metrics.rms_cross_track
            );
        }
    }
}

/// A model of the equations of a vessel and the vessel itself are steered alike, in a current that sets in.
#[test]
fn a_current_moves_a_model_as_it_moves_a_vessel() {
    let model = Arc::new(boat(1.0, 0.4, false));
    let (scenario, scale) = lawn_mower(&model, &model);
    let mut control =
        ControllerOptions::new(ControlMethod::FeedbackLinearization, &scenario.plant, 0.1).scaled(scale);
    control.model = Some(Arc::clone(&model));
    let calm = Conditions { noise: 0.0, ..Conditions::calm(0) };
    let later = Conditions { current: [0.1, -0.05], onset_s: 10.0, ..calm };
    let (still, moved) = (steered(&control, &scenario, &calm), steered(&control, &scenario, &later));
    for (a, b) in still.samples.iter().zip(&moved.samples).take(101) {
        assert!((0..3).all(|i| (a.eta[i] - b.eta[i]).abs() < 1e-9 && (a.nu[i] - b.nu[i]).abs() < 1e-9));
    }
    let [a, b] = [&still, &moved].map(|run| run.samples[101].nu);
    let jump = (a[0] - b[0]).hypot(a[1] - b[1]);
    assert!(jump > 1e-5 && jump < 0.02, "{jump}");
    let [a, b] = [&still, &moved].map(|run| run.samples[160].eta);
    assert!((a[0] - b[0]).hypot(a[1] - b[1]) > 0.02);
    // The run is a log with the names of the model.
    let mut csv = Vec::new();
    moved.write_csv(&mut csv).unwrap();
    let head = String::from_utf8(csv).unwrap();
    assert!(
        head.starts_with("t [s],L [us],R [us],x [m],y [m],psi [rad],u [m/s],v [m/s],r [rad/s],u_true [m/s]"),
        "{}",
        &head[..120]
    );
    let log = moved.trajectory();
    assert_eq!((log.len(), log.inputs.width()), (moved.samples.len(), 2));
}

#[test]
fn what_a_model_cannot_simulate_is_refused() {
    let model = Arc::new(boat(1.0, 0.4, false));
    let (scenario, scale) = lawn_mower(&model, &model);
    let mut control = ControllerOptions::new(ControlMethod::CrossEntropy, &scenario.plant, 0.1).scaled(scale);
    control.model = Some(Arc::clone(&model));
    let refused = |scenario: &Scenario, conditions: &Conditions| {
        let mut controller = control.controller(0).unwrap();
        closed_loop::run(scenario, conditions, controller.as_mut(), &mut silent()).unwrap_err().to_string()
    };
    let heavy = Conditions { mass: 1.2, ..Conditions::calm(0) };
    assert!(refused(&scenario, &heavy).contains("another mass needs a vessel with given parameters"));
    let mut wind = Conditions::calm(0);
    wind.wind.force = [1.0, 0.0];
    assert!(refused(&scenario, &wind).contains("wind needs a vessel"));
    let coarse = Scenario { dt_s: 0.2, ..scenario.clone() };
    assert!(refused(&coarse, &Conditions::calm(0)).contains("identify both with the same dt"));
    // Another boat.
    let other: TruePlant = Craft::simple().into();
    let mut control = ControllerOptions::new(ControlMethod::CrossEntropy, &other, 0.1);
    control.model = Some(Arc::clone(&model));
    let error = control.controller(0).err().unwrap();
    assert!(
        matches!(&error, ClosedLoopError::Channels(why) if why.contains("its inputs are L, R")),
        "{error}"
    );
}
