//! Recurrent networks on board, one sequence: `cargo bench -p hydroid-core --bench cells`.
//!
//! Networks with 5 inputs and 3 outputs: LSTM of 18 cells projected to 3, GRU of 18, two vanilla layers of 18.

use std::sync::Arc;

use divan::Bencher;
use hydroid_core::adapt::kalman::KalmanNetwork;
use hydroid_core::model::recurrent::{
    BaseModel, Cell, Change, Linearization, Network, Packed, Recurrent, RecurrentSession, Scaling,
};
use hydroid_core::predict::{Predictor, Workspace};

fn main() {
    divan::main();
}

const NAMES: [&str; 3] = ["lstm", "gru", "rnn"];

fn network(name: &str, inputs: usize) -> Network {
    let cell = match name {
        "lstm" => Cell::Lstm { hidden: 18, projection: Some(3) },
        "gru" => Cell::Gru { hidden: 18 },
        _ => Cell::Vanilla { hidden: 18, layers: 2 },
    };
    Network { cell, inputs, outputs: 3, read_out: name != "lstm" }
}

fn numbers(count: usize) -> Vec<f64> {
    (0..count).map(|k| 0.45 * (k as f64 * 12.9898).sin()).collect()
}

/// A step and the output of its state.
#[divan::bench(args = NAMES)]
fn step(bencher: Bencher, name: &str) {
    let network = network(name, 5);
    let packed = Packed::new(network, &numbers(network.weights()));
    let (mut state, x, mut y) = (numbers(network.state_len()), numbers(5), numbers(3));
    let mut scratch = numbers(packed.scratch());
    bencher.bench_local(|| {
        packed.step(&mut state, divan::black_box(&x), &mut scratch);
        packed.output(&state, &mut y);
        divan::black_box(y[0])
    });
}

/// The same with its partials.
#[divan::bench(args = NAMES)]
fn linearize(bencher: Bencher, name: &str) {
    let network = network(name, 5);
    let packed = Packed::new(network, &numbers(network.weights()));
    let (mut state, x) = (numbers(network.state_len()), numbers(5));
    let mut linear = Linearization::new(&packed);
    bencher.bench_local(|| linear.step(&packed, &mut state, divan::black_box(&x)));
}

/// `df/dweights P` for `P` of `weights x weights` (2 inputs: 558, 1245 and 1137 weights).
#[divan::bench(args = NAMES)]
fn weights_times_square_matrix(bencher: Bencher, name: &str) {
    let network = network(name, 2);
    let n = network.weights();
    let packed = Packed::new(network, &numbers(n));
    let mut linear = Linearization::new(&packed);
    linear.step(&packed, &mut numbers(network.state_len()), &numbers(2));
    let (p, mut out) = (numbers(n * n), numbers(network.state_len() * n));
    let mut scratch = numbers(linear.scratch(n));
    bencher.bench_local(|| {
        let change = Change { weights: Some(divan::black_box(&p)), ..Change::default() };
        linear.times(&packed, change, n, &mut out, &mut scratch);
    });
}

/// New weights of the same network.
#[divan::bench(args = NAMES)]
fn set_weights(bencher: Bencher, name: &str) {
    let network = network(name, 5);
    let weights = numbers(network.weights());
    let mut packed = Packed::new(network, &weights);
    bencher.bench_local(|| packed.set_weights(divan::black_box(&weights)));
}

fn session(name: &str, feedback: bool) -> RecurrentSession {
    let network = network(name, if feedback { 5 } else { 2 });
    let scaling = Scaling {
        output_mean: vec![0.0; 3],
        output_scale: vec![1.0; 3],
        input_mean: vec![0.0; 2],
        input_scale: vec![1.0; 2],
        correction_scale: vec![1.0; 3],
    };
    let model = Recurrent {
        network,
        weights: numbers(network.weights()),
        scaling,
        base: BaseModel::Nothing,
        feedback,
        wash_out: 100,
    };
    RecurrentSession::new(Arc::new(model)).unwrap()
}

/// A rollout of 100 samples of a network that sees its outputs.
#[divan::bench(args = NAMES)]
fn rollout_100(bencher: Bencher, name: &str) {
    let mut session = session(name, true);
    session.observe(&[0.1, 0.2, 0.3]);
    let (commands, mut y, mut work) = (numbers(200), vec![0.0; 300], Workspace::new());
    bencher.bench_local(|| session.rollout(divan::black_box(&commands), &mut work, &mut y));
}

/// A sample of the filter of the hidden state.
#[divan::bench(args = NAMES)]
fn state_filter_sample(bencher: Bencher, name: &str) {
    let model = Arc::new(session(name, false).model().clone());
    let mut session = KalmanNetwork::state_filter(model, 1e-4, 1.0, &[1e-3; 3]).unwrap();
    bencher.bench_local(|| {
        session.observe(divan::black_box(&[0.1, 0.2, 0.3]));
        session.advance(divan::black_box(&[0.4, -0.2]));
    });
}
