//! Weights of networks from tensors with PyTorch's names.

use hydroid_core::model::recurrent::{Network, Tensor};

/// A tensor with PyTorch's name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NamedTensor<'a> {
    /// Name with or without the module: `weight_ih_l0`, `rnn.weight_ih_l0`.
    pub name: &'a str,
    /// Shape as in PyTorch.
    pub shape: &'a [usize],
    /// Values, row by row.
    pub values: &'a [f64],
}

/// Weights of a recurrent network, in the order of [`Network::tensors`], from tensors such as a `state_dict`.
///
/// # Errors
/// If a tensor is missing, ambiguous, of another shape, or not finite.
pub fn weights_from_torch(network: &Network, tensors: &[NamedTensor<'_>]) -> Result<Vec<f64>, String> {
    network.check().map_err(|error| error.to_string())?;
    weights_of(&network.tensors(), tensors)
}

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
