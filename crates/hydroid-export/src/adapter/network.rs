//! Recurrent networks that learn by an extended Kalman filter over hidden state and weights.
//!
//! The filter needs the rows of the Jacobians of transition and observation with respect to hidden state and weights. They
//! are vector-Jacobian products with unit vectors.

use std::sync::Arc;

use hydroid::adapt::{CovarianceForm, Options, network_filter_options};
use hydroid::model::Model;
use hydroid_core::adapt::kalman::FilterOptions;
use hydroid_core::model::recurrent::Recurrent;

use super::{Adapter, Method};
use crate::ExportError;
use crate::graph::{Function, vector_jacobian_product};
use crate::state_space::recurrent::{self, Learning, Outputs};

/// A network that learns.
#[derive(Clone, Debug)]
pub(crate) struct NetworkLearner {
    pub(crate) options: FilterOptions,
    pub(crate) network: Arc<Recurrent>,
    /// `(state, command) -> input` of the network.
    pub(crate) input: usize,
    /// `(state, command) -> outputs` after a sample, without the correction by the network.
    pub(crate) base: usize,
    pub(crate) outputs: Outputs,
    /// `(hidden, input, weights) -> hidden` after a sample.
    pub(crate) transition: usize,
    /// `(hidden, weights) -> output` of the network.
    pub(crate) observation: usize,
    /// `(hidden, input, weights, v) -> v' [df/dh df/dtheta]`.
    pub(crate) of_transition: usize,
    /// `(hidden, weights, v) -> v' [dg/dh dg/dtheta]`.
    pub(crate) of_observation: usize,
}

impl NetworkLearner {
    /// Adds the derivatives to the functions of a network that learns.
    fn new(network: Arc<Recurrent>, learning: &mut Learning, options: FilterOptions) -> Self {
        let space = &mut learning.space;
        let functions = learning.network;
        let mut derivative = |of: usize, arguments: &[usize], name: &'static str, about: &'static str| {
            let of: &Function = space.function(of);
            let product = vector_jacobian_product(of, arguments, name, about);
            space.module.add(product)
        };
        Self {
            of_transition: derivative(
                functions.transition,
                &[0, 2],
                "transition_jacobian",
                "The adjoint times the derivatives of the next hidden state by hidden state and weights",
            ),
            of_observation: derivative(
                functions.observation,
                &[0, 1],
                "observation_jacobian",
                "The adjoint times the derivatives of the output by hidden state and weights",
            ),
            transition: functions.transition,
            observation: functions.observation,
            input: learning.input,
            base: learning.base,
            outputs: learning.outputs,
            options,
            network,
        }
    }

    /// Length of the hidden state.
    pub(crate) fn hidden(&self) -> usize {
        self.network.network.state_len()
    }

    /// Functions that the filter calls.
    pub(crate) fn functions(&self) -> Vec<usize> {
        let of_outputs = match self.outputs {
            Outputs::OfHidden(shown) => shown,
            Outputs::Read { wait } => wait,
        };
        vec![self.input, self.base, self.observation, self.of_transition, self.of_observation, of_outputs]
    }
}

pub(super) fn adapter(
    model: &Model,
    network: &Arc<Recurrent>,
    options: &Options,
) -> Result<Adapter, ExportError> {
    let unsupported = |reason: &str, remedy: &str| ExportError::Unsupported {
        model: model.title(),
        format: "C with an adapter",
        reason: reason.to_owned(),
        remedy: remedy.to_owned(),
    };
    if options.kalman.rehearsal.is_some() {
        return Err(unsupported(
            "rehearsal needs windows of the training data",
            "export it without rehearsal",
        ));
    }
    if options.kalman.covariance != CovarianceForm::Full {
        return Err(unsupported(
            "the filter in C has the full covariance of the weights",
            "export it with the covariance full, or train a network with fewer cells",
        ));
    }
    let filter = network_filter_options(model, network, &options.kalman)?;
    let mut learning = recurrent::learning(network, model);
    let learner = NetworkLearner::new(Arc::clone(network), &mut learning, filter);
    let (space, limit) = learning.space.behind_limits(model);
    let (weights, method) = (network.weights.len(), Method::Network(Box::new(learner)));
    Ok(Adapter { space, weights, limit, method })
}
