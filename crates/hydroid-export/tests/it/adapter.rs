//! Exported C that learns, against the adapters of hydroid: 10,000 samples with noise, missing values and outliers.

use std::process::Command;
use std::sync::Arc;

use hydroid::adapt::{self, InnovationGate};
use hydroid::model::{Body, Model};
use hydroid_core::adapt::Adapter;
use hydroid_core::model::committee::{Committee, Prior};
use hydroid_core::predict::Workspace;
use hydroid_export::{COptions, Format, Options, Precision, export};

use crate::learning::{AHEAD, CLANG, FAST, Run, SANITIZED, apart, program};
use crate::models::{all, drawn};

const SAMPLES: usize = 10_000;

/// Samples between two rollouts.
const EVERY: usize = 500;

fn simulated(model: &Model, samples: usize) -> Run {
    Run::simulated(model, samples, 4000, |k| if k % 1301 == 700 { 5.0 } else { 0.0 })
}

/// What an adapter learns and predicts: its weights at every tenth sample, and rollouts.
#[derive(Debug, PartialEq)]
struct Learned {
    weights: Vec<f64>,
    predicted: Vec<f64>,
    /// Rows that were learned, and rejected.
    counts: [usize; 2],
}

impl Learned {
    fn of(adapter: &mut dyn Adapter, run: &Run) -> Self {
        let (n, m) = (run.first.len(), run.held.len());
        let mut own = Self { weights: Vec::new(), predicted: Vec::new(), counts: [0; 2] };
        let mut work = Workspace::new();
        let mut y = vec![0.0; AHEAD * n];
        for _ in 1..adapter.warm_up() {
            adapter.observe(&run.first);
            adapter.advance(&run.held);
        }
        adapter.observe(&run.first);
        for (k, (c, row)) in run.commands.chunks_exact(m).zip(run.measured.chunks_exact(n)).enumerate() {
            adapter.advance(c);
            adapter.observe(row);
            match adapter.outcome() {
                hydroid_core::adapt::Outcome::Waiting => {}
                hydroid_core::adapt::Outcome::Rejected(_) => own.counts[1] += 1,
                _ => own.counts[0] += 1,
            }
            if k % 10 == 0 {
                own.weights.extend(adapter.weights());
            }
            if k % EVERY == 0 {
                adapter.rollout(&run.commands[..AHEAD * m], &mut work, &mut y);
                own.predicted.extend(&y);
            }
        }
        own
    }
}

/// Learns along a run in C and in Rust, and gives the differences of weights and predictions.
fn compare(
    model: &Model,
    options: &adapt::Options,
    precision: Precision,
    samples: usize,
    flags: &[&str],
) -> [f64; 2] {
    let title = &model.description.name;
    let run = simulated(model, samples);
    let (mut adapter, _) = adapt::adapter(model, options, &[]).unwrap();
    let initial = adapter.weights().to_vec();
    let learned = Learned::of(adapter.as_mut(), &run);
    let sizes = [("EVERY", EVERY), ("WARM_UP", adapter.warm_up())];
    let (numbers, header) =
        program(model, (options, precision), &run, (include_str!("adapter.c"), &sizes), flags);
    let (w, n) = (initial.len(), run.first.len());
    let (start, mut rest) = numbers.split_at(w);
    let (mut weights, mut predicted) = (Vec::new(), Vec::new());
    for k in 0..samples {
        if k % 10 == 0 {
            weights.extend(&rest[..w]);
            rest = &rest[w..];
        }
        if k % EVERY == 0 {
            predicted.extend(&rest[..AHEAD * n]);
            rest = &rest[AHEAD * n..];
        }
    }
    let single = precision == Precision::Float;
    let exact = if single { 1e-6 } else { 0.0 };
    assert!(apart(&initial, start) <= exact, "{title}");
    assert_eq!(rest.len(), 4 + 2 * w);
    let [waiting, accepted, rejected, size] = rest[..4].try_into().unwrap();
    assert_eq!(waiting + accepted + rejected, samples as f64);
    if !single {
        // At least one member completed a row, or an equation did.
        assert_eq!([accepted, rejected], learned.counts.map(|count| count as f64), "{title}");
    }
    assert!(accepted > samples as f64 / 50.0, "{title}: {accepted} rows");
    assert!(header.contains(&format!("memory of the method: {size} bytes")), "{title}: {size}");
    let last = &rest[4..4 + w];
    assert!(apart(last, start) > 1e-3, "{title}: nothing was learned");
    assert!(apart(&rest[4 + w..], start) == 0.0, "{title}: a new beginning");
    [apart(&learned.weights, &weights), apart(&learned.predicted, &predicted)]
}

fn equations(model: &Model) -> bool {
    matches!(model.body, Body::Equations(_))
}

/// A committee of which two members learn, from priors that are not diagonal.
fn committee() -> Model {
    let mut model = all().into_iter().find(|model| matches!(model.body, Body::Committee(_))).unwrap();
    let Body::Committee(given) = &model.body else { unreachable!() };
    let mut members = given.members().to_vec();
    for (index, averaging) in [(0, 3), (1, 1), (2, 5)] {
        let count = members[index].equations.terms().len();
        let numbers = drawn(count * count, index as f64);
        let triangle = (0..count * count).map(|at| match at % count {
            column if column < at / count => 0.0,
            column if column == at / count => 3.0 + numbers[at],
            _ => numbers[at],
        });
        let r_factor = triangle.collect();
        members[index].prior =
            (index != 1).then_some(Prior { averaging, information: 2.0 + index as f64, r_factor });
    }
    let ranges = given.ranges().to_vec();
    let committee = Committee::new(members).unwrap().with_ranges(ranges).unwrap();
    model.body = Body::Committee(Arc::new(committee));
    model.description.name = String::from("committee with two members that learn");
    model
}

/// Models that learn, with the options of their method.
fn learning_models() -> Vec<(Model, adapt::Options)> {
    let learns = |model: &Model| matches!(model.body, Body::Equations(_) | Body::Committee(_));
    let mut models: Vec<(Model, adapt::Options)> = all()
        .into_iter()
        .chain([committee()])
        .filter(learns)
        .map(|model| {
            let options = adapt::Options::of(&model);
            (model, options)
        })
        .collect();
    let (model, defaults) = models.iter().find(|(model, _)| equations(model)).unwrap().clone();
    let mut add = |name: &str, change: &dyn Fn(&mut adapt::LeastSquaresOptions)| {
        let (mut model, mut options) = (model.clone(), defaults.clone());
        name.clone_into(&mut model.description.name);
        change(&mut options.least_squares);
        models.push((model, options));
    };
    add("equations, all terms", &|options| options.all_terms = true);
    add("equations without leak", &|options| options.leak = false);
    add("equations that forget nothing", &|options| options.forgetting_s = f64::INFINITY);
    add("equations without gate", &|options| options.gate = InnovationGate::OPEN);
    add("equations with rows of one sample", &|options| options.window_s = Some(0.1));
    models
}

#[test]
fn what_is_learned_in_c_is_what_hydroid_learns() {
    for (model, options) in learning_models() {
        let title = &model.description.name;
        let far = compare(&model, &options, Precision::Double, SAMPLES, &FAST);
        println!("{title}: weights {:.1e}, predictions {:.1e}", far[0], far[1]);
        assert!(far.iter().all(|far| *far < 1e-9), "{title}: {far:?}");
    }
}

#[test]
fn learning_in_single_precision_follows_that_in_double_precision() {
    for (model, options) in learning_models() {
        let title = &model.description.name;
        let far = compare(&model, &options, Precision::Float, 1000, &FAST);
        println!("{title}, float: weights {:.1e}, predictions {:.1e}", far[0], far[1]);
        assert!(far.iter().all(|far| *far < 1e-5), "{title}: {far:?}");
    }
}

#[test]
#[ignore = "slow tier: .ci/run runs it"]
fn learning_in_c_passes_sanitizers_and_clang() {
    let clang = Command::new("clang").arg("--version").output().is_ok();
    if !clang {
        println!("skipped: no clang");
    }
    for (model, options) in learning_models() {
        for precision in [Precision::Double, Precision::Float] {
            compare(&model, &options, precision, 1000, &SANITIZED);
            if clang {
                compare(&model, &options, precision, 1000, &CLANG);
            }
        }
    }
}

#[test]
fn models_without_an_adapter_in_c_are_refused() {
    let refused = |model: &Model, options: &adapt::Options| {
        let c_options = COptions { precision: Precision::Double, adapter: Some(Box::new(options.clone())) };
        let format = Format::C(c_options);
        let error = export(model, &format, &Options { name: String::from("boat") }).unwrap_err();
        error.to_string()
    };
    for model in all().iter().filter(|model| !matches!(model.body, Body::Equations(_) | Body::Recurrent(_))) {
        let options = adapt::Options::of(model);
        match &model.body {
            Body::Committee(_) => {}
            Body::Direct(_) | Body::Craft(_) => {
                let error = refused(model, &options);
                assert!(error.contains("without adapter") && error.contains("C library"), "{error}");
            }
            _ => {
                assert!(refused(model, &options).contains("cannot be adapted"), "{}", model.description.name);
            }
        }
    }
    // Constant members, and options that do not fit.
    let constant = committee().frozen();
    assert!(refused(&constant, &adapt::Options::of(&constant)).contains("none of its members learns"));
    let model = all().remove(0);
    let mut options = adapt::Options::of(&model);
    options.least_squares.window_s = Some(1e9);
    assert!(refused(&model, &options).contains("window of 1000000000 s"));
    options = adapt::Options::of(&model);
    options.method = adapt::Method::Kalman;
    assert!(refused(&model, &options).contains("without adapter"));
}
