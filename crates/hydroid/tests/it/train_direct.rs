//! Direct predictors: training, model file, and their place among the methods.

use std::ops::ControlFlow;
use std::path::Path;

use crate::vessel::{INPUTS, OUTPUTS, with_gaps};
use hydroid::evaluate::{Options, band_coverage, evaluate};
use hydroid::identify::{
    GivenRanges, Job as Identification, Method, MotionOption, NetworkOptions, NetworkTrainingOptions,
    RateLimitOption, SindyOptions,
};
use hydroid::identify::{IdentifyError, identify};
use hydroid::log::{Split, Table, Trajectory};
use hydroid::model::{Body, Model, Reading, decode, encode};
use hydroid::progress::silent;
use hydroid::train::{
    BaseKind, CellKind, Job, Outcome, Status, TrainError, TrainOptions, Trained, TrainedNetwork, train,
};
use hydroid_core::model::direct::{Direct, DirectSession};
use hydroid_core::predict::{Predictor, Workspace};

fn settings() -> TrainOptions {
    TrainOptions {
        hidden: 16,
        layers: Some(2),
        history_s: Some(0.5),
        window_s: Some(0.8),
        epochs: 8,
        batch: 150,
        learning_rate: 0.01,
        ..TrainOptions::of(CellKind::Direct)
    }
}

type MeteredAdapter<'a> = &'a mut dyn FnMut(&Status) -> ControlFlow<()>;

fn with(
    settings: &TrainOptions,
    checkpoint: Option<&Path>,
    watch: MeteredAdapter<'_>,
) -> Result<Trained, TrainError> {
    let (a, b, c) = (with_gaps("a", 900, 0.0), with_gaps("b", 500, 40.0), with_gaps("c", 330, 100.0));
    let job = Job {
        runs: &[&a, &b],
        validation: &[&c],
        outputs: &OUTPUTS,
        inputs: &INPUTS,
        horizon: 20,
        equations: None,
    };
    train(&job, settings, checkpoint, watch)
}

fn go(settings: &TrainOptions) -> Trained {
    with(settings, None, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn without_time(trained: &Trained) -> Trained {
    Trained { seconds: 0.0, ..trained.clone() }
}

/// Validation over two and a half horizons, with gaps, as in a session.
#[test]
fn it_learns_the_vessel_and_its_validation_error_is_that_of_the_evaluation() {
    for base in [BaseKind::Nothing, BaseKind::Hold] {
        let trained = go(&TrainOptions { base, epochs: 30, ..settings() });
        assert!(trained.validation < 0.1, "{base:?}: {}", trained.validation);
        assert_eq!((trained.wash_out, trained.window), (4, 8));
        let TrainedNetwork::Direct(model) = &trained.model else { panic!("no direct predictor") };
        let mut session = DirectSession::new(model.clone().into()).unwrap();
        let mut whole = with_gaps("c", 330, 100.0);
        // The training holds missing values in a history, the session predicts them: on a whole run they agree.
        let options = Options { horizon: 20, ..Options::default() };
        let score = |session: &mut DirectSession, run: &Trajectory| {
            evaluate("direct", session, &OUTPUTS, &[run], &options, &mut silent()).unwrap().score()
        };
        let gaps = score(&mut session, &whole);
        assert!((gaps / trained.validation - 1.0).abs() < 0.1, "{gaps} {}", trained.validation);
        // So short that every origin is evaluated.
        whole = whole.slice(0, 130);
        let filled = (0..130).flat_map(|k| [0, 1].map(|c| whole.outputs.row(k)[c])).collect::<Vec<_>>();
        let filled = filled.iter().enumerate().map(|(i, y)| if y.is_nan() { filled[i - 2] } else { *y });
        whole.outputs = Table::new(whole.outputs.channels().to_vec(), filled.collect());
        let (a, b) = (with_gaps("a", 900, 0.0), with_gaps("b", 500, 40.0));
        let job = Job {
            runs: &[&a, &b],
            validation: &[&whole],
            outputs: &OUTPUTS,
            inputs: &INPUTS,
            horizon: 20,
            equations: None,
        };
        let settings = TrainOptions { base, epochs: 3, ..settings() };
        let trained = train(&job, &settings, None, &mut |_| ControlFlow::Continue(())).unwrap();
        let TrainedNetwork::Direct(model) = trained.model else { panic!("no direct predictor") };
        let told = score(&mut DirectSession::new(model.into()).unwrap(), &whole);
        assert!((told / trained.validation - 1.0).abs() < 1e-4, "{told} {}", trained.validation);
    }
}

#[test]
fn the_bytes_do_not_depend_on_threads() {
    let settings =
        TrainOptions { restarts: 2, batch: 300, epochs: 2, ensemble: true, refit: true, ..settings() };
    let [one, two, three] = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        without_time(&pool.install(|| go(&settings)))
    });
    assert_eq!(one, two);
    assert_eq!(one, three);
    assert_eq!(one.members.len(), 2);
    assert_eq!(&one.members[one.restart], one.before_refit().weights());
    assert_ne!(one.members[0], one.members[1]);
}

#[test]
fn an_interrupted_training_resumes_to_the_same_model() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("direct.checkpoint");
    // Long enough for progress callbacks on a fast machine.
    let settings = TrainOptions { epochs: 60, hidden: 48, ..settings() };
    let whole = go(&settings);
    let stopped = with(&settings, Some(&path), &mut |status| {
        if status.fraction > 0.3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(TrainError::Cancelled(_))));
    let mut first = None;
    let again = with(&settings, Some(&path), &mut |status| {
        first.get_or_insert(status.fraction);
        ControlFlow::Continue(())
    });
    assert!(first.is_none_or(|fraction| fraction > 0.2), "{first:?}");
    assert_eq!(without_time(&again.unwrap()), without_time(&whole));
}

#[test]
fn settings_that_are_not_for_it_are_refused() {
    let told = |settings: TrainOptions| {
        let error = with(&settings, None, &mut |_| panic!("it began"));
        error.unwrap_err().to_string()
    };
    assert!(told(TrainOptions { base: BaseKind::Equations, ..settings() }).contains("none are given"));
    assert!(told(TrainOptions { feedback: false, ..settings() }).contains("feedback = false"));
    assert!(told(TrainOptions { wash_out_s: Some(3.0), ..settings() }).contains("history_s"));
    assert!(
        told(TrainOptions { history_s: Some(1e9), ..settings() }).contains("history of 10000000000 samples")
    );
    assert!(told(TrainOptions { hidden: 5000, ..settings() }).contains("5000 units"));
    assert!(told(TrainOptions { window_s: Some(95.0), ..settings() }).contains("long enough"));
    let recurrent = TrainOptions { history_s: Some(1.0), ..TrainOptions::of(CellKind::Gru) };
    assert!(told(recurrent).contains("history_s = given is invalid"));
}

fn job(change: impl FnOnce(&mut NetworkOptions)) -> Identification {
    let mut direct = NetworkOptions {
        hidden: Some(16),
        layers: Some(2),
        history_s: Some(0.5),
        window_s: Some(0.8),
        epochs: Some(10),
        learning_rate: Some(0.01),
        base: Some(BaseKind::Nothing),
        ..NetworkOptions::default()
    };
    change(&mut direct);
    // Options of recurrent networks do not apply.
    let all = NetworkOptions { hidden: Some(3), feedback: Some(false), ..NetworkOptions::default() };
    Identification {
        methods: vec![Method::Direct],
        split: Split {
            train: vec![with_gaps("a", 900, 0.0)],
            validation: vec![with_gaps("b", 300, 40.0)],
            test: vec![with_gaps("c", 300, 100.0)],
            notes: Vec::new(),
        },
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 20,
        origin_stride: 1,
        seed: 0,
        ranges: GivenRanges::new(),
        motion: MotionOption::default(),
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions::default(),
        networks: NetworkTrainingOptions { all, direct, ..NetworkTrainingOptions::default() },
        vessel: None,
    }
}

/// An ensemble of three with bands; the file is read back, and damaged files do not panic.
#[test]
fn a_method_like_the_others_with_a_file_and_an_ensemble() {
    let identified =
        identify(&job(|s| (s.restarts, s.ensemble) = (Some(3), Some(true))), &mut silent()).unwrap();
    let candidate = &identified.candidates[0];
    let model = &candidate.model;
    assert_eq!((model.kind(), model.description.name.as_str()), ("direct", "direct"));
    assert!(candidate.judged().score() < 0.3, "{}", candidate.judged().score());
    let text = model.network_text().join("\n");
    assert!(text.contains("22-16-16-16"), "{text}");
    let bytes = encode(model).unwrap();
    let again = decode(&bytes, Path::new("m")).unwrap();
    assert_eq!(&again, model);
    let members = again.member_sessions();
    assert_eq!(members.len(), 3);
    let test = with_gaps("c", 300, 100.0);
    let coverage = band_coverage(&members, &[&test], &Options::default(), &[1, 20]).unwrap();
    assert_eq!(coverage.members, 3);
    let Body::Direct(direct) = &model.body else { panic!("no direct predictor") };
    let refused = |change: fn(&mut Direct)| {
        let mut direct = Direct::clone(direct);
        change(&mut direct);
        let changed = Model { body: Body::Direct(direct.into()), ..model.clone() };
        encode(&changed)
            .map_or_else(|e| e.to_string(), |b| decode(&b, Path::new("m")).unwrap_err().to_string())
    };
    assert!(refused(|d| d.history = 6).contains("reads"));
    assert!(refused(|d| d.horizon = 0).contains("horizon of 0"));
    assert!(refused(|d| d.scaling.output_scale[0] = -1.0).contains("outputs' scales"));
    assert!(refused(|d| d.weights.truncate(9)).contains("weights"));
    for at in (0..bytes.len().min(3000)).step_by(7) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x15;
        let _ = decode(&damaged, Path::new("m"));
        let _ = decode(&bytes[..at], Path::new("m"));
    }
}

/// By default a short training decides between outputs and increments.
#[test]
fn its_formulation_is_chosen_where_none_is_given() {
    let identified = identify(&job(|s| s.base = None), &mut silent()).unwrap();
    let notes: Vec<&str> = identified.warnings.iter().map(|note| note.message.as_str()).collect();
    let told = notes.iter().find(|note| note.starts_with("direct: ")).unwrap();
    assert!(told.contains("increments") && !told.contains("inputs alone"), "{told}");
}

#[test]
fn a_history_without_windows_to_evaluate_is_refused_before_training() {
    let error = identify(&job(|s| s.history_s = Some(28.5)), &mut silent()).unwrap_err();
    assert!(matches!(error, IdentifyError::NotEvaluable { warm_up: 285, .. }), "{error}");
    let session = |model: &Model| model.session().warm_up();
    let identified = identify(&job(|_| ()), &mut silent()).unwrap();
    assert_eq!(session(&identified.candidates[0].model), 5);
}

/// The refit has another scale of increments; the predictions of the members do not change.
#[test]
fn members_predict_the_same_after_a_refit() {
    let settings =
        TrainOptions { base: BaseKind::Hold, ensemble: true, restarts: 2, epochs: 30, ..settings() };
    let (before, after) = (go(&settings), go(&TrainOptions { refit: true, ..settings }));
    assert_eq!(after.refit.as_ref().unwrap().outcome, Outcome::Taken);
    let run = with_gaps("d", 200, 7.0);
    let predict = |trained: &Trained, member: usize| {
        let TrainedNetwork::Direct(model) = &trained.model else { panic!("no direct predictor") };
        let model = Direct { weights: trained.members[member].clone(), ..model.clone() };
        let mut session = DirectSession::new(model.into()).unwrap();
        for k in 0..50 {
            session.observe(run.outputs.row(k));
            session.advance(run.inputs.row(k));
        }
        let mut y = [0.0; 40];
        session.rollout(run.inputs.rows(50, 70), &mut Workspace::new(), &mut y);
        y
    };
    let scale = |trained: &Trained| match &trained.model {
        TrainedNetwork::Direct(model) => model.scaling.correction_scale.clone(),
        TrainedNetwork::Recurrent(_) | TrainedNetwork::Affine(_) => panic!("no direct predictor"),
    };
    assert_ne!(scale(&before), scale(&after), "there is nothing to see");
    for member in 0..2 {
        for (a, b) in predict(&before, member).iter().zip(predict(&after, member)) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}
