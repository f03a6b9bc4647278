//! Recurrent networks as models: what they are in words, and weights from elsewhere.

use std::sync::Arc;

use hydroid_core::model::recurrent::{Cell, Network, Recurrent, Tensor};

use super::{Body, Model};

/// A tensor of another program: its name, its shape, its numbers row by row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedTensor<'a> {
    /// `weight_ih_l0`, or with the name of the module before it, `rnn.weight_ih_l0`.
    pub name: &'a str,
    /// As PyTorch has it.
    pub shape: &'a [usize],
    /// Row by row.
    pub values: &'a [f64],
}

/// The weights of a network from tensors under PyTorch's names, such as a `state_dict`: in the order of
/// [`Network::tensors`]. The module's name may stand before that of the tensor; tensors that the network does not have
/// are passed over.
///
/// # Errors
/// If a tensor is missing, there twice, of another shape, or not finite.
pub fn weights_from_torch(network: &Network, tensors: &[NamedTensor<'_>]) -> Result<Vec<f64>, String> {
    network.check().map_err(|error| error.to_string())?;
    weights_of(&network.tensors(), tensors)
}

/// The same for the places of any network's weights.
pub(super) fn weights_of(places: &[Tensor], tensors: &[NamedTensor<'_>]) -> Result<Vec<f64>, String> {
    let mut weights = Vec::new();
    for place in places {
        let is_it = |given: &&NamedTensor<'_>| {
            given
                .name
                .strip_suffix(place.name.as_str())
                .is_some_and(|module| module.is_empty() || module.ends_with('.'))
        };
        let mut found = tensors.iter().filter(is_it);
        let Some(tensor) = found.next() else {
            return Err(format!("tensor '{}' is missing", place.name));
        };
        if let Some(second) = found.next() {
            return Err(format!(
                "'{}' and '{}' may both be the tensor '{}': leave one out",
                tensor.name, second.name, place.name
            ));
        }
        if tensor.shape != place.shape().as_slice() || tensor.values.len() != place.len() {
            return Err(format!(
                "tensor '{}' has shape {:?}, a network of these sizes needs {:?}",
                tensor.name,
                tensor.shape,
                place.shape()
            ));
        }
        if tensor.values.iter().any(|value| !value.is_finite()) {
            return Err(format!("a number of tensor '{}' is not finite", tensor.name));
        }
        weights.extend_from_slice(tensor.values);
    }
    Ok(weights)
}

/// The cell in words: `LSTM with 18 cells, projected to 3`.
pub fn cell_text(cell: &Cell) -> String {
    let s = |n: usize| if n == 1 { "" } else { "s" };
    match *cell {
        Cell::Lstm { hidden, projection: None } => format!("LSTM with {hidden} cell{}", s(hidden)),
        Cell::Lstm { hidden, projection: Some(to) } => {
            format!("LSTM with {hidden} cell{}, projected to {to}", s(hidden))
        }
        Cell::Gru { hidden } => format!("GRU with {hidden} cell{}", s(hidden)),
        Cell::Vanilla { hidden, layers } => {
            format!("vanilla recurrent network, {layers} layer{} of {hidden} cell{}", s(layers), s(hidden))
        }
    }
}

impl Model {
    /// The network; none for models of equations.
    pub fn recurrent(&self) -> Option<&Arc<Recurrent>> {
        match &self.body {
            Body::Recurrent(recurrent) => Some(recurrent),
            Body::Equations(_) | Body::Direct(_) | Body::Affine(_) | Body::Plant(_) => None,
        }
    }
}
