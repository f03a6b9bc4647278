//! Manoeuvring trials against analytic solutions, an independent integration, and logs of simulated trials.

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;
use std::sync::Arc;

use hydroid::boat::Boat;
use hydroid::config::Manoeuvre;
use hydroid::evaluate::{DesignRange, PredictionBands};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::manoeuvre::{
    Approach, Comparison, Options, Recognised, RecognisedKind, Trial, TrialKind, TrialOptions, compare,
    pull_out, recognise, spiral, trials, turning_circle, zigzag,
};
use hydroid::model::{Body, Description, Members, Model, MovedTogether, Port, Provenance, Reading};
use hydroid::plant::{Commands, InputMap, PlantError, Record, RecordOptions, Simulation, record};
use hydroid::progress::silent;
use hydroid_core::craft::Craft;
use hydroid_core::model::sparse::{Equations, Term};
use hydroid_core::predict::Workspace;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub(crate) fn port(name: &str, unit: &str, low: f64, high: f64) -> Port {
    Port {
        channel: Channel::new(name, unit),
        range: DesignRange { low, high },
        training_range: None,
        noise: None,
        rate_limit: None,
    }
}

/// Equations `dy/dt = sum of coefficient x term`; variables are outputs, then inputs.
pub(crate) fn equations(
    outputs: Vec<Port>,
    inputs: Vec<Port>,
    dt: f64,
    terms: Vec<Term>,
    coefficients: Vec<f64>,
) -> Model {
    let (n, m) = (outputs.len(), inputs.len());
    let body = Equations::new(terms, coefficients, n, m, dt, 4).unwrap();
    Model {
        description: Description {
            bands: None,
            trial_errors: Vec::new(),
            current: None,
            name: String::from("ship"),
            dt,
            outputs,
            inputs,
            reading: Reading::default(),
            boat: Boat::default(),
            provenance: Provenance {
                hydroid: String::from("0"),
                seed: 0,
                training: Vec::new(),
                validation: Vec::new(),
                settings: serde_json::Value::Null,
                ..Provenance::default()
            },
        },
        body: Body::Equations(Arc::new(body)),
        members: Members::default(),
        learning: None,
    }
}

/// `T_u du/dt = n - u`, `T dr/dt + n_1 r + n_3 r^3 = K delta` (Nomoto; Norrbin with `n_3`): speed 5 m/s at full ahead.
fn nomoto(k: f64, t: f64, n1: f64, n3: f64) -> Model {
    let outputs = vec![port("u", "m/s", 0.0, 6.0), port("r", "rad/s", -0.1, 0.1)];
    let inputs = vec![port("n", "", 0.0, 5.0), port("delta", "rad", -0.6, 0.6)];
    // The variables are u, r, n, delta.
    let terms = [&[0][..], &[2], &[1], &[3], &[1, 1, 1]];
    let terms = terms.iter().map(|variables| Term::monomial(variables)).collect();
    let t_u = 20.0;
    let coefficients = vec![
        -1.0 / t_u,
        1.0 / t_u,
        0.0,
        0.0,
        0.0, //
        0.0,
        0.0,
        -n1 / t,
        k / t,
        -n3 / t,
    ];
    let mut model = equations(outputs, inputs, NOMOTO_DT, terms, coefficients);
    model.description.boat.inputs.entry("delta".to_owned()).or_default().limits = Some([-0.6, 0.6]);
    model
}

fn approach(model: &Model, p: f64) -> (Approach, InputMap) {
    let map = InputMap::find(model).unwrap();
    let options = Options { propulsion: p, speed_m_s: None };
    (Approach::new(model, &map, Simulation::new(model).unwrap(), &options).unwrap(), map)
}

/// Small, because the heading is of second order in it \[s\].
const NOMOTO_DT: f64 = 0.02;

const K: f64 = 0.12;
const T: f64 = 8.0;

#[test]
fn a_linear_nomoto_model_has_its_analytic_turn() {
    let (approach, map) = approach(&nomoto(K, T, 1.0, 0.0), 0.8);
    assert!((approach.speed_m_s - 4.0).abs() < 4e-6, "{}", approach.speed_m_s);
    assert_eq!(approach.steering, 0.0);
    let delta = 0.5 * 0.6;
    let (circle, _) = turning_circle(&approach, &map, 0.5, 3_600.0);
    let steady = circle.steady.unwrap();
    // r(t) = K delta (1 - exp(-t/T)); the last half turn is long after the transient.
    assert!((steady.yaw_rate_deg_s.to_radians() / (K * delta) - 1.0).abs() < 1e-6);
    assert!((steady.radius_m / (4.0 / (K * delta)) - 1.0).abs() < 2e-6);
    // psi(t) = K delta (t - T (1 - exp(-t/T))) reaches 90 degrees.
    let psi = |t: f64| K * delta * (t - T * (1.0 - (-t / T).exp()));
    assert!((psi(circle.time_90_s.unwrap()) - FRAC_PI_2).abs() < 1e-4);
    let (other, _) = turning_circle(&approach, &map, -0.5, 3_600.0);
    assert_eq!(
        other.tactical_diameter_m, circle.tactical_diameter_m,
        "port is the mirror image of starboard"
    );
    assert_eq!(other.steady.unwrap().yaw_rate_deg_s, -steady.yaw_rate_deg_s);
}

#[test]
fn a_linear_nomoto_model_has_its_analytic_overshoot() {
    let (approach, map) = approach(&nomoto(K, T, 1.0, 0.0), 0.8);
    let (delta, heading) = (0.2, 0.15);
    let (result, track) = zigzag(&approach, &map, delta / 0.6, heading, 3_600.0);
    assert_eq!(result.executes_s.len(), 5);
    // The first execute is at rest, the second at the first sample at which the heading is reached.
    let second = result.executes_s[1];
    let r = |t: f64| K * delta * (1.0 - (-t / T).exp());
    let psi = |t: f64| K * delta * t - T * r(t);
    assert!(psi(second) >= heading && psi(second - NOMOTO_DT) < heading);
    let sample = track.steering.iter().position(|s| *s < 0.0).unwrap();
    assert!((track.eta[sample][2] - psi(second)).abs() < 1e-6);
    assert!((track.nu[sample][2] - r(second)).abs() < 1e-9);
    // Afterwards dr/dt = -(r + K delta)/T: r is zero at t = T ln(1 + r_0/(K delta)).
    let r_0 = r(second);
    let zero = T * (r_0 / (K * delta)).ln_1p();
    let overshoot = (r_0 + K * delta) * T * (1.0 - (-zero / T).exp()) - K * delta * zero;
    let found = result.overshoots_deg[0].to_radians();
    assert!((found - overshoot).abs() < 1e-6, "{found} against {overshoot}");
    // The heading passes between the samples.
    let initial = result.initial_turning_time_s.unwrap();
    assert!(initial <= second && (psi(initial) - heading).abs() < 1e-6, "{initial} {second}");
    assert!((result.initial_turning_distance_m.unwrap() - 4.0 * initial).abs() < 1e-4);
    assert!(result.period_s.unwrap() > result.reach_s.unwrap());
}

#[test]
fn an_unstable_ship_has_a_loop_and_goes_on_turning() {
    // Norrbin's model with n_1 < 0: K delta = n_1 r + n_3 r^3.
    let (n1, n3) = (-0.5, 4_000.0);
    let model = nomoto(K, T, n1, n3);
    let (approach, map) = approach(&model, 0.8);
    let fold_rate = (-n1 / (3.0 * n3)).sqrt();
    let fold = (2.0 / 3.0) * -n1 * fold_rate / K / 0.6;
    let steps = 96;
    let result = spiral(&approach, &map, 0.2, steps, 3_600.0).unwrap();
    let resolution = 0.2 * 2.0 / f64::from(steps);
    assert_eq!(result.stable, Some(false));
    let width = result.loop_width.unwrap();
    assert!((width - 2.0 * fold).abs() < 2.0 * resolution, "{width} against {}", 2.0 * fold);
    let (result, _) = pull_out(&approach, &map, 0.5, 3_600.0);
    assert_eq!(result.stable, Some(false));
    let remaining = (-n1 / n3).sqrt().to_degrees();
    assert!((result.residual_deg_s[0].unwrap() / remaining - 1.0).abs() < 1e-3);
    assert!((result.residual_deg_s[1].unwrap() / remaining + 1.0).abs() < 1e-3);

    let stable = nomoto(K, T, 1.0, 0.0);
    let (approach, map) = self::approach(&stable, 0.8);
    let result = spiral(&approach, &map, 1.0, 24, 3_600.0).unwrap();
    assert_eq!((result.stable, result.loop_width), (Some(true), Some(0.0)));
    for point in &result.points {
        assert!((point.yaw_rate_deg_s - (K * 0.6 * point.steering).to_degrees()).abs() < 1e-3);
    }
    let (result, _) = pull_out(&approach, &map, 0.5, 3_600.0);
    assert_eq!(result.stable, Some(true));
    // A tenth of the yaw rate is left after T ln 10.
    assert!((result.decay_s[0].unwrap() - T * 10.0_f64.ln()).abs() < 0.11);
}

#[test]
fn a_straight_course_needs_steering_if_the_propeller_turns_the_ship() {
    let mut model = nomoto(K, T, 1.0, 0.0);
    let Body::Equations(own) = &model.body else { panic!() };
    let mut coefficients = own.coefficients().to_vec();
    // dr/dt gains 0.0003 n: full ahead at 5 needs K delta / T = -0.0003 n.
    coefficients[5 + 1] = 0.0003;
    model.body = Body::Equations(Arc::new(
        Equations::new(own.terms().to_vec(), coefficients, 2, 2, NOMOTO_DT, 4).unwrap(),
    ));
    let (approach, map) = approach(&model, 1.0);
    let expected = -0.0003 * 5.0 * T / K / 0.6;
    assert!((approach.steering - expected).abs() < 1e-6, "{} against {expected}", approach.steering);
    assert_eq!(map.turn[0], 0.0, "the propeller is not a steering input");
}

#[test]
fn the_approach_has_any_speed_that_the_vessel_can_hold() {
    let model = nomoto(K, T, 1.0, 0.0);
    let map = InputMap::find(&model).unwrap();
    let at = |model: &Model, map: &InputMap, speed: f64| {
        let options = Options { speed_m_s: Some(speed), ..Options::default() };
        Approach::new(model, map, Simulation::new(model).unwrap(), &options)
    };
    let approach = at(&model, &map, 1.3).unwrap();
    assert!((approach.speed_m_s - 1.3).abs() < 2e-6 && (approach.propulsion - 0.26).abs() < 1e-5);
    let error = at(&model, &map, 5.5).unwrap_err();
    assert!(error.to_string().contains("0.000 to 5.000 m/s"), "{error}");
    // An order that is never zero: the vessel is slower than at its middle.
    let mut ordered = model.clone();
    ordered.description.inputs[0].range = DesignRange { low: 1.0, high: 5.0 };
    let map = InputMap::find(&ordered).unwrap();
    assert!((at(&ordered, &map, 1.3).unwrap().speed_m_s - 1.3).abs() < 2e-6);
    assert!(at(&ordered, &map, 0.5).is_err());
}

fn golden() -> HashMap<String, HashMap<String, HashMap<String, f64>>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden/manoeuvres.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn figures(trial: &Trial) -> HashMap<&str, f64> {
    trial.figures.iter().filter_map(|figure| Some((figure.name.as_str(), figure.value?))).collect()
}

#[test]
fn trials_of_vessels_agree_with_an_independent_integration() {
    let golden = golden();
    for (vessel, circle, steering, heading_deg) in
        [(Craft::simple(), 1.0, 0.2, 20.0), (Craft::hydrofoil(), 1.0, 1.0 / 3.0, 10.0)]
    {
        let model = Model::of_vessel(&vessel, 0.1).unwrap();
        let map = InputMap::find(&model).unwrap();
        let kinds =
            [TrialKind::TurningCircle { steering: circle }, TrialKind::Zigzag { steering, heading_deg }];
        let result = trials(&model, &map, &kinds, &TrialOptions::default(), &mut silent()).unwrap().unwrap();
        for (trial, name) in result.trials.iter().zip(["circle", "zigzag"]) {
            let found = figures(trial);
            for (figure, expected) in &golden[&vessel.name][name] {
                let found = found[figure.as_str()];
                assert!(
                    (found / expected - 1.0).abs() < 1e-3,
                    "{} {figure}: {found}, {expected}",
                    vessel.name
                );
            }
        }
    }
}

#[test]
fn criteria_depend_on_length_and_speed() {
    let model = nomoto(K, T, 1.0, 0.0);
    let map = InputMap::find(&model).unwrap();
    let ten = 10.0_f64.to_radians() / 0.6;
    let kinds = [
        TrialKind::TurningCircle { steering: 1.0 },
        TrialKind::Zigzag { steering: ten, heading_deg: 10.0 },
        TrialKind::Stopping,
    ];
    let at = |length: f64| {
        let options = TrialOptions { length_m: Some(length), ..TrialOptions::default() };
        trials(&model, &map, &kinds, &options, &mut silent()).unwrap().unwrap()
    };
    let limit = |trial: &Trial, name: &str| {
        let figure = trial.figures.iter().find(|figure| figure.name == name).unwrap();
        figure.criterion.map(|criterion| criterion.limit)
    };
    // 4.25 m/s; 85 m take 20 s: between 10 s and 30 s the limits grow with the time.
    let ship = at(85.0);
    // Distances of a vessel that does not move sideways meet no criterion.
    assert_eq!(limit(&ship.trials[0], "tactical_diameter_m"), None);
    assert!(ship.notes.iter().any(|note| note.contains("no sway velocity")), "{:?}", ship.notes);
    let vessel = Model::of_vessel(&Craft::simple(), 0.1).unwrap();
    let options = TrialOptions { length_m: Some(8.0), ..TrialOptions::default() };
    let map_of_vessel = InputMap::find(&vessel).unwrap();
    let circle = trials(&vessel, &map_of_vessel, &kinds[..1], &options, &mut silent()).unwrap().unwrap();
    assert_eq!(limit(&circle.trials[0], "tactical_diameter_m"), Some(40.0));
    assert_eq!(limit(&circle.trials[0], "advance_m"), Some(36.0));
    assert!((limit(&ship.trials[1], "first_overshoot_deg").unwrap() - 15.0).abs() < 1e-4);
    assert!((limit(&ship.trials[1], "second_overshoot_deg").unwrap() - 32.5).abs() < 1e-4);
    assert_eq!(limit(&ship.trials[1], "third_overshoot_deg"), None);
    assert_eq!(limit(&ship.trials[2], "track_reach_m"), None, "without astern power there is no limit");
    assert_eq!(limit(&at(10.0).trials[1], "first_overshoot_deg"), Some(10.0));
    assert_eq!(limit(&at(700.0).trials[1], "second_overshoot_deg"), Some(40.0));
    assert!(at(85.0).notes.iter().any(|note| note.contains("ships of 100 m and more")));
    assert!(!at(200.0).notes.iter().any(|note| note.contains("criteri")));
}

/// A model of 1 : 49: the criteria are those of the ship, and without the scale none is judged.
#[test]
fn criteria_are_those_of_the_ship_and_not_of_its_model() {
    let model = nomoto(K, T, 1.0, 0.0);
    let map = InputMap::find(&model).unwrap();
    let kinds = [
        TrialKind::TurningCircle { steering: 1.0 },
        TrialKind::Spiral { steering: 1.0, steps: 4 },
        TrialKind::Zigzag { steering: 10.0_f64.to_radians() / 0.6, heading_deg: 10.0 },
    ];
    let at = |scale: f64, length_m: f64| {
        let options = TrialOptions { length_m: Some(length_m), scale, ..TrialOptions::default() };
        trials(&model, &map, &kinds, &options, &mut silent()).map(Option::unwrap)
    };
    let (own, ship) = (at(1.0, 20.0).unwrap(), at(49.0, 980.0).unwrap());
    assert!((ship.approach_speed_m_s / own.approach_speed_m_s - 7.0).abs() < 1e-12);
    for (own, ship) in own.trials.iter().zip(&ship.trials) {
        for (own, ship) in own.figures.iter().zip(&ship.figures) {
            let factor = match own.name_and_unit().1 {
                "m" => 49.0,
                "s" | "m/s" => 7.0,
                "deg/s" => 1.0 / 7.0,
                _ => 1.0,
            };
            let [own_value, ship_value] = [own, ship].map(|figure| figure.value.unwrap_or(0.0));
            assert!((ship_value - factor * own_value).abs() <= 1e-9 * ship_value.abs(), "{ship:?}");
            // Ratios of lengths and angles are the same, and so are their judgements.
            let passed = |figure: &hydroid::manoeuvre::Figure| figure.criterion.map(|one| one.passed);
            if own.name.ends_with("_m") {
                assert_eq!(passed(own), passed(ship), "{ship:?}");
            }
        }
        for (own, ship) in own.tracks.iter().zip(&ship.tracks) {
            let last = own.len() - 1;
            assert!((ship.eta[last][0] - 49.0 * own.eta[last][0]).abs() < 1e-9);
            assert!((ship.time_s(last) - 7.0 * own.time_s(last)).abs() < 2e-6);
        }
        for (own, ship) in own.points.iter().zip(&ship.points) {
            assert!((7.0 * ship.yaw_rate_deg_s - own.yaw_rate_deg_s).abs() < 1e-12);
        }
    }
    let without = at(1.0, 980.0).unwrap();
    assert!(without.trials.iter().flat_map(|trial| &trial.figures).all(|figure| figure.criterion.is_none()));
    assert!(without.notes.iter().any(|note| note.contains("no criterion is judged")), "{:?}", without.notes);
    for wrong in [0.0, -45.7, f64::NAN] {
        assert!(at(wrong, 980.0).unwrap_err().to_string().contains("the scale is"));
    }
}

/// Within the logs of the model, `u` is 0 to 5 m/s and `r` up to 0.04 rad/s to either side.
fn seen(mut model: Model) -> Model {
    for (port, high) in model.description.outputs.iter_mut().zip([5.0, 0.04]) {
        port.training_range = Some(DesignRange { low: if high > 1.0 { 0.0 } else { -high }, high });
    }
    model
}

#[test]
fn a_circle_that_diverges_has_no_figures_and_meets_no_criterion() {
    let kinds = [
        TrialKind::TurningCircle { steering: 1.0 },
        TrialKind::Spiral { steering: 1.0, steps: 8 },
        TrialKind::PullOut { steering: 1.0 },
        TrialKind::TurningCircle { steering: 0.1 },
    ];
    // The damping of the yaw rate ends at 0.06 rad/s.
    let model = seen(nomoto(K, T, 1.0, -1.0 / 0.06_f64.powi(2)));
    let map = InputMap::find(&model).unwrap();
    let options = TrialOptions { length_m: Some(1_000.0), ..TrialOptions::default() };
    let result = trials(&model, &map, &kinds, &options, &mut silent()).unwrap().unwrap();
    assert!(!result.passed());
    for trial in &result.trials[..3] {
        let reason = trial.not_valid.as_ref().unwrap();
        assert!(reason.contains(": r is "), "{reason}");
        assert!(reason.ends_with("and -2.292 to 2.292 deg/s in the logs of the model"), "{reason}");
        for figure in &trial.figures {
            assert_eq!((figure.value, figure.criterion, figure.missing()), (None, None, "not valid"));
            assert_eq!(figure.not_valid.as_ref(), Some(reason));
        }
        assert_eq!(trial.directionally_stable, None);
        assert!(trial.tracks.iter().flat_map(|track| &track.nu).all(|[_, _, r]| r.abs() <= 0.08));
    }
    let gentle = &result.trials[3];
    assert_eq!(gentle.not_valid, None);
    // The model has no sway.
    let has_none = |name: &str| name == "drift_angle_deg";
    assert!(gentle.figures.iter().all(|figure| figure.value.is_none() == has_none(&figure.name)));
    let document = result.document("ship", &model);
    assert_eq!(document["trials"][0]["figures"][0]["value"], serde_json::Value::Null);
    assert!(document["trials"][0]["figures"][0]["not_valid"].is_string());
}

/// Where each input is in its range, and both together are not: what each of them does is not known.
#[test]
fn trials_of_inputs_that_did_not_move_apart_are_not_valid() {
    let mut model = nomoto(K, T, 1.0, 0.0);
    let range = DesignRange { low: -0.05, high: 0.05 };
    model.description.provenance.moved_together = vec![MovedTogether { factors: vec![-0.1, 1.0], range }];
    let map = InputMap::find(&model).unwrap();
    let kinds = [TrialKind::TurningCircle { steering: 1.0 }, TrialKind::Spiral { steering: 1.0, steps: 4 }];
    let result = trials(&model, &map, &kinds, &TrialOptions::default(), &mut silent()).unwrap().unwrap();
    for trial in &result.trials {
        let reason = trial.not_valid.as_deref().unwrap();
        assert!(reason.contains("delta - 0.100 n goes from"), "{reason}");
        assert!(trial.figures.iter().all(|figure| figure.value.is_none()), "{:?}", trial.figures);
    }
}

/// What the logs do not show has no figures, whatever the equations say.
#[test]
fn trials_of_an_output_that_is_not_identified_are_not_valid() {
    let mut model = nomoto(K, T, 1.0, 0.0);
    let map = InputMap::find(&model).unwrap();
    let kinds = [
        TrialKind::TurningCircle { steering: 1.0 },
        TrialKind::Spiral { steering: 1.0, steps: 4 },
        TrialKind::Zigzag { steering: 10.0_f64.to_radians() / 0.6, heading_deg: 10.0 },
    ];
    let options = TrialOptions { length_m: Some(85.0), ..TrialOptions::default() };
    let at = |model: &Model| trials(model, &map, &kinds, &options, &mut silent()).unwrap().unwrap();
    assert!(at(&model).passed());
    let why = "over 5 s its NRMSE is 1.20, of persistence 1.00, of the mean 1";
    model.description.provenance.not_identified.insert("r".to_owned(), why.to_owned());
    let result = at(&model);
    assert!(!result.passed());
    for trial in &result.trials {
        assert_eq!(
            trial.not_valid.as_deref().unwrap(),
            format!("from the start on: r is not identified: {why}")
        );
        assert_eq!(trial.directionally_stable, None);
        let none = |figure: &hydroid::manoeuvre::Figure| {
            figure.value.is_none() && figure.interval.is_none() && figure.criterion.is_none()
        };
        assert!(trial.figures.iter().all(none), "{:?}", trial.figures);
    }
    // A file keeps what is not identified.
    let again = hydroid::model::decode(&hydroid::model::encode(&model).unwrap(), Path::new("ship")).unwrap();
    assert_eq!(again.description.provenance, model.description.provenance);
    // Sway decides distances alone.
    let mut vessel = Model::of_vessel(&Craft::simple(), 0.1).unwrap();
    vessel.description.provenance.not_identified.insert("v".to_owned(), why.to_owned());
    let map = InputMap::find(&vessel).unwrap();
    let options = TrialOptions { length_m: Some(8.0), ..TrialOptions::default() };
    let result = trials(&vessel, &map, &kinds[..1], &options, &mut silent()).unwrap().unwrap();
    let circle = &result.trials[0];
    assert!(circle.not_valid.is_none() && circle.figures.iter().all(|figure| figure.criterion.is_none()));
    assert!(result.notes.iter().any(|note| note.contains("v is not identified")), "{:?}", result.notes);
}

/// The boat says how long the ship is, and that the logs are those of its model.
#[test]
fn particulars_of_the_boat_count_where_no_option_does() {
    let mut model = twin();
    let particulars = &mut model.description.boat.particulars;
    (particulars.length, particulars.scale) = (Some(980.0), Some(49.0));
    let options = |settings: &Manoeuvre| settings.plan(&model).unwrap().options;
    let (of_boat, stated) = (
        options(&Manoeuvre::default()),
        options(&Manoeuvre { length: Some(20.0), scale: Some(1.0), ..Manoeuvre::default() }),
    );
    assert_eq!((of_boat.length_m, of_boat.scale), (Some(980.0), 49.0));
    assert_eq!((stated.length_m, stated.scale), (Some(20.0), 1.0));
    assert_eq!(model.description.boat.particulars.length_in_logs(), Some(20.0));
    // Those of trials in logs, too.
    let log = log();
    let at = |model: &Model| compare(model, std::slice::from_ref(&log), &mut silent()).unwrap().remove(0);
    let ship = at(&model);
    let own = at(&Manoeuvre { scale: Some(1.0), ..Manoeuvre::default() }.for_logs(model.clone()).unwrap());
    let period = |found: &Comparison| {
        let of = |figures: &[hydroid::manoeuvre::Figure]| {
            figures.iter().find(|figure| figure.name == "initial_turning_time_s").unwrap().value.unwrap()
        };
        [of(&found.measured), of(&found.predicted)]
    };
    for (ship, own) in period(&ship).into_iter().zip(period(&own)) {
        assert!((ship / own - 7.0).abs() < 1e-9, "{ship} {own}");
    }
}

#[test]
fn a_trial_that_gains_energy_is_not_valid() {
    // `du/dt` gains 30 r^2: 5 m/s and more are added in a hard turn.
    let mut model = nomoto(K, T, 1.0, 0.0);
    let Body::Equations(own) = &model.body else { panic!() };
    let (mut terms, mut coefficients) = (own.terms().to_vec(), own.coefficients().to_vec());
    terms.push(Term::monomial(&[1, 1]));
    coefficients.insert(5, 50.0);
    coefficients.push(0.0);
    model.body = Body::Equations(Arc::new(Equations::new(terms, coefficients, 2, 2, NOMOTO_DT, 4).unwrap()));
    let map = InputMap::find(&model).unwrap();
    let kinds = [1.0, 0.2].map(|steering| TrialKind::TurningCircle { steering });
    let result = trials(&model, &map, &kinds, &TrialOptions::default(), &mut silent()).unwrap().unwrap();
    let reason = result.trials[0].not_valid.as_ref().unwrap();
    assert!(reason.contains("the speed through the water is 4.67"), "{reason}");
    assert!(reason.contains("4.25 m/s at the order, and no order pushes more"), "{reason}");
    assert_eq!(result.trials[1].not_valid, None);
}

#[test]
fn an_approach_far_from_the_logs_is_refused() {
    let mut model = seen(nomoto(K, T, 1.0, 0.0));
    model.description.outputs[0].training_range = Some(DesignRange { low: 1.0, high: 2.0 });
    let map = InputMap::find(&model).unwrap();
    let at = |speed| {
        let options = Options { speed_m_s: Some(speed), ..Options::default() };
        Approach::new(&model, &map, Simulation::new(&model).unwrap(), &options)
    };
    assert!(at(2.4).is_ok());
    let error = at(2.6).unwrap_err().to_string();
    assert!(error.contains("u is 2.6 m/s, and 1 to 2 m/s in the logs of the model"), "{error}");
}

/// Two thrusters: `du/dt = a (L + R) - b u`, `dr/dt = c (L - R) - d r`.
fn twin() -> Model {
    let outputs = vec![port("r", "rad/s", -1.0, 1.0), port("u", "m/s", -1.0, 3.0)];
    let inputs = vec![port("L", "", -1.0, 1.0), port("R", "", -1.0, 1.0)];
    let terms = (0..4).map(|v| Term::monomial(&[v])).collect();
    let coefficients = vec![-1.0, 0.0, 0.6, -0.6, 0.0, -0.5, 0.7, 0.7];
    equations(outputs, inputs, 0.1, terms, coefficients)
}

#[test]
fn two_thrusters_push_together_and_turn_in_opposite_directions() {
    let model = twin();
    let map = InputMap::find(&model).unwrap();
    assert!((map.push[0] - 1.0).abs() < 1e-9 && (map.push[1] - 1.0).abs() < 1e-9, "{map:?}");
    assert!((map.turn[0] - 1.0).abs() < 1e-9 && (map.turn[1] + 1.0).abs() < 1e-9, "{map:?}");
    assert_eq!((map.steering().unit, map.steering().full), ("%", 100.0));
    assert_eq!(map.command(0.8, 0.5), [1.0, 0.8 - 0.5]);
    assert!((map.astern() - 1.0).abs() < 1e-9);
    let stated = InputMap::with(&model, &["L".into(), "R".into()], &["-R".into()]).unwrap();
    assert_eq!(stated.turn, [0.0, -1.0]);
    let unknown = InputMap::with(&model, &["left".into()], &[]).unwrap_err();
    assert!(matches!(unknown, PlantError::UnknownInput { option: "push", .. }), "{unknown}");

    let kinds = [TrialKind::Stopping, TrialKind::Acceleration, TrialKind::TurningCircle { steering: 0.2 }];
    let result = trials(&model, &map, &kinds, &TrialOptions::default(), &mut silent()).unwrap().unwrap();
    // From 0.85 * 2.8 m/s, du/dt = -1.4 - 0.5 u stops after 2 ln(1 + u/2.8).
    assert!((result.approach_speed_m_s - 2.38).abs() < 1e-5);
    let stopping = figures(&result.trials[0]);
    assert!((stopping["stopping_time_s"] - 2.0 * 0.85_f64.ln_1p()).abs() < 1e-3, "{stopping:?}");
    assert!((stopping["track_reach_m"] - stopping["head_reach_m"]).abs() < 1e-2);
    let acceleration = figures(&result.trials[1]);
    assert!((acceleration["time_to_95_percent_s"] - 2.0 * 20.0_f64.ln()).abs() < 0.01);
    assert!(result.trials[2].outside.is_empty());
}

#[test]
fn a_model_without_a_motion_is_no_plant() {
    let mut model = twin();
    model.description.outputs[0].channel.name = String::from("yaw");
    let error = Simulation::new(&model).unwrap_err();
    assert!(matches!(error, PlantError::NoMotion { missing: "r", .. }), "{error}");
    assert!(error.to_string().contains("yaw, u"));
    model.description.outputs[0].channel = Channel::new("r", "deg/s");
    assert!(matches!(Simulation::new(&model), Err(PlantError::Unit { name: "r", .. })));
    let mut still = twin();
    let Body::Equations(own) = &still.body else { panic!() };
    let without = [-1.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.7, 0.7];
    still.body = Body::Equations(Arc::new(
        Equations::new(own.terms().to_vec(), without.to_vec(), 2, 2, 0.1, 4).unwrap(),
    ));
    let error = InputMap::find(&still).unwrap_err();
    assert!(matches!(error, PlantError::NoEffect { output: "r", option: "turn", .. }), "{error}");
}

#[test]
fn a_simulation_predicts_what_a_rollout_predicts() {
    for model in [twin(), Model::of_vessel(&Craft::hydrofoil(), 0.1).unwrap()] {
        let (n, m) = (model.description.outputs.len(), model.description.inputs.len());
        let start: Vec<f64> = (0..n).map(|i| 0.3 + 0.1 * i as f64).collect();
        let commands: Vec<f64> = (0..200 * m)
            .map(|i| {
                let port = &model.description.inputs[i % m];
                0.4 * (0.1 * i as f64).sin() * port.range.high
            })
            .collect();
        let mut session = model.session();
        session.observe(&start);
        let mut expected = vec![0.0; 200 * n];
        session.rollout(&commands, &mut Workspace::new(), &mut expected);
        let mut simulation = Simulation::new(&model).unwrap();
        simulation.start([0.0; 3], &start, &vec![0.0; m]);
        for (c, expected) in commands.chunks(m).zip(expected.chunks(n)) {
            simulation.advance(c);
            for (found, expected) in simulation.outputs().iter().zip(expected) {
                assert!((found - expected).abs() < 1e-12 * expected.abs().max(1.0));
            }
        }
    }
}

#[test]
fn a_steady_turn_is_a_circle_in_a_current() {
    let model = twin();
    let current = [0.2, -0.1];
    let mut simulation = Simulation::new(&model).unwrap().with_current(current);
    let c = [0.9, 0.5];
    let (u, r) = (1.4 * 1.4, 0.6 * 0.4);
    simulation.start([0.0; 3], &[r, u], &c);
    let samples = 1_000;
    for _ in 0..samples {
        simulation.advance(&c);
    }
    let t = 0.1 * f64::from(samples);
    let [x, y, psi] = simulation.eta();
    assert!((psi - r * t).abs() < 1e-9);
    assert!((x - (u / r * psi.sin() + current[0] * t)).abs() < 1e-6);
    assert!((y - (u / r * (1.0 - psi.cos()) + current[1] * t)).abs() < 1e-6);
    let [surge, sway, _] = simulation.nu_over_ground();
    assert!((surge - (u + current[0] * psi.cos() + current[1] * psi.sin())).abs() < 1e-6);
    assert!((sway - (-current[0] * psi.sin() + current[1] * psi.cos())).abs() < 1e-6);
}

/// A log of the twin-thruster boat: straight, a zigzag of 12 degrees, straight, a turn, straight.
fn log() -> Trajectory {
    let model = twin();
    let mut simulation = Simulation::new(&model).unwrap();
    simulation.start([0.0; 3], &[0.0, 1.4], &[0.5, 0.5]);
    let (mut outputs, mut inputs, mut heading) = (Vec::new(), Vec::new(), Vec::new());
    let mut position = Vec::new();
    let mut command = [0.5, 0.5];
    let (mut start, mut reversals) = (0.0, 0);
    for k in 0..900 {
        let psi = simulation.heading();
        match k {
            50 => {
                start = psi;
                command = [0.7, 0.3];
            }
            51..300 => {
                let side = if command[0] > command[1] { 1.0 } else { -1.0 };
                if side * (psi - start) >= 12.0_f64.to_radians() && reversals < 4 {
                    command.swap(0, 1);
                    reversals += 1;
                }
            }
            300 | 700 => command = [0.5, 0.5],
            400 => command = [0.4, 0.8],
            _ => {}
        }
        outputs.extend_from_slice(simulation.outputs());
        inputs.extend(command);
        heading.push(psi.rem_euclid(std::f64::consts::TAU));
        position.push([simulation.eta()[0], simulation.eta()[1]]);
        simulation.advance(&command);
    }
    let channels = |ports: &[Port]| ports.iter().map(|port| port.channel.clone()).collect::<Vec<_>>();
    Trajectory {
        name: String::from("run"),
        t0: 10.0,
        dt: 0.1,
        outputs: Table::new(channels(&model.description.outputs), outputs),
        inputs: Table::new(channels(&model.description.inputs), inputs),
        truth: None,
        heading: Some(heading),
        position: Some(position),
    }
}

#[test]
fn trials_in_a_log_are_recognised_and_predicted() {
    let run = log();
    let found = recognise(&run, &Boat::default());
    let kinds: Vec<RecognisedKind> = found.iter().map(|trial| trial.kind).collect();
    assert_eq!(kinds, [RecognisedKind::Zigzag, RecognisedKind::TurningCircle]);
    assert_eq!((found[0].executes[0], found[0].executes.len()), (50, 5));
    assert!((found[0].heading_deg - 12.0).abs() < 1.0, "first to starboard: {}", found[0].heading_deg);
    let title = found[0].title();
    assert!(title.ends_with("deg, first to starboard by L 0.7, R 0.3"), "{title}");
    assert_eq!((found[1].executes.as_slice(), found[1].end), (&[400][..], 700));
    assert!(found[1].heading_deg < -180.0, "to port: {}", found[1].heading_deg);

    let compared = compare(&twin(), &[run], &mut silent()).unwrap();
    assert_eq!(compared.len(), 2);
    assert!((compared[0].at_s - 15.0).abs() < 1e-9);
    for comparison in &compared {
        let values = comparison.measured.iter().filter(|figure| figure.value.is_some()).count();
        assert!(values >= 5, "{:?}", comparison.measured);
        for (measured, predicted) in comparison.measured.iter().zip(&comparison.predicted) {
            let Some(measured_value) = measured.value else { continue };
            let value = predicted.value.unwrap();
            let close = (value - measured_value).abs() <= 2e-3 * measured_value.abs().max(0.1);
            assert!(close, "{}: {value} against {measured_value}", measured.name);
        }
    }
}

/// A run whose speeds are 3 % too small.
fn slowed(run: Trajectory) -> Trajectory {
    let rows = (0..run.len()).flat_map(|k| [run.outputs.row(k)[0], 0.97 * run.outputs.row(k)[1]]).collect();
    Trajectory { outputs: Table::new(run.outputs.channels().to_vec(), rows), ..run }
}

fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    move || StandardNormal.sample(&mut rng)
}

#[test]
fn a_measured_path_is_that_of_the_positions() {
    let exact = log();
    let of = |run: Trajectory| {
        let compared = compare(&twin(), &[run], &mut silent()).unwrap();
        compared.into_iter().find(|of| of.trial.kind == RecognisedKind::TurningCircle).unwrap()
    };
    let names = ["advance_m", "transfer_m", "tactical_diameter_m"];
    let value = |comparison: &Comparison, name: &str| {
        comparison.measured.iter().find(|figure| figure.name == name).unwrap().clone()
    };
    let truth = of(exact.clone());
    let positions = truth.positions.as_ref().unwrap();
    assert!(positions.deviation_m < 1e-3 && (positions.rate - 1.0).abs() < 1e-3, "{positions:?}");
    // Velocities that are 6 % too small, and a heading that is 4 degrees off: the integral has the wrong size.
    let wrong = || {
        let mut run = exact.clone();
        let rows: Vec<f64> =
            (0..run.len()).flat_map(|k| [run.outputs.row(k)[0], 0.94 * run.outputs.row(k)[1]]).collect();
        run.outputs = Table::new(run.outputs.channels().to_vec(), rows);
        run
    };
    let integral = of(Trajectory { position: None, ..wrong() });
    assert!(integral.positions.is_none() && value(&integral, "advance_m").not_valid.is_some());
    let mut random = noise(5);
    let all = exact.position.clone().unwrap();
    let mut kinds: Vec<(&str, Vec<[f64; 2]>, f64)> = Vec::new();
    kinds.push(("exact", all.clone(), 0.01));
    kinds.push(("east first", all.iter().map(|[x, y]| [*y, *x]).collect(), 0.01));
    let (sin, cos) = 0.6_f64.sin_cos();
    kinds.push((
        "turned",
        all.iter().map(|[x, y]| [cos * x + sin * y, cos * y - sin * x + 400.0]).collect(),
        0.05,
    ));
    let noisy: Vec<[f64; 2]> = all.iter().map(|p| p.map(|x| x + 0.1 * random())).collect();
    kinds.push(("noisy", noisy.clone(), 0.25));
    let seldom = |k: usize| k.is_multiple_of(5);
    let missing = |(k, p): (usize, &[f64; 2])| if seldom(k) { *p } else { [f64::NAN; 2] };
    kinds.push(("missing", noisy.iter().enumerate().map(missing).collect(), 0.4));
    kinds.push(("held", (0..all.len()).map(|k| noisy[k - k % 5]).collect(), 0.4));
    let outlier = |(k, p): (usize, &[f64; 2])| if k % 53 == 7 { [p[0] + 40.0, p[1]] } else { *p };
    kinds.push(("outliers", noisy.iter().enumerate().map(outlier).collect(), 0.25));
    for (kind, position, tolerance) in kinds {
        let found = of(Trajectory { position: Some(position), ..wrong() });
        let located = found.positions.clone().unwrap_or_else(|| panic!("{kind}: {:?}", found.no_positions));
        assert!((located.rate - 1.0 / 0.94).abs() < 0.03, "{kind}: {located:?}");
        assert_eq!(located.east_first, kind == "east first");
        let turned = if kind == "turned" { 0.6_f64.to_degrees() } else { 0.0 };
        assert!((located.turned_deg - turned).abs() < 0.5, "{kind}: {located:?}");
        assert_eq!(located.outliers > 0, kind == "outliers", "{kind}: {located:?}");
        let is_noisy = !["exact", "east first", "turned"].contains(&kind);
        assert!(!is_noisy || (0.07..0.13).contains(&located.deviation_m), "{kind}: {located:?}");
        for name in names {
            let (measured, right) = (value(&found, name), value(&truth, name).value.unwrap());
            let [low, high] = measured.interval.unwrap();
            let own = measured.value.unwrap();
            assert!((own - right).abs() < tolerance, "{kind}, {name}: {own} against {right}");
            assert!(
                high - low < 4.0 * tolerance && low <= own && own <= high,
                "{kind}, {name}: {low} to {high}"
            );
        }
        let words = found.path_words();
        assert!(
            words.contains("0.94") && words.contains("positions with a standard deviation of"),
            "{words}"
        );
        let errors: Vec<&str> = found.errors.iter().map(|error| error.name.as_str()).collect();
        assert!(names.iter().all(|name| errors.contains(name)), "{errors:?}");
    }
    // Another datum in the turn, and positions of another vessel, are not used.
    let datum = |(k, p): (usize, &[f64; 2])| if k > 500 { [p[0] + 30.0, p[1]] } else { *p };
    let jumps = of(Trajectory { position: Some(all.iter().enumerate().map(datum).collect()), ..wrong() });
    assert!(
        jumps.positions.is_none() && jumps.no_positions.as_ref().unwrap().contains("jump"),
        "{:?}",
        jumps.no_positions
    );
    let other = (0..all.len()).map(|k| [20.0 * (0.1 * k as f64).sin(), 0.3 * k as f64]).collect();
    let other = of(Trajectory { position: Some(other), ..wrong() });
    assert!(other.positions.is_none(), "{:?}", other.positions);
    assert!(other.path_words().contains("positions of the log are not used"), "{}", other.path_words());
}

/// Positions that are the integral of the velocities say nothing of their errors, and those of a late receiver are doubted.
#[test]
fn positions_without_information_and_late_ones_are_stated() {
    let exact = log();
    let mut random = noise(11);
    let motion = |run: &Trajectory, k: usize| [run.outputs.row(k)[0], run.outputs.row(k)[1]];
    let rows =
        (0..exact.len()).flat_map(|k| [motion(&exact, k)[0], 0.95 * motion(&exact, k)[1] + 0.02 * random()]);
    let outputs = Table::new(exact.outputs.channels().to_vec(), rows.collect());
    let run = Trajectory { outputs, ..exact.clone() };
    let heading = exact.heading.clone().unwrap();
    let mut place = [0.0; 2];
    let integral = (0..run.len()).map(|k| {
        let before = place;
        let next = (k + 1).min(run.len() - 1);
        let way = 0.5 * run.dt * (motion(&run, k)[1] + motion(&run, next)[1]);
        let psi = heading[k] + 0.5 * run.dt * motion(&run, k)[0];
        place = [place[0] + way * psi.cos(), place[1] + way * psi.sin()];
        before
    });
    let of = |position: Vec<[f64; 2]>| {
        let run = Trajectory { position: Some(position), ..run.clone() };
        let compared = compare(&twin(), &[run], &mut silent()).unwrap();
        compared.into_iter().find(|of| of.trial.kind == RecognisedKind::TurningCircle).unwrap()
    };
    let odometry = of(integral.collect());
    assert!(
        odometry.path_words().contains("they are the integral of the velocities"),
        "{}",
        odometry.path_words()
    );
    let exact = exact.position.unwrap();
    let right = of(exact.iter().map(|p| p.map(|x| x + 0.01 * random())).collect());
    assert!(
        right.doubts.is_empty() && right.positions.is_some(),
        "{:?}, {}",
        right.doubts,
        right.path_words()
    );
    let late =
        of((0..exact.len()).map(|k| exact[k.saturating_sub(8)].map(|x| x + 0.01 * random())).collect());
    assert!(
        late.doubts.iter().any(|doubt| doubt.contains("s later than the velocities")),
        "{:?}",
        late.doubts
    );
}

#[test]
fn intervals_of_measured_figures_hold_the_truth_as_often_as_they_say() {
    let exact = log();
    let all = exact.position.clone().unwrap();
    let compared = |run: Trajectory| compare(&twin(), &[run], &mut silent()).unwrap();
    let truth = compared(slowed(exact.clone()));
    let (mut inside, mut count) = (0, 0);
    for seed in 0..30 {
        let mut random = noise(seed);
        let position = all.iter().map(|p| p.map(|x| x + 0.2 * random())).collect();
        let rows =
            (0..exact.len()).flat_map(|k| [exact.outputs.row(k)[0], 0.97 * exact.outputs.row(k)[1] + 0.01]);
        let outputs = Table::new(exact.outputs.channels().to_vec(), rows.collect());
        let found = compared(Trajectory { position: Some(position), outputs, ..exact.clone() });
        for (found, truth) in found.iter().zip(&truth) {
            for (figure, right) in found.measured.iter().zip(&truth.measured) {
                let (Some([low, high]), Some(right)) = (figure.interval, right.value) else { continue };
                // Times and overshoots follow from the headings, which are exact.
                if high - low > 1e-9 {
                    count += 1;
                    inside += usize::from((low..=high).contains(&right));
                }
            }
        }
    }
    let share = f64::from(u32::try_from(inside).unwrap()) / f64::from(count);
    assert!(count > 120 && (0.84..0.97).contains(&share), "{inside} of {count}");
}

#[test]
fn a_trial_without_its_beginning_is_none() {
    let run = log();
    let kinds = |run: &Trajectory| -> Vec<RecognisedKind> {
        recognise(run, &Boat::default()).iter().map(|trial| trial.kind).collect()
    };
    assert_eq!(kinds(&run.slice(400, 900)), [RecognisedKind::TurningCircle], "it begins with the order");
    for begin in [410, 430, 500] {
        assert_eq!(kinds(&run.slice(begin, 900)), [], "{begin}");
    }
    assert_eq!(kinds(&run.slice(60, 380)), []);
    let compared = compare(&twin(), &[run.slice(400, 900)], &mut silent()).unwrap();
    assert!(compared[0].doubts[0].contains("begins 0.0 s before the order"), "{:?}", compared[0].doubts);
}

/// Missing velocities were zero, and the loss of speed minus infinity.
#[test]
fn missing_velocities_are_interpolated() {
    let exact = log();
    let whole = compare(&twin(), &[slowed(exact.clone())], &mut silent()).unwrap();
    let mut random = noise(1);
    for seldom in [2, 5] {
        let rows: Vec<f64> = (0..exact.len())
            .flat_map(|k| {
                let [r, u] = [exact.outputs.row(k)[0], exact.outputs.row(k)[1]];
                [r, if k % seldom == 1 { u + 1e-3 * random() } else { f64::NAN }]
            })
            .collect();
        let outputs = Table::new(exact.outputs.channels().to_vec(), rows);
        for position in [exact.position.clone(), None] {
            let run = Trajectory { outputs: outputs.clone(), position: position.clone(), ..exact.clone() };
            let found = compare(&twin(), &[run], &mut silent()).unwrap();
            for (found, whole) in found.iter().zip(&whole) {
                for (figure, right) in found.measured.iter().zip(&whole.measured) {
                    let (Some(value), Some(right)) = (figure.value, right.value) else {
                        assert!(position.is_none() || figure.value.is_some() == right.value.is_some());
                        continue;
                    };
                    let close = (value - right).abs() < 0.02 * right.abs().max(1.0);
                    assert!(close, "{seldom}, {}: {value} against {right}", figure.name);
                }
            }
        }
    }
}

/// How a ship with a rudder and a shaft is logged.
#[derive(Clone, Copy, Debug)]
struct Logged {
    dt: f64,
    /// The order, or the measured angle.
    order: bool,
    /// Noise of the angle \[deg\], and of the shaft speed relative to it.
    noise: [f64; 2],
    /// Part by which the shaft speed falls in a turn.
    sag: f64,
}

/// A first-order ship of Nomoto whose rudder turns at 2.5 deg/s: 60 s straight, then a zigzag of `angle` degrees with as much
/// rudder, or a circle, and straight on. The log, and the samples of the orders.
fn ship(logged: Logged, angle: f64, is_zigzag: bool) -> (Trajectory, Vec<usize>) {
    let Logged { dt, order, noise, sag } = logged;
    let mut random = 3_u64;
    let mut noisy = move |of: f64| {
        let sum: f64 = (0..12)
            .map(|_| {
                random =
                    random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (random >> 11) as f64 / (1_u64 << 53) as f64
            })
            .sum();
        of * (sum - 6.0)
    };
    let (mut psi, mut r, mut rudder, mut ordered, mut shaft) = (0.0_f64, 0.0, 0.0_f64, 0.0_f64, 80.0);
    let (mut outputs, mut inputs, mut orders) = (Vec::new(), Vec::new(), Vec::new());
    let end_s = if is_zigzag { 700.0 } else { 900.0 };
    for k in 0.. {
        let t = f64::from(k) * dt;
        if t >= end_s {
            break;
        }
        let before = ordered;
        if t >= 60.0 && orders.is_empty() {
            ordered = angle;
        } else if is_zigzag && ordered.signum() * psi.to_degrees() >= angle.abs() && orders.len() < 5 {
            ordered = -ordered;
        } else if t > if is_zigzag { 650.0 } else { 800.0 } {
            ordered = 0.0;
        }
        if ordered != before && ordered != 0.0 {
            orders.push(inputs.len() / 2);
        }
        let shown = if order { ordered } else { rudder };
        inputs.extend([shaft * (1.0 + noisy(noise[1])), shown + noisy(noise[0])]);
        outputs.extend([7.0, 0.0, r]);
        for _ in 0..10 {
            rudder += (ordered - rudder).clamp(-0.25 * dt, 0.25 * dt);
            r += 0.1 * dt * (0.05 * rudder.to_radians() - r) / 20.0;
            psi += 0.1 * dt * r;
        }
        shaft += dt * (80.0 * (1.0 - sag * (rudder.abs() / 35.0)) - shaft) / 20.0;
    }
    let channel = |name: &str, unit: &str| Channel::new(name, unit);
    let run = Trajectory {
        name: String::from("ship"),
        t0: 0.0,
        dt,
        outputs: Table::new(
            [channel("u", "m/s"), channel("v", "m/s"), channel("r", "rad/s")].to_vec(),
            outputs,
        ),
        inputs: Table::new([channel("rpm", ""), channel("rudder", "")].to_vec(), inputs),
        truth: None,
        heading: None,
        position: None,
    };
    (run, orders)
}

#[test]
fn trials_are_found_with_a_measured_rudder_and_a_shaft_speed_that_varies() {
    let found = |run: &Trajectory| {
        let mut boat = Boat::default();
        boat.find(run.inputs.channels());
        recognise(run, &boat)
    };
    let exact = Logged { dt: 1.0, order: true, noise: [0.0; 2], sag: 0.0 };
    let kinds = [
        exact,
        Logged { noise: [0.0, 0.005], ..exact },
        Logged { noise: [0.0, 0.005], sag: 0.15, ..exact },
        Logged { order: false, ..exact },
        Logged { order: false, noise: [0.15, 0.005], sag: 0.1, ..exact },
        Logged { dt: 0.1, order: false, noise: [0.15, 0.005], sag: 0.1 },
        Logged { dt: 0.2, order: false, noise: [0.3, 0.01], sag: 0.05 },
        Logged { dt: 0.5, order: true, noise: [0.2, 0.0], sag: 0.1 },
    ];
    for logged in kinds {
        for (angle, is_zigzag) in [(20.0, true), (-10.0, true), (35.0, false), (-15.0, false)] {
            let (run, orders) = ship(logged, angle, is_zigzag);
            let all = found(&run);
            let story = format!("{logged:?}, {angle}, {orders:?}: {all:?}");
            let kind = if is_zigzag { RecognisedKind::Zigzag } else { RecognisedKind::TurningCircle };
            assert_eq!(all.len(), 1, "{story}");
            let Recognised { kind: found, executes, heading_deg, .. } = &all[0];
            assert_eq!((*found, executes.len()), (kind, orders.len()), "{story}");
            for (execute, order) in executes.iter().zip(&orders) {
                let late_s = logged.dt * (*execute as f64 - *order as f64);
                assert!(late_s.abs() <= 1.0_f64.max(logged.dt), "{late_s} s, {story}");
            }
            assert_eq!(heading_deg.signum(), angle.signum(), "{story}");
            assert!(!is_zigzag || (heading_deg.abs() - angle.abs()).abs() < 1.0, "{story}");
        }
    }
    // Of an autopilot on a straight course, and of a rudder that is never held, there is none.
    let (mut run, _) = ship(exact, 35.0, false);
    let steered: Vec<f64> = (0..run.len()).flat_map(|k| [80.0, 8.0 * (0.3 * k as f64).sin()]).collect();
    run.inputs = Table::new(run.inputs.channels().to_vec(), steered);
    assert_eq!(found(&run), []);
}

#[test]
fn process_noise_is_the_growth_of_the_errors() {
    let mut model = twin();
    // The variance of the errors of r grows by 0.0004 per sample; that of u is explained by its measurement noise.
    let half_width = |r: f64, u: f64| vec![1.281_55 * r, 1.281_55 * u];
    model.description.bands = Some(PredictionBands {
        levels: vec![0.8],
        horizons: vec![1, 25],
        half_widths: vec![vec![half_width(0.01, 0.1), half_width(0.1, 0.1)]],
    });
    model.description.outputs[1].noise = Some(0.1);
    let simulated = |process_noise: f64| {
        let options = RecordOptions {
            commands: Commands::Given([0.5, 0.5].repeat(20_000)),
            seed: 3,
            noise: 0.0,
            process_noise,
            current: [0.0; 2],
        };
        record(&model, None, &options, &mut silent()).unwrap()
    };
    let (still, noisy) = (simulated(0.0), simulated(2.0));
    assert_eq!(still.measured, still.truth);
    assert!(still.truth.chunks(2).all(|row| row[0] == 0.0));
    // r' = e r + w with e = exp(-dt): its variance is q / (1 - e^2).
    let variance = noisy.truth.chunks(2).map(|row| row[0] * row[0]).sum::<f64>() / noisy.len() as f64;
    let expected = 4.0 * 0.000_4 / (1.0 - (-0.2_f64).exp());
    assert!((variance / expected - 1.0).abs() < 0.1, "{variance} against {expected}");
    let surge = |record: &Record| record.truth.chunks(2).map(|row| row[1]).collect::<Vec<f64>>();
    assert_eq!(surge(&still), surge(&noisy));
}

#[test]
fn a_log_without_a_yaw_rate_has_no_trials() {
    let mut run = log();
    let channels = [Channel::new("yaw", "rad/s"), Channel::new("u", "m/s")];
    run.outputs = Table::new(channels.to_vec(), run.outputs.rows(0, run.len()).to_vec());
    assert!(recognise(&run, &Boat::default()).is_empty());
}
