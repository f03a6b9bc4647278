//! Initial weights.

use hydroid_core::math::Scalar;
use hydroid_core::model::direct::Perceptron;
use hydroid_core::model::recurrent::{Cell, Network, Tensor};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

/// Initialization of recurrent networks as in PyTorch: uniform in `+-1 / sqrt(hidden)`; 1 is added to the forget-gate
/// bias of an LSTM (Gers, Schmidhuber and Cummins 2000; Jozefowicz et al. 2015).
pub(super) fn weights<T: Scalar>(network: &Network, rng: &mut ChaCha8Rng) -> Vec<T> {
    let (Cell::Lstm { hidden, .. } | Cell::Gru { hidden } | Cell::Vanilla { hidden, .. }) = network.cell;
    let bound = 1.0 / (hidden as f64).sqrt();
    let mut weights: Vec<T> =
        (0..network.weights()).map(|_| T::of(rng.random_range(-bound..bound))).collect();
    if let Cell::Lstm { .. } = network.cell {
        for tensor in network.tensors().iter().filter(|tensor| tensor.name.starts_with("bias_ih")) {
            for weight in &mut weights[tensor.range()][hidden..2 * hidden] {
                *weight += T::one();
            }
        }
    }
    weights
}

/// Initialization of perceptrons as in PyTorch: uniform in `+-1 / sqrt(fan-in)` for each layer.
pub(super) fn perceptron<T: Scalar>(network: &Perceptron, rng: &mut ChaCha8Rng) -> Vec<T> {
    let mut weights = Vec::with_capacity(network.weights());
    for pair in network.tensors().chunks(2) {
        let bound = 1.0 / (pair[0].columns as f64).sqrt();
        let count: usize = pair.iter().map(Tensor::len).sum();
        weights.extend((0..count).map(|_| T::of(rng.random_range(-bound..bound))));
    }
    weights
}
