//! Recurrent networks.

use hydroid_core::model::recurrent::{BaseModel, Cell, Layout, Recurrent, Scaling};

use super::{Channels, Label, Sizes, StateSpace, equations, outputs_first};
use crate::graph::{self, Builder, Matrix, Module, Unary, Vector};

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

pub(super) fn state_space(model: &Recurrent, sizes: Sizes, channels: &Channels) -> StateSpace {
    let Sizes { outputs: n, inputs: m, .. } = sizes;
    let mut module = Module::default();
    let base = match &model.base {
        BaseModel::Equations(equations) => {
            let lowered = equations::lower(&mut module, equations, &channels.all(), &[]);
            Some((equations, lowered))
        }
        BaseModel::Nothing | BaseModel::Hold => None,
    };
    let front = base.as_ref().map_or(n, |(equations, _)| equations.state_len());
    let hidden = model.network.state_len();
    let states = front + hidden;
    let Scaling { output_mean, output_scale, input_mean, input_scale, correction_scale } = &model.scaling;

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let mut read = vec![scaled(&b, c, input_mean, input_scale)];
    if model.feedback {
        read.push(scaled(&b, x.slice(0, n), output_mean, output_scale));
    }
    let [next, output] = network(&b, model, x.slice(front, hidden), b.concat(&read));
    let correction = b.constant(correction_scale) * output;
    let front_next = match (&base, &model.base) {
        (Some((_, lowered)), _) => {
            let moved = b.call(lowered.step, front, &[x.slice(0, front), c]);
            b.concat(&[moved.slice(0, n) + correction, moved.slice(n, front - n)])
        }
        (None, BaseModel::Hold) => x.slice(0, n) + correction,
        (None, _) => b.constant(output_mean) + correction,
    };
    let next = b.concat(&[front_next, next]);
    let step = module.add(b.finish("step", "State after a sample with the command held", next));
    let [observe, output] = outputs_first(&mut module, n, states);

    // The hidden state settles under the command and the measured outputs.
    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let y = b.argument("outputs", n);
    let settled = b.call(observe, states, &[b.call(step, states, &[x, c]), y]);
    let settle = module.add(b.finish("settle", "State after a sample with measured outputs", settled));

    let b = Builder::new();
    let (y, c) = (b.argument("outputs", n), b.argument("command", m));
    let rest = match &base {
        Some((equations, _)) => equations::steady(&b, equations, y, c),
        None => y,
    };
    let first = b.concat(&[rest, b.constant(&vec![0.0; hidden])]);
    // The warm-up of a session.
    let of_base = base.as_ref().map_or(0, |(equations, _)| equations.warm_up() - 1);
    let state = match model.wash_out.max(of_base) {
        0 => first,
        samples => b.repeat(settle, samples, &[first, c, y]),
    };
    let start =
        module.add(b.finish("start", "State of a steady motion, with the hidden state settled", state));

    let mut labels = match base {
        Some((_, lowered)) => lowered.state,
        None => channels.outputs.clone(),
    };
    labels.extend((0..hidden).map(|i| Label::new(format!("hidden state {i}"), "1")));
    StateSpace { module, state: labels, start, step, observe, output, rates: None, block: None }
}
