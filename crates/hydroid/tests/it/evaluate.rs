//! Evaluation of models with known errors.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::judged::{DT, RANGES, judge, options, run, table, wave};
use hydroid::evaluate::{
    Against, DesignRange, EvaluateError, Evaluation, Options, Origin, PredictionBands, evaluate,
    evaluate_each,
};
use hydroid::log::Trajectory;
use hydroid::progress::silent;
use hydroid_core::model::Persistence;
use hydroid_core::predict::{Predictor, Workspace, plain, rollout_steps};

/// A predictor with a given error of every prediction.
#[derive(Clone)]
struct Oracle {
    outputs: Arc<Vec<Vec<f64>>>,
    /// Error by sample of the origin, horizon (from 1) and channel.
    error: fn(usize, usize, usize) -> f64,
    warm_up: usize,
}

impl Oracle {
    fn new(outputs: &[Vec<f64>], error: fn(usize, usize, usize) -> f64) -> Self {
        Self { outputs: Arc::new(outputs.to_vec()), error, warm_up: 1 }
    }
}

impl Predictor for Oracle {
    plain!(over_ground advance_observe rollout_batch rollout_snapshots);

    fn outputs(&self) -> usize {
        2
    }
    fn inputs(&self) -> usize {
        1
    }
    fn warm_up(&self) -> usize {
        self.warm_up
    }
    fn reset(&mut self) {}
    fn observe(&mut self, _y: &[f64]) {}
    fn advance(&mut self, _c: &[f64]) {}
    fn output(&self, y: &mut [f64]) {
        y.fill(f64::NAN);
    }
    fn rollout(&self, commands: &[f64], _work: &mut Workspace, y: &mut [f64]) {
        let steps = rollout_steps(commands, 1, y, 2);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let origin = commands[0] as usize;
        for step in 0..steps {
            assert_eq!(commands[step], (origin + step) as f64, "the commands of this origin, in order");
            for c in 0..2 {
                y[2 * step + c] = self.outputs[origin + step + 1][c] + (self.error)(origin, step + 1, c);
            }
        }
    }
    fn snapshot_len(&self) -> usize {
        0
    }
    fn snapshot(&self, _into: &mut [f64]) {}
    fn restore(&mut self, _from: &[f64]) {}
    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12
}

/// Standard deviation by definition.
fn deviation(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
}

#[test]
fn a_known_error_has_its_measures() {
    let outputs = wave(60);
    let log = run("a", &outputs);
    // The error is constant in u and grows with the horizon in v.
    let oracle = Oracle::new(&outputs, |_, h, c| if c == 0 { 0.25 } else { -0.01 * h as f64 });
    let result = judge(&oracle, &[&log], &options(5)).unwrap();
    assert_eq!((result.windows, result.diverged), (55, 0));
    assert_eq!(result.horizons, [1, 2, 3, 4, 5]);
    for h in 0..5 {
        let expected = [0.25, 0.01 * (h + 1) as f64];
        for c in 0..2 {
            assert!(near(result.mae[h][c], expected[c]) && near(result.max[h][c], expected[c]));
            assert!(near(result.rmse[h][c], expected[c]));
            let compared: Vec<f64> = (0..55).map(|k| outputs[k + h + 1][c]).collect();
            let nrmse = expected[c] / deviation(&compared);
            assert!(near(result.nrmse[h][c], nrmse) && near(result.r2[h][c], 1.0 - nrmse * nrmse));
        }
    }
    let mean = result.nrmse.iter().flatten().sum::<f64>() / 10.0;
    assert!(near(result.score(), mean));
    assert_eq!((result.at(3), result.at(6)), (Some(2), None));
}

#[test]
fn the_largest_the_mean_and_the_root_mean_square_are_different_things() {
    let outputs = wave(12);
    // Errors 3, -4, 0, 0 .. from the ten origins of horizon 2.
    let oracle = Oracle::new(&outputs, |origin, _, _| match origin {
        0 => 3.0,
        1 => -4.0,
        _ => 0.0,
    });
    let result = judge(&oracle, &[&run("a", &outputs)], &options(2)).unwrap();
    assert_eq!(result.windows, 10);
    for h in 0..2 {
        for c in 0..2 {
            assert!(near(result.mae[h][c], 0.7));
            assert!(near(result.max[h][c], 4.0));
            assert!(near(result.rmse[h][c], 2.5f64.sqrt()));
        }
    }
}

#[test]
fn persistence_is_its_own_baseline_to_the_bit() {
    let mut outputs = wave(200);
    outputs[50][0] = f64::NAN;
    outputs[120][1] = f64::NAN;
    let log = run("a", &outputs);
    let result = judge(&Persistence::new(2, 1), &[&log], &options(7)).unwrap();
    assert_eq!(result.mae, result.persistence.mae);
    assert_eq!(result.rmse, result.persistence.rmse);
    assert_eq!(result.nrmse, result.persistence.nrmse);
    // The definition: |y_k+h - y_k|, with the last value where y_k is missing.
    let mut last = f64::NAN;
    let mut errors = Vec::new();
    for k in 0..=200 - 8 {
        last = if outputs[k][0].is_nan() { last } else { outputs[k][0] };
        let target = outputs[k + 3][0];
        if !target.is_nan() {
            errors.push((target - last).abs());
        }
    }
    assert!(near(result.mae[2][0], errors.iter().sum::<f64>() / errors.len() as f64));
    assert_eq!(errors.len(), 192);
}

#[test]
fn a_diverged_rollout_is_counted_and_reported() {
    let outputs = wave(100);
    // Divergence only of v, from origin 20, at horizon 3.
    let errors: [fn(usize, usize, usize) -> f64; 3] = [
        |k, h, c| if (k, h, c) == (20, 3, 1) { f64::NAN } else { 0.1 },
        |k, h, c| if (k, h, c) == (20, 3, 1) { f64::INFINITY } else { 0.1 },
        |k, h, c| if (k, h, c) == (20, 3, 1) { 30.0 } else { 0.1 },
    ];
    for error in errors {
        let result = judge(&Oracle::new(&outputs, error), &[&run("storm", &outputs)], &options(5)).unwrap();
        assert_eq!((result.windows, result.diverged), (95, 1));
        let told = &result.divergences;
        assert_eq!(told.len(), 1);
        assert_eq!((told[0].run.as_str(), told[0].horizon, told[0].channel.as_str()), ("storm", 3, "v"));
        assert!(near(told[0].origin_s, 100.0 + 20.0 * DT));
        for h in 0..5 {
            for c in (0..2).filter(|c| (h, *c) != (2, 1)) {
                assert!(near(result.mae[h][c], 0.1) && near(result.max[h][c], 0.1));
            }
        }
        // The diverged prediction of v is limited to 10; NaN to the limit that is farther from the target.
        let (above, below) = (10.0 - outputs[23][1], 10.0 + outputs[23][1]);
        let expected = if error(20, 3, 1).is_nan() { above.max(below) } else { above };
        assert!(near(result.max[2][1], expected), "{}", result.max[2][1]);
        assert!(near(result.mae[2][1], (94.0 * 0.1 + result.max[2][1]) / 95.0));
        // Persistence is evaluated on all windows.
        let kept: Vec<f64> = (0..95).map(|k| (outputs[k + 1][0] - outputs[k][0]).abs()).collect();
        assert!(near(result.persistence.mae[0][0], kept.iter().sum::<f64>() / 95.0));
        assert_eq!(result.score(), f64::INFINITY, "never the best");
    }
}

#[test]
fn divergence_starts_at_ten_times_the_design_range() {
    let outputs = vec![vec![2.0, 0.0]; 10];
    // The design range of u is 0..4: 2 +- 20.
    let inside = Oracle::new(&outputs, |_, _, c| if c == 0 { -20.0 } else { 0.0 });
    assert_eq!(judge(&inside, &[&run("a", &outputs)], &options(1)).unwrap().diverged, 0);
    let outside = Oracle::new(&outputs, |_, _, c| if c == 0 { -20.001 } else { 0.0 });
    let result = judge(&outside, &[&run("a", &outputs)], &options(1)).unwrap();
    assert_eq!((result.windows, result.diverged), (9, 9));
    // The windows stay in the errors, with the limit -18 as prediction.
    assert!(near(result.mae[0][0], 20.0) && near(result.max[0][0], 20.0));
    assert_eq!(result.persistence.mae[0][0], 0.0);
}

#[test]
fn a_right_prediction_outside_the_design_range_has_not_diverged() {
    // The design range of v is -1 to 1.
    let outputs: Vec<Vec<f64>> = (0..50).map(|k| vec![2.0, f64::from(k)]).collect();
    let result = judge(&Oracle::new(&outputs, |_, _, _| 0.1), &[&run("a", &outputs)], &options(5)).unwrap();
    assert_eq!((result.windows, result.diverged), (45, 0));
    assert!(near(result.mae[4][1], 0.1) && near(result.persistence.mae[4][1], 5.0));
}

#[test]
fn the_first_ten_divergences_are_listed_in_order() {
    let outputs = wave(100);
    let oracle = Oracle::new(&outputs, |_, _, _| f64::NAN);
    let result = judge(&oracle, &[&run("a", &outputs)], &options(5)).unwrap();
    assert_eq!((result.diverged, result.divergences.len()), (95, 10));
    for (k, told) in result.divergences.iter().enumerate() {
        assert!(near(told.origin_s, 100.0 + k as f64 * DT));
    }
}

#[test]
fn origins_start_after_the_warm_up_and_keep_their_stride() {
    let outputs = wave(50);
    let log = run("a", &outputs);
    // The error is the index of the origin: mean and maximum identify the origins.
    let mut oracle = Oracle::new(&outputs, |origin, _, _| 1e-3 * origin as f64);
    for (warm_up, own, stride, expected) in [
        (1, 1, 1, (0..=46).collect::<Vec<usize>>()),
        (0, 0, 1, (0..=46).collect()),
        (4, 1, 1, (3..=46).collect()),
        (1, 4, 1, (3..=46).collect()),
        (1, 1, 7, vec![0, 7, 14, 21, 28, 35, 42]),
        (5, 2, 20, vec![4, 24, 44]),
        (47, 1, 1, vec![46]),
        (1, 1, 1000, vec![0]),
    ] {
        oracle.warm_up = own;
        let options = Options { warm_up, origin_stride: stride, ..options(3) };
        let result = judge(&oracle, &[&log], &options).unwrap();
        assert_eq!(result.windows, expected.len());
        let sum: usize = expected.iter().sum();
        assert!(
            near(result.mae[2][0], 1e-3 * sum as f64 / expected.len() as f64),
            "{warm_up} {own} {stride}"
        );
        assert!(near(result.max[0][1], 1e-3 * *expected.last().unwrap() as f64));
    }
}

#[test]
fn a_missing_target_gives_no_row_and_a_missing_start_waits() {
    let mut outputs = wave(40);
    let oracle = Oracle::new(&outputs, |origin, _, c| if c == 1 { 1e-3 * origin as f64 } else { 0.1 });
    // v is measured from sample 5 on, but not at 20.
    for k in (0..5).chain([20]) {
        outputs[k][1] = f64::NAN;
    }
    let result = judge(&oracle, &[&run("a", &outputs)], &options(2)).unwrap();
    // Origins 5 .. 37; the target is missing for origin 19 at horizon 1 and for origin 18 at horizon 2.
    assert_eq!((result.windows, result.diverged), (33, 0));
    for (h, without) in [(0, 19usize), (1, 18)] {
        let origins: Vec<usize> = (5..=37).filter(|k| *k != without).collect();
        let mean = 1e-3 * origins.iter().sum::<usize>() as f64 / 32.0;
        assert!(near(result.mae[h][1], mean));
        assert!(near(result.mae[h][0], 0.1));
    }
}

#[test]
fn truth_and_measurement_are_not_mixed_up() {
    let truth = wave(60);
    let measured: Vec<Vec<f64>> = truth.iter().map(|y| vec![y[0] + 0.5, y[1] - 0.25]).collect();
    let mut log = run("a", &measured);
    log.truth = Some(table(&["u", "v"], "m/s", &truth));
    // The error of persistence is the target minus the observed value.
    let model = Persistence::new(2, 1);
    for (origin, against) in [
        (Origin::Measured, Against::Measurement),
        (Origin::Measured, Against::Truth),
        (Origin::True, Against::Measurement),
        (Origin::True, Against::Truth),
    ] {
        let result = judge(&model, &[&log], &Options { origin, against, ..options(1) }).unwrap();
        assert_eq!((result.origin, result.against), (origin, against));
        let seen = if origin == Origin::True { &truth } else { &measured };
        let target = if against == Against::Truth { &truth } else { &measured };
        let errors: Vec<f64> = (0..59).map(|k| (target[k + 1][0] - seen[k][0]).abs()).collect();
        assert!(near(result.mae[0][0], errors.iter().sum::<f64>() / 59.0), "{origin:?} {against:?}");
    }
}

#[test]
fn runs_are_judged_together_and_never_joined() {
    // The ends of the two runs differ: a window across them would have an error of 100.
    let (a, b) = (wave(30), wave(41).iter().map(|y| vec![y[0] + 100.0, y[1]]).collect::<Vec<_>>());
    let wide = [DesignRange { low: 0.0, high: 200.0 }, DesignRange { low: -1.0, high: 1.0 }];
    let (first, second) = (run("a", &a), run("b", &b));
    let judge = |runs: &[&Trajectory]| {
        evaluate("p", &mut Persistence::new(2, 1), &wide, runs, &options(4), &mut |_| {
            ControlFlow::Continue(())
        })
        .unwrap()
    };
    let (both, one, two) = (judge(&[&first, &second]), judge(&[&first]), judge(&[&second]));
    assert_eq!((one.windows, two.windows, both.windows), (26, 37, 63));
    for h in 0..4 {
        for c in 0..2 {
            let mean = (26.0 * one.mae[h][c] + 37.0 * two.mae[h][c]) / 63.0;
            assert!(near(both.mae[h][c], mean));
            assert_eq!(both.max[h][c], one.max[h][c].max(two.max[h][c]));
            // The scale includes all compared points, with the jump between the runs in u.
            let compared: Vec<f64> =
                (0..26).map(|k| a[k + h + 1][c]).chain((0..37).map(|k| b[k + h + 1][c])).collect();
            assert!((both.nrmse[h][c] * deviation(&compared) / both.rmse[h][c] - 1.0).abs() < 1e-9);
        }
    }
    // A run that is too short for a window does not change the result.
    let short = run("short", &wave(4));
    assert_eq!(judge(&[&short, &first]).windows, 26);
}

#[test]
fn a_constant_channel_has_no_scale() {
    let mut outputs = wave(40);
    for y in &mut outputs {
        y[1] = 0.3;
    }
    let oracle = Oracle::new(&outputs, |_, _, _| 0.1);
    let result = judge(&oracle, &[&run("a", &outputs)], &options(2)).unwrap();
    assert!(result.nrmse[0][1].is_nan() && result.r2[0][1].is_nan() && near(result.rmse[0][1], 0.1));
    assert!(near(result.score(), f64::midpoint(result.nrmse[0][0], result.nrmse[1][0])));
}

#[test]
fn invalid_evaluations_are_refused_with_a_reason() {
    let model = Persistence::new(2, 1);
    let log = run("a", &wave(10));
    let error = |runs: &[&Trajectory], options: &Options| judge(&model, runs, options).unwrap_err();
    assert_eq!(error(&[&log], &options(0)), EvaluateError::NoHorizon);
    assert_eq!(error(&[&log], &Options { origin_stride: 0, ..options(1) }), EvaluateError::NoHorizon);
    let short =
        |needed, warm_up, horizon, longest| EvaluateError::TooShort { needed, warm_up, horizon, longest };
    assert_eq!(error(&[&log], &options(10)), short(11, 1, 10, 10));
    assert_eq!(error(&[&log], &Options { warm_up: 8, ..options(3) }), short(11, 8, 3, 10));
    assert_eq!(judge(&model, &[&log], &options(9)).unwrap().windows, 1, "one sample more is enough");
    assert_eq!(error(&[], &options(1)), short(2, 1, 1, 0));
    assert_eq!(error(&[&run("empty", &[vec![0.0, 0.0]])], &options(1)), short(2, 1, 1, 1));
    for options in
        [Options { origin: Origin::True, ..options(1) }, Options { against: Against::Truth, ..options(1) }]
    {
        assert_eq!(error(&[&log], &options), EvaluateError::NoTruth { run: String::from("a") });
    }
    let channels =
        |what, expected, given| EvaluateError::Channels { run: String::from("a"), what, expected, given };
    let other = |outputs, inputs| {
        let ranges = vec![RANGES[0]; outputs];
        let silent = &mut |_| ControlFlow::Continue(());
        evaluate("p", &mut Persistence::new(outputs, inputs), &ranges, &[&log], &options(1), silent)
            .unwrap_err()
    };
    assert_eq!(other(3, 1), channels("outputs", 3, 2));
    assert_eq!(other(2, 4), channels("inputs", 4, 1));
    let slow = Trajectory { dt: 1.0, name: String::from("slow"), ..log.clone() };
    let mixed = EvaluateError::SampleTime { run: String::from("slow"), expected: 0.5, given: 1.0 };
    assert_eq!(error(&[&log, &slow], &options(1)), mixed);
    let stopped =
        evaluate("p", &mut model.clone(), &RANGES, &[&log], &options(1), &mut |_| ControlFlow::Break(()));
    assert_eq!(stopped.unwrap_err(), EvaluateError::Cancelled(hydroid::progress::Cancelled));
}

/// 2^64 - 1 must not overflow a sum or a capacity.
#[test]
fn an_endless_horizon_is_an_error() {
    let log = run("a", &wave(30));
    let error = judge(&Persistence::new(2, 1), &[&log], &options(usize::MAX)).unwrap_err();
    assert!(matches!(error, EvaluateError::TooShort { .. }), "{error}");
}

fn keys(value: &serde_json::Value) -> BTreeSet<&str> {
    value.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
fn json_has_the_keys_and_shapes_of_the_contract() {
    let mut outputs = wave(30);
    for y in &mut outputs {
        y[1] = 0.3;
    }
    let oracle = Oracle::new(&outputs, |k, _, _| if k == 3 { f64::NAN } else { 0.1 });
    let result = judge(&oracle, &[&run("a", &outputs)], &options(4)).unwrap();
    let json: serde_json::Value = serde_json::from_str(&serde_json::to_string(&result).unwrap()).unwrap();
    let mut contract = BTreeSet::from([
        "model",
        "origin",
        "against",
        "dt",
        "channels",
        "units",
        "horizons",
        "windows",
        "diverged",
        "mae",
        "max",
        "rmse",
        "nrmse",
        "r2",
        "persistence",
    ]);
    // In addition to the contract.
    contract.extend(["divergences", "runs", "by_run", "independent"]);
    assert_eq!(keys(&json), contract);
    assert_eq!(keys(&json["persistence"]), BTreeSet::from(["mae", "rmse", "nrmse"]));
    assert_eq!(keys(&json["divergences"][0]), BTreeSet::from(["run", "origin_s", "horizon", "channel"]));
    assert_eq!(json["model"], "double");
    assert_eq!((&json["origin"], &json["against"]), (&"measured".into(), &"measurement".into()));
    assert_eq!(json["dt"], 0.5);
    assert_eq!(json["channels"], serde_json::json!(["u", "v"]));
    assert_eq!(json["units"], serde_json::json!(["m/s", "m/s"]));
    assert_eq!(json["horizons"], serde_json::json!([1, 2, 3, 4]));
    assert_eq!((&json["windows"], &json["diverged"]), (&26.into(), &1.into()));
    let tables = ["mae", "max", "rmse", "nrmse", "r2"].map(|key| &json[key]);
    let baseline = ["mae", "rmse", "nrmse"].map(|key| &json["persistence"][key]);
    for table in tables.into_iter().chain(baseline) {
        let rows = table.as_array().unwrap();
        assert_eq!(rows.len(), 4, "a row per horizon");
        assert!(rows.iter().all(|row| row.as_array().unwrap().len() == 2), "a figure per channel");
    }
    assert!(
        json["nrmse"][0][1].is_null() && json["nrmse"][0][0].is_f64(),
        "a figure that does not exist is null"
    );
    for (option, word) in [(Origin::Measured, "measured"), (Origin::True, "true")] {
        assert_eq!(serde_json::to_value(option).unwrap(), word);
    }
    for (option, word) in [(Against::Measurement, "measurement"), (Against::Truth, "truth")] {
        assert_eq!(serde_json::to_value(option).unwrap(), word);
    }
    // The JSON is read back, undefined values included; blocks are not written.
    assert!(json.get("blocks").is_none());
    let again: Evaluation = serde_json::from_value(json).unwrap();
    let written = Evaluation { blocks: Vec::new(), ..result };
    assert_eq!(format!("{again:?}"), format!("{written:?}"));
}

/// An output without values leaves no origin; this is not a divergence of the model.
#[test]
fn an_output_that_is_never_measured_is_named() {
    let mut outputs = wave(20);
    for y in &mut outputs {
        y[1] = f64::NAN;
    }
    let nowhere = EvaluateError::NoOrigin { channel: String::from("v") };
    let model = Persistence::new(2, 1);
    assert_eq!(judge(&model, &[&run("a", &outputs)], &options(3)).unwrap_err(), nowhere);
    // Measured once, too late for a window.
    outputs[18][1] = 0.0;
    assert_eq!(judge(&model, &[&run("a", &outputs)], &options(3)).unwrap_err(), nowhere);
    // One run with measurements is enough.
    let good = run("b", &wave(20));
    assert_eq!(judge(&model, &[&run("a", &outputs), &good], &options(3)).unwrap().windows, 17);
}

#[test]
fn each_run_has_errors_of_its_own_and_a_session_of_its_own() {
    let outputs = wave(60);
    let runs = [run("a", &outputs), run("b", &outputs[..40])];
    let errors: [fn(usize, usize, usize) -> f64; 2] = [|_, _, _| 0.25, |_, _, _| -0.5];
    let sessions = || errors.map(|error| Box::new(Oracle::new(&outputs, error)) as Box<dyn Predictor>);
    let both = runs.each_ref();
    let result = evaluate_each("each", &mut sessions(), &RANGES, &both, &options(5), &mut silent()).unwrap();
    assert_eq!(result.by_run.iter().map(|run| run.run.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert_eq!(result.by_run.iter().map(|run| run.windows).collect::<Vec<_>>(), [55, 35]);
    // The deviation is that over both runs.
    for c in 0..2 {
        let all: Vec<f64> = outputs.iter().chain(&outputs[..40]).map(|row| row[c]).collect();
        let deviation = deviation(&all);
        assert!(near(result.by_run[0].nrmse[c], 0.25 / deviation));
        assert!(near(result.by_run[1].nrmse[c], 0.5 / deviation));
        let pooled = ((55.0 * 0.25f64.powi(2) + 35.0 * 0.5f64.powi(2)) / 90.0).sqrt();
        assert!(near(result.rmse[4][c], pooled));
    }
}

#[test]
fn bands_hold_their_share_of_the_errors_they_are_made_of_and_of_twice_as_large_ones_less() {
    let outputs = wave(500);
    let log = run("a", &outputs);
    // Errors between -1 and 1 thousandths times the horizon, evenly spread.
    let oracle =
        Oracle::new(&outputs, |k, h, _| ((0.618_034 * k as f64).fract() * 2.0 - 1.0) * 1e-3 * h as f64);
    let larger =
        Oracle::new(&outputs, |k, h, _| ((0.618_034 * k as f64).fract() * 2.0 - 1.0) * 2e-3 * h as f64);
    let options = Options { errors_at: vec![2, 4, 8], ..options(8) };
    let result = judge(&oracle, &[&log], &options).unwrap();
    let bands = PredictionBands::new(&result).unwrap();
    let worse = judge(&larger, &[&log], &options).unwrap();
    let (held, less) = (bands.coverage(&result), bands.coverage(&worse));
    for (i, level) in [0.5, 0.8, 0.9].into_iter().enumerate() {
        for h in 0..3 {
            for c in 0..2 {
                let width = level * 1e-3 * [2.0, 4.0, 8.0][h];
                assert!((bands.half_width(i, [2, 4, 8][h], c) / width - 1.0).abs() < 0.02);
                assert!((held.share[i][h][c] - level).abs() < 0.005);
                assert!((less.share[i][h][c] - 0.5 * level).abs() < 0.02);
            }
        }
    }
    // Errors are kept at horizons of the evaluation only.
    assert!(judge(&oracle, &[&log], &Options { errors_at: vec![9], ..options }).is_err());
}

#[test]
fn bands_of_runs_that_differ_hold_their_share_of_the_run_that_is_left_out() {
    let outputs = wave(2_000);
    let (a, b) = (run("a", &outputs), run("b", &outputs));
    // Errors on the second run are twice those on the first.
    let small = Oracle::new(&outputs, |k, _, _| ((0.618_034 * k as f64).fract() * 2.0 - 1.0) * 1e-3);
    let large = Oracle::new(&outputs, |k, _, _| ((0.618_034 * k as f64).fract() * 2.0 - 1.0) * 2e-3);
    let mut sessions: [Box<dyn Predictor>; 2] = [Box::new(small), Box::new(large)];
    let options = Options { errors_at: vec![4], ..options(4) };
    let result = evaluate_each("each", &mut sessions, &RANGES, &[&a, &b], &options, &mut silent()).unwrap();
    let bands = PredictionBands::new(&result).unwrap();
    // Bands of the quantile p hold min(2p, 1) of the first run by the second one and p / 2 of the second by the first:
    // 50 % at p = 0.4. The share of pooled errors below x is 0.75 x / 1e-3 there. The widest band of the first run holds
    // half of the second, so that the other bands contain all errors.
    for (level, width) in [0.4 / 0.75 * 1e-3, 2e-3, 2e-3].into_iter().enumerate() {
        assert!((bands.half_width(level, 4, 0) / width - 1.0).abs() < 0.02, "{bands:?}");
    }
}
