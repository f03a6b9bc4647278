//! Numbers of a file, checked against what the head says of them.

use safetensors::tensor::{Dtype, SafeTensors};

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
