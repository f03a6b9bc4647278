//! The direct predictor 58-256-256-256-60: `cargo bench -p hydroid-core --bench direct`.
//!
//! One item is one window, so that the throughput is in windows a second.

use std::sync::Arc;

use divan::Bencher;
use divan::counter::ItemsCount;
use hydroid_core::adapt::{DirectLastLayer, LastLayerOptions};
use hydroid_core::math::Scalar;
use hydroid_core::model::direct::{Batch, Direct, DirectSession, Perceptron};
use hydroid_core::model::recurrent::{BaseModel, Scaling};
use hydroid_core::predict::{Predictor, Workspace};

fn main() {
    divan::main();
}

const HISTORY: usize = 4;
const HORIZON: usize = 20;

fn network() -> Perceptron {
    let (inputs, outputs) = Direct::lengths(HISTORY, HORIZON, 3, 2);
    Perceptron { inputs, hidden: vec![256; 3], outputs }
}

fn numbers<T: Scalar>(len: usize) -> Vec<T> {
    (0..len).map(|k| T::of(0.1 * (0.7 * k as f64 + 0.1).sin())).collect()
}

/// Forward, back, and the gradient of all weights.
#[divan::bench(types = [f32, f64], args = [64, 128, 256])]
fn forward_and_gradient<T: Scalar>(bencher: Bencher, windows: usize) {
    let network = network();
    let (mut batch, weights) = (Batch::<T>::new(&network, windows), numbers::<T>(network.weights()));
    let inputs = numbers::<T>(network.inputs * batch.lanes());
    let mut gradient = vec![T::zero(); weights.len()];
    bencher.counter(ItemsCount::new(windows)).bench_local(|| {
        batch.input_mut().copy_from_slice(&inputs);
        batch.forward(divan::black_box(&weights));
        batch.output_adjoint_mut().fill(T::one());
        batch.backward(&weights, &mut gradient);
        gradient[0]
    });
}

/// Forward alone, as many windows as a planner tries.
#[divan::bench(types = [f32, f64], args = [1000])]
fn forward<T: Scalar>(bencher: Bencher, windows: usize) {
    let network = network();
    let (mut batch, weights) = (Batch::<T>::new(&network, windows), numbers::<T>(network.weights()));
    let inputs = numbers::<T>(network.inputs * batch.lanes());
    bencher.counter(ItemsCount::new(windows)).bench_local(|| {
        batch.input_mut().copy_from_slice(&inputs);
        batch.forward(divan::black_box(&weights));
        batch.output()[0]
    });
}

fn model() -> Arc<Direct> {
    let network = network();
    let scaling = Scaling {
        output_mean: vec![0.0; 3],
        output_scale: vec![1.0; 3],
        input_mean: vec![0.0; 2],
        input_scale: vec![1.0; 2],
        correction_scale: vec![1.0; 3],
    };
    let weights = numbers(network.weights());
    Arc::new(Direct {
        network,
        weights,
        scaling,
        history: HISTORY,
        horizon: HORIZON,
        base: BaseModel::Nothing,
    })
}

/// A whole sample of a session whose read-out learns, observed and advanced: 257 weights for each of 60 numbers.
#[divan::bench]
fn learning_sample(bencher: Bencher) {
    let options = LastLayerOptions { forgetting: 0.9997, information: 0.1, leak: true, noise_rate: 0.005 };
    let mut session = match DirectLastLayer::new(model(), &options) {
        Ok(session) => session,
        Err(error) => panic!("{error}"),
    };
    let mut k = 0.0_f64;
    bencher.bench_local(|| {
        k += 1.0;
        session.observe(divan::black_box(&[(0.1 * k).sin(), (0.3 * k).cos(), (0.7 * k).sin()]));
        session.advance(divan::black_box(&[(0.05 * k).sin(), (0.2 * k).cos()]));
    });
}

/// A session's rollout, in double precision.
#[divan::bench(args = [20, 100])]
fn rollout(bencher: Bencher, steps: usize) {
    let mut session = match DirectSession::new(model()) {
        Ok(session) => session,
        Err(error) => panic!("{error}"),
    };
    for k in 0..HISTORY {
        session.observe(&[0.1, 0.2, 0.3]);
        if k + 1 < HISTORY {
            session.advance(&[0.1, 0.2]);
        }
    }
    let (mut work, commands, mut y) = (Workspace::new(), vec![0.1; 2 * steps], vec![0.0; 3 * steps]);
    bencher.bench_local(|| {
        session.rollout(divan::black_box(&commands), &mut work, &mut y);
        y[0]
    });
}
