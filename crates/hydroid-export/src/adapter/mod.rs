//! Models that learn along a run: a state space with the weights at the end of its state, and what the method needs.
//!
//! Methods and options are those of [`hydroid::adapt`], without the guard.

mod committee;
mod equations;
mod network;

use hydroid::adapt::{AdaptError, Method as MethodKind, Options};
use hydroid::key::key;
use hydroid::model::{Body, Model};

use crate::ExportError;
use crate::state_space::StateSpace;

pub(crate) use committee::MemberLearner;
pub(crate) use equations::EquationsLearner;
pub(crate) use network::NetworkLearner;

/// A model that learns.
#[derive(Clone, Debug)]
pub(crate) struct Adapter {
    /// The whole model. The state ends with the weights.
    pub(crate) space: StateSpace,
    pub(crate) weights: usize,
    /// The function `(positions, command) -> positions` of actuators with a limited rate, whose positions come first in the
    /// state. The functions of the method are those of the state behind them.
    pub(crate) limit: Option<usize>,
    pub(crate) method: Method,
}

/// How a model learns.
#[derive(Clone, Debug)]
pub(crate) enum Method {
    /// Recursive least squares of each member on averaged increments.
    Committee(Vec<MemberLearner>),
    /// Recursive least squares on increments over a window.
    Equations(Box<EquationsLearner>),
    /// An extended Kalman filter over hidden state and weights.
    Network(Box<NetworkLearner>),
}

impl Adapter {
    /// The adapter of a model.
    ///
    /// # Errors
    /// If the kind of model has no adapter in this form, or the options do not fit the model.
    pub(crate) fn of(model: &Model, options: &Options) -> Result<Self, ExportError> {
        match &model.body {
            Body::Committee(committee) => committee::adapter(model, committee),
            Body::Equations(equations) if options.method == MethodKind::LeastSquares => {
                equations::adapter(model, equations, options)
            }
            Body::Recurrent(recurrent) => network::adapter(model, recurrent, options),
            _ => Err(refusal(model)),
        }
    }

    /// Functions that the method calls.
    pub(crate) fn functions(&self) -> Vec<usize> {
        let of_method = match &self.method {
            Method::Committee(members) => members.iter().map(|member| member.increment).collect(),
            Method::Equations(learner) => vec![learner.variables, learner.library],
            Method::Network(learner) => learner.functions(),
        };
        self.limit.into_iter().chain(of_method).collect()
    }

    /// Place of the state of the model behind the positions of its actuators.
    pub(crate) fn behind_positions(&self) -> usize {
        if self.limit.is_some() { self.space.inputs() } else { 0 }
    }

    /// Place of the weights in the state.
    pub(crate) fn first_weight(&self) -> usize {
        self.space.state.len() - self.weights
    }
}

/// The error for a model without an adapter in this form.
fn refusal(model: &Model) -> ExportError {
    match hydroid::adapt::adaptable(model) {
        Err(error @ AdaptError::Kind { .. }) => ExportError::Adapt(error),
        _ => ExportError::Unsupported {
            model: model.title(),
            format: "C with an adapter",
            reason: String::from("its adapter is not written in C"),
            remedy: format!(
                "export it without {}, or use the C library of hydroid, which has all adapters",
                key("adapter")
            ),
        },
    }
}
