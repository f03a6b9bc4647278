//! Networks of an independent implementation (PyTorch, f64): files under `/tests/golden/networks`.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::{BaseModel, Cell, Network, Recurrent, Scaling};
use safetensors::SafeTensors;
use serde_json::Value;

/// The thesis's networks by their names in the files.
pub(crate) const NAMES: [&str; 3] = ["lstm", "gru", "rnn"];

pub(crate) fn network(name: &str) -> Network {
    let cell = match name {
        "lstm" => Cell::Lstm { hidden: 18, projection: Some(3) },
        "gru" => Cell::Gru { hidden: 18 },
        _ => Cell::Vanilla { hidden: 18, layers: 2 },
    };
    Network { cell, inputs: 2, outputs: 3, read_out: name != "lstm" }
}

pub(crate) fn golden_path(file: &str) -> String {
    format!("{}/../../tests/golden/{file}", env!("CARGO_MANIFEST_DIR"))
}

pub(crate) fn read(path: &str) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|e| panic!("{path}: {e}"))
}

pub(crate) fn tensor(file: &SafeTensors, name: &str) -> Vec<f64> {
    let view = file.tensor(name).unwrap_or_else(|e| panic!("{name}: {e}"));
    view.data().chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect()
}

/// Flat weights from a file with PyTorch's names.
pub(crate) fn weights_of(network: &Network, bytes: &[u8]) -> Vec<f64> {
    let file = SafeTensors::deserialize(bytes).unwrap();
    let mut weights = Vec::new();
    for place in network.tensors() {
        assert_eq!(file.tensor(&place.name).unwrap().shape(), place.shape(), "{}", place.name);
        weights.extend(tensor(&file, &place.name));
    }
    weights
}

pub(crate) fn golden_weights(name: &str) -> Vec<f64> {
    weights_of(&network(name), &read(&golden_path(&format!("networks/{name}_weights.safetensors"))))
}

/// Rows of a file of `adaptation`.
pub(crate) fn rows(file: &str) -> Vec<Vec<f64>> {
    let text = String::from_utf8(read(&golden_path(&format!("adaptation/{file}")))).unwrap();
    text.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect()
}

/// A network trained on low speed alone, and the variances of the simulated sensors (1 cm/s, 1 cm/s, 1 deg/s) in its
/// scaled units.
pub(crate) fn pretrained(name: &str) -> (Recurrent, Vec<f64>) {
    let network = network(name);
    let bytes = read(&golden_path(&format!("adaptation/{name}_pretrained.safetensors")));
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let scaling = Scaling {
        output_mean: tensor(&file, "norm.output_mean"),
        output_scale: tensor(&file, "norm.output_std"),
        input_mean: tensor(&file, "norm.input_mean"),
        input_scale: tensor(&file, "norm.input_std"),
        correction_scale: tensor(&file, "norm.output_std"),
    };
    let sigma = [0.01, 0.01, 1.0_f64.to_radians()];
    let noise = sigma.iter().zip(&scaling.output_scale).map(|(s, scale)| (s / scale).powi(2)).collect();
    let weights = weights_of(&network, &bytes);
    let (base, feedback, wash_out) = (BaseModel::Nothing, false, 100);
    (Recurrent { network, weights, scaling, base, feedback, wash_out }, noise)
}

pub(crate) fn golden_json(name: &str) -> Value {
    serde_json::from_slice(&read(&golden_path(&format!("networks/{name}_golden.json")))).unwrap()
}

/// Numbers in nested lists, flat.
pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        value => vec![value.as_f64().unwrap()],
    }
}

/// Rows at `sequence.key` of the golden file, flat.
pub(crate) fn sequence(name: &str, key: &str) -> Vec<f64> {
    numbers(&golden_json(name)["sequence"][key])
}

/// Largest absolute difference.
pub(crate) fn worst<T: Scalar>(ours: &[T], theirs: &[f64]) -> f64 {
    assert_eq!(ours.len(), theirs.len());
    ours.iter().zip(theirs).map(|(a, b)| (a.wide() - b).abs()).fold(0.0, f64::max)
}
