//! Identification of the motion through the water from runs in unknown currents.

use std::path::Path;

use hydroid::adapt;
use hydroid::evaluate::{Evaluation, Options, evaluate};
use hydroid::identify::{
    IdentifyError, IdentifyResult, Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption,
    SindyOptions, identify,
};
use hydroid::log::{
    Channel, PrepareOptions, RawLog, Selection, Split, Table, Trajectory, prepare, read_from,
};
use hydroid::model::{Model, Reading, decode, encode};
use hydroid::progress::silent;
use hydroid_core::current::in_body;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const DT: f64 = 0.2;

/// Standard deviation of the measurements.
const NOISE: f64 = 0.01;

/// `du/dt = -0.1 u - 0.2 u|u| + 0.4 n`, `dv/dt = -0.5 v - 0.3 u r`, `dr/dt = -0.6 r + 0.3 u delta`, through the water.
fn step([u, v, r]: [f64; 3], [n, delta]: [f64; 2], h: f64) -> [f64; 3] {
    [
        u + h * (-0.1 * u - 0.2 * u * u.abs() + 0.4 * n),
        v + h * (-0.5 * v - 0.3 * u * r),
        r + h * (-0.6 * r + 0.3 * u * delta),
    ]
}

/// A run of ten minutes over ground in a current.
fn run(current: [f64; 2], seed: u64) -> Trajectory {
    const FINE: usize = 10;
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (mut outputs, mut inputs, mut headings) = (Vec::new(), Vec::new(), Vec::new());
    let (mut water, mut heading, mut command) = ([1.0, 0.0, 0.0], 0.3, [0.0; 2]);
    for k in 0..1_500 {
        if k % 40 == 0 {
            command = [random.random_range(0.3..2.0), random.random_range(-0.6..0.6)];
        }
        let [surge, sway] = in_body(current, heading);
        let over_ground = [water[0] + surge, water[1] + sway, water[2]];
        outputs.extend(over_ground.map(|y| y + NOISE * random.sample::<f64, _>(StandardNormal)));
        inputs.extend(command);
        headings.push(heading);
        for _ in 0..FINE {
            water = step(water, command, DT / FINE as f64);
            heading += water[2] * DT / FINE as f64;
        }
    }
    let table = |names: [(&str, &str); 2], values| {
        Table::new(names.map(|(name, unit)| Channel::new(name, unit)).to_vec(), values)
    };
    let motion = [("u", "m/s"), ("v", "m/s"), ("r", "rad/s")];
    Trajectory {
        name: format!("run {seed}"),
        t0: 0.0,
        dt: DT,
        outputs: Table::new(motion.map(|(name, unit)| Channel::new(name, unit)).to_vec(), outputs),
        inputs: table([("n", "rps"), ("delta", "rad")], inputs),
        truth: None,
        heading: Some(headings),
        position: None,
    }
}

fn job(train: Vec<Trajectory>, methods: &[Method]) -> Job {
    Job {
        methods: methods.to_vec(),
        split: Split { train, validation: Vec::new(), test: Vec::new(), notes: Vec::new() },
        reading: Reading {
            selection: Selection { heading: Some("psi".parse().unwrap()), ..Selection::default() },
            ..Reading::default()
        },
        boat: hydroid::boat::Boat::default(),
        horizon: 50,
        origin_stride: 10,
        seed: 0,
        ranges: std::collections::BTreeMap::default(),
        motion: MotionOption::Auto,
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions { members: Some(0), ..SindyOptions::default() },
        networks: NetworkTrainingOptions::default(),
        vessel: None,
    }
}

const CURRENTS: [[f64; 2]; 4] = [[0.0, 0.0], [0.4, -0.1], [-0.2, 0.3], [0.0, 0.0]];

fn identified(currents: [[f64; 2]; 4], methods: &[Method]) -> IdentifyResult {
    let runs = currents.into_iter().zip(1..).map(|(current, seed)| run(current, seed)).collect();
    identify(&job(runs, methods), &mut silent()).unwrap()
}

#[test]
fn currents_of_the_runs_are_found_and_the_model_predicts_in_another_one() {
    let result = identified(CURRENTS, &[Method::Committee]);
    let found = result.currents.as_ref().unwrap();
    for (run, current) in found.runs.iter().zip(CURRENTS) {
        let errors = [run.north_m_s - current[0], run.east_m_s - current[1]];
        assert!(errors.iter().all(|error| error.abs() < 0.01), "{run:?}");
        assert!(errors.iter().zip(run.deviations_m_s).all(|(error, std)| error.abs() < 4.0 * std), "{run:?}");
        assert!(run.deviations_m_s.iter().all(|std| (1e-4..0.01).contains(std)), "{run:?}");
    }
    let [frames] = &found.methods[..] else { panic!("{found:?}") };
    assert!(frames.taken && frames.through_water < 0.6 * frames.over_ground, "{frames:?}");
    assert!(
        result.warnings.iter().any(|note| note.message.contains("predicts the motion through the water"))
    );

    let best = &result.candidates[result.best.unwrap()].model;
    let current = best.description.current.as_ref().unwrap();
    assert_eq!((current.motion, current.window), ([0, 1, 2], 12));
    assert_eq!(best.description.reading.selection.heading.as_ref().unwrap().column, "psi");
    let other = run([-0.3, -0.3], 9);
    let options = Options { horizon: 50, origin_stride: 10, warm_up: 300, ..Options::default() };
    let score = |run: &Trajectory| {
        let ranges = best.output_ranges();
        let session = &mut *best.session();
        evaluate("model", session, &ranges, &[run], &options, &mut silent()).unwrap().score()
    };
    let (with, without) = (score(&other), score(&Trajectory { heading: None, ..other.clone() }));
    assert!(with < 0.1 && without > 3.0 * with, "{with} {without}");

    // The file holds the estimate of the current.
    let again = decode(&encode(best).unwrap(), Path::new("model.safetensors")).unwrap();
    assert_eq!(again.description.current, best.description.current);
    let mut broken = best.clone();
    broken.description.current.as_mut().unwrap().window = 0;
    let error = decode(&encode(&broken).unwrap(), Path::new("broken.safetensors")).unwrap_err().to_string();
    assert!(error.contains("broken.safetensors") && error.contains("current"), "{error}");

    // It adapts around the estimate of the current, with and without a guard.
    for guarded in [false, true] {
        let adapting = adapt::Options { evaluate: options.clone(), ..adapt::Options::of(best) };
        let adapting = if guarded { adapting.guarded(best) } else { adapting };
        let adapted = adapt::adapt(best, &[&other], &adapting, &mut silent()).unwrap();
        let [frozen, learned] = [&adapted.report.frozen, &adapted.report.adapted].map(Evaluation::score);
        assert!(learned < 1.2 * frozen, "{learned} {frozen}");
        assert_eq!(adapted.model.description.current, best.description.current);
        let (mut adapter, _) = adapt::adapter(best, &adapting, &[]).unwrap();
        adapt::replay_training_runs(adapter.as_mut(), &[&other]);
        assert!(adapter.current().is_some());
    }
}

#[test]
fn in_still_water_models_stay_over_ground() {
    let result = identified([[0.0; 2]; 4], &[Method::Sindy]);
    let found = result.currents.as_ref().unwrap();
    assert!(found.deviation_m_s < 0.005, "{found:?}");
    // Known currents would not help, so that no other model was tried.
    assert!(
        found.methods.is_empty() && result.warnings.iter().all(|note| !note.message.contains("Currents"))
    );
    let model = &result.candidates[0].model;
    assert_eq!((&model.description.current, &model.description.reading.selection.heading), (&None, &None));
}

#[test]
fn the_current_of_a_single_run_is_found_from_its_blocks() {
    let identified = |motion| {
        let job = Job { motion, ..job(vec![run([0.4, -0.1], 3)], &[Method::Committee]) };
        identify(&job, &mut silent()).unwrap()
    };
    // Models over ground are tried, too.
    let found = identified(MotionOption::Auto).currents.unwrap();
    assert_eq!(found.methods.len(), 1, "{found:?}");
    let result = identified(MotionOption::ThroughWater);
    let found = result.currents.unwrap();
    let [of] = &found.runs[..] else { panic!("{found:?}") };
    assert!((of.north_m_s - 0.4).abs() < 0.02 && (of.east_m_s + 0.1).abs() < 0.02, "{of:?}");
    assert!(found.methods.is_empty() && result.candidates.len() == 1);
    assert!(result.candidates[0].model.description.current.is_some());
    let result = identified(MotionOption::OverGround);
    assert!(result.currents.is_none() && result.candidates[0].model.description.current.is_none());
}

#[test]
fn runs_without_a_heading_stay_over_ground_with_a_note() {
    let without = |seed| Trajectory { heading: None, ..run([0.3, 0.0], seed) };
    let result = identify(&job(vec![without(1), without(2)], &[Method::Committee]), &mut silent()).unwrap();
    assert!(result.currents.is_none());
    assert!(result.warnings.iter().any(|note| note.message.contains("no heading")), "{:?}", result.warnings);
}

#[test]
fn what_the_current_needs_is_asked_for() {
    let runs: Vec<Trajectory> = (1..=3).map(|seed| run([0.0; 2], seed)).collect();
    let without = runs.iter().cloned().map(|run| Trajectory { heading: None, ..run }).collect();
    let demanded = |runs: Vec<Trajectory>, methods: &[Method]| {
        identify(&Job { motion: MotionOption::ThroughWater, ..job(runs, methods) }, &mut silent())
            .unwrap_err()
    };
    let error = demanded(without, &[Method::Committee]);
    assert!(matches!(&error, IdentifyError::NoHeading { run } if run == "run 1"), "{error}");
    assert!(error.to_string().contains("heading=\"psi [deg]\""), "{error}");
    let names = ["u", "v", "yaw"].map(|name| Channel::new(name, ""));
    let renamed = runs.iter().cloned().map(|run| {
        let values = run.outputs.rows(0, run.len()).to_vec();
        Trajectory { outputs: Table::new(names.to_vec(), values), ..run }
    });
    let error = demanded(renamed.collect(), &[Method::Committee]);
    assert!(matches!(error, IdentifyError::NoMotion { name: "r" }), "{error}");
    let error = demanded(runs, &[Method::Committee, Method::Gru]);
    assert!(matches!(error, IdentifyError::ThroughWater), "{error}");
}

/// A log of a vessel that turns, with a heading in another unit and direction.
fn log(header: &str, heading: impl Fn(f64) -> f64) -> RawLog {
    let mut psi = 0.4;
    let row = |k: u32| {
        let r = 0.2 * (0.02 * f64::from(k)).sin() + 0.05;
        let row = format!("{},1,0,{r},{},{}\n", 0.1 * f64::from(k), k % 9, heading(psi));
        psi += 0.1 * r;
        row
    };
    let text = format!("t,u,v,r,n_cmd,{header}\n") + &(0..600).map(row).collect::<String>();
    read_from(text.as_bytes(), "log.csv").unwrap()
}

#[test]
fn the_heading_is_found_by_its_name_and_checked_by_the_yaw_rate() {
    let degrees = |psi: f64| psi.to_degrees().rem_euclid(360.0);
    let prepared = |log: RawLog, heading: Option<&str>| {
        let heading = heading.map(|text| text.parse().unwrap());
        let selection = Selection { heading, ..Selection::default() };
        prepare(&[log], &selection, &PrepareOptions::default()).unwrap()
    };
    let found = prepared(log("heading [deg]", degrees), None);
    let run = &found.runs[0];
    assert!((run.heading_at(0) - 0.4).abs() < 1e-9, "{}", run.heading_at(0));
    assert_eq!(found.selection.heading.as_ref().unwrap().to_string(), "psi=heading [deg]");
    assert_eq!(run.slice(5, 9).heading_at(0), run.heading_at(5));
    // Again with the complete selection.
    let again = prepare(&[log("heading [deg]", degrees)], &found.selection, &PrepareOptions::default());
    assert_eq!(again.unwrap().runs[0].heading, run.heading);
    // Counterclockwise: not taken by itself, and with a remark where it is named.
    let port = |psi: f64| degrees(-psi);
    assert_eq!(prepared(log("yaw [deg]", port), None).runs[0].heading, None);
    let named = prepared(log("yaw [deg]", port), Some("yaw"));
    assert!(named.runs[0].heading.is_some());
    assert!(
        named.notes.iter().any(|note| note.message.contains("changes by -1.00 times")),
        "{:?}",
        named.notes
    );
    let turned = prepared(log("yaw [deg]", port), Some("psi=yaw * -1"));
    assert!(turned.notes.iter().all(|note| !note.message.contains("changes by")), "{:?}", turned.notes);
    // A column that only has the name of a heading.
    assert_eq!(prepared(log("heading", |_| 7.0), None).runs[0].heading, None);
    let error = prepare(
        &[log("heading [deg]", degrees)],
        &Selection { heading: Some("compass".parse().unwrap()), ..Selection::default() },
        &PrepareOptions::default(),
    );
    assert!(error.unwrap_err().to_string().contains("compass"));
}

#[test]
fn a_model_with_known_errors_can_estimate_a_current() {
    let result = identified([[0.0; 2]; 4], &[Method::Committee]);
    let model = &result.candidates[0].model;
    assert_eq!(model.description.current, None);
    let other = run([-0.3, 0.2], 9);
    let options = Options { horizon: 50, origin_stride: 10, warm_up: 300, ..Options::default() };
    let score = |model: &Model| {
        let session = &mut *model.session();
        let ranges = model.output_ranges();
        evaluate("model", session, &ranges, &[&other], &options, &mut silent()).unwrap().score()
    };
    let (still, current) = (score(model), score(&model.with_current(0.3).unwrap()));
    assert!(current < 0.5 * still, "{current} {still}");
    // The adapted model keeps the estimate of the current.
    let adapting =
        adapt::Options { current_m_s: Some(0.3), evaluate: options.clone(), ..adapt::Options::of(model) };
    let adapted = adapt::adapt(model, &[&other], &adapting, &mut silent()).unwrap();
    let estimate = model.with_current(0.3).unwrap().description.current;
    assert_eq!(adapted.model.description.current, estimate);
    let (adapter, used) = adapt::adapter(model, &adapting, &[&other]).unwrap();
    let learned = adapt::learned(model, &adapting, adapter.weights(), &[], &used).unwrap();
    assert_eq!(learned.description.current, estimate);
    assert!(adapted.report.adapted.score() < 0.6 * still);

    let error = |model: &Model, deviation| model.with_current(deviation).unwrap_err().to_string();
    assert!(error(model, f64::NAN).contains("NaN m/s: give a positive number"));
    let mut without = model.clone();
    without.description.bands = None;
    without.description.outputs[1].noise = None;
    assert!(error(&without, 0.3).contains("no noise of 'v'"), "{}", error(&without, 0.3));
    without.description.outputs[2].channel.name = "yaw".to_owned();
    assert!(error(&without, 0.3).contains("no output 'r'"), "{}", error(&without, 0.3));
}
