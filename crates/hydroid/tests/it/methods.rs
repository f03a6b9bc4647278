//! The choice of the best method, and files of adapting models.

use hydroid::adapt::{self, adapt};
use hydroid::evaluate;
use hydroid::excitation::Excitation;
use hydroid::identify::{
    GateOption, GivenRange, GivenRanges, IdentifyError, IdentifyResult, Job, Keyword, LagOption, Method,
    MotionOption, NetworkTrainingOptions, RateLimitOption, SindyOptions, identify,
};
use hydroid::log::{Channel, Split, Table, Trajectory};
use hydroid::model::{self, Reading};
use hydroid::progress::silent;
use hydroid::simulate::{Options, simulate};
use hydroid_core::craft::Craft;
use hydroid_core::predict::Workspace;

fn run(drag: f64, seed: u64, duration_s: f64) -> Trajectory {
    let mut vessel = Craft::simple();
    vessel.hull.linear.iter_mut().enumerate().for_each(|(i, row)| row[i] *= drag);
    let options = Options { seed, duration_s, ..Options::new(vessel, Excitation::Mixed) };
    simulate(&options, &mut silent()).unwrap().to_trajectory(&["u", "v", "r", "P_f"]).unwrap()
}

/// Trained on the original vessel; validated and tested with drag larger by a factor.
fn identified(drag: f64, methods: &[Method]) -> (IdentifyResult, Trajectory) {
    let test = run(drag, 3, 300.0);
    let split = Split {
        train: vec![run(1.0, 1, 1_200.0)],
        validation: vec![run(drag, 2, 300.0)],
        test: vec![test.clone()],
        notes: Vec::new(),
    };
    (identify(&job(methods, split), &mut silent()).unwrap(), test)
}

/// A short search over polynomials.
fn job(methods: &[Method], split: Split) -> Job {
    Job {
        methods: methods.to_vec(),
        split,
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 50,
        origin_stride: 10,
        seed: 0,
        ranges: GivenRanges::new(),
        networks: NetworkTrainingOptions::default(),
        vessel: None,
        motion: MotionOption::default(),
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions {
            degree: Some(2),
            signed_squares: Some(false),
            lag: Some(LagOption::Keyword(Keyword::None)),
            gate: Some(GateOption::Keyword(Keyword::None)),
            ridge: Some(1e-6),
            members: Some(0),
            ..SindyOptions::default()
        },
    }
}

fn names(identified: &IdentifyResult) -> Vec<&str> {
    identified.candidates.iter().map(|c| c.model.description.name.as_str()).collect()
}

#[test]
fn a_constant_vessel_needs_no_lags_and_no_adaptation() {
    let (found, _) = identified(1.0, &[Method::Sindy, Method::Lagged, Method::Recursive]);
    assert_eq!(names(&found), ["sindy", "lagged", "recursive"]);
    assert_eq!(found.best, Some(0), "what is no better beyond the noise is not called best");
    let windows: Vec<usize> = found.candidates.iter().map(|c| c.judged().windows).collect();
    assert!(windows.iter().all(|w| *w == windows[0]), "all are judged on the same windows: {windows:?}");
    let lagged = found.candidates[1].found().unwrap().fit.equations.signals();
    assert!(!lagged.is_empty(), "the past is there to be used");
}

/// A ship that needs a minute to turn, `du/dt = 0.02 (5 n - u)`, `dr/dt = (0.05 delta - r) / 60`: its rudder is reversed after some
/// seconds.
fn reversals(period_s: f64, seed: u64) -> Trajectory {
    let mut noise = crate::recording::Noise(seed);
    let (mut u, mut r, mut outputs, mut inputs) = (5.0, 0.0, Vec::new(), Vec::new());
    for k in 0..3_000 {
        let t = 0.5 * f64::from(k);
        let part = (t / period_s).floor();
        let n = 1.0 + 0.2 * (0.7 * part).sin();
        let delta = 0.3 * if part % 2.0 == 0.0 { 1.0 } else { -1.0 } * (0.6 + 0.4 * part.sin());
        outputs.extend([u + 0.01 * noise.draw(), r + 1e-4 * noise.draw()]);
        inputs.extend([n, delta]);
        for _ in 0..10 {
            u += 0.05 * 0.02 * (5.0 * n - u);
            r += 0.05 * (0.05 * delta - r) / 60.0;
        }
    }
    let table = |names: [(&str, &str); 2], values| {
        Table::new(names.map(|(name, unit)| Channel::new(name, unit)).to_vec(), values)
    };
    Trajectory {
        name: format!("reversals {seed}"),
        t0: 0.0,
        dt: 0.5,
        outputs: table([("u", "m/s"), ("r", "rad/s")], outputs),
        inputs: table([("n", "rps"), ("delta", "rad")], inputs),
        truth: None,
        heading: None,
        position: None,
    }
}

/// Small errors of prediction on short reversals say nothing of a circle.
#[test]
fn a_model_that_leaves_its_logs_in_a_circle_is_not_for_trials() {
    for (period_s, is_for_trials) in [(6.0, false), (90.0, true)] {
        let train = (1..=4).map(|seed| reversals(period_s, seed)).collect();
        let split = Split { train, validation: Vec::new(), test: Vec::new(), notes: Vec::new() };
        let found = identify(&job(&[Method::Sindy], split), &mut silent()).unwrap();
        assert!(found.best.is_some(), "{:?}", found.verdicts);
        let trials = found.for_trials.as_ref().unwrap();
        assert_eq!(trials.best.is_some(), is_for_trials, "{trials:?}");
        let document = found.summary(&[]);
        assert_eq!(document["for_trials"]["model"].is_string(), is_for_trials);
        if !is_for_trials {
            let reason = trials.not_valid[0].as_ref().unwrap();
            assert!(
                reason.starts_with("in a turn to starboard from ") && reason.contains(": r is "),
                "{reason}"
            );
            assert_eq!(document["for_trials"]["not_valid"]["sindy"], reason.as_str());
        }
    }
}

/// A log with a spike in every hundredth sample causes a warning with a remedy.
#[test]
fn spikes_are_named_with_their_remedy() {
    let spiky = |mut run: Trajectory| {
        let width = run.outputs.width();
        let mut values = run.outputs.rows(0, run.len()).to_vec();
        for row in values.chunks_exact_mut(width).step_by(100) {
            row[0] += 3.0;
        }
        run.outputs = Table::new(run.outputs.channels().to_vec(), values);
        run
    };
    let told = |train: Trajectory, huber| {
        let part = |seed| vec![run(1.0, seed, 120.0)];
        let split = Split { train: vec![train], validation: part(2), test: part(3), notes: Vec::new() };
        let job = Job {
            methods: vec![Method::Sindy],
            split,
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            horizon: 20,
            origin_stride: 10,
            seed: 0,
            ranges: GivenRanges::new(),
            networks: NetworkTrainingOptions::default(),
            vessel: None,
            motion: MotionOption::default(),
            rate_limits: RateLimitOption::default(),
            allow_feedback: Vec::new(),
            sindy: SindyOptions {
                degree: Some(1),
                lag: Some(LagOption::Keyword(Keyword::None)),
                gate: Some(GateOption::Keyword(Keyword::None)),
                members: Some(0),
                huber,
                ..SindyOptions::default()
            },
        };
        let notes = identify(&job, &mut silent()).unwrap().warnings;
        notes.into_iter().find(|note| note.message.contains("spikes in u"))
    };
    let clean = run(1.0, 1, 300.0);
    assert_eq!(told(clean.clone(), None), None);
    let note = told(spiky(clean.clone()), None).unwrap();
    assert!(note.remedy.unwrap().contains("huber=1.345"), "{}", note.message);
    assert_eq!(told(spiky(clean), Some(1.345)), None, "the remedy has been taken");
}

/// Regression test: equations without a given lag could be selected.
#[test]
fn a_given_lag_is_in_all_candidates() {
    let part = |seed| vec![run(1.0, seed, 120.0)];
    let job = Job {
        methods: vec![Method::Sindy],
        split: Split { train: part(1), validation: part(2), test: part(3), notes: Vec::new() },
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 20,
        origin_stride: 10,
        seed: 0,
        ranges: GivenRanges::new(),
        networks: NetworkTrainingOptions::default(),
        vessel: None,
        motion: MotionOption::default(),
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions {
            lag: Some(LagOption::Fixed([(String::from("RD_cmd"), 0.3)].into())),
            gate: Some(GateOption::Keyword(Keyword::None)),
            members: Some(0),
            ..SindyOptions::default()
        },
    };
    let found = identify(&job, &mut silent()).unwrap();
    let trials = &found.candidates[0].found().unwrap().trials;
    assert!(!trials.is_empty() && trials.iter().all(|t| t.structure.lags.len() == 1));
}

#[test]
fn recursive_equations_are_best_on_a_changed_vessel() {
    let (found, test) = identified(1.6, &[Method::Recursive, Method::Sindy]);
    assert_eq!(found.best, Some(0));
    let [learning, fixed] = [&found.candidates[0], &found.candidates[1]];
    assert!(learning.judged().score() < 0.8 * fixed.judged().score());
    assert_eq!((learning.model.kind(), fixed.model.kind()), ("recursive_equations", "sparse_equations"));

    // The file contains the adaptation: the model read back gives equal predictions.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("learning.safetensors");
    model::write(&learning.model, &path).unwrap();
    let again = model::read(&path).unwrap();
    assert_eq!(again, learning.model);
    let predicted = |model: &model::Model| {
        let mut session = model.session();
        for k in 0..1_000 {
            session.observe(test.outputs.row(k));
            session.advance(test.inputs.row(k));
        }
        let mut y = vec![0.0; 50 * 4];
        session.rollout(test.inputs.rows(1_000, 1_050), &mut Workspace::new(), &mut y);
        y
    };
    assert_eq!(predicted(&again), predicted(&learning.model));
    assert_ne!(predicted(&again), predicted(&fixed.model), "it has learned on the way");

    // Regression test: the frozen model of `adapt` was adapted.
    let report = adapt(&again, &[&test], &adapt::Options::default(), &mut silent()).unwrap().report;
    let still = model::Model { learning: None, ..again };
    let judged = adapt(&still, &[&test], &adapt::Options::default(), &mut silent()).unwrap().report;
    assert_eq!(report.frozen.rmse, judged.frozen.rmse);
}

#[test]
fn ranges_have_two_ends_and_a_unit() {
    for text in ["", "1", "2:1", "1:1", "a:b", "0:inf", "nan:1", "0:1 [kn", "0:1]"] {
        assert!(text.parse::<GivenRange>().is_err(), "{text}");
    }
    let range: GivenRange = " -1.5 : 2e1 [ kn ] ".parse().unwrap();
    assert_eq!(range, GivenRange { low: -1.5, high: 20.0, unit: Some("kn".into()) });
}

#[test]
fn runs_of_different_parts_that_share_data_are_refused() {
    let run = |name: &str, values: Vec<f64>| {
        let table = |name: &str, values| Table::new(vec![Channel::new(name, "")], values);
        let inputs = table("c", vec![0.0; values.len()]);
        Trajectory {
            name: name.into(),
            t0: 0.0,
            dt: 1.0,
            outputs: table("y", values),
            inputs,
            truth: None,
            heading: None,
            position: None,
        }
    };
    let wave = |n: u32, shift: f64| (0..n).map(|k| (0.1 * f64::from(k) + shift).sin()).collect::<Vec<_>>();
    // Without methods, the check of the parts is all that is done.
    let refused = |a: &Trajectory, b: &Trajectory| {
        let split = Split {
            train: vec![a.clone()],
            validation: vec![b.clone()],
            test: vec![run("test", wave(400, 0.3))],
            notes: Vec::new(),
        };
        let job = Job {
            methods: Vec::new(),
            split,
            reading: Reading::default(),
            boat: hydroid::boat::Boat::default(),
            horizon: 10,
            origin_stride: 10,
            seed: 0,
            ranges: GivenRanges::new(),
            networks: NetworkTrainingOptions::default(),
            vessel: None,
            motion: MotionOption::default(),
            rate_limits: RateLimitOption::default(),
            allow_feedback: Vec::new(),
            sindy: SindyOptions::default(),
        };
        matches!(identify(&job, &mut silent()), Err(IdentifyError::DataLeakage { .. }))
    };
    let whole = run("whole", wave(400, 0.0));
    let (front, back) = (whole.slice(0, 300), whole.slice(300, 400));
    let other = run("other", wave(400, 0.5));
    assert!(refused(&whole, &whole.clone()));
    assert!(refused(&front, &whole) && refused(&whole, &back) && refused(&back, &whole));
    assert!(!refused(&front, &back) && !refused(&whole, &other));
    // A vessel at rest repeats its measurements.
    let idle = |rest: Vec<f64>| run("idle", [vec![0.0; 5_000], rest].concat());
    assert!(!refused(&idle(wave(400, 0.1)), &idle(wave(400, 0.7))));
    assert!(refused(&idle(wave(400, 0.1)), &idle(wave(400, 0.1))));
    assert!(!refused(&idle(vec![]), &idle(wave(400, 0.7))));
}

/// A cross-validation over runs with the drag multiplied by each of the factors.
fn cross_validated(methods: &[Method], drags: &[f64], test: Vec<Trajectory>) -> (IdentifyResult, Job) {
    let runs = drags.iter().zip(1..).map(|(&drag, seed)| run(drag, seed, 300.0)).collect();
    let job = job(methods, Split { train: runs, validation: Vec::new(), test, notes: Vec::new() });
    (identify(&job, &mut silent()).unwrap(), job)
}

#[test]
fn each_run_is_judged_by_models_without_it_and_the_delivered_model_is_fitted_to_all() {
    // Twice the drag in the last run.
    let (found, job) =
        cross_validated(&[Method::Sindy, Method::Committee], &[1.0, 1.0, 1.0, 2.0], Vec::new());
    let folds = found.cross_validation.as_ref().unwrap();
    assert!((folds.folds(), folds.has_blocks()) == (4, false));
    for candidate in &found.candidates {
        let name = &candidate.model.description.name;
        assert!(candidate.test.is_none() && candidate.left_out.len() == 4, "{name}");
        let judged = candidate.judged();
        assert_eq!(judged.by_run.len(), 4);
        // The model without the last run does not know its drag.
        let last = &job.split.train[3];
        let error = |model: &model::Model| {
            let options = evaluate::Options { horizon: 50, origin_stride: 10, ..Default::default() };
            let ranges = model.output_ranges();
            let mut session = model.frozen().session();
            evaluate::evaluate("", session.as_mut(), &ranges, &[last], &options, &mut silent())
                .unwrap()
                .score()
        };
        if candidate.model.committee().is_some() {
            let (with, without) = (error(&candidate.model), error(&candidate.left_out[3]));
            assert!(with < 0.9 * without, "{with} {without}");
        }
        for left_out in &candidate.left_out {
            assert_ne!(left_out.body, candidate.model.body, "{name}");
        }
        let bands = candidate.model.description.bands.as_ref().unwrap();
        assert_eq!(bands.horizons.last(), Some(&50));
        let provenance = &candidate.model.description.provenance;
        assert!((provenance.training.len(), provenance.validation.len()) == (4, 0));
    }
}

#[test]
fn one_run_is_divided_into_blocks_and_test_runs_take_no_part() {
    let test = run(1.0, 9, 120.0);
    let (found, _) = cross_validated(&[Method::Committee], &[1.0], vec![test.clone()]);
    let folds = found.cross_validation.as_ref().unwrap();
    assert!((folds.folds(), folds.has_blocks()) == (6, true));
    let candidate = &found.candidates[0];
    assert_eq!(candidate.validation.by_run.len(), 6);
    assert_eq!(candidate.judged().by_run.len(), 1, "the test run judges");
    assert!(candidate.judged().score() < 0.5, "{}", candidate.judged().score());
    // The bands hold about their share on the test run.
    let bands = candidate.model.description.bands.as_ref().unwrap();
    let options = evaluate::Options { horizon: 50, errors_at: vec![12, 25, 50], ..Default::default() };
    let ranges = candidate.model.output_ranges();
    let mut session = candidate.model.session();
    let judged =
        evaluate::evaluate("", session.as_mut(), &ranges, &[&test], &options, &mut silent()).unwrap();
    let coverage = bands.coverage(&judged);
    for (level, table) in coverage.levels.iter().zip(&coverage.share) {
        let mean = table.iter().flatten().sum::<f64>() / 12.0;
        assert!((mean - level).abs() < 0.2, "{level}: {mean}");
    }
}

/// Runs that are given twice would be predicted by a model that was fitted to them.
#[test]
fn the_runs_of_a_cross_validation_must_differ() {
    let once = run(1.0, 1, 120.0);
    let runs = vec![once.clone(), run(1.0, 2, 120.0), Trajectory { name: "again".into(), ..once }];
    let split = Split { train: runs, validation: Vec::new(), test: Vec::new(), notes: Vec::new() };
    let job = job(&[Method::Committee], split);
    let refused = identify(&job, &mut silent()).unwrap_err();
    assert!(matches!(refused, IdentifyError::DataLeakage { .. }), "{refused}");
    // Networks need validation runs.
    let job = Job { methods: vec![Method::Committee, Method::Gru], ..job };
    let job = Job { split: Split { train: vec![run(1.0, 1, 60.0)], ..job.split }, ..job };
    assert!(matches!(identify(&job, &mut silent()), Err(IdentifyError::NoRuns { what: "validate" })));
}
