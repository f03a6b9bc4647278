//! Sparse equations in a file: `coefficients` (outputs x terms) in physical units, the members of an ensemble, and what
//! equations that learn begin with.

use std::sync::Arc;

use hydroid_core::adapt::BlendSettings;
use hydroid_core::model::sparse::{Equations, EquationsError, Signal, Term};
use safetensors::tensor::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};

use super::super::{Body, Description, Learning, MOST_MEMBERS, Members, Model};
use super::tensors::{Written, numbers, write};

/// Tensor of the coefficients, `outputs x terms`.
const COEFFICIENTS: &str = "coefficients";
/// Tensor of the ensemble, `members x places`; a file without it has no ensemble.
const MEMBERS: &str = "members";
/// Tensor of the places that `members` has, counted in the table of coefficients row by row.
const PLACES: &str = "member_places";
/// Tensor of the triangle that a model which learns begins with.
const ROOT: &str = "root";

/// What gives the coefficients their meaning.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Library {
    terms: Vec<Term>,
    /// Variables beyond outputs and inputs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    signals: Vec<Signal>,
    substeps: usize,
}

/// Structure of a model of equations. (Its fields are those of [`Library`]: flattening would let unknown ones pass.)
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Structure {
    terms: Vec<Term>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    signals: Vec<Signal>,
    substeps: usize,
    /// How sessions learn on the way; with it stands a tensor `root`, `terms x terms`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    learning: Option<BlendSettings>,
}

impl Library {
    pub(super) fn of(equations: &Equations) -> Self {
        let (terms, signals) = (equations.terms().to_vec(), equations.signals().to_vec());
        Self { terms, signals, substeps: equations.substeps() }
    }

    /// The equations, with their coefficients from the file.
    pub(super) fn read(self, tensors: &SafeTensors<'_>, of: &Description) -> Result<Equations, String> {
        let (outputs, inputs) = (of.outputs.len(), of.inputs.len());
        let coefficients = numbers(tensors, COEFFICIENTS, &[outputs, self.terms.len()])?;
        let Self { terms, signals, substeps } = self;
        Equations::with_signals(terms, coefficients, outputs, inputs, signals, of.dt, substeps)
            .map_err(|e: EquationsError| e.to_string())
    }
}

/// The tensor of the coefficients.
pub(super) fn coefficients(equations: &Equations) -> Written {
    write(COEFFICIENTS, vec![equations.outputs(), equations.terms().len()], equations.coefficients())
}

impl Structure {
    /// Structure and tensors of a model of equations.
    pub(super) fn write(model: &Model, equations: &Equations) -> Result<(Self, Vec<Written>), String> {
        let Library { terms, signals, substeps } = Library::of(equations);
        let count = terms.len();
        let learning = model.learning.as_ref().map(|learning| learning.settings.clone());
        let mut tensors = vec![coefficients(equations)];
        if !model.members.is_empty() {
            let (places, values) = model.members.parts();
            let width = places.len();
            let places: Vec<u32> = places
                .iter()
                .map(|&place| u32::try_from(place))
                .collect::<Result<_, _>>()
                .map_err(|e| e.to_string())?;
            let places = places.iter().flat_map(|place| place.to_le_bytes()).collect();
            tensors.push(write(MEMBERS, vec![model.members.len(), width], values));
            tensors.push((PLACES.to_owned(), Dtype::U32, vec![width], places));
        }
        if let Some(learning) = &model.learning {
            tensors.push(write(ROOT, vec![count, count], &learning.root));
        }
        Ok((Self { terms, signals, substeps, learning }, tensors))
    }

    /// The model, with its numbers from the file.
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let Self { terms, signals, substeps, learning } = self;
        let count = terms.len();
        let equations = Library { terms, signals, substeps }.read(tensors, &description)?;
        let learning = match learning {
            Some(settings) => Some(Learning { settings, root: numbers(tensors, ROOT, &[count, count])? }),
            None => None,
        };
        let members = members(tensors, equations.coefficients().len())?;
        let model = Model { description, body: Body::Equations(Arc::new(equations)), members, learning };
        if let (Some(learning), Some(motion)) = (&model.learning, model.equations()) {
            motion.blended(learning).map_err(|e| e.to_string())?;
        }
        Ok(model)
    }
}

/// The ensemble, if the file has one.
fn members(tensors: &SafeTensors<'_>, count: usize) -> Result<Members, String> {
    let (values, places) = match (tensors.tensor(MEMBERS), tensors.tensor(PLACES)) {
        (Ok(values), Ok(places)) => (values, places),
        (Err(_), Err(_)) => return Ok(Members::default()),
        _ => return Err(format!("of '{MEMBERS}' and '{PLACES}' it has one tensor alone")),
    };
    let (&[members, width], &[length]) = (values.shape(), places.shape()) else {
        return Err(String::from("its ensemble is no table"));
    };
    if places.dtype() != Dtype::U32 || length != width || !(1..=MOST_MEMBERS).contains(&members) {
        return Err(format!(
            "its ensemble has {members} members of {width} coefficients and {length} places (at most {MOST_MEMBERS} members)"
        ));
    }
    let values = numbers(tensors, MEMBERS, &[members, width])?;
    let (chunks, _) = places.data().as_chunks::<4>();
    let places: Vec<u32> = chunks.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    Members::from_parts(&places, values, count)
}
