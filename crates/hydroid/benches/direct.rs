//! Training of the direct predictor 58-256-256-256-60: `cargo bench -p hydroid --bench direct`.
//!
//! One item is one window of a batch of 256, with all that a training does with it: gathering, errors, gradient, clipping, Adam,
//! and the judgement of the validation run. On one thread.

use std::ops::ControlFlow;

use divan::Bencher;
use divan::counter::ItemsCount;
use hydroid::evaluate::DesignRange;
use hydroid::log::{Channel, Table, Trajectory};
use hydroid::train::{BaseKind, CellKind, Job, Precision, TrainOptions, train};

fn main() {
    divan::main();
}

const SAMPLES: usize = 10_023;
const HISTORY: usize = 4;
const HORIZON: usize = 20;

/// Three outputs that follow two inputs.
fn run(samples: usize, phase: f64) -> Trajectory {
    let (mut y, mut outputs, mut inputs) = ([0.0_f64; 3], Vec::new(), Vec::new());
    for k in 0..samples {
        let t = 0.1 * k as f64 + phase;
        let c = [(0.7 * t).sin(), (1.9 * t).cos()];
        inputs.extend(c);
        outputs.extend(y);
        y = [y[0] + 0.1 * (c[0] - y[0]), y[1] + 0.1 * (c[1] - y[1] * y[0]), y[2] + 0.1 * (y[1] - y[2])];
    }
    let channels = |names: &[&str]| -> Vec<Channel> { names.iter().map(|n| Channel::new(*n, "")).collect() };
    Trajectory {
        name: format!("run {phase}"),
        t0: 0.0,
        dt: 0.1,
        outputs: Table::new(channels(&["u", "v", "r"]), outputs),
        inputs: Table::new(channels(&["n", "delta"]), inputs),
        truth: None,
        heading: None,
        position: None,
    }
}

#[divan::bench(args = [Precision::F32, Precision::F64], sample_count = 10, sample_size = 1)]
fn training(bencher: Bencher, precision: Precision) {
    let (learn, choose) = (run(SAMPLES, 0.0), run(400, 1000.0));
    let range = DesignRange { low: -2.0, high: 2.0 };
    let settings = TrainOptions {
        history_s: Some(0.1 * HISTORY as f64),
        window_s: Some(0.1 * HORIZON as f64),
        base: BaseKind::Nothing,
        epochs: 1,
        precision,
        ..TrainOptions::of(CellKind::Direct)
    };
    let windows = SAMPLES - HISTORY - HORIZON + 1;
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(pool) => pool,
        Err(error) => panic!("{error}"),
    };
    bencher.counter(ItemsCount::new(windows)).bench_local(|| {
        let job = Job {
            runs: &[&learn],
            validation: &[&choose],
            outputs: &[range; 3],
            inputs: &[range; 2],
            horizon: HORIZON,
            equations: None,
        };
        pool.install(|| train(&job, &settings, None, &mut |_| ControlFlow::Continue(())))
    });
}
