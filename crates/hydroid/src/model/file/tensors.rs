//! Numbers of a file, checked against what the head says of them.

use hydroid_core::model::recurrent::Tensor;
use safetensors::tensor::{Dtype, SafeTensors};

use super::super::recurrent::{NamedTensor, weights_of};

/// A tensor to write: name, kind of number, shape, bytes.
pub(super) type Written = (String, Dtype, Vec<usize>, Vec<u8>);

/// A tensor of f64 to write.
pub(super) fn write(name: &str, shape: Vec<usize>, values: &[f64]) -> Written {
    (name.to_owned(), Dtype::F64, shape, values.iter().flat_map(|value| value.to_le_bytes()).collect())
}

/// A tensor of f64.
pub(super) fn numbers(tensors: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<Vec<f64>, String> {
    let tensor = tensors.tensor(name).map_err(|_| format!("tensor '{name}' is missing"))?;
    if tensor.dtype() != Dtype::F64 || tensor.shape() != shape {
        return Err(format!(
            "tensor '{name}' is {:?} {:?}, the description says F64 {shape:?}",
            tensor.dtype(),
            tensor.shape()
        ));
    }
    let (chunks, _) = tensor.data().as_chunks::<8>();
    Ok(chunks.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}

/// A network's weights. Files that PyTorch wrote may have them in single precision, which becomes double without loss.
pub(super) fn weights(places: &[Tensor], tensors: &SafeTensors<'_>) -> Result<Vec<f64>, String> {
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
