//! The refit of networks on training and validation runs.

use std::ops::ControlFlow;
use std::sync::Arc;

use hydroid::evaluate::{DesignRange, Options, evaluate};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::train::{CellKind, Ending, Job, Outcome, Schedule, TrainOptions, Trained, train};
use hydroid_core::model::recurrent::{Recurrent, RecurrentSession};

const OUTPUT: [DesignRange; 1] = [DesignRange { low: -1.0, high: 1.0 }];
const INPUT: [DesignRange; 1] = [DesignRange { low: -1.0, high: 1.0 }];
const HORIZON: usize = 20;

/// A vessel with quadratic drag under steps of its command of the given size.
fn run(name: &str, samples: usize, size: f64, seed: u64) -> Trajectory {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let (mut y, mut c) = (0.0f64, 0.0);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..samples {
        if k % 15 == 0 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            c = size * ((state >> 33) as f64 / f64::from(1u32 << 30) - 1.0);
        }
        inputs.push(c);
        outputs.push(y);
        y += 0.1 * (c - 0.3 * y - 2.0 * y * y.abs());
    }
    let table = |name: &str, values| Table::new([Channel::new(name, "")], values);
    let (outputs, inputs) = (table("u", outputs), table("n", inputs));
    Trajectory {
        name: name.to_owned(),
        t0: 0.0,
        dt: 0.1,
        outputs,
        inputs,
        truth: None,
        heading: None,
        position: None,
    }
}

/// A slow training run and a fast validation run.
fn go(settings: &TrainOptions) -> Trained {
    on(settings, &run("slow", 900, 0.1, 1), &run("fast", 500, 1.0, 2))
}

fn on(settings: &TrainOptions, learn: &Trajectory, choose: &Trajectory) -> Trained {
    let (runs, validation) = ([learn], [choose]);
    let (outputs, inputs) = (&OUTPUT, &INPUT);
    let job =
        Job { runs: &runs, validation: &validation, outputs, inputs, horizon: HORIZON, equations: None };
    train(&job, settings, None, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn settings() -> TrainOptions {
    TrainOptions {
        hidden: 6,
        epochs: 60,
        restarts: 2,
        wash_out_s: Some(2.0),
        window_s: Some(4.0),
        learning_rate: 0.02,
        ..TrainOptions::of(CellKind::Gru)
    }
}

#[test]
fn the_refit_uses_all_runs() {
    let (before, after) = (go(&settings()), go(&TrainOptions { refit: true, ..settings() }));
    let refit = after.refit.clone().unwrap();
    assert_eq!((refit.outcome, after.before_refit()), (Outcome::Taken, &before.model));
    assert!(refit.validation < 0.5 * before.validation, "{} {}", refit.validation, before.validation);
    // Another fast run, new to both networks.
    let new = run("new", 500, 1.0, 3);
    let score = |model: &Recurrent| {
        let mut session = RecurrentSession::new(Arc::new(model.clone())).unwrap();
        let options = Options { horizon: HORIZON, ..Options::default() };
        let progress = &mut |_| ControlFlow::Continue(());
        evaluate("gru", &mut session, &OUTPUT, &[&new], &options, progress).unwrap().score()
    };
    let [old, learned] = [&before.model, &after.model].map(|model| score(model.recurrent().unwrap()));
    assert!(learned < 0.5 * old, "{learned} {old}");
    // All other fields are of the first training.
    let told = Trained { model: before.model.clone(), refit: None, seconds: before.seconds, ..after };
    assert_eq!(told, before);
}

/// With constant large steps the last weights are rarely as good as the best.
#[test]
fn a_worse_refit_is_discarded() {
    let (a, b) = (run("a", 900, 1.0, 1), run("b", 500, 1.0, 2));
    let outcomes: Vec<Outcome> = (0..4)
        .map(|seed| {
            let wild = TrainOptions { learning_rate: 0.5, schedule: Schedule::Constant, seed, ..settings() };
            let (before, after) = (on(&wild, &a, &b), on(&TrainOptions { refit: true, ..wild }, &a, &b));
            let refit = after.refit.unwrap();
            assert_eq!(refit.before, before.model);
            let worse = refit.outcome == Outcome::Worse;
            assert_eq!(refit.validation > before.validation, worse);
            assert_eq!(after.model == before.model, worse);
            refit.outcome
        })
        .collect();
    assert!(outcomes.contains(&Outcome::Worse), "{outcomes:?}");
}

#[test]
fn a_time_limit_includes_the_refit() {
    let settings = TrainOptions { epochs: 1_000_000, budget_s: Some(1.0), refit: true, ..settings() };
    let trained = go(&settings);
    let refit = trained.refit.as_ref().unwrap();
    assert!(trained.epochs < 1_000_000);
    if refit.outcome == Outcome::Budget {
        assert_eq!(&trained.model, &refit.before);
    } else if trained.ending == Ending::Done {
        let again = go(&TrainOptions { epochs: trained.epochs, budget_s: None, ..settings });
        assert_eq!((again.model, again.refit), (trained.model.clone(), trained.refit.clone()));
    }
}
