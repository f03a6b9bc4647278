//! Identification of the built-in hydrofoil (lag, change of mode, equations) from ten minutes, of a simple vessel, and
//! with the settings of the thesis.

use hydroid::evaluate::{Against, Evaluation, Options, Origin, evaluate};
use hydroid::excitation::Excitation;
use hydroid::identify::{
    GivenRanges, IdentifyResult, Job, Keyword, Method, MotionOption, NetworkTrainingOptions, RateLimitOption,
    SindyOptions, identify, output_ranges,
};
use hydroid::log::{Split, Trajectory};
use hydroid::model::Reading;
use hydroid::progress::silent;
use hydroid::simulate::{self, simulate};
use hydroid::sindy::{GateSpec, Lag, Structure};
use hydroid_core::craft::Craft;
use hydroid_core::model::sparse::Shape;
use hydroid_study::recipe::{self, DIFFERENCES, UNITS, Verdict, recipe};

/// Without the propeller force, which is not logged.
fn run(vessel: Craft, duration_s: f64, seed: u64) -> Trajectory {
    let options = simulate::Options { duration_s, seed, ..simulate::Options::new(vessel, Excitation::Mixed) };
    simulate(&options, &mut silent()).unwrap().to_trajectory(&["u", "v", "r"]).unwrap()
}

/// Default options: ten minutes of training and five of validation; evaluation on another twenty, from true states
/// against the truth.
fn from_ten_minutes(vessel: &Craft, seed: u64) -> (IdentifyResult, Evaluation) {
    let part = |duration_s, seed| vec![run(vessel.clone(), duration_s, seed)];
    let split = Split {
        train: part(600.0, seed),
        validation: part(300.0, seed + 2),
        test: part(1_200.0, seed + 1),
        notes: Vec::new(),
    };
    let job = Job {
        methods: vec![Method::Sindy],
        split,
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 100,
        origin_stride: 20,
        seed: 0,
        ranges: GivenRanges::new(),
        networks: NetworkTrainingOptions::default(),
        vessel: None,
        motion: MotionOption::OverGround,
        rate_limits: RateLimitOption::Keyword(Keyword::None),
        allow_feedback: Vec::new(),
        sindy: SindyOptions::default(),
    };
    let identified = identify(&job, &mut silent()).unwrap();
    let options = Options {
        horizon: 100,
        origin_stride: 20,
        origin: Origin::True,
        against: Against::Truth,
        warm_up: 1,
        ..Options::default()
    };
    let mut session = identified.candidates[0].model.session();
    let ranges = output_ranges(&[&job.split.train[0]]);
    let test =
        evaluate("sindy", session.as_mut(), &ranges, &[&job.split.test[0]], &options, &mut silent()).unwrap();
    (identified, test)
}

fn structure(identified: &IdentifyResult) -> &Structure {
    let found = identified.candidates[0].found().unwrap();
    &found.trials[found.chosen].structure
}

fn the_hydrofoil_is_found(seed: u64, factor: f64) {
    let (identified, test) = from_ten_minutes(&Craft::hydrofoil(), seed);
    let structure = structure(&identified);
    println!("seed {seed}: 20 steps {:.4?}, 100 steps {:.4?}, {structure:?}", test.mae[19], test.mae[99]);
    // The plant: lag of 1 s of the propeller, change of the drag at 2.5 m/s with slope 12.
    let [Lag { input: 0, time_constant_s }] = structure.lags[..] else { panic!("{:?}", structure.lags) };
    assert!((time_constant_s - 1.0).abs() < 0.05, "{time_constant_s} s");
    let Some(GateSpec { output: 0, gate }) = structure.gate else { panic!("{:?}", structure.gate) };
    assert!((gate.centre.0 - 2.5).abs() < 0.05 && (gate.slope.0 - 12.0).abs() < 2.0, "{gate:?}");
    assert_eq!((test.diverged, identified.best), (0, Some(0)));
    for horizon in [20, 100] {
        for (error, limit) in test.mae[horizon - 1].iter().zip([0.0013, 0.0012, 0.0020]) {
            let limit = factor * limit;
            assert!(*error <= limit, "{error} above {limit}, {horizon} steps ahead");
        }
    }
}

/// Limits are a multiple of the errors with two hours of training. Record 10 once gave a lag of the rudder in ungated
/// equations; with it gated equations failed, with errors of 0.18, 0.05 and 0.03.
#[test]
fn ten_minutes_of_the_hydrofoil_give_lag_mode_and_motion() {
    the_hydrofoil_is_found(10, 1.0);
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn the_hydrofoil_from_ten_other_minutes() {
    the_hydrofoil_is_found(40, 1.0);
}

/// Ten minutes with less excitation.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn ten_less_excited_minutes_of_the_hydrofoil() {
    the_hydrofoil_is_found(0, 1.75);
}

#[test]
fn the_simple_vessel_gets_no_change_of_mode() {
    let (identified, test) = from_ten_minutes(&Craft::simple(), 0);
    let structure = structure(&identified);
    println!("20 steps {:.4?}, 100 steps {:.4?}, {structure:?}", test.mae[19], test.mae[99]);
    assert_eq!(structure.gate, None);
    let found = identified.candidates[0].found().unwrap();
    let equations = &found.fit.equations;
    for (j, term) in equations.terms().iter().enumerate() {
        let used = (0..3).any(|i| equations.coefficient(i, j) != 0.0);
        let gated = term.factors().iter().any(|f| matches!(f.shape, Shape::Above(_) | Shape::Below(_)));
        assert!(!(used && gated), "{term:?}");
    }
    // The propeller has the lag of the hydrofoil.
    let [Lag { input: 0, time_constant_s }] = structure.lags[..] else { panic!("{:?}", structure.lags) };
    assert!((time_constant_s - 1.0).abs() < 0.05, "{time_constant_s} s");
    assert_eq!((test.diverged, identified.best), (0, Some(0)));
}

/// With the settings of the thesis, a threshold on coefficients in newtons removes the propeller, and smoothing over 51
/// samples removes the motion. Other settings have a hundred times the error of the equations of hydroid.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn the_settings_of_the_thesis_have_moderate_accuracy() {
    let [train, test] = [0, 1].map(|seed| run(Craft::hydrofoil(), 600.0, seed));
    let rows = recipe(&train, &test, &[2], &[DIFFERENCES[0], DIFFERENCES[2]], &[0.0, 0.05, 0.5]).unwrap();
    let row = |difference: &str, unit: &str, threshold: f64| {
        let same =
            |r: &&recipe::Row| r.difference == difference && r.unit == unit && r.threshold == threshold;
        rows.iter().find(same).unwrap()
    };
    assert_eq!(rows.len(), 12);
    for row in &rows {
        println!(
            "{} {} {}: {} terms, {:.4?}, {}",
            row.difference, row.unit, row.threshold, row.terms, row.errors, row.verdict
        );
    }
    // u, v, r at 20 steps, then at 100.
    let errors = |row: &recipe::Row| row.errors.clone().unwrap().concat();
    let [newtons, hundreds] = UNITS.map(|(name, _)| name);
    // Without a threshold the result does not depend on units.
    let (plain, scaled) = (row("central", newtons, 0.0), row("central", hundreds, 0.0));
    for (a, b) in errors(plain).iter().zip(&errors(scaled)) {
        assert!((a - b).abs() <= 1e-6 * a, "{a} and {b}");
    }
    assert_eq!((plain.verdict, scaled.verdict), (Verdict::WorksModerately, Verdict::WorksModerately));
    assert!((0.1..0.5).contains(&errors(plain)[0]), "{:?}", plain.errors);
    // With a threshold it does.
    assert_eq!(row("central", hundreds, 0.05).verdict, Verdict::WorksModerately);
    let lost = row("central", newtons, 0.05);
    assert!(matches!(lost.verdict, Verdict::LostItsPropeller | Verdict::Diverges));
    assert!(errors(lost)[3] > 4.0 * errors(scaled)[3]);
    let smooth = row("smoothed, 51", hundreds, 0.0);
    assert!(errors(smooth)[..3].iter().zip(&errors(scaled)[..3]).all(|(a, b)| a > b), "{:?}", smooth.errors);
    assert_eq!(row("smoothed, 51", hundreds, 0.5).verdict, Verdict::Collapsed);
}
