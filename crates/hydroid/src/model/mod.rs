//! Identified models: what they are, and their file.

mod file;

use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::predict::Predictor;
use serde::{Deserialize, Serialize};

use crate::evaluate::DesignRange;
use crate::log::{Channel, PrepareOptions, Selection};

pub use file::{ModelError, decode, read, write};

/// A model with all that is needed to use it on another log.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// What the numbers mean.
    pub description: Description,
    /// The numbers.
    pub body: Body,
}

/// What the numbers of a model mean; the JSON in the head of a model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Short name in tables and figures: `sindy`, `gru` ...
    pub name: String,
    /// Sample time \[s\].
    pub dt: f64,
    /// Outputs, in the order of the model.
    pub outputs: Vec<Port>,
    /// Inputs, in the order of the model.
    pub inputs: Vec<Port>,
    /// How a log's columns become the model's channels, so that another log is read in the same way.
    pub reading: Reading,
    /// Where the model comes from.
    pub provenance: Provenance,
}

/// How a log becomes runs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Reading {
    /// Which columns.
    pub selection: Selection,
    /// On which clock, and how commands are aligned with it.
    pub options: PrepareOptions,
}

/// A channel of a model and the range it is meant for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Port {
    /// Name and unit.
    pub channel: Channel,
    /// Range in which it was trained or is meant to work.
    pub range: DesignRange,
}

/// Where a model comes from: enough to make it again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Version of hydroid that made it.
    pub hydroid: String,
    /// Seed of the run.
    pub seed: u64,
    /// Runs that the coefficients or weights come from.
    pub training: Vec<String>,
    /// Runs that settings were chosen on.
    pub validation: Vec<String>,
    /// Settings that were chosen.
    pub settings: serde_json::Value,
}

/// The numbers of a model, by kind.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Sparse equations of motion.
    Equations(Arc<Equations>),
}

impl Model {
    /// The kind, as it stands in the file.
    pub fn kind(&self) -> &'static str {
        match self.body {
            Body::Equations(_) => "sparse_equations",
        }
    }

    /// Number of coefficients or weights that are not zero.
    pub fn weights(&self) -> usize {
        match &self.body {
            Body::Equations(equations) => equations.active_terms(),
        }
    }

    /// A session at the start of a run.
    pub fn session(&self) -> Box<dyn Predictor> {
        match &self.body {
            Body::Equations(equations) => Box::new(EquationsSession::new(Arc::clone(equations))),
        }
    }

    /// Design ranges of the outputs.
    pub fn output_ranges(&self) -> Vec<DesignRange> {
        self.description.outputs.iter().map(|port| port.range).collect()
    }
}
