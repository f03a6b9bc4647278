//! Equations that learn.

use std::sync::Arc;

use hydroid::adapt::{AdaptError, Options, recursive_options};
use hydroid::model::Model;
use hydroid_core::adapt::EquationsConstants;
use hydroid_core::model::sparse::Equations;

use super::{Adapter, Method};
use crate::ExportError;
use crate::graph::{Builder, Scalar, Vector};
use crate::state_space::{Channels, equations};

/// Equations that learn.
#[derive(Clone, Debug)]
pub(crate) struct EquationsLearner {
    pub(crate) constants: EquationsConstants,
    /// The weights at the start.
    pub(crate) initial: Vec<f64>,
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
    /// Number of variables: outputs, inputs, signals.
    pub(crate) variables_len: usize,
    /// `(state, command) -> variables`.
    pub(crate) variables: usize,
    /// `(variables at the start of an interval, variables at its end) -> scaled terms` in its middle.
    pub(crate) library: usize,
    pub(crate) dt: f64,
}

pub(super) fn adapter(model: &Model, of: &Arc<Equations>, options: &Options) -> Result<Adapter, ExportError> {
    let recursive = recursive_options(model, &options.least_squares)?;
    let motion = model.equations().ok_or_else(|| super::refusal(model))?;
    let session = motion.learner(&recursive).map_err(AdaptError::Options)?;
    let constants = session.constants();
    let (mut space, lowered) = equations::learning(of, &Channels::of(model), &constants.places);

    let b = Builder::new();
    let len = constants.holds.len();
    let (start, end) = (b.argument("start", len), b.argument("end", len));
    let middle: Vec<Scalar<'_>> = constants
        .holds
        .iter()
        .enumerate()
        .map(|(v, holds)| if *holds { start.at(v) } else { (start.at(v) + end.at(v)) * 0.5 })
        .collect();
    let terms = constants.terms.iter().zip(&constants.scales);
    let scaled: Vec<Vector<'_>> =
        terms.map(|(term, scale)| b.vector_of(equations::term(term, &middle) * (1.0 / scale))).collect();
    let about = "Scaled terms in the middle of an interval";
    let library = space.module.add(b.finish("library", about, b.concat(&scaled)));

    let weights = constants.places.len();
    let learner = EquationsLearner {
        initial: constants.places.iter().map(|&place| of.coefficients()[place]).collect(),
        outputs: of.outputs(),
        inputs: of.inputs(),
        variables_len: len,
        variables: lowered.variables,
        library,
        dt: of.dt(),
        constants,
    };
    let (space, limit) = space.behind_limits(model);
    Ok(Adapter { space, weights, limit, method: Method::Equations(Box::new(learner)) })
}
