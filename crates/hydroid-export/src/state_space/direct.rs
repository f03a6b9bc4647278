//! Direct predictors.

use hydroid_core::model::direct::Direct;
use hydroid_core::model::recurrent::BaseModel;

use super::affine::perceptron;
use super::recurrent::scaled;
use super::{Block, Channels, Label, StateSpace, equations};
use crate::graph::{Builder, Module, Vector};

/// Sizes of the past of a direct predictor.
#[derive(Clone, Copy)]
struct Past {
    /// Outputs, inputs, samples of the history and of the horizon.
    n: usize,
    m: usize,
    p: usize,
    horizon: usize,
    /// Memory of the base equations.
    memory: usize,
}

impl Past {
    fn outputs(self) -> usize {
        self.p * self.n
    }

    fn commands(self) -> usize {
        (self.p - 1) * self.m
    }

    fn states(self) -> usize {
        self.outputs() + self.commands() + self.memory
    }

    /// Outputs, commands and memory in a state.
    fn parts(self, x: Vector<'_>) -> [Vector<'_>; 3] {
        let (outputs, commands) = (self.outputs(), self.commands());
        [x.slice(0, outputs), x.slice(outputs, commands), x.slice(outputs + commands, self.memory)]
    }
}

/// The state: `history` rows of outputs, the present one last, `history - 1` rows of commands, the memory of the equations.
pub(super) fn state_space(model: &Direct, channels: &Channels) -> StateSpace {
    let (n, m) = (model.outputs(), model.inputs());
    let mut module = Module::default();
    let base = model.equations().map(|equations| {
        let lowered = equations::lower(&mut module, equations, &channels.all(), &[]);
        (equations, lowered)
    });
    let memory = base.as_ref().map_or(0, |(equations, _)| equations.state_len() - n);
    let past = Past { n, m, p: model.history, horizon: model.horizon, memory };
    let (horizon, states) = (past.horizon, past.states());

    let b = Builder::new();
    let (x, ahead) = (b.argument("state", states), b.argument("commands", horizon * m));
    let [outputs, commands, memory_of_base] = past.parts(x);
    let s = &model.scaling;
    let window = b.concat(&[
        scaled(&b, outputs, &s.output_mean.repeat(past.p), &s.output_scale.repeat(past.p)),
        scaled(&b, commands, &s.input_mean.repeat(past.p - 1), &s.input_scale.repeat(past.p - 1)),
        scaled(&b, ahead, &s.input_mean.repeat(horizon), &s.input_scale.repeat(horizon)),
    ]);
    let g = perceptron(&model.network, &model.weights, window);
    let present = outputs.slice((past.p - 1) * n, n);
    let below = match (&base, &model.base) {
        (Some((_, lowered)), _) => {
            let mut state = b.concat(&[present, memory_of_base]);
            let rows = (0..horizon).map(|k| {
                state = b.call(lowered.step, n + memory, &[state, ahead.slice(k * m, m)]);
                state.slice(0, n)
            });
            rows.collect::<Vec<_>>()
        }
        (None, BaseModel::Hold) => vec![present; horizon],
        (None, _) => vec![b.constant(&s.output_mean); horizon],
    };
    let y = b.concat(&below) + b.constant(&s.correction_scale.repeat(horizon)) * g;
    let predict = module.add(b.finish("predict", "Outputs over the horizon, row by row", y));

    let follow = {
        let b = Builder::new();
        let (x, ahead) = (b.argument("state", states), b.argument("commands", horizon * m));
        let y = b.argument("outputs", horizon * n);
        let [outputs, commands, memory_of_base] = past.parts(x);
        let outputs_next = b.concat(&[outputs, y]).slice_last(past.outputs());
        let commands_next = b.concat(&[commands, ahead]).slice_last(past.commands());
        let mut state = b.concat(&[outputs.slice((past.p - 1) * n, n), memory_of_base]);
        if let Some((_, lowered)) = base.as_ref().filter(|_| memory > 0) {
            for k in 0..horizon {
                let waited = b.call(lowered.wait, n + memory, &[state, ahead.slice(k * m, m)]);
                state = b.concat(&[y.slice(k * n, n), waited.slice(n, memory)]);
            }
        }
        let next = b.concat(&[outputs_next, commands_next, state.slice(n, memory)]);
        module.add(b.finish("follow", "State at the end of a predicted horizon", next))
    };

    let b = Builder::new();
    let (x, c) = (b.argument("state", states), b.argument("command", m));
    let [outputs, commands, memory_of_base] = past.parts(x);
    let y = b.call(predict, horizon * n, &[x, b.concat(&vec![c; horizon])]);
    let present = outputs.slice((past.p - 1) * n, n);
    let memory_next = match base.as_ref().filter(|_| memory > 0) {
        Some((_, lowered)) => {
            let waited = b.call(lowered.wait, n + memory, &[b.concat(&[present, memory_of_base]), c]);
            waited.slice(n, memory)
        }
        None => memory_of_base,
    };
    let next = b.concat(&[
        outputs.slice(n, (past.p - 1) * n),
        y.slice(0, n),
        b.concat(&[commands, c]).slice_last(past.commands()),
        memory_next,
    ]);
    let step = module.add(b.finish("step", "State after a sample, predicted with the command held", next));

    let b = Builder::new();
    let (y, c) = (b.argument("outputs", n), b.argument("command", m));
    let mut parts = vec![y; past.p];
    parts.extend(vec![c; past.p - 1]);
    if let Some((equations, _)) = &base {
        parts.push(equations::steady(&b, equations, y, c).slice(n, memory));
    }
    let start = module.add(b.finish("start", "State of a steady motion", b.concat(&parts)));

    let first = (past.p - 1) * n;
    let b = Builder::new();
    let (x, y) = (b.argument("state", states), b.argument("outputs", n));
    let measured = y.or(x.slice(first, n));
    let rest = x.slice(first + n, states - first - n);
    let next = b.concat(&[x.slice(0, first), measured, rest]);
    let observe = module.add(b.finish("observe", "State after a measurement of the outputs", next));
    let output = super::output(&mut module, first, n, states);

    let mut state = Vec::new();
    let ago = |samples: usize, of: &[Label]| -> Vec<Label> {
        let of_one = |label: &Label| Label::new(format!("{} {samples} samples ago", label.name), &label.unit);
        of.iter().map(of_one).collect()
    };
    state.extend((0..past.p).rev().flat_map(|samples| ago(samples, &channels.outputs)));
    state.extend((1..past.p).rev().flat_map(|samples| ago(samples, &channels.inputs)));
    if let Some((_, lowered)) = base {
        state.extend_from_slice(&lowered.state[n..]);
    }
    let block = Some(Block { horizon, predict, follow });
    StateSpace { module, state, start, step, observe, output, rates: None, block }
}
