//! Direct predictors on equations: their training, their model file, and their place among the methods.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use crate::vessel::{INPUTS, OUTPUTS, smooth, with_gaps};
use hydroid::evaluate::{Options, evaluate};
use hydroid::identify::{
    GivenRanges, IdentifyError, Job as Identification, Method, MotionOption, NetworkOptions,
    NetworkTrainingOptions, RateLimitOption, SindyOptions, identify,
};
use hydroid::log::{Split, Trajectory};
use hydroid::model::{Body, Model, Reading, decode, encode};
use hydroid::progress::silent;
use hydroid::train::{BaseKind, CellKind, Job, TrainError, TrainOptions, Trained, TrainedNetwork, train};
use hydroid_core::model::direct::{Direct, DirectSession};
use hydroid_core::model::recurrent::BaseModel;
use hydroid_core::model::sparse::{Equations, EquationsSession, Real, Signal, Term};
use hydroid_core::predict::Predictor;

/// Approximate equations of the vessel, with a lag and past values that it does not have.
fn equations() -> Equations {
    let signals =
        vec![Signal::Lag { input: 2, time_constant_s: Real(0.05) }, Signal::Past { variable: 0, samples: 2 }];
    let terms: Vec<Term> = [0, 1, 3, 4].iter().map(|&v| Term::monomial(&[v])).collect();
    let coefficients = vec![-0.9, 0.0, 0.9, 0.0, 0.5, -1.4, 0.0, 0.3];
    Equations::with_signals(terms, coefficients, 2, 1, signals, 0.1, 1).unwrap()
}

fn settings() -> TrainOptions {
    TrainOptions {
        hidden: 16,
        layers: Some(2),
        history_s: Some(0.5),
        window_s: Some(0.8),
        epochs: 30,
        batch: 150,
        learning_rate: 0.01,
        base: BaseKind::Equations,
        ..TrainOptions::of(CellKind::Direct)
    }
}

fn on(
    equations: &Equations,
    settings: &TrainOptions,
    validation: &Trajectory,
) -> Result<Trained, TrainError> {
    let (a, b) = (with_gaps("a", 900, 0.0), with_gaps("b", 500, 40.0));
    let job = Job {
        runs: &[&a, &b],
        validation: &[validation],
        outputs: &OUTPUTS,
        inputs: &INPUTS,
        horizon: 20,
        equations: Some(Arc::new(equations.clone())),
    };
    train(&job, settings, None, &mut |_| ControlFlow::Continue(()))
}

fn direct(trained: &Trained) -> &Direct {
    let TrainedNetwork::Direct(model) = &trained.model else { panic!("no direct predictor") };
    model
}

fn score(session: &mut dyn Predictor, run: &Trajectory) -> f64 {
    let options = Options { horizon: 20, ..Options::default() };
    evaluate("direct", session, &OUTPUTS, &[run], &options, &mut silent()).unwrap().score()
}

/// Chained over two and a half horizons, on a run so short that every origin is evaluated.
#[test]
fn a_network_on_equations_corrects_them() {
    let whole = smooth("c", 130, 100.0);
    let trained = on(&equations(), &settings(), &whole).unwrap();
    let model = direct(&trained);
    let alone = score(&mut EquationsSession::new(Arc::new(equations())), &whole);
    assert!(trained.validation < 0.3 * alone, "{} of {alone}", trained.validation);
    let told = score(&mut DirectSession::new(Arc::new(model.clone())).unwrap(), &whole);
    assert!((told / trained.validation - 1.0).abs() < 1e-4, "{told} {}", trained.validation);
    // Corrections are scaled by the residual of the equations.
    let scale = &model.scaling;
    let shares = scale.correction_scale.iter().zip(&scale.output_scale).map(|(c, s)| c / s);
    assert!(shares.clone().all(|share| (1e-3..0.5).contains(&share)), "{:?}", shares.collect::<Vec<_>>());
}

#[test]
fn the_bytes_do_not_depend_on_threads() {
    let validation = with_gaps("c", 330, 100.0);
    let settings = TrainOptions { restarts: 2, epochs: 2, ensemble: true, refit: true, ..settings() };
    let trained = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let trained = pool.install(|| on(&equations(), &settings, &validation).unwrap());
        Trained { seconds: 0.0, ..trained }
    });
    assert_eq!(trained[0], trained[1]);
    assert_eq!(trained[0], trained[2]);
}

#[test]
fn equations_that_are_not_for_it_are_refused() {
    let told = |equations: &Equations| {
        let error = on(equations, &settings(), &with_gaps("c", 330, 100.0)).unwrap_err();
        error.to_string()
    };
    let of = |terms: Vec<Term>, coefficients: Vec<f64>, outputs: usize, dt: f64| {
        Equations::new(terms, coefficients, outputs, 1, dt, 1).unwrap()
    };
    assert!(told(&of(vec![Term::monomial(&[0])], vec![0.1], 1, 0.1)).contains("1 outputs and 1 inputs"));
    assert!(told(&of(vec![Term::monomial(&[0])], vec![0.1; 2], 2, 0.2)).contains("samples of 0.2 s"));
    let runs_away = told(&of(vec![Term::monomial(&[0, 0, 0])], vec![1e6, 0.0], 2, 0.1));
    assert!(runs_away.contains("of run 'a'") && runs_away.contains("choose base"), "{runs_away}");
}

fn job(methods: Vec<Method>) -> Identification {
    let direct = NetworkOptions {
        hidden: Some(16),
        layers: Some(2),
        history_s: Some(0.5),
        window_s: Some(0.8),
        epochs: Some(10),
        base: Some(BaseKind::Equations),
        ..NetworkOptions::default()
    };
    Identification {
        methods,
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
        sindy: SindyOptions { degree: Some(1), members: Some(0), ..SindyOptions::default() },
        networks: NetworkTrainingOptions { direct, ..NetworkTrainingOptions::default() },
        vessel: None,
    }
}

/// The file contains the equations; inconsistent and damaged files are refused without panic.
#[test]
fn it_takes_the_equations_of_the_job_into_its_file() {
    let alone = identify(&job(vec![Method::Direct]), &mut silent()).unwrap_err();
    assert!(matches!(alone, IdentifyError::NoBase { method: Method::Direct }), "{alone}");
    let identified = identify(&job(vec![Method::Sindy, Method::Direct]), &mut silent()).unwrap();
    let [below, model] = [Method::Sindy, Method::Direct].map(|method| {
        let named = |model: &&Model| model.description.name == method.name();
        identified.candidates.iter().map(|candidate| &candidate.model).find(named).unwrap()
    });
    let Body::Equations(equations) = &below.body else { panic!("no equations") };
    let Body::Direct(direct) = &model.body else { panic!("no direct predictor") };
    assert_eq!(direct.base, BaseModel::Equations(Arc::clone(equations)));
    let text = model.network_text().join("\n");
    assert!(text.contains("a grey box"), "{text}");
    let motion = model.base_equations().unwrap();
    assert_eq!(motion.equations_text(), below.equations().unwrap().equations_text());
    let bytes = encode(model).unwrap();
    let again = decode(&bytes, Path::new("m")).unwrap();
    assert_eq!(&again, model);
    assert_eq!(encode(&again).unwrap(), bytes);
    let whole = with_gaps("c", 300, 100.0);
    let [one, two] = [&again, model].map(|model| score(model.session().as_mut(), &whole));
    assert_eq!(one.to_bits(), two.to_bits());

    let changed = |from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|part| part == from.as_bytes()).unwrap();
        let mut changed = bytes.clone();
        changed[at..at + from.len()].copy_from_slice(to.as_bytes());
        decode(&changed, Path::new("m")).unwrap_err().to_string()
    };
    assert_eq!("\\\"hold\\\":false".len(), "\\\"hold\\\":true ".len());
    let both = changed("\\\"hold\\\":false", "\\\"hold\\\":true ");
    assert!(both.contains("both to the present outputs and to equations"), "{both}");
    assert!(changed("\"coefficients\"", "\"koefficients\"").contains("coefficients"));
    for at in (0..bytes.len().min(4000)).step_by(11) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x15;
        let _ = decode(&damaged, Path::new("m"));
        let _ = decode(&bytes[..at], Path::new("m"));
    }
}
