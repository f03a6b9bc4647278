//! A model as a state space: functions of the [graph](crate::graph) for start, step, measurement and output.
//!
//! ```text
//! x_0     = start(y, c)          steady motion: outputs y, and the command c held for a long time
//! x_{k+1} = step(x_k, c_k)       the command is held over a sample of dt seconds
//! x_k     = observe(x_k, y_k)    measured outputs; a NaN is a missing value, for which the prediction stays
//! y_k     = output(x_k)
//! ```
//!
//! The weights are constant. Outputs are those of the motion that the model predicts: through the water, if the model was
//! identified with an estimate of the current. Between two measurements, predictions are those of a rollout
//! ([`Predictor::rollout`](hydroid_core::predict::Predictor::rollout)) from the last one.

mod affine;
pub(crate) mod committee;
mod craft;
mod direct;
pub(crate) mod equations;
pub(crate) mod network;
mod rate_limits;
pub(crate) mod recurrent;

use hydroid::model::{Body, Model};
use hydroid_core::vessel::Number as _;

use crate::graph::{Builder, Function, Module, Scalar, Vector};

/// A number of the state: name and unit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Label {
    pub(crate) name: String,
    pub(crate) unit: String,
}

impl Label {
    fn new(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { name: name.into(), unit: unit.into() }
    }
}

/// Indices of the functions of a model in its module. Arguments: `state`, `command`, `outputs`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct StateSpace {
    pub(crate) module: Module,
    /// The numbers of the state.
    pub(crate) state: Vec<Label>,
    /// `(outputs, command) -> state`.
    pub(crate) start: usize,
    /// `(state, command) -> state`.
    pub(crate) step: usize,
    /// `(state, outputs) -> state`.
    pub(crate) observe: usize,
    /// `(state) -> outputs`.
    pub(crate) output: usize,
    /// `(state, command) -> rates of the state`; none for a model in discrete time.
    pub(crate) rates: Option<usize>,
    /// Functions of a model that predicts several samples at once.
    pub(crate) block: Option<Block>,
}

/// Functions of a model that predicts a horizon of samples at once. Commands and outputs are rows, one after the other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Block {
    /// Samples of the horizon.
    pub(crate) horizon: usize,
    /// `(state, commands) -> outputs`.
    pub(crate) predict: usize,
    /// `(state, commands, outputs) -> state` at the end of the horizon.
    pub(crate) follow: usize,
}

/// Sizes and names of a model.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    outputs: usize,
    inputs: usize,
    dt: f64,
}

impl Sizes {
    fn of(model: &Model) -> Self {
        let d = &model.description;
        Self { outputs: d.outputs.len(), inputs: d.inputs.len(), dt: d.dt }
    }
}

/// Names of the outputs and inputs of a model.
pub(crate) struct Channels {
    outputs: Vec<Label>,
    inputs: Vec<Label>,
}

impl Channels {
    pub(crate) fn of(model: &Model) -> Self {
        let labels = |ports: &[hydroid::model::Port]| {
            ports.iter().map(|port| Label::new(&port.channel.name, &port.channel.unit)).collect()
        };
        Self { outputs: labels(&model.description.outputs), inputs: labels(&model.description.inputs) }
    }

    /// Outputs, then inputs.
    fn all(&self) -> Vec<Label> {
        self.outputs.iter().chain(&self.inputs).cloned().collect()
    }
}

impl StateSpace {
    /// The state space of a model with constant weights.
    pub(crate) fn of(model: &Model) -> Self {
        let frozen = model.frozen();
        let channels = Channels::of(&frozen);
        let sizes = Sizes::of(&frozen);
        let space = match &frozen.body {
            Body::Equations(equations) => equations::state_space(equations, &channels),
            Body::Recurrent(recurrent) => recurrent::state_space(recurrent, sizes, &channels),
            Body::Direct(direct) => direct::state_space(direct, &channels),
            Body::Affine(affine) => affine::state_space(affine, &channels),
            Body::Committee(committee) => committee::state_space(committee, &channels),
            Body::Craft(craft) => craft::state_space(&craft.model),
        };
        space.behind_limits(model).0
    }

    /// The state space behind the limits of the rates of the model: the positions come first in the state. The index is that of
    /// the function `(positions, command) -> positions`; none without a limit.
    pub(crate) fn behind_limits(self, model: &Model) -> (Self, Option<usize>) {
        let rates: Vec<Option<f64>> = model.description.inputs.iter().map(|port| port.rate_limit).collect();
        rate_limits::behind(self, &rates, Sizes::of(model), &Channels::of(model))
    }

    /// Indices of the functions that the model needs, each behind those that it calls.
    pub(crate) fn functions(&self) -> Vec<usize> {
        let block = self.block.iter().flat_map(|block| [block.predict, block.follow]);
        let roots = [self.start, self.step, self.observe, self.output];
        self.needed(&roots.into_iter().chain(self.rates).chain(block).collect::<Vec<_>>())
    }

    /// Indices of functions and of those that they call, each behind those that it calls.
    pub(crate) fn needed(&self, roots: &[usize]) -> Vec<usize> {
        let mut needed = vec![false; self.module.functions.len()];
        for &index in roots {
            needed[index] = true;
        }
        for index in (0..needed.len()).rev() {
            if needed[index] {
                let called = self.function(index).nodes.iter().filter_map(|node| node.op.called());
                called.for_each(|index| needed[index] = true);
            }
        }
        (0..needed.len()).filter(|&index| needed[index]).collect()
    }

    /// The function at an index.
    pub(crate) fn function(&self, index: usize) -> &Function {
        &self.module.functions[index]
    }

    pub(crate) fn outputs(&self) -> usize {
        self.function(self.output).len()
    }

    pub(crate) fn inputs(&self) -> usize {
        self.function(self.step).arguments[1].len
    }
}

/// `observe` and `output` of a state that begins with the outputs: measured values replace them.
fn outputs_first(module: &mut Module, outputs: usize, state: usize) -> [usize; 2] {
    let b = Builder::new();
    let (x, y) = (b.argument("state", state), b.argument("outputs", outputs));
    let measured = y.or(x.slice(0, outputs));
    let next = b.concat(&[measured, x.slice(outputs, state - outputs)]);
    let observe = module.add(b.finish("observe", "State after a measurement of the outputs", next));
    [observe, output(module, 0, outputs, state)]
}

/// The function of the outputs, which are a part of the state.
fn output(module: &mut Module, first: usize, outputs: usize, state: usize) -> usize {
    let b = Builder::new();
    let x = b.argument("state", state);
    module.add(b.finish("output", "Outputs in a state", x.slice(first, outputs)))
}

/// `x + h/6 (k1 + 2 k2 + 2 k3 + k4)` with the rates `f(stage, x)` of the classical Runge-Kutta method of order 4.
fn rk4<'a>(b: &'a Builder, x: Vector<'a>, h: f64, f: impl Fn(usize, Vector<'a>) -> Vector<'a>) -> Vector<'a> {
    let factor = |value: f64| b.constant(&[value]);
    let along = |k: Vector<'a>, step: f64| x + factor(step) * k;
    let k1 = f(0, x);
    let k2 = f(1, along(k1, 0.5 * h));
    let k3 = f(2, along(k2, 0.5 * h));
    let k4 = f(3, along(k3, h));
    x + factor(h / 6.0) * (k1 + factor(2.0) * k2 + factor(2.0) * k3 + k4)
}

/// The exact step of a first-order lag to a held command, `c + (a - c) decay`.
fn lag<'a>(a: Scalar<'a>, c: Scalar<'a>, decay: f64) -> Scalar<'a> {
    c + (a - c) * Scalar::constant(decay)
}
