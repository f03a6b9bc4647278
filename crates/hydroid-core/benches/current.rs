//! What an estimate of the current costs: a sample and a rollout of a model alone, and in a session through the water.
//!
//! The estimate works once in a window; the benchmark of samples contains its mean share.

#[path = "../tests/it/controllers/written.rs"]
mod written;

use std::sync::Arc;

use divan::{Bencher, black_box};
use hydroid_core::craft::Craft;
use hydroid_core::current::{CurrentOptions, ThroughWater};
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, RecurrentSession, Scaling};
use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::predict::{BATCH, Predictor, Workspace};
use written::{Force, equations};

fn main() {
    divan::main();
}

const MODELS: [&str; 4] = ["equations", "equations, through the water", "GRU", "GRU, through the water"];

/// The equations of the hydrofoil, or a GRU of 18 cells.
fn inner(name: &str) -> Box<dyn Predictor> {
    if name.starts_with("GRU") {
        let network = Network { cell: Cell::Gru { hidden: 18 }, inputs: 2, outputs: 3, read_out: true };
        let weights = (0..network.weights()).map(|k| 0.3 * (1.7 * k as f64).sin()).collect();
        let scaling = Scaling {
            output_mean: vec![0.0; 3],
            output_scale: vec![1.0; 3],
            input_mean: vec![0.0; 2],
            input_scale: vec![100.0, 1.0],
            correction_scale: vec![1.0; 3],
        };
        let base = BaseModel::Nothing;
        let model = Recurrent { network, weights, scaling, base, feedback: false, wash_out: 1 };
        Box::new(RecurrentSession::new(Arc::new(model)).expect("parts that fit"))
    } else {
        let fine = equations(&Craft::hydrofoil(), Force::Hidden);
        let (terms, coefficients, signals) =
            (fine.terms().to_vec(), fine.coefficients().to_vec(), fine.signals().to_vec());
        // One integration step in a sample, as identification makes them.
        let model = Equations::with_signals(terms, coefficients, 3, 2, signals, 0.1, 1).expect("as before");
        Box::new(EquationsSession::new(Arc::new(model)))
    }
}

fn session(name: &str) -> Box<dyn Predictor> {
    let inner = inner(name);
    if !name.ends_with("water") {
        return inner;
    }
    let options = CurrentOptions {
        motion: [0, 1, 2],
        dt: 0.1,
        window: 25,
        deviations: [0.02, 0.02, 0.02],
        noise: [0.01; 3],
        initial: 0.3,
        walk: 0.005,
    };
    Box::new(ThroughWater::new(inner, options).expect("valid"))
}

/// A run of the model itself in turns: heading, outputs, and the command that follows.
fn run(name: &str) -> Vec<(f64, [f64; 3], [f64; 2])> {
    let mut model = inner(name);
    model.observe(&[2.0, 0.1, 0.08]);
    let (mut heading, mut y) = (0.0, [0.0; 3]);
    let mut rows = Vec::new();
    for k in 0..9_000 {
        let phase = 0.05 * f64::from(k);
        model.output(&mut y);
        let command = [100.0 + 50.0 * phase.cos(), 0.1 * phase.sin()];
        rows.push((heading, y, command));
        model.advance(&command);
        heading += 0.1 * y[2];
    }
    rows
}

fn begin(session: &mut dyn Predictor, (heading, y, _): &(f64, [f64; 3], [f64; 2])) {
    session.reset();
    session.observe_heading(*heading);
    session.observe(y);
}

/// The samples after the first one.
fn follow(session: &mut dyn Predictor, rows: &[(f64, [f64; 3], [f64; 2])]) {
    for pair in rows.windows(2) {
        session.observe_heading(pair[1].0);
        session.advance_observe(&pair[0].2, &pair[1].1);
    }
}

#[divan::bench(args = MODELS, sample_count = 20)]
fn nine_thousand_samples(bencher: Bencher, name: &str) {
    let (mut session, rows) = (session(name), run(name));
    bencher.bench_local(|| {
        begin(session.as_mut(), &rows[0]);
        follow(black_box(session.as_mut()), &rows);
    });
}

/// One prediction over ten seconds.
#[divan::bench(args = MODELS, sample_size = 100)]
fn rollout(bencher: Bencher, name: &str) {
    rollouts(bencher, name, 1);
}

/// As many candidates as a planner predicts side by side.
#[divan::bench(args = MODELS, sample_size = 10)]
fn rollout_batch(bencher: Bencher, name: &str) {
    rollouts(bencher, name, BATCH);
}

fn rollouts(bencher: Bencher, name: &str, count: usize) {
    const STEPS: usize = 100;
    let mut session = session(name);
    let rows = run(name);
    begin(session.as_mut(), &rows[0]);
    follow(session.as_mut(), &rows[..200]);
    let commands: Vec<f64> = (0..count * STEPS).flat_map(|k| [100.0, 0.1 * (0.1 * k as f64).sin()]).collect();
    let (mut work, mut y) = (Workspace::new(), vec![0.0; count * STEPS * 3]);
    bencher.bench_local(|| session.rollout_batch(count, black_box(&commands), &mut work, &mut y));
}
