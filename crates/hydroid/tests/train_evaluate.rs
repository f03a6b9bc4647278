//! What a training calls its validation error is what `evaluate` says of the model.

use std::ops::ControlFlow;
use std::sync::Arc;

use hydroid::evaluate::{DesignRange, Options, evaluate};
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::progress::silent;
use hydroid::train::{BaseKind, CellKind, Job, Precision, Settings, train};
use hydroid_core::model::recurrent::RecurrentSession;

/// A first-order lag of two outputs under a sum of sines.
fn run(name: &str, samples: usize, phase: f64) -> Trajectory {
    let (mut u, mut v) = (0.0, 0.0);
    let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let t = 0.1 * k as f64 + phase;
        let c = 0.6 * (0.7 * t).sin() + 0.4 * (1.9 * t).sin();
        inputs.push(c);
        outputs.extend([u, v]);
        (u, v) = (u + 0.1 * (c - u - 0.5 * v * v), v + 0.1 * (0.8 * u - 1.5 * v));
    }
    Trajectory {
        name: name.to_owned(),
        t0: 0.0,
        dt: 0.1,
        outputs: Table::new([Channel::new("u", "m/s"), Channel::new("v", "m/s")], outputs),
        inputs: Table::new([Channel::new("n", "1/s")], inputs),
        truth: None,
    }
}

#[test]
fn the_validation_error_is_that_of_the_evaluation() {
    // So short that every origin is judged.
    let (a, mut b) = (run("a", 1500, 0.0), run("b", 209, 100.0));
    let mut values = b.outputs.rows(0, 209).to_vec();
    for (k, c) in [(20, 0), (21, 0), (122, 1), (150, 0), (151, 0), (151, 1), (180, 1)] {
        values[2 * k + c] = f64::NAN;
    }
    b.outputs = Table::new([Channel::new("u", "m/s"), Channel::new("v", "m/s")], values);
    let range = |half: f64| DesignRange { low: -half, high: half };
    let ranges = [range(1.5), range(1.0)];
    for (cell, base, feedback) in [
        (CellKind::Lstm, BaseKind::Nothing, false),
        (CellKind::Gru, BaseKind::Nothing, true),
        (CellKind::Rnn, BaseKind::Hold, true),
        (CellKind::Gru, BaseKind::Hold, false),
    ] {
        let settings = Settings {
            hidden: 5,
            epochs: 5,
            wash_out_s: Some(12.0),
            window_s: Some(5.0),
            base,
            feedback,
            precision: Precision::F64,
            ..Settings::of(cell)
        };
        let job = Job {
            runs: &[&a],
            validation: &[&b],
            outputs: &ranges,
            inputs: &[range(1.0)],
            horizon: 25,
            equations: None,
        };
        let trained = train(&job, &settings, None, &mut |_| ControlFlow::Continue(())).unwrap();
        let mut session =
            RecurrentSession::new(Arc::new(trained.model.recurrent().unwrap().clone())).unwrap();
        let options = Options { horizon: 25, ..Options::default() };
        let evaluation = evaluate("trained", &mut session, &ranges, &[&b], &options, &mut silent()).unwrap();
        let (told, score) = (trained.validation, evaluation.score());
        // The same origins; a hidden state that knows of more than the wash-out.
        let off = (told / score - 1.0).abs();
        println!("{cell:?} {base:?} {feedback}: {told} {score}, off by {off:.1e}");
        assert!(off < 1e-5, "{cell:?} {base:?} {feedback}: {told} {score}");
    }
}
