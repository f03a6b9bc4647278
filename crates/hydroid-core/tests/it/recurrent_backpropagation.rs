//! Recurrent networks compared with PyTorch in double precision: files under `/tests/golden/networks`.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{Network, Tape};

use crate::networks::{NAMES, golden_json, golden_weights, network, numbers};

struct Golden {
    network: Network,
    weights: Vec<f64>,
    gradient: Vec<f64>,
    input: Vec<Vec<f64>>,
    state: Vec<Vec<f64>>,
    output: Vec<Vec<f64>>,
    target: Vec<Vec<f64>>,
    loss: f64,
}

fn golden(name: &str) -> Golden {
    let (network, json) = (network(name), golden_json(name));
    let gradients = network.tensors();
    let gradient = gradients.iter().flat_map(|tensor| numbers(&json["loss"]["gradient"][&tensor.name]));
    let rows = |key: &str| json["sequence"][key].as_array().unwrap().iter().map(numbers).collect();
    Golden {
        network,
        weights: golden_weights(name),
        gradient: gradient.collect(),
        input: rows("input"),
        state: rows("state"),
        output: rows("output"),
        target: rows("target"),
        loss: json["loss"]["value"].as_f64().unwrap(),
    }
}

/// Largest differences of outputs, states, loss and gradient: the sequence in one lane, beside others of zero weight in
/// the loss.
fn differences<T: Scalar>(golden: &Golden, sequences: usize, lane: usize) -> [f64; 4] {
    let steps = golden.input.len();
    let mut tape = Tape::<T>::new(&golden.network, steps, sequences);
    let lanes = tape.lanes();
    let weights: Vec<T> = golden.weights.iter().map(|&w| T::of(w)).collect();
    tape.load(&weights);
    let (mut outputs, mut states, mut loss) = (0.0_f64, 0.0_f64, 0.0);
    let count = (steps * golden.network.outputs) as f64;
    for k in 0..steps {
        for (row, &x) in tape.input_mut(k).chunks_exact_mut(lanes).zip(&golden.input[k]) {
            row.fill(T::of(-x));
            row[lane] = T::of(x);
        }
        tape.step(k);
        for (row, &y) in tape.output(k).chunks_exact(lanes).zip(&golden.output[k]) {
            outputs = outputs.max((row[lane].wide() - y).abs());
        }
        for (row, &x) in tape.state(k + 1).chunks_exact(lanes).zip(&golden.state[k]) {
            states = states.max((row[lane].wide() - x).abs());
        }
    }
    tape.begin_backward();
    for k in (0..steps).rev() {
        for (i, &target) in golden.target[k].iter().enumerate() {
            let error = tape.output(k)[i * lanes + lane].wide() - target;
            loss += error * error / count;
            tape.output_adjoint_mut(k)[i * lanes + lane] = T::of(2.0 * error / count);
        }
        tape.step_back(k);
    }
    let mut gradient = vec![T::zero(); weights.len()];
    tape.gradient(&mut gradient);
    let largest = golden.gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    let gradient =
        gradient.iter().zip(&golden.gradient).fold(0.0_f64, |m, (a, b)| m.max((a.wide() - b).abs()))
            / largest;
    [outputs, states, (loss - golden.loss).abs(), gradient]
}

#[test]
fn outputs_loss_and_gradients_are_pytorchs() {
    for name in NAMES {
        let golden = golden(name);
        for (sequences, lane) in [(1, 0), (21, 17)] {
            let double = differences::<f64>(&golden, sequences, lane);
            assert!(double.iter().all(|&d| d <= 1e-12), "{name}, f64: {double:?}");
            let single = differences::<f32>(&golden, sequences, lane);
            assert!(single.iter().all(|&d| d <= 1e-5), "{name}, f32: {single:?}");
        }
    }
}
