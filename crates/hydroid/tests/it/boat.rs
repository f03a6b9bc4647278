//! Roles of inputs: a rudder steers and does not push, the wind is not an actuator.

use std::fmt::Write as _;
use std::sync::Arc;

use hydroid::boat::{Boat, Evidence, Input, Property, Role, StatedRoles};
use hydroid::closed_loop::{ClosedLoopError, ControlMethod, ControllerOptions, TruePlant, limits_of};
use hydroid::config::{self, Config, Logs, TrialName};
use hydroid::identify::identify;
use hydroid::log::{Channel, RawLog};
use hydroid::manoeuvre::{Approach, Options, Trials};
use hydroid::model::{self, Model};
use hydroid::plant::{InputMap, Simulation, find_roles};
use hydroid::progress::silent;
use hydroid_core::actuator::Limits;
use hydroid_core::control::cem::{Cost, Planner, PlannerOptions};
use hydroid_core::craft::Craft;
use hydroid_core::guidance::Reference;
use hydroid_core::model::sparse::Term;

use crate::manoeuvre::{equations, port};

/// A ship at a constant shaft speed: `du/dt = 0.05 (4 - u) - 0.4 delta^2 - 0.3 r^2`, even in the rudder, and
/// `dr/dt = 0.05 u delta - 0.2 r`, odd in it; it does not move sideways. Its largest angle is that of a log.
pub(crate) fn rudder_only(name: &str, unit: &str) -> Model {
    let outputs =
        vec![port("u", "m/s", 3.0, 4.2), port("v", "m/s", -0.1, 0.1), port("r", "rad/s", -0.4, 0.4)];
    let inputs = vec![port(name, unit, -20.25_f64.to_radians(), 20.25_f64.to_radians())];
    let terms = [&[][..], &[0], &[3, 3], &[2, 2], &[0, 3], &[2]];
    let terms = terms.iter().map(|variables| Term::monomial(variables)).collect();
    let surge = [0.2, -0.05, -0.4, -0.3, 0.0, 0.0];
    let yaw = [0.0, 0.0, 0.0, 0.0, 0.05, -0.2];
    let coefficients = [surge, [0.0; 6], yaw].concat();
    equations(outputs, inputs, 0.1, terms, coefficients)
}

fn with(role: Role) -> Input {
    Input { role: Some(role), ..Input::default() }
}

fn trials(model: &Model, settings: &config::Manoeuvre) -> Trials {
    settings.plan(model).unwrap().run(model, &mut silent()).unwrap().unwrap()
}

fn figure(trials: &Trials, trial: usize, name: &str) -> f64 {
    let figures = &trials.trials[trial].figures;
    figures
        .iter()
        .find(|figure| figure.name == name)
        .and_then(|figure| figure.value)
        .unwrap_or_else(|| panic!("{name}: {figures:?}"))
}

#[test]
fn a_rudder_as_the_only_input_turns_the_ship_and_does_not_push_it() {
    for (name, unit) in [("delta", "rad"), ("angle", "rad"), ("x1", "")] {
        let model = rudder_only(name, unit);
        let map = InputMap::find(&model).unwrap();
        assert_eq!((map.push[0], map.roles[0]), (0.0, Some(Role::Steering)), "{name}: {map:?}");
        let found = trials(&model, &config::Manoeuvre::default());
        assert!((found.approach_speed_m_s - 4.0).abs() < 1e-4, "{}", found.approach_speed_m_s);
        assert!(found.approach_command[0].abs() < 1e-6, "{:?}", found.approach_command);
        assert_eq!(found.propulsion, None);
        let reason = found.no_propulsion.clone().unwrap();
        assert_eq!(reason, format!("no input pushes the vessel: {name} (steering)"));
        let left_out: Vec<&str> = found.left_out.iter().map(|left_out| left_out.trial).collect();
        assert_eq!(left_out, ["acceleration", "stopping"]);
        for figure_name in ["advance_m", "tactical_diameter_m", "transfer_m"] {
            let [starboard, port] = [0, 1].map(|side| figure(&found, side, figure_name).abs());
            assert!((port / starboard - 1.0).abs() < 0.03, "{figure_name}: {starboard} and {port}");
        }
    }
}

#[test]
fn the_zigzag_of_a_rudder_reverses_at_its_angles() {
    let model = rudder_only("delta", "rad");
    let zigzag = vec!["10/10".parse().unwrap()];
    let settings =
        config::Manoeuvre { trials: vec![TrialName::Zigzag], zigzag, ..config::Manoeuvre::default() };
    let found = trials(&model, &settings);
    for trial in &found.trials {
        let track = &trial.tracks[0];
        let mut command = [0.0];
        let mut reversals = 0;
        let mut before = 0.0;
        for (k, &steering) in track.steering.iter().enumerate() {
            found.inputs.write_command(0.0, steering, &mut command);
            if command[0] * before < 0.0 {
                reversals += 1;
                let heading = track.eta[k][2].to_degrees().abs();
                assert!((10.0..11.0).contains(&heading), "reversed at {heading}");
            }
            assert!(command[0] == 0.0 || (command[0].to_degrees().abs() - 10.0).abs() < 1e-9, "{command:?}");
            before = command[0];
        }
        assert!(reversals >= 2, "{reversals}");
    }
}

#[test]
fn the_speed_of_a_ship_that_nothing_pushes_is_its_own() {
    let model = rudder_only("delta", "rad");
    let map = InputMap::find(&model).unwrap();
    let at = |speed: f64| {
        let options = Options { speed_m_s: Some(speed), ..Options::default() };
        Approach::new(&model, &map, Simulation::new(&model).unwrap(), &options)
    };
    assert!(at(4.02).is_ok());
    let refused = at(3.0).unwrap_err().to_string();
    assert!(refused.contains("4.000 m/s") && refused.contains("role=\"NAME=propulsion\""), "{refused}");
    let refused = |settings: config::Manoeuvre| settings.plan(&model).unwrap_err().to_string();
    let named = config::Manoeuvre { trials: vec![TrialName::Stopping], ..config::Manoeuvre::default() };
    assert!(refused(named).contains("delta (steering)"));
    let percent = config::Manoeuvre { propulsion: Some(50.0), ..config::Manoeuvre::default() };
    assert!(refused(percent).contains("propulsion=50: no input pushes"));
}

#[test]
fn roles_follow_from_names_and_units_and_from_what_is_stated() {
    use Role::{Disturbance, Propulsion, Setting, Steering, Thruster};
    let found = |channels: &[(&str, &str)]| {
        let mut boat = Boat::default();
        let channels: Vec<Channel> = channels.iter().map(|&(name, unit)| Channel::new(name, unit)).collect();
        boat.find(&channels);
        channels.iter().map(|channel| boat.role(&channel.name)).collect::<Vec<_>>()
    };
    assert_eq!(found(&[("n", "rad/s"), ("delta", "rad")]), [Some(Propulsion), Some(Steering)]);
    assert_eq!(found(&[("throttle_left", ""), ("throttle_right", "")]), [Some(Thruster); 2]);
    assert_eq!(found(&[("RD_cmd", "rad"), ("PP_cmd", "N")]), [Some(Steering), None]);
    assert_eq!(found(&[("wind_x", "m^2/s^2"), ("depth", "m")]), [Some(Disturbance), Some(Setting)]);
    assert_eq!(found(&[("bow_thruster", ""), ("left", ""), ("x", "")]), [Some(Thruster), None, None]);
    // Words of two kinds, and a word with another unit, decide nothing; the response does.
    assert_eq!(
        found(&[("azimuth_rpm", "rps"), ("propeller_pitch", "rad"), ("rudder_rpm", "rps")]),
        [None; 3]
    );
    assert_eq!(found(&[("azimuth_angle", "rad"), ("pitch", "rad")]), [Some(Steering); 2]);
    assert_eq!(found(&[("rel_wind_x", ""), ("wave_height", "m")]), [Some(Disturbance); 2]);
    assert_eq!(found(&[("current_n", "m/s"), ("tau_n", "N m"), ("N", "N m")]), [None; 3]);
    assert_eq!(found(&[("n1", "rps"), ("n2", "rps")]), [Some(Thruster); 2]);
    assert_eq!(found(&[("left_thrust", "N"), ("right_motor", "")]), [Some(Thruster), None]);

    let stated: StatedRoles = "n=thruster, n=thruster".parse().unwrap();
    let mut boat = Boat::default();
    boat.state(&stated.0, &["n", "delta"]).unwrap();
    boat.find(&[Channel::new("n", ""), Channel::new("delta", "rad")]);
    assert_eq!(boat.inputs["n"], with(Thruster));
    assert_eq!(boat.inputs["delta"].found[&Property::Role], Evidence::Name);
    let error = boat.state(&[("m".to_owned(), Thruster)].into(), &["n", "delta"]).unwrap_err().to_string();
    assert!(error.contains("'m'") && error.contains("the inputs are n, delta"), "{error}");
    assert!("n".parse::<StatedRoles>().unwrap_err().to_string().contains("delta=steering"));
    let twice = "n=thruster,n=steering".parse::<StatedRoles>().unwrap_err().to_string();
    assert_eq!(twice, "two roles are stated of 'n', thruster and steering: leave one");
    assert!("n=rudder".parse::<StatedRoles>().unwrap_err().to_string().contains("write propulsion"));
}

/// `du/dt = 0.2 (a push_a + b push_b) - 0.2 u`, `dr/dt = 0.1 (a turn_a + b turn_b) - 0.2 r`.
fn two_inputs(inputs: &[model::Port; 2], push: [f64; 2], turn: [f64; 2]) -> Model {
    let outputs = vec![port("u", "m/s", -2.0, 2.0), port("r", "rad/s", -0.5, 0.5)];
    let terms = (0..4).map(|v| Term::monomial(&[v])).collect();
    let coefficients = vec![-0.2, 0.0, 0.2 * push[0], 0.2 * push[1], 0.0, -0.2, 0.1 * turn[0], 0.1 * turn[1]];
    equations(outputs, inputs.to_vec(), 0.1, terms, coefficients)
}

#[test]
fn a_name_that_the_response_contradicts_is_no_role() {
    let inputs = || [port("rudder_motor", "", -1.0, 1.0), port("m2", "", -1.0, 1.0)];
    let twin = two_inputs(&inputs(), [1.0, 1.0], [1.0, -1.0]);
    let boat = find_roles(&twin);
    assert!(boat.contradiction("rudder_motor").unwrap().contains("u changes by"), "{boat:?}");
    assert_eq!((boat.contradiction("m2"), boat.role("m2")), (None, Some(Role::Thruster)));
    let refused = InputMap::find(&twin).unwrap_err().to_string();
    assert!(refused.contains("role=\"rudder_motor=thruster\""), "{refused}");
    let mut stated = twin.clone();
    let roles = [("rudder_motor".to_owned(), Role::Thruster)].into();
    stated.description.boat.state(&roles, &["rudder_motor", "m2"]).unwrap();
    let map = InputMap::find(&stated).unwrap();
    assert!((map.push[0] - map.push[1]).abs() < 1e-6 && map.push[0] > 0.5, "{map:?}");
    // Inputs that are named by an option have no need of a role.
    let names = ["rudder_motor".to_owned(), "m2".to_owned()];
    assert!(InputMap::with(&twin, &names, &["rudder_motor".to_owned(), "-m2".to_owned()]).is_ok());
    // A rudder without a name or unit that goes farther to one side: the drag to both sides is no propulsion.
    let outputs = vec![port("u", "m/s", 3.0, 4.2), port("r", "rad/s", -0.6, 0.6)];
    let terms = [&[][..], &[0], &[2, 2], &[0, 2], &[1]].map(Term::monomial);
    let coefficients = vec![0.2, -0.05, -0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.05, -0.2];
    let rudder = vec![port("x1", "", -0.1, 0.6)];
    let model = equations(outputs, rudder, 0.1, terms.to_vec(), coefficients);
    assert_eq!(find_roles(&model).role("x1"), Some(Role::Steering), "{:?}", find_roles(&model));
    // A rudder whose model shows a drag on one side only is not taken for propulsion.
    let alone =
        two_inputs(&[port("rudder", "", -1.0, 1.0), port("x", "", -1.0, 1.0)], [0.5, 0.0], [1.0, 0.0]);
    assert_eq!(find_roles(&alone).contradiction("rudder"), None);
}

#[test]
fn an_angle_that_pushes_is_propulsion() {
    // The pitch of a propeller.
    let inputs = [port("pitch", "rad", -0.5, 0.5), port("delta", "rad", -0.5, 0.5)];
    let boat = find_roles(&two_inputs(&inputs, [2.0, 0.0], [0.0, 1.0]));
    assert_eq!((boat.role("pitch"), boat.role("delta")), (Some(Role::Propulsion), Some(Role::Steering)));
    assert!(matches!(boat.inputs["pitch"].found[&Property::Role], Evidence::Response(_)));
}

#[test]
fn roles_of_vessels_follow_from_their_actuators() {
    let role = |model: &Model, name: &str| find_roles(model).role(name);
    let simple = Model::of_vessel(&Craft::simple(), 0.1).unwrap();
    assert_eq!(role(&simple, "PP_cmd"), Some(Role::Propulsion));
    assert_eq!(role(&simple, "RD_cmd"), Some(Role::Steering));
    let text = r#"
        name = "launch"
        rigid_body = { mass = 400.0, x_g = 0.1, i_z = 900.0 }
        added_mass = { x_udot = -30.0, y_vdot = -250.0, n_rdot = -500.0 }
        drag = { linear = [60.0, 300.0, 400.0], quadratic = [20.0, 200.0, 300.0] }
        command = [{ name = "a", limits = [-1.0, 1.0] }, { name = "b", limits = [-1.0, 1.0] }, { name = "c", limits = [-1.0, 1.0] }]
        [[thruster]]
        name = "port"
        position = [-2.0, -0.6]
        order = { a = 100.0, b = 30.0 }
        forward = 0.02
        reverse = 0.01
        [[thruster]]
        name = "starboard"
        like = "port"
        position = [-2.0, 0.6]
        order = { a = 100.0, b = -30.0, c = 10.0 }
    "#;
    let launch = model::decode(text.as_bytes(), "launch.toml".as_ref()).unwrap();
    let roles = ["a", "b", "c"].map(|name| role(&launch, name).unwrap());
    assert_eq!(roles, [Role::Propulsion, Role::Steering, Role::Thruster]);
}

/// A ship in wind: `du/dt = 0.1 n - 0.1 u + 0.02 wind_x`, `dr/dt = 0.1 delta - 0.2 r + 0.01 wind_y`. The wind of its logs was
/// never calm.
fn in_wind() -> Model {
    let outputs =
        vec![port("u", "m/s", 0.0, 4.0), port("v", "m/s", -1.0, 1.0), port("r", "rad/s", -0.3, 0.3)];
    let inputs = vec![
        port("n", "", 0.0, 4.0),
        port("delta", "rad", -0.6, 0.6),
        port("wind_x", "m^2/s^2", -20.0, -4.0),
        port("wind_y", "m^2/s^2", 2.0, 12.0),
    ];
    let terms: Vec<Term> = (0..7).map(|v| Term::monomial(&[v])).collect();
    let coefficients = vec![
        -0.1, 0.0, 0.0, 0.1, 0.0, 0.02, 0.0, //
        0.0, -0.5, 0.0, 0.0, 0.0, 0.0, 0.0, //
        0.0, 0.0, -0.2, 0.0, 0.1, 0.0, 0.01,
    ];
    equations(outputs, inputs, 0.5, terms, coefficients)
}

#[test]
fn the_wind_is_calm_and_not_an_actuator() {
    let model = in_wind();
    let found = trials(&model, &config::Manoeuvre::default());
    assert_eq!(found.approach_command[2..], [0.0, 0.0]);
    assert_eq!(found.inputs.roles[2..], [Some(Role::Disturbance); 2]);
    assert!((found.approach_speed_m_s - 0.85 * 4.0).abs() < 1e-4, "{}", found.approach_speed_m_s);
    let limits = limits_of(&model).unwrap();
    assert_eq!(limits[2..], [Limits::held(0.0); 2]);
    // The same input as an actuator, if it is said.
    let other = model.with_roles(&[("wind_x".to_owned(), Role::Propulsion)].into()).unwrap();
    assert!(InputMap::find(&other).unwrap().push[2] != 0.0);
}

#[test]
fn laws_that_solve_for_all_inputs_refuse_a_model_with_wind() {
    let model = Arc::new(in_wind());
    let plant = TruePlant::from(Arc::clone(&model));
    for method in [ControlMethod::FeedbackLinearization, ControlMethod::Backstepping] {
        let mut control = ControllerOptions::new(method, &plant, 0.5);
        control.model = Some(Arc::clone(&model));
        let error = control.controller(0).err().unwrap();
        assert!(matches!(error, ClosedLoopError::NotCommanded { .. }), "{error}");
        assert!(error.to_string().contains("'wind_x' is a disturbance"), "{error}");
    }
}

#[test]
fn a_planner_holds_an_input_that_is_not_commanded_to_the_bit() {
    let model = in_wind();
    let mut limits = limits_of(&model).unwrap();
    limits[2] = Limits::held(-1.1);
    for gauss_newton_steps in [0, 2] {
        let options =
            PlannerOptions { horizon: 8, candidates: 64, gauss_newton_steps, ..PlannerOptions::new(1) };
        let mut planner = Planner::new(options, Cost::tracking(4), &limits, 3, 0.5, 50.0).unwrap();
        planner.reset();
        let mut session = model.session();
        session.observe(&[2.0, 0.0, 0.0]);
        let references: Vec<Reference> = (1..=8)
            .map(|k| Reference {
                s: f64::from(k),
                curvature: 0.0,
                position: [f64::from(k), 0.5 * f64::from(k)],
                velocity: [2.0, 1.0],
                acceleration: [0.0; 2],
                course: 0.46,
                speed: 2.2,
            })
            .collect();
        let mut command = [0.0; 4];
        for _ in 0..3 {
            let plan = planner.command(&*session, [0.0; 3], &references, &mut || false, &mut command);
            assert_eq!(command[2..], [-1.1, 0.0], "{plan:?}");
            assert!(
                plan.cost.is_finite() && command[..2].iter().all(|c| c.is_finite()),
                "{plan:?} {command:?}"
            );
        }
        assert!(command[1] > 0.0, "it turns to starboard: {command:?}");
    }
}

/// A log of the ship in wind, simulated sample by sample.
fn log_in_wind() -> RawLog {
    let mut text = String::from("t,u [m/s],v [m/s],r [rad/s],n,delta,ws [m/s],wd [rad],stern\n");
    let (mut u, mut r) = (1.0_f64, 0.0_f64);
    let mut random = 1_u64;
    let mut noise = || {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let (mut n, mut delta, mut wind, mut direction) = (1.0_f64, 0.0_f64, 3.0_f64, 1.0_f64);
    for k in 0..900 {
        if k % 23 == 0 {
            (n, delta) = (2.0 + 3.0 * noise(), noise());
        }
        wind = (wind + 0.4 * noise()).clamp(2.0, 5.0);
        direction = (direction + 0.2 * noise()).clamp(0.5, 2.5);
        let measured = [u + 0.02 * noise(), 0.02 * noise(), r + 0.004 * noise()];
        let [mu, mv, mr] = measured;
        writeln!(text, "{},{mu},{mv},{mr},{n},{delta},{wind},{direction},0.7", 0.5 * f64::from(k)).unwrap();
        let (x, y) = (wind * wind * direction.cos(), wind * wind * direction.sin());
        for _ in 0..10 {
            u += 0.05 * (0.1 * n - 0.1 * u + 0.02 * x);
            r += 0.05 * (0.1 * delta - 0.2 * r + 0.01 * y);
        }
    }
    hydroid::log::read_from(text.as_bytes(), "wind.csv").unwrap()
}

#[test]
fn an_identified_model_knows_its_wind_and_what_its_inputs_do() {
    let config: Config = toml::from_str(
        "[log]\ninputs = [\"a=n\", \"b=delta\", \"thrust=stern\"]\nwind = { speed = \"ws\", direction = \"wd\" }\n[boat.inputs.a]\nrole = \"propulsion\"\n",
    )
    .unwrap();
    let reading = config.reading().unwrap();
    let logs = Logs { train: vec![log_in_wind()], validate: Vec::new(), test: Vec::new() };
    let (job, _) = config.job(reading, &logs, None).unwrap();
    let result = identify(&job, &mut silent()).unwrap();
    let model = &result.candidates[result.best.unwrap()].model;
    let boat = &model.description.boat;
    assert_eq!(boat.inputs["a"], with(Role::Propulsion));
    assert_eq!(boat.role("b"), Some(Role::Steering), "{boat:?}");
    assert!(matches!(boat.inputs["b"].found[&Property::Role], Evidence::Response(_)), "{boat:?}");
    assert_eq!(boat.inputs["thrust"].found[&Property::Role], Evidence::Constant);
    assert_eq!(boat.role("wind_y"), Some(Role::Disturbance));
    assert_eq!(boat.inputs["wind_y"].found[&Property::Role], Evidence::Name);
    assert_eq!(result.summary(&[])["models"][0]["boat"]["inputs"]["a"]["role"], "propulsion");
    // The file keeps them.
    let path = std::path::Path::new("m.safetensors");
    let again = model::decode(&model::encode(model).unwrap(), path).unwrap();
    assert_eq!(again.description.boat, *boat);
    let found = trials(model, &config::Manoeuvre::default());
    assert_eq!(found.approach_command[2..], [0.7, 0.0, 0.0], "the constant value, and no wind");
}

#[test]
fn a_role_of_an_input_that_is_not_there_is_refused() {
    let config: Config =
        toml::from_str("[log]\ninputs = [\"n\", \"delta\"]\n[boat.inputs.detla]\nrole = \"steering\"\n")
            .unwrap();
    let reading = config.reading().unwrap();
    let logs = Logs { train: vec![log_in_wind()], validate: Vec::new(), test: Vec::new() };
    let error = config.job(reading, &logs, None).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("'detla'") && text.contains("did you mean 'delta'"), "{text}");
    let error = toml::from_str::<Config>("[boat.inputs.n]\nrole = \"engine\"\n").unwrap_err().to_string();
    assert!(error.contains("`propulsion`"), "{error}");
}

/// The figures of a tanker at a constant shaft speed after a step of the rudder, by the package shipmmg (`tests/peers/shipmmg_tanker.py`).
#[test]
fn circles_of_a_tanker_at_a_constant_shaft_speed_are_those_of_shipmmg() {
    let golden = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden");
    let config: Config =
        toml::from_str("[log]\ninputs = [\"delta\"]\n[identify]\nhorizon = \"10s\"\nrate_limit = \"none\"\n")
            .unwrap();
    let reading = config.reading().unwrap();
    let log = hydroid::log::read(golden.join("tanker.csv").as_path()).unwrap();
    let logs = Logs { train: vec![log], validate: Vec::new(), test: Vec::new() };
    let (job, _) = config.job(reading, &logs, None).unwrap();
    let result = identify(&job, &mut silent()).unwrap();
    let model = &result.candidates[result.best.unwrap()].model;
    let settings = config::Manoeuvre {
        trials: vec![TrialName::TurningCircle],
        steering: Some(35.0),
        ..config::Manoeuvre::default()
    };
    let found = trials(model, &settings);
    let truth: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(golden.join("tanker.json")).unwrap()).unwrap();
    let near = |value: f64, truth: f64, tolerance: f64| (value / truth - 1.0).abs() < tolerance;
    assert!(near(found.approach_speed_m_s, truth["speed_m_s"].as_f64().unwrap(), 0.02), "{found:?}");
    for name in ["advance_m", "transfer_m", "tactical_diameter_m"] {
        let both = [0, 1].map(|side| figure(&found, side, name).abs());
        assert!(near(both[1], both[0], 0.03), "{name}: {both:?}");
        for (value, side) in both.into_iter().zip(["starboard", "port"]) {
            let expected = truth["circles"][side][name].as_f64().unwrap();
            assert!(near(value, expected, 0.05), "{name} to {side}: {value}, {expected}");
        }
    }
}
