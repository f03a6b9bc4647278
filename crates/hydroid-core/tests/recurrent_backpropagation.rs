//! Recurrent networks against PyTorch in double precision: files under `/tests/golden/networks`.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{Cell, Network, Tape};
use safetensors::SafeTensors;
use serde_json::Value;

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

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        value => vec![value.as_f64().unwrap()],
    }
}

fn golden(name: &str, network: Network) -> Golden {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden/networks");
    let golden: Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{folder}/{name}_golden.json")).unwrap())
            .unwrap();
    let file = std::fs::read(format!("{folder}/{name}_weights.safetensors")).unwrap();
    let file = SafeTensors::deserialize(&file).unwrap();
    let (mut weights, mut gradient) = (vec![0.0; network.weights()], vec![0.0; network.weights()]);
    for tensor in network.tensors() {
        let view = file.tensor(&tensor.name).unwrap();
        assert_eq!(view.shape(), tensor.shape(), "{}", tensor.name);
        for (w, bytes) in weights[tensor.range()].iter_mut().zip(view.data().chunks_exact(8)) {
            *w = f64::from_le_bytes(bytes.try_into().unwrap());
        }
        gradient[tensor.range()].copy_from_slice(&numbers(&golden["loss"]["gradient"][&tensor.name]));
    }
    let rows = |name: &str| golden["sequence"][name].as_array().unwrap().iter().map(numbers).collect();
    Golden {
        network,
        weights,
        gradient,
        input: rows("input"),
        state: rows("state"),
        output: rows("output"),
        target: rows("target"),
        loss: golden["loss"]["value"].as_f64().unwrap(),
    }
}

/// Largest differences of outputs, states, loss and gradient: the sequence is walked in one lane of some, others
/// beside it with weight zero in the loss.
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

fn check(name: &str, cell: Cell, read_out: bool) {
    let golden = golden(name, Network { cell, inputs: 2, outputs: 3, read_out });
    for (sequences, lane) in [(1, 0), (21, 17)] {
        let double = differences::<f64>(&golden, sequences, lane);
        assert!(double.iter().all(|&d| d <= 1e-12), "{name}, f64: {double:?}");
        let single = differences::<f32>(&golden, sequences, lane);
        assert!(single.iter().all(|&d| d <= 1e-5), "{name}, f32: {single:?}");
    }
}

#[test]
fn lstm_with_projection() {
    check("lstm", Cell::Lstm { hidden: 18, projection: Some(3) }, false);
}

#[test]
fn gru_with_read_out() {
    check("gru", Cell::Gru { hidden: 18 }, true);
}

#[test]
fn vanilla_of_two_layers_with_read_out() {
    check("rnn", Cell::Vanilla { hidden: 18, layers: 2 }, true);
}
