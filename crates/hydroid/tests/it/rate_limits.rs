//! Limits of the rates of actuators, found from logs or stated.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use hydroid::closed_loop::TruePlant;
use hydroid::identify::{
    IdentifyResult, Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions,
    identify,
};
use hydroid::log::{Channel, Split, Table, Trajectory};
use hydroid::manoeuvre::{Figure, compare};
use hydroid::model::{Model, ModelError, Reading, decode, encode};
use hydroid::plant::Simulation;
use hydroid::progress::silent;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const DT: f64 = 0.5;

/// Rate of the steering gear \[rad/s\], with which a reversal from 30 to -30 degrees takes 15 s.
const RATE: f64 = 0.07;

/// `du/dt = 0.05 (2 n - u)`, `dr/dt = (0.05 delta' - r) / 8`, where the rudder `delta'` moves at a limited rate.
fn run(rate: f64, seed: u64) -> Trajectory {
    logged([f64::INFINITY, rate], seed, false)
}

/// As [`run`], with rates of shaft and rudder, and with the order of the rudder or its measured angle.
fn logged([shaft_rate, rate]: [f64; 2], seed: u64, is_measured: bool) -> Trajectory {
    const FINE: usize = 20;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    let (mut u, mut r, mut rudder, mut psi, mut side) = (2.0, 0.0, 0.0, 0.0_f64, 1.0);
    let (mut n, mut shaft, mut delta) = (1.0, 1.0, 0.0);
    for k in 0..2_000 {
        if k >= 800 && k % 100 == 0 {
            n = random.random_range(0.6..1.4);
        }
        // Zigzags, then random steps.
        if k < 800 {
            if side * psi > 0.35 {
                side = -side;
            }
            delta = 0.52 * side;
        } else if k % 60 == 0 {
            delta = random.random_range(-0.52..0.52);
        }
        let mut noise = |std: f64| std * random.sample::<f64, _>(StandardNormal);
        outputs.extend([u + noise(0.01), r + noise(0.0005)]);
        let angle = if is_measured { rudder + noise(0.002) } else { delta };
        inputs.extend([n, angle]);
        for _ in 0..FINE {
            let h = DT / FINE as f64;
            rudder += (delta - rudder).clamp(-rate * h, rate * h);
            shaft += (n - shaft).clamp(-shaft_rate * h, shaft_rate * h);
            u += h * 0.05 * (2.0 * shaft - u);
            r += h * (0.05 * rudder - r) / 8.0;
            psi += h * r;
        }
    }
    let table = |names: [(&str, &str); 2], values| {
        Table::new(names.map(|(name, unit)| Channel::new(name, unit)).to_vec(), values)
    };
    Trajectory {
        name: format!("run {seed}"),
        t0: 0.0,
        dt: DT,
        outputs: table([("u", "m/s"), ("r", "rad/s")], outputs),
        inputs: table([("n", "rps"), ("delta", "rad")], inputs),
        truth: None,
        heading: None,
        position: None,
    }
}

fn identified(rate: f64, option: &str, methods: &[Method]) -> IdentifyResult {
    try_identify(rate, option, methods).unwrap()
}

fn identified_in(runs: Vec<Trajectory>, option: &str, methods: &[Method]) -> IdentifyResult {
    identify(&job(runs, option, methods), &mut silent()).unwrap()
}

fn try_identify(
    rate: f64,
    option: &str,
    methods: &[Method],
) -> Result<IdentifyResult, hydroid::identify::IdentifyError> {
    identify(&job((1..=4).map(|seed| run(rate, seed)).collect(), option, methods), &mut silent())
}

fn job(train: Vec<Trajectory>, option: &str, methods: &[Method]) -> Job {
    Job {
        methods: methods.to_vec(),
        split: Split { train, validation: Vec::new(), test: Vec::new(), notes: Vec::new() },
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 60,
        origin_stride: 10,
        seed: 0,
        ranges: BTreeMap::default(),
        motion: MotionOption::Auto,
        rate_limits: option.parse::<RateLimitOption>().unwrap(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions { members: Some(0), ..SindyOptions::default() },
        networks: NetworkTrainingOptions::default(),
        vessel: None,
    }
}

fn limits(model: &Model) -> Vec<Option<f64>> {
    model.description.inputs.iter().map(|port| port.rate_limit).collect()
}

fn first_overshoot(model: &Model, run: &Trajectory) -> f64 {
    let of = |figures: &[Figure]| {
        figures.iter().find(|figure| figure.name == "first_overshoot_deg").unwrap().value.unwrap()
    };
    let zigzag = compare(model, std::slice::from_ref(run), &mut silent()).unwrap().remove(0);
    (of(&zigzag.predicted) - of(&zigzag.measured)).abs()
}

#[test]
fn the_rate_of_a_steering_gear_is_found_and_overshoots_become_right() {
    let methods = [Method::Sindy, Method::Committee];
    let found = identified(RATE, "auto", &methods);
    let without = identified(RATE, "none", &methods);
    let other = run(RATE, 9);
    for (with, without) in found.candidates.iter().zip(&without.candidates) {
        let [n, delta] = limits(&with.model)[..] else { panic!() };
        assert_eq!(n, None);
        assert!((delta.unwrap() / RATE - 1.0).abs() < 0.15, "{delta:?}");
        assert_eq!(limits(&without.model), [None, None]);
        let [r, without_r] = [with, without].map(|candidate| candidate.validation.nrmse[59][1]);
        assert!(r < 0.8 * without_r, "{}: {r} against {without_r}", with.model.description.name);
        // The model and those of the folds are files like any other.
        let again = decode(&encode(&with.model).unwrap(), Path::new("model")).unwrap();
        assert_eq!(again, with.model);
        let [limited, plain] = [&again, &without.model].map(|model| first_overshoot(model, &other));
        assert!(limited < 0.5 && limited < plain, "{limited} against {plain}");
    }
    assert!(found.warnings.iter().any(|note| note.message.contains("limits of the rates")));
    let text = found.candidates[0].model.equations().unwrap().equations_text().join("\n");
    assert!(text.contains("delta follows its command at "), "{text}");
    let latex = found.candidates[0].model.equations().unwrap().equations_latex();
    assert!(latex.contains(r"|\dot{\delta}| &\le 0.0"), "{latex}");
}

/// Trials order steps of the rudder, which the measured angle of a steering gear never has.
#[test]
fn a_measured_angle_has_the_fastest_rate_of_the_logs() {
    let other = run(RATE, 9);
    let methods = [Method::Sindy, Method::Committee];
    let found = identified_in(
        (1..=4).map(|seed| logged([f64::INFINITY, RATE], seed, true)).collect(),
        "auto",
        &methods,
    );
    for candidate in &found.candidates {
        let [n, delta] = limits(&candidate.model)[..] else { panic!() };
        assert_eq!(n, None);
        assert!((delta.unwrap() / RATE - 1.0).abs() < 0.05, "{delta:?}");
        let error = first_overshoot(&candidate.model, &other);
        assert!(error < 1.0, "{error}");
    }
    let note = found.warnings.iter().find(|note| note.message.contains("never steps"));
    assert!(note.is_some_and(|note| note.message.contains("delta 4.")), "{note:?}");
}

#[test]
fn an_actuator_that_follows_at_once_has_no_limit() {
    let found = identified(1e3, "auto", &[Method::Committee]);
    assert_eq!(limits(&found.candidates[0].model), [None, None], "{:?}", found.warnings);
    assert!(!found.warnings.iter().any(|note| note.message.contains("limits of the rates")));
}

#[test]
fn a_stated_rate_is_taken_in_its_unit_and_bounds_controllers_and_simulations() {
    let stated = identified(RATE, "delta=4 [deg],n=0.5", &[Method::Committee]);
    let model = &stated.candidates[0].model;
    let [n, delta] = limits(model)[..] else { panic!() };
    assert_eq!(n, Some(0.5));
    assert!((delta.unwrap() - 4.0_f64.to_radians()).abs() < 1e-12);
    assert!(
        (TruePlant::Model(Arc::new(model.clone())).limits()[1].rate - 4.0_f64.to_radians()).abs() < 1e-12
    );
    // A simulation reverses its rudder as the model does under the positions.
    let mut free = Simulation::new(model).unwrap();
    let unlimited = {
        let mut model = model.clone();
        model.description.inputs.iter_mut().for_each(|port| port.rate_limit = None);
        model
    };
    let mut by_positions = Simulation::new(&unlimited).unwrap();
    for simulation in [&mut free, &mut by_positions] {
        simulation.start([0.0; 3], &[2.0, 0.0], &[1.0, 0.5]);
    }
    let mut rudder = 0.5;
    for _ in 0..60 {
        rudder = (rudder - 4.0_f64.to_radians() * DT).max(-0.5);
        free.advance(&[1.0, -0.5]);
        by_positions.advance(&[1.0, rudder]);
        for (a, b) in free.outputs().iter().zip(by_positions.outputs()) {
            assert!((a - b).abs() < 1e-9, "{a} and {b}");
        }
    }
}

#[test]
fn limits_that_make_no_sense_are_refused() {
    for (option, part) in [
        ("rudder=4", "rudder"),
        ("delta=0", "0 is not a positive number"),
        ("delta=-1 [deg]", "-1 is not a positive number"),
        ("delta=4 [m]", "rate_limit=\"delta=4 [deg]\""),
    ] {
        let error = try_identify(RATE, option, &[Method::Committee]).unwrap_err().to_string();
        assert!(error.contains(part), "{option}: {error}");
    }
    for text in ["delta", "delta=4=5", "delta=4 [deg", "fast"] {
        let error = text.parse::<RateLimitOption>().unwrap_err();
        assert!(error.contains("delta=4 [deg]"), "{error}");
    }
    let mut model = identified(RATE, "none", &[Method::Committee]).candidates.remove(0).model;
    model.description.inputs[1].rate_limit = Some(-0.1);
    let error = decode(&encode(&model).unwrap(), Path::new("model")).unwrap_err();
    assert!(
        matches!(&error, ModelError::Inconsistent { reason, .. } if reason.contains("'delta'")),
        "{error}"
    );
}

/// The rudder and the shaft of a ship follow their orders slowly: each rate alone explains little.
#[test]
fn the_rates_of_a_rudder_and_of_a_shaft_are_found_together() {
    let runs = (1..=4).map(|seed| logged([0.02, RATE], seed, false)).collect();
    let found = identified_in(runs, "auto", &[Method::Committee]);
    let limits = limits(&found.candidates[0].model);
    let [shaft, rudder] = [0, 1].map(|i| limits[i].unwrap_or_else(|| panic!("{limits:?}")));
    assert!((shaft / 0.02 - 1.0).abs() < 0.15 && (rudder / RATE - 1.0).abs() < 0.15, "{limits:?}");
}
