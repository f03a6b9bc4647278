//! Networks in an identification: refusals before training, and interrupted trainings.

use std::ops::ControlFlow;
use std::path::Path;

use hydroid::identify::{
    GateOption, GivenRanges, IdentifyError, IdentifyResult, Job, Keyword, LagOption, Method, MotionOption,
    NetworkOptions, NetworkTrainingOptions, RateLimitOption, SindyOptions, identify_with_stages,
};
use hydroid::log::{Channel, Split, Table, Trajectory};
use hydroid::model::Reading;
use hydroid::train::TrainError;

/// A first-order lag of two outputs under a sum of sines, or left to itself.
fn run(samples: usize, phase: f64, driven: bool) -> Trajectory {
    let (mut u, mut v) = if driven { (0.0, 0.0) } else { (phase.sin(), phase.cos()) };
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let t = 0.1 * k as f64 + phase;
        let c = if driven { 0.6 * (0.7 * t).sin() + 0.4 * (1.9 * t).sin() } else { -v };
        inputs.push(c);
        outputs.extend([u, v]);
        (u, v) = if driven {
            (u + 0.1 * (c - u), v + 0.1 * (0.8 * u - 1.5 * v))
        } else {
            (u + 0.05 * v, v - 0.05 * u)
        };
    }
    let inputs = if driven { Table::new([Channel::new("n", "1/s")], inputs) } else { Table::new([], vec![]) };
    let outputs = Table::new([Channel::new("u", "m/s"), Channel::new("v", "m/s")], outputs);
    Trajectory {
        name: format!("run {phase}"),
        t0: 0.0,
        dt: 0.1,
        outputs,
        inputs,
        truth: None,
        heading: None,
        position: None,
    }
}

/// A job of small networks on runs of given lengths.
fn job(methods: &[Method], [train, validation, test]: [usize; 3], driven: bool) -> Job {
    Job {
        methods: methods.to_vec(),
        split: Split {
            train: vec![run(train, 0.0, driven)],
            validation: vec![run(validation, 100.0, driven)],
            test: vec![run(test, 200.0, driven)],
            notes: Vec::new(),
        },
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 25,
        origin_stride: 1,
        seed: 0,
        ranges: GivenRanges::new(),
        motion: MotionOption::default(),
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions {
            degree: Some(1),
            lag: Some(LagOption::Keyword(Keyword::None)),
            gate: Some(GateOption::Keyword(Keyword::None)),
            ridge: Some(1e-6),
            members: Some(0),
            ..SindyOptions::default()
        },
        vessel: None,
        networks: NetworkTrainingOptions {
            all: NetworkOptions {
                hidden: Some(3),
                epochs: Some(2),
                feedback: Some(false),
                ..NetworkOptions::default()
            },
            ..NetworkTrainingOptions::default()
        },
    }
}

/// The result, and the number of progress reports.
fn done(job: &Job) -> (Result<IdentifyResult, IdentifyError>, usize) {
    let mut heard = 0;
    let result = identify_with_stages(job, &mut |stage| {
        heard += usize::from(stage.training.is_some());
        ControlFlow::Continue(())
    });
    (result, heard)
}

fn notes(identified: &IdentifyResult) -> String {
    identified.warnings.iter().flat_map(|note| [note.message.as_str(), "\n"]).collect()
}

#[test]
fn a_horizon_longer_than_all_runs_is_refused_for_all_methods() {
    for (lengths, part) in [([600, 200, 300], "validation"), ([600, 300, 200], "test")] {
        for horizon in [200, 10_000_000_000, usize::MAX] {
            for method in [Method::Sindy, Method::Lagged, Method::Recursive, Method::Gru] {
                let (result, heard) = done(&Job { horizon, ..job(&[method], lengths, true) });
                let error = result.unwrap_err();
                assert!(matches!(&error, IdentifyError::Horizon { longest: 200, .. }), "{error}");
                let told = error.to_string();
                assert!(told.contains(part) && told.contains("at most 199 samples"), "{told}");
                assert_eq!(heard, 0);
            }
        }
    }
}

/// The default wash-out is an eighth of 400 samples: predictions begin at sample 50 and end 25 samples later.
#[test]
fn runs_too_short_for_evaluation_are_refused_before_training() {
    let (enough, _) = done(&job(&[Method::Gru], [400, 200, 76], true));
    let gru = &enough.unwrap().candidates[0];
    assert_eq!((gru.training.network().unwrap().wash_out, gru.judged().windows), (50, 1));

    let (refused, heard) = done(&job(&[Method::Gru], [400, 200, 75], true));
    let refused = refused.unwrap();
    let told = notes(&refused);
    assert!(told.contains("all test runs are shorter") && told.contains("wash_out_s"), "{told}");
    assert!(refused.candidates.is_empty() && refused.missing.is_some());
    assert_eq!(heard, 0, "nothing was trained in vain");

    let (beside, heard) = done(&job(&[Method::Gru, Method::Sindy], [400, 200, 75], true));
    let beside = beside.unwrap();
    // Sindy has three windows, which judge nothing.
    assert_eq!((beside.candidates.len(), beside.best, heard), (1, None, 0));
    assert!(
        notes(&beside).contains("no model by the method gru: it cannot be evaluated"),
        "{}",
        notes(&beside)
    );

    let mut given = job(&[Method::Gru], [400, 200, 75], true);
    given.networks.gru.wash_out_s = Some(4.9);
    assert_eq!(done(&given).0.unwrap().candidates[0].judged().windows, 1);
}

#[test]
fn runs_without_inputs_are_for_networks_with_feedback() {
    let mut both = job(&[Method::Sindy, Method::Gru], [600, 300, 300], false);
    let (result, heard) = done(&both);
    let identified = result.unwrap();
    assert_eq!((identified.candidates.len(), heard), (1, 0));
    let told = notes(&identified);
    assert!(told.contains("no model by the method gru") && told.contains("feedback = true"), "{told}");
    both.networks.gru.feedback = Some(true);
    assert_eq!(done(&both).0.unwrap().candidates.len(), 2);
}

/// A job with checkpoints.
fn kept_job(folder: &Path) -> Job {
    let mut job = job(&[Method::Gru], [1_200, 300, 300], true);
    // Long enough for several reports.
    job.networks.all.epochs = Some(400);
    job.networks.checkpoints = Some(folder.to_owned());
    job
}

fn interrupt(job: &Job) {
    let error = identify_with_stages(job, &mut |stage| match stage.training {
        Some(status) if status.epoch >= 2 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    });
    assert!(matches!(error, Err(IdentifyError::Train { error: TrainError::Cancelled(_), .. })));
}

#[test]
fn the_same_job_resumes_and_another_job_restarts() {
    let whole = done(&job_without_files()).0.unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (file, old) = (folder.path().join("gru.checkpoint"), folder.path().join("gru.checkpoint.old"));
    let kept = kept_job(folder.path());
    interrupt(&kept);
    assert!(file.exists());

    // Another job renames the checkpoint.
    let interrupted = std::fs::read(&file).unwrap();
    let other = done(&Job { seed: 9, ..kept.clone() }).0.unwrap();
    assert!(notes(&other).contains("gru.checkpoint.old"), "{}", notes(&other));
    assert_eq!(std::fs::read(&old).unwrap(), interrupted);
    assert_ne!(other.candidates[0].model.body, whole.candidates[0].model.body);

    // The same job resumes with a note.
    std::fs::rename(&old, &file).unwrap();
    let again = done(&kept).0.unwrap();
    assert!(notes(&again).contains("gru: resumed from"), "{}", notes(&again));
    assert_eq!(again.candidates[0].model, whole.candidates[0].model);
    assert!(!old.exists());

    // With `resume` it resumes without a note.
    std::fs::write(&file, &interrupted).unwrap();
    let mut insists = kept.clone();
    insists.networks.resume = true;
    let again = done(&insists).0.unwrap();
    assert_eq!(again.candidates[0].model, whole.candidates[0].model);
    assert!(!notes(&again).contains("resumed from"));

    // An unreadable checkpoint is renamed as well.
    std::fs::write(&file, b"not a checkpoint").unwrap();
    let anew = done(&kept).0.unwrap();
    assert_eq!(anew.candidates[0].model, whole.candidates[0].model);
    assert_eq!(std::fs::read(&old).unwrap(), b"not a checkpoint");
}

fn job_without_files() -> Job {
    let mut job = kept_job(Path::new("."));
    job.networks.checkpoints = None;
    job
}

#[test]
fn resume_without_a_checkpoint_is_an_error_before_the_search() {
    let folder = tempfile::tempdir().unwrap();
    let mut job = kept_job(folder.path());
    interrupt(&job);
    job.networks.resume = true;
    job.methods.insert(0, Method::Sindy);
    let refused = |job: &Job| {
        let error = identify_with_stages(job, &mut |_| panic!("something was begun"));
        error.unwrap_err().to_string()
    };
    let told = refused(&Job { seed: 9, ..job.clone() });
    assert!(told.contains("other settings") && told.contains("gru.checkpoint"), "{told}");
    let mut longer = job.clone();
    longer.split.train = vec![run(1_300, 0.0, true)];
    assert!(refused(&longer).contains("other data"));
    std::fs::write(folder.path().join("gru.checkpoint"), b"not a checkpoint").unwrap();
    assert!(refused(&job).contains("damaged"));
    std::fs::remove_file(folder.path().join("gru.checkpoint")).unwrap();
    assert!(refused(&job).contains("no interrupted training"));
}

/// A network refitted on the validation runs is not evaluated on them.
#[test]
fn validation_uses_the_network_before_the_refit() {
    let mut plain = job(&[Method::Gru], [600, 300, 300], true);
    plain.networks.all.epochs = Some(40);
    let mut again = plain.clone();
    again.networks.all.refit = Some(true);
    let [plain, again] = [plain, again].map(|job| done(&job).0.unwrap());
    let (before, after) = (&plain.candidates[0], &again.candidates[0]);
    assert!(after.training.network().unwrap().refit.as_ref().unwrap().is_taken());
    assert_eq!(after.validation, before.validation);
    assert_ne!((&after.test, &after.model.body), (&before.test, &before.model.body));
    let runs = |of: &hydroid::model::Model| of.description.provenance.training.len();
    assert_eq!((runs(&before.model), runs(&after.model)), (1, 2));
    assert!(notes(&again).contains("gru: refitted over 40 epochs on"), "{}", notes(&again));
}

/// With a stated range, samples outside the training range still cause a warning.
#[test]
fn leaving_the_training_range_is_reported_for_any_design_range() {
    let mut job = job(&[Method::Sindy], [600, 300, 300], true);
    job.ranges = [("u", "-15:15"), ("n", "-9:9")].map(|(c, r)| (c.to_owned(), r.parse().unwrap())).into();
    let model = done(&job).0.unwrap().candidates.remove(0).model;
    let mut fast = run(300, 3.0, true);
    assert_eq!(model.outside(&[fast.clone()]), None);
    let faster = (0..300).flat_map(|k| fast.outputs.row(k).iter().map(|y| 3.0 * y)).collect();
    fast.outputs = Table::new(fast.outputs.channels().to_vec(), faster);
    let note = model.outside(&[fast]).unwrap();
    assert!(note.message.contains("training range of the model in u ("), "{}", note.message);
    assert!(!note.message.contains("n ("), "{}", note.message);

    // The file keeps both ranges.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.safetensors");
    hydroid::model::write(&model, &path).unwrap();
    let again = hydroid::model::read(&path).unwrap();
    assert_eq!(again, model);
    assert!(again.description.outputs[0].training_range.is_some_and(|range| range.high < 2.0));
    assert_eq!(again.description.outputs[1].training_range, None);
}
