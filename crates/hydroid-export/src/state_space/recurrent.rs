//! Recurrent networks.

use hydroid::model::Model;
use hydroid_core::model::recurrent::{BaseModel, Cell, Layout, Recurrent, Scaling};
use hydroid_core::model::sparse::Equations;

use super::equations::{self, Lowered};
use super::network::NetworkFunctions;
use super::{Channels, Label, Sizes, StateSpace, outputs_first};
use crate::graph::{self, Builder, Function, Matrix, Module, Unary, Vector};

/// Values of a slice of the weights as a matrix.
pub(super) fn matrix(weights: &[f64], rows: usize, columns: usize) -> Matrix {
    Matrix { rows, columns, numbers: weights.to_vec() }
}

/// `(x - mean) / scale`, element by element.
pub(super) fn scaled<'a>(b: &'a Builder, x: Vector<'a>, mean: &[f64], scale: &[f64]) -> Vector<'a> {
    (x - b.constant(mean)) / b.constant(scale)
}

/// The network over a sample: `[new state, output]`.
fn network<'a>(b: &'a Builder, model: &Recurrent, hidden: Vector<'a>, x: Vector<'a>) -> [Vector<'a>; 2] {
    let network = &model.network;
    let layout = Layout::new(network);
    let w = &model.weights;
    let mut shown = x;
    let mut parts = Vec::new();
    for (index, layer) in layout.layers.iter().enumerate() {
        let cell = graph::Cell {
            weight_ih: matrix(&w[layer.weight_ih.clone()], layer.rows, layer.reads),
            weight_hh: matrix(&w[layer.weight_hh.clone()], layer.rows, layer.shown),
            bias_ih: w[layer.bias_ih.clone()].to_vec(),
            bias_hh: w[layer.bias_hh.clone()].to_vec(),
        };
        match network.cell {
            Cell::Gru { hidden: cells } => {
                shown = shown.gru(cell, hidden.slice(0, cells));
                parts.push(shown);
            }
            Cell::Lstm { hidden: cells, .. } => {
                let (c, h) = (hidden.slice(0, cells), hidden.slice(cells, layer.shown));
                let both = shown.lstm(cell, c, h);
                let m = both.slice(cells, cells);
                shown = match &layout.projection {
                    Some(at) => m.affine(matrix(&w[at.clone()], layer.shown, cells), vec![0.0; layer.shown]),
                    None => m,
                };
                parts.extend([both.slice(0, cells), shown]);
            }
            Cell::Vanilla { hidden: cells, .. } => {
                let h = hidden.slice(index * cells, cells);
                let of_input = shown.affine(cell.weight_ih, cell.bias_ih);
                shown = (of_input + h.affine(cell.weight_hh, cell.bias_hh)).unary(Unary::Tanh);
                parts.push(shown);
            }
        }
    }
    let output = match &layout.read_out {
        Some((matrix_at, bias_at)) => shown
            .affine(matrix(&w[matrix_at.clone()], network.outputs, shown.len()), w[bias_at.clone()].to_vec()),
        None => shown,
    };
    [b.concat(&parts), output]
}

/// A model while it is translated.
struct Lowering<'m> {
    model: &'m Recurrent,
    sizes: Sizes,
    base: Option<(&'m Equations, Lowered)>,
    /// Functions of a network that learns: its weights come last in the state.
    learned: Option<NetworkFunctions>,
}

impl<'m> Lowering<'m> {
    fn new(module: &mut Module, model: &'m Recurrent, sizes: Sizes, channels: &Channels) -> Self {
        let base = match &model.base {
            BaseModel::Equations(equations) => {
                let lowered = equations::lower(module, equations, &channels.all(), &[]);
                Some((&**equations, lowered))
            }
            BaseModel::Nothing | BaseModel::Hold => None,
        };
        Self { model, sizes, base, learned: None }
    }

    /// Numbers of the state in front of the hidden state: outputs, and the memory of the equations.
    fn front(&self) -> usize {
        self.base.as_ref().map_or(self.sizes.outputs, |(equations, _)| equations.state_len())
    }

    fn hidden(&self) -> usize {
        self.model.network.state_len()
    }

    fn weights(&self) -> usize {
        if self.learned.is_some() { self.model.weights.len() } else { 0 }
    }

    fn states(&self) -> usize {
        self.front() + self.hidden() + self.weights()
    }

    /// Arguments `state` and `command`.
    fn arguments<'a>(&self, b: &'a Builder) -> [Vector<'a>; 2] {
        [b.argument("state", self.states()), b.argument("command", self.sizes.inputs)]
    }

    /// The input of the network.
    fn input<'a>(&self, b: &'a Builder, x: Vector<'a>, c: Vector<'a>) -> Vector<'a> {
        let Scaling { output_mean, output_scale, input_mean, input_scale, .. } = &self.model.scaling;
        let mut read = vec![scaled(b, c, input_mean, input_scale)];
        if self.model.feedback {
            read.push(scaled(b, x.slice(0, self.sizes.outputs), output_mean, output_scale));
        }
        b.concat(&read)
    }

    /// The network over a sample: `[new state, output]`.
    fn network<'a>(&self, b: &'a Builder, x: Vector<'a>, input: Vector<'a>) -> [Vector<'a>; 2] {
        let hidden = x.slice(self.front(), self.hidden());
        match &self.learned {
            Some(functions) => {
                let weights = x.slice_last(self.weights());
                let next = b.call(functions.transition, self.hidden(), &[hidden, input, weights]);
                [next, b.call(functions.observation, self.sizes.outputs, &[next, weights])]
            }
            None => network(b, self.model, hidden, input),
        }
    }

    /// The numbers in front of the hidden state after a sample, without the correction by the network.
    fn moved<'a>(&self, b: &'a Builder, x: Vector<'a>, c: Vector<'a>) -> Vector<'a> {
        match (&self.base, &self.model.base) {
            (Some((_, lowered)), _) => b.call(lowered.step, self.front(), &[x.slice(0, self.front()), c]),
            (None, BaseModel::Hold) => x.slice(0, self.sizes.outputs),
            (None, _) => b.constant(&self.model.scaling.output_mean),
        }
    }

    fn step(&self) -> Function {
        let b = Builder::new();
        let [x, c] = self.arguments(&b);
        let [next, output] = self.network(&b, x, self.input(&b, x, c));
        let correction = b.constant(&self.model.scaling.correction_scale) * output;
        let (n, moved) = (self.sizes.outputs, self.moved(&b, x, c));
        let memory = moved.slice(n, moved.len() - n);
        let next = b.concat(&[moved.slice(0, n) + correction, memory, next, x.slice_last(self.weights())]);
        b.finish("step", "State after a sample with the command held", next)
    }

    /// The state after the warm-up of a session in a steady motion.
    fn settled<'a>(&self, b: &'a Builder, settle: usize, [y, c]: [Vector<'a>; 2]) -> Vector<'a> {
        let rest = match &self.base {
            Some((equations, _)) => equations::steady(b, equations, y, c),
            None => y,
        };
        let weights = if self.learned.is_some() { &self.model.weights[..] } else { &[] };
        let first = b.concat(&[rest, b.constant(&vec![0.0; self.hidden()]), b.constant(weights)]);
        let of_base = self.base.as_ref().map_or(0, |(equations, _)| equations.warm_up() - 1);
        match self.model.wash_out.max(of_base) {
            0 => first,
            samples => b.repeat(settle, samples, &[first, c, y]),
        }
    }

    fn space(&self, mut module: Module, channels: &Channels) -> StateSpace {
        let Sizes { outputs: n, inputs: m, .. } = self.sizes;
        let states = self.states();
        let step = module.add(self.step());
        let [observe, output] = outputs_first(&mut module, n, states);

        // The hidden state settles under the command and the measured outputs.
        let b = Builder::new();
        let [x, c] = self.arguments(&b);
        let y = b.argument("outputs", n);
        let settled = b.call(observe, states, &[b.call(step, states, &[x, c]), y]);
        let settle = module.add(b.finish("settle", "State after a sample with measured outputs", settled));

        let b = Builder::new();
        let (y, c) = (b.argument("outputs", n), b.argument("command", m));
        let state = self.settled(&b, settle, [y, c]);
        let about = "State of a steady motion, with the hidden state settled";
        let start = module.add(b.finish("start", about, state));

        let mut labels = match &self.base {
            Some((_, lowered)) => lowered.state.clone(),
            None => channels.outputs.clone(),
        };
        labels.extend((0..self.hidden()).map(|i| Label::new(format!("hidden state {i}"), "1")));
        if self.learned.is_some() {
            let names = self.model.network.tensors().into_iter().flat_map(|tensor| {
                (0..tensor.len()).map(move |at| format!("weight {at} of {}", tensor.name))
            });
            labels.extend(names.map(|name| Label::new(name, "1")));
        }
        StateSpace { module, state: labels, start, step, observe, output, rates: None, block: None }
    }
}

pub(super) fn state_space(model: &Recurrent, sizes: Sizes, channels: &Channels) -> StateSpace {
    let mut module = Module::default();
    let lowering = Lowering::new(&mut module, model, sizes, channels);
    lowering.space(module, channels)
}

/// A network that learns. States are `[outputs, memory of a base, hidden state, weights]`.
#[derive(Clone, Debug)]
pub(crate) struct Learning {
    pub(crate) space: StateSpace,
    pub(crate) network: NetworkFunctions,
    /// `(state, command) -> input` of the network.
    pub(crate) input: usize,
    /// `(state, command) -> outputs` after a sample, without the correction by the network.
    pub(crate) base: usize,
    pub(crate) outputs: Outputs,
}

/// The outputs of a network that learns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outputs {
    /// They follow from the hidden state: `(state) -> outputs`.
    OfHidden(usize),
    /// The step reads them, so that it waits for their first measurement.
    Read {
        /// `(state, command) -> state` after a sample that begins with unknown outputs.
        wait: usize,
    },
}

/// The state space of a network with the weights in its state, and the parts of the step.
pub(crate) fn learning(recurrent: &Recurrent, model: &Model) -> Learning {
    let (channels, sizes) = (Channels::of(model), Sizes::of(model));
    let mut module = Module::default();
    let network = NetworkFunctions::add(&mut module, &recurrent.network);
    let mut lowering = Lowering::new(&mut module, recurrent, sizes, &channels);
    lowering.learned = Some(network);
    let mut space = lowering.space(module, &channels);
    let mut add = |function: Function| space.module.add(function);

    let b = Builder::new();
    let [x, c] = lowering.arguments(&b);
    let input = add(b.finish("input", "Scaled input of the network", lowering.input(&b, x, c)));

    let b = Builder::new();
    let [x, c] = lowering.arguments(&b);
    let moved = lowering.moved(&b, x, c).slice(0, sizes.outputs);
    let base = add(b.finish("base", "Outputs after a sample, without the correction by the network", moved));

    let outputs = match (&recurrent.base, recurrent.feedback) {
        (BaseModel::Nothing, false) => Outputs::OfHidden(add(lowering.of_hidden(network))),
        _ => Outputs::Read { wait: add(lowering.wait()) },
    };
    Learning { space, network, input, base, outputs }
}

impl Lowering<'_> {
    /// Correction of the base by the network in a state.
    fn correction<'a>(&self, b: &'a Builder, network: NetworkFunctions, x: Vector<'a>) -> Vector<'a> {
        let [hidden, weights] = [x.slice(self.front(), self.hidden()), x.slice_last(self.weights())];
        let output = b.call(network.observation, self.sizes.outputs, &[hidden, weights]);
        b.constant(&self.model.scaling.correction_scale) * output
    }

    fn of_hidden(&self, network: NetworkFunctions) -> Function {
        let b = Builder::new();
        let x = b.argument("state", self.states());
        let y = b.constant(&self.model.scaling.output_mean) + self.correction(&b, network, x);
        b.finish("shown", "Outputs of the network in a state", y)
    }

    fn wait(&self) -> Function {
        let b = Builder::new();
        let [x, c] = self.arguments(&b);
        let front = x.slice(0, self.front());
        let front = match &self.base {
            Some((equations, lowered)) => {
                let waited = b.call(lowered.wait, self.front(), &[front, c]);
                equations::with_known_lags(&b, equations, waited, c)
            }
            None => front,
        };
        let hidden = if self.model.feedback {
            x.slice(self.front(), self.hidden())
        } else {
            self.network(&b, x, self.input(&b, x, c))[0]
        };
        let next = b.concat(&[front, hidden, x.slice_last(self.weights())]);
        b.finish("wait", "State after a sample that begins with unknown outputs", next)
    }
}
