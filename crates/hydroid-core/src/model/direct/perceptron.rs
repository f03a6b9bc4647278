//! Structure of a feed-forward network and the order of its weights.

use alloc::format;
use alloc::vec::Vec;

use crate::model::recurrent::{NetworkError, Tensor};

/// A multilayer perceptron with `tanh` between its layers and a linear last layer.
///
/// ```text
/// h_0 = x,   h_l = tanh(W_l h_{l-1} + b_l),   y = W_L h_{L-1} + b_L
/// ```
///
/// The weights are one flat slice: `W_1 b_1 W_2 b_2 ..`, each matrix row by row (`outputs x inputs` of the layer).
/// Tensor names are those of `torch.nn.Sequential(Linear, Tanh, Linear, .., Linear)`, for exchange in both directions.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Perceptron {
    /// Length of the input `x`.
    pub inputs: usize,
    /// Length of each hidden layer, from the input on; empty for a linear map.
    pub hidden: Vec<usize>,
    /// Length of the output `y`.
    pub outputs: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layer {
    pub(super) reads: usize,
    pub(super) gives: usize,
    /// Offset of the matrix, which the bias follows.
    pub(super) at: usize,
}

impl Layer {
    pub(super) fn matrix<'a, T>(&self, weights: &'a [T]) -> &'a [T] {
        &weights[self.at..self.at + self.reads * self.gives]
    }

    pub(super) fn bias<'a, T>(&self, weights: &'a [T]) -> &'a [T] {
        let at = self.at + self.reads * self.gives;
        &weights[at..at + self.gives]
    }
}

impl Perceptron {
    /// Largest length of a layer, input or output.
    pub const MOST: usize = 4096;
    /// Largest number of hidden layers.
    pub const DEEPEST: usize = 64;
    /// Largest number of weights: half a gigabyte.
    pub const HEAVIEST: usize = 1 << 26;

    /// Checks the sizes.
    ///
    /// # Errors
    /// If a size is zero or exceeds its limit.
    pub fn check(&self) -> Result<(), NetworkError> {
        if self.hidden.len() > Self::DEEPEST {
            return Err(NetworkError::Huge("layers", self.hidden.len(), Self::DEEPEST));
        }
        let ends = [("inputs", self.inputs), ("outputs", self.outputs)];
        for (what, size) in ends.into_iter().chain(self.hidden.iter().map(|&size| ("units", size))) {
            if size == 0 {
                return Err(NetworkError::Empty(what));
            }
            if size > Self::MOST {
                return Err(NetworkError::Huge(what, size, Self::MOST));
            }
        }
        // No overflow: the number and the lengths of the layers are limited.
        let weights = self.weights();
        if weights > Self::HEAVIEST {
            return Err(NetworkError::Huge("weights", weights, Self::HEAVIEST));
        }
        Ok(())
    }

    /// Number of weights.
    pub fn weights(&self) -> usize {
        self.layers().last().map_or(0, |layer| layer.at + (layer.reads + 1) * layer.gives)
    }

    pub(super) fn layers(&self) -> Vec<Layer> {
        let (mut reads, mut at) = (self.inputs, 0);
        let layer = |&gives: &usize| {
            let layer = Layer { reads, gives, at };
            at += (reads + 1) * gives;
            reads = gives;
            layer
        };
        self.hidden.iter().chain([&self.outputs]).map(layer).collect()
    }

    /// The tensors of the weights, in their order.
    pub fn tensors(&self) -> Vec<Tensor> {
        let both = |(l, layer): (usize, &Layer)| {
            let tensor = |what: &str, columns, vector, offset| Tensor {
                name: format!("{}.{what}", 2 * l),
                rows: layer.gives,
                columns,
                vector,
                offset,
            };
            let bias = layer.at + layer.reads * layer.gives;
            [tensor("weight", layer.reads, false, layer.at), tensor("bias", 1, true, bias)]
        };
        self.layers().iter().enumerate().flat_map(both).collect()
    }
}
