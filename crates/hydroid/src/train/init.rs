//! First weights.

use hydroid_core::math::Scalar;
use hydroid_core::model::direct::Perceptron;
use hydroid_core::model::recurrent::{Cell, Network, Tensor};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use super::scaling::HALF_RANGE;

/// First weights as PyTorch draws them: uniform in `+-1 / sqrt(hidden)`; of an LSTM 1 is added to the biases of the
/// forget gate, so that it remembers from the start (Gers, Schmidhuber and Cummins 2000; Jozefowicz et al. 2015).
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

/// First weights as PyTorch draws them: those of a layer uniform in `+-1 / sqrt(length of what it reads)`.
pub(super) fn perceptron<T: Scalar>(network: &Perceptron, rng: &mut ChaCha8Rng) -> Vec<T> {
    let mut weights = Vec::with_capacity(network.weights());
    for pair in network.tensors().chunks(2) {
        let bound = 1.0 / (pair[0].columns as f64).sqrt();
        let count: usize = pair.iter().map(Tensor::len).sum();
        weights.extend((0..count).map(|_| T::of(rng.random_range(-bound..bound))));
    }
    weights
}

/// First weights of a control-affine network: as above but for the layer that reads the outputs, whose units change over all of
/// the range (-2 to 2 in scaled outputs) and from gently to sharply. A change of mode is a step in one output, and units that
/// are all gentle and near the middle take many epochs to find it: so every second unit is of one output alone.
pub(super) fn control_affine<T: Scalar>(network: &Perceptron, rng: &mut ChaCha8Rng) -> Vec<T> {
    let mut weights = perceptron::<T>(network, rng);
    let (reads, Some(&units)) = (network.inputs, network.hidden.first()) else { return weights };
    let (matrix, rest) = weights.split_at_mut(reads * units);
    for (unit, (row, bias)) in matrix.chunks_exact_mut(reads).zip(rest).enumerate() {
        let slope = SLOPES.0 * (SLOPES.1 / SLOPES.0).powf(rng.random_range(0.0..1.0));
        let mut direction: Vec<f64> = (0..reads).map(|_| rng.random_range(-1.0..1.0)).collect();
        if unit % 2 == 0 {
            let alone = unit / 2 % reads;
            direction.iter_mut().enumerate().for_each(|(k, x)| *x = if k == alone { 1.0 } else { 0.0 });
        }
        let length = direction.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-3);
        let centre: Vec<f64> = (0..reads).map(|_| rng.random_range(-HALF_RANGE..HALF_RANGE)).collect();
        let mut offset = 0.0;
        for ((w, x), centre) in row.iter_mut().zip(&direction).zip(centre) {
            *w = T::of(slope * x / length);
            offset -= slope * x / length * centre;
        }
        *bias = T::of(offset);
    }
    weights
}

/// Slopes of first units in scaled outputs, from the range as a whole to a twentieth of it.
const SLOPES: (f64, f64) = (0.4, 8.0);
