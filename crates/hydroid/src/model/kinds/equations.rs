//! Sparse equations. File: `coefficients` (outputs x terms, physical units), ensemble, prior `r_factor` (terms x
//! terms).

use std::sync::Arc;

use hydroid_core::adapt::{Adapter, ExpertMixtureOptions};
use hydroid_core::control::AffineEquations;
use hydroid_core::model::sparse::{Equations, EquationsError, EquationsSession, Signal, Term};
use hydroid_core::predict::Predictor;
use safetensors::tensor::SafeTensors;
use serde::{Deserialize, Serialize};

use super::{Body, Encoded, InvertibleModel, Kind, NotInvertible, WeightMap};
use crate::key::key;
use crate::model::file::{Tensor, ensemble, numbers, tensor};
use crate::model::{Description, Learning, Model};

const COEFFICIENTS: &str = "coefficients";
/// Tensor of the prior of an expert mixture.
const R_FACTOR: &str = "r_factor";

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Library {
    terms: Vec<Term>,
    /// Variables beyond outputs and inputs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    signals: Vec<Signal>,
    substeps: usize,
}

/// Repeats the fields of [`Library`], because `flatten` would accept unknown fields.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::model) struct Structure {
    terms: Vec<Term>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    signals: Vec<Signal>,
    substeps: usize,
    /// Options of the expert mixture; its prior is the tensor `r_factor`, `terms x terms`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    learning: Option<ExpertMixtureOptions>,
}

impl Library {
    pub(super) fn of(equations: &Equations) -> Self {
        let (terms, signals) = (equations.terms().to_vec(), equations.signals().to_vec());
        Self { terms, signals, substeps: equations.substeps() }
    }

    pub(super) fn read(self, tensors: &SafeTensors<'_>, of: &Description) -> Result<Equations, String> {
        let (outputs, inputs) = (of.outputs.len(), of.inputs.len());
        let coefficients = numbers(tensors, COEFFICIENTS, &[outputs, self.terms.len()])?;
        let Self { terms, signals, substeps } = self;
        Equations::with_signals(terms, coefficients, outputs, inputs, signals, of.dt, substeps)
            .map_err(|e: EquationsError| e.to_string())
    }
}

pub(super) fn coefficients(equations: &Equations) -> Tensor {
    tensor(COEFFICIENTS, vec![equations.outputs(), equations.terms().len()], equations.coefficients())
}

impl Structure {
    pub(super) fn read(self, tensors: &SafeTensors<'_>, description: Description) -> Result<Model, String> {
        let Self { terms, signals, substeps, learning } = self;
        let count = terms.len();
        let equations = Library { terms, signals, substeps }.read(tensors, &description)?;
        let learning = match learning {
            Some(settings) => {
                Some(Learning { settings, r_factor: numbers(tensors, R_FACTOR, &[count, count])? })
            }
            None => None,
        };
        let members = ensemble::read(tensors, equations.coefficients().len())?;
        let model = Model { description, body: Body::Equations(Arc::new(equations)), members, learning };
        if let (Some(learning), Some(motion)) = (&model.learning, model.equations()) {
            motion.expert_mixture(learning).map_err(|e| e.to_string())?;
        }
        Ok(model)
    }
}

impl Kind for Arc<Equations> {
    fn name(&self, model: &Model) -> &'static str {
        if model.learning.is_some() { "recursive_equations" } else { "sparse_equations" }
    }

    fn title(&self, model: &Model) -> &'static str {
        if model.learning.is_some() {
            "Sparse equations of motion with online adaptation"
        } else {
            "Sparse equations of motion"
        }
    }

    fn weights(&self) -> usize {
        self.active_terms()
    }

    fn session(&self, model: &Model) -> Box<dyn Predictor> {
        match self.learning_session(model) {
            Some(session) => session,
            None => Box::new(EquationsSession::new(Self::clone(self))),
        }
    }

    fn learning_session(&self, model: &Model) -> Option<Box<dyn Adapter>> {
        // The options were checked when the model was made.
        let session = model.named(self).expert_mixture(model.learning.as_ref()?).ok()?;
        Some(Box::new(session))
    }

    fn encode(&self, model: &Model) -> Result<Encoded, String> {
        let Library { terms, signals, substeps } = Library::of(self);
        let count = terms.len();
        let learning = model.learning.as_ref().map(|learning| learning.settings.clone());
        let mut tensors = vec![coefficients(self)];
        tensors.extend(ensemble::write(&model.members)?);
        if let Some(learning) = &model.learning {
            tensors.push(tensor(R_FACTOR, vec![count, count], &learning.r_factor));
        }
        let structure = Structure { terms, signals, substeps, learning };
        Ok(Encoded::Tensors(super::Structure::SparseEquations(structure), tensors))
    }

    fn ensemble_numbers(&self) -> usize {
        self.coefficients().len()
    }

    fn member_session(&self, coefficients: Vec<f64>) -> Option<Box<dyn Predictor>> {
        let member = Equations::with_signals(
            self.terms().to_vec(),
            coefficients,
            self.outputs(),
            self.inputs(),
            self.signals().to_vec(),
            self.dt(),
            self.substeps(),
        );
        Some(Box::new(EquationsSession::new(Self::new(member.ok()?))))
    }

    fn invert(&self, model: &Model, motion: [usize; 3]) -> Result<InvertibleModel, NotInvertible> {
        AffineEquations::new(self, motion).map(|affine| InvertibleModel::Equations(Box::new(affine))).map_err(
            |error| {
                let description = &model.description;
                let ports = description.outputs.iter().chain(&description.inputs);
                let mut names: Vec<String> = ports.map(|port| port.channel.name.clone()).collect();
                let signals: Vec<String> =
                    self.signals().iter().map(|signal| signal.name(&names, description.dt)).collect();
                names.extend(signals);
                let remedy = format!(
                    ", or identify with terms that have one function of each command ({}, or {} for each)",
                    key("for_control"),
                    key("terms")
                );
                NotInvertible::NotAffine(error.with_names(&names), remedy)
            },
        )
    }

    fn weight_map(&self) -> Option<WeightMap> {
        Some(WeightMap::equations(self))
    }
}
