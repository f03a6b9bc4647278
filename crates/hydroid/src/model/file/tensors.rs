//! Tensors of a file, checked against its description.

use hydroid_core::model::recurrent::Tensor as Place;
use safetensors::tensor::{Dtype, SafeTensors};

use super::super::torch::{NamedTensor, weights_of};

/// A tensor to write: name, type, shape, bytes.
pub(in crate::model) type Tensor = (String, Dtype, Vec<usize>, Vec<u8>);

pub(in crate::model) fn tensor(name: &str, shape: Vec<usize>, values: &[f64]) -> Tensor {
    (name.to_owned(), Dtype::F64, shape, values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

pub(in crate::model) fn numbers(
    tensors: &SafeTensors<'_>,
    name: &str,
    shape: &[usize],
) -> Result<Vec<f64>, String> {
    let tensor = tensors.tensor(name).map_err(|_| format!("tensor '{name}' is missing"))?;
    if tensor.dtype() != Dtype::F64 || tensor.shape() != shape {
        return Err(format!(
            "tensor '{name}' is {:?} {:?}, the description requires F64 {shape:?}",
            tensor.dtype(),
            tensor.shape()
        ));
    }
    let (chunks, _) = tensor.data().as_chunks::<8>();
    Ok(chunks.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}

pub(in crate::model) fn network_tensors(places: &[Place], weights: &[f64]) -> Result<Vec<Tensor>, String> {
    let values = |place: &Place| {
        weights.get(place.range()).ok_or_else(|| format!("the network has {} weights", weights.len()))
    };
    places.iter().map(|place| Ok(tensor(&place.name, place.shape(), values(place)?))).collect()
}

pub(in crate::model) fn weights(places: &[Place], tensors: &SafeTensors<'_>) -> Result<Vec<f64>, String> {
    let mut given = Vec::new();
    for place in places {
        let tensor =
            tensors.tensor(&place.name).map_err(|_| format!("tensor '{}' is missing", place.name))?;
        let data = tensor.data();
        let values: Vec<f64> = match tensor.dtype() {
            Dtype::F64 => data.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect(),
            Dtype::F32 => {
                data.as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes).into()).collect()
            }
            other => return Err(format!("tensor '{}' is {other:?}: weights are F64 or F32", place.name)),
        };
        given.push((place.name.as_str(), tensor.shape().to_vec(), values));
    }
    let named: Vec<NamedTensor<'_>> =
        given.iter().map(|(name, shape, values)| NamedTensor { name, shape, values }).collect();
    weights_of(places, &named)
}
