//! A recurrent network whose weights are arguments: for models that learn.

use std::ops::Range;

use hydroid_core::model::recurrent::{Cell, LayerLayout, Layout, Network};

use crate::graph::{Builder, Function, Module, Unary, Vector};

/// Functions of a network, in its scaled units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NetworkFunctions {
    /// `f`: `(hidden, input, weights) -> hidden` after a sample.
    pub(crate) transition: usize,
    /// `g`: `(hidden, weights) -> output`.
    pub(crate) observation: usize,
}

impl NetworkFunctions {
    pub(super) fn add(module: &mut Module, network: &Network) -> Self {
        Self { transition: module.add(transition(network)), observation: module.add(observation(network)) }
    }
}

/// A part of the weights.
fn part<'a>(weights: Vector<'a>, range: &Range<usize>) -> Vector<'a> {
    weights.slice(range.start, range.len())
}

/// `W_ih x + b_ih` and `W_hh h + b_hh` of all gates of a layer.
fn gates<'a>(layer: &LayerLayout, weights: Vector<'a>, x: Vector<'a>, h: Vector<'a>) -> [Vector<'a>; 2] {
    let part = |range| part(weights, range);
    [
        part(&layer.weight_ih).product(x) + part(&layer.bias_ih),
        part(&layer.weight_hh).product(h) + part(&layer.bias_hh),
    ]
}

fn transition(network: &Network) -> Function {
    let layout = Layout::new(network);
    let b = Builder::new();
    let hidden = b.argument("hidden", network.state_len());
    let input = b.argument("input", network.inputs);
    let weights = b.argument("weights", network.weights());
    let next = match network.cell {
        Cell::Gru { hidden: n } => {
            let [of_x, of_h] = gates(&layout.layers[0], weights, input, hidden);
            let gate = |at: usize| (of_x.slice(at * n, n) + of_h.slice(at * n, n)).unary(Unary::Logistic);
            let (reset, update) = (gate(0), gate(1));
            let fresh = (of_x.slice(2 * n, n) + reset * of_h.slice(2 * n, n)).unary(Unary::Tanh);
            fresh + update * (hidden - fresh)
        }
        Cell::Lstm { hidden: n, .. } => {
            let (c, h) = (hidden.slice(0, n), hidden.slice(n, hidden.len() - n));
            let [of_x, of_h] = gates(&layout.layers[0], weights, input, h);
            let gate = |at: usize| of_x.slice(at * n, n) + of_h.slice(at * n, n);
            let [keep_new, keep_old, shows] = [0, 1, 3].map(|at| gate(at).unary(Unary::Logistic));
            let c = keep_old * c + keep_new * gate(2).unary(Unary::Tanh);
            let m = shows * c.unary(Unary::Tanh);
            let shown = match &layout.projection {
                Some(at) => part(weights, at).product(m),
                None => m,
            };
            b.concat(&[c, shown])
        }
        Cell::Vanilla { hidden: n, .. } => {
            let (mut x, mut parts) = (input, Vec::new());
            for (index, layer) in layout.layers.iter().enumerate() {
                let [of_x, of_h] = gates(layer, weights, x, hidden.slice(index * n, n));
                x = (of_x + of_h).unary(Unary::Tanh);
                parts.push(x);
            }
            b.concat(&parts)
        }
    };
    b.finish("transition", "Hidden state of the network after a sample", next)
}

fn observation(network: &Network) -> Function {
    let layout = Layout::new(network);
    let b = Builder::new();
    let hidden = b.argument("hidden", network.state_len());
    let weights = b.argument("weights", network.weights());
    let shown = hidden.slice_last(network.cell.shown());
    let output = match &layout.read_out {
        Some((matrix, bias)) => part(weights, matrix).product(shown) + part(weights, bias),
        None => shown,
    };
    b.finish("observation", "Output of the network in a hidden state", output)
}
