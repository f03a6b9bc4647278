//! Ensembles in a file.

use safetensors::tensor::{Dtype, SafeTensors};

use super::super::{MAX_MEMBERS, Members};
use super::tensors::{Tensor, numbers, tensor};

/// Tensor of the ensemble, `members x places`; optional.
const MEMBERS: &str = "members";
/// Tensor of the indices of the columns of `members` in the coefficients (row by row) or weights.
const PLACES: &str = "member_places";

pub(in crate::model) fn write(members: &Members) -> Result<Vec<Tensor>, String> {
    if members.is_empty() {
        return Ok(Vec::new());
    }
    let (places, values) = members.parts();
    let width = places.len();
    let places: Vec<u32> = places
        .iter()
        .map(|&place| u32::try_from(place))
        .collect::<Result<_, _>>()
        .map_err(|e| e.to_string())?;
    let places = places.iter().flat_map(|place| place.to_le_bytes()).collect();
    Ok(vec![
        tensor(MEMBERS, vec![members.len(), width], values),
        (PLACES.to_owned(), Dtype::U32, vec![width], places),
    ])
}

pub(in crate::model) fn read(tensors: &SafeTensors<'_>, count: usize) -> Result<Members, String> {
    let (values, places) = match (tensors.tensor(MEMBERS), tensors.tensor(PLACES)) {
        (Ok(values), Ok(places)) => (values, places),
        (Err(_), Err(_)) => return Ok(Members::default()),
        _ => return Err(format!("it has only one of the tensors '{MEMBERS}' and '{PLACES}'")),
    };
    let (&[members, width], &[length]) = (values.shape(), places.shape()) else {
        return Err(String::from("its ensemble is not a table"));
    };
    if places.dtype() != Dtype::U32 || length != width || !(1..=MAX_MEMBERS).contains(&members) {
        return Err(format!(
            "its ensemble has {members} members of {width} coefficients and {length} places (at most {MAX_MEMBERS} members)"
        ));
    }
    let values = numbers(tensors, MEMBERS, &[members, width])?;
    let (chunks, _) = places.data().as_chunks::<4>();
    let places: Vec<u32> = chunks.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    Members::from_parts(&places, values, count)
}
