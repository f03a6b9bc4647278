//! Identification on logs of real ships, against the ridge baseline on the same split.
//!
//! Without the logs in `HYDROID_DATA` the tests pass with a message.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use crate::ridge_baseline::{CYBERSHIP, ESSO, Row, Ship, baseline, chosen, last};
use hydroid::evaluate::Evaluation;
use hydroid::identify::{
    GivenRanges, Grade, IdentifyResult, Job, Method, MotionOption, NetworkTrainingOptions, RateLimitOption,
    SindyOptions, identify,
};
use hydroid::log::{self, PrepareOptions, Selection, Split, split_named};
use hydroid::model::Reading;
use hydroid::progress::silent;

fn data() -> Option<PathBuf> {
    let data = std::env::var_os("HYDROID_DATA").map(PathBuf::from);
    if data.is_none() {
        let _ = writeln!(std::io::stderr(), "skipped: no HYDROID_DATA");
    }
    data
}

fn job(split: Split, horizon: usize, origin_stride: usize) -> Job {
    Job {
        methods: vec![Method::Sindy],
        split,
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon,
        origin_stride,
        seed: 0,
        ranges: GivenRanges::new(),
        networks: NetworkTrainingOptions::default(),
        vessel: None,
        motion: MotionOption::default(),
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions::default(),
    }
}

/// The baseline with negligible shrinkage.
fn plain(rows: &[Row]) -> impl Iterator<Item = &Row> {
    rows.iter().filter(|row| row.lambda <= 1e-2)
}

fn beats_persistence(test: &Evaluation, factor: f64) {
    let horizon_1_s = (1.0 / test.dt).round();
    for (h, (errors, kept)) in test.nrmse.iter().zip(&test.persistence.nrmse).enumerate() {
        for (error, kept) in errors.iter().zip(kept) {
            assert!((h as f64) + 1.0 < horizon_1_s || *error < factor * kept, "{h}: {error} against {kept}");
        }
    }
}

/// Mean NRMSE of the outputs at the last horizon by method, and of the ridge selected on the validation runs.
fn means(ship: &Ship, data: &Path) -> (IdentifyResult, Vec<f64>, f64) {
    let [train, validation, test] = ship.runs(data);
    let split = Split { train, validation, test, notes: Vec::new() };
    let methods = vec![Method::Sindy, Method::Lagged, Method::Recursive];
    let sindy = SindyOptions { members: Some(0), ..SindyOptions::default() };
    let result = identify(&Job { methods, sindy, ..job(split, ship.horizon, 5) }, &mut silent()).unwrap();
    let means = result.candidates.iter().map(|c| last(c.judged()).1).collect();
    let ridge = last(&chosen(&baseline(ship, data)).test).1;
    (result, means, ridge)
}

/// The ridge is constant; the best model on the tug adapts along the run.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn cybership_is_a_tenth_below_the_ridge_that_validation_chooses() {
    let Some(data) = data() else { return };
    let (result, means, ridge) = means(&CYBERSHIP, &data);
    let best = result.best.unwrap();
    assert!(means[best] < 0.9 * ridge, "{means:?} against {ridge}");
    assert!(result.candidates.iter().all(|c| c.judged().diverged == 0));
    beats_persistence(result.candidates[best].judged(), 0.85);
    assert!(result.is_usable());
    // Constant equations are better than ridge with negligible shrinkage.
    for row in plain(&baseline(&CYBERSHIP, &data)) {
        let (_, ridge) = last(&row.test);
        assert!(means[0] < 0.95 * ridge, "{means:?} against {ridge}");
    }
}

/// Without the ends at which the ship is towed, for the ridge as well; README has the result with them.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn esso_is_a_tenth_below_the_ridge_that_validation_chooses() {
    let Some(data) = data() else { return };
    let (result, means, ridge) = means(&ESSO, &data);
    assert!(means.iter().all(|mean| *mean < 0.9 * ridge), "{means:?} against {ridge}");
    assert!(means[result.best.unwrap()] < 0.8 * ridge, "{means:?} against {ridge}");
    assert!(result.candidates.iter().all(|c| c.judged().diverged == 0));
    assert!(result.is_usable());
}

/// Regression test: on ten minutes of the hydrofoil in one log, two minutes of validation selected unstable equations.
#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn a_short_log_has_a_robust_validation() {
    let Some(path) = data().map(|data| data.join("../reference/records/both_val.csv")) else { return };
    if !path.exists() {
        let _ = writeln!(std::io::stderr(), "skipped: no simulated records beside HYDROID_DATA");
        return;
    }
    let selection = Selection::of("u,v,r", "PP_cmd,RD_ang").unwrap();
    let prepared =
        log::prepare(&[log::read(&path).unwrap()], &selection, &PrepareOptions::default()).unwrap();
    let split = split_named(prepared.runs, Vec::new(), Vec::new()).unwrap();
    let result = identify(&job(split, 100, 1), &mut silent()).unwrap();
    assert!(result.verdicts.iter().all(|v| v.grade == Grade::Good), "{:?}", result.verdicts);
}

#[test]
fn the_ugly_log_is_prepared_with_warnings() {
    let Some(data) = data() else { return };
    let files = ["boat1_2_circle.csv", "boat1_2_sin.csv"].map(|file| data.join("usv-asw").join(file));
    let raw: Vec<_> = files.iter().map(|file| log::read(file).unwrap()).collect();
    let selection =
        Selection::of("u=u_mps,v=v_mps,r=r_radps", "left=pwm_left_us,right=pwm_right_us").unwrap();
    let doubts = log::inspect(&raw[1], &selection, &PrepareOptions::default()).unwrap().notes;
    assert!(doubts.iter().any(|note| note.message.contains("the sway is unreliable")));
    let prepared = log::prepare(&raw, &selection, &PrepareOptions::default()).unwrap();
    let split = split_named(prepared.runs, Vec::new(), Vec::new()).unwrap();
    let result = identify(&job(split, 100, 1), &mut silent()).unwrap();
    assert!(!result.is_usable());
    let sway = &result.verdicts[1];
    assert_eq!((sway.channel.as_str(), sway.grade), ("v", Grade::NotIdentified));
    assert!(result.warnings.iter().any(|note| note.message.contains("'v' is not identified")));
}
