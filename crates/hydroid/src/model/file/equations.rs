//! Sparse equations in a file: `coefficients` (outputs x terms) in physical units, the members of an ensemble, and what
//! equations that learn begin with.

use std::sync::Arc;

use hydroid_core::adapt::BlendSettings;
use hydroid_core::model::sparse::{Equations, EquationsError, Signal, Term};
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::super::{Body, Description, Learning, Model};
use super::members;
use super::tensors::{Written, numbers, write};

/// Tensor of the coefficients, `outputs x terms`.
const COEFFICIENTS: &str = "coefficients";
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
        tensors.extend(members::write(&model.members)?);
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
        let members = members::read(tensors, equations.coefficients().len())?;
        let model = Model { description, body: Body::Equations(Arc::new(equations)), members, learning };
        if let (Some(learning), Some(motion)) = (&model.learning, model.equations()) {
            motion.blended(learning).map_err(|e| e.to_string())?;
        }
        Ok(model)
    }
}
