//! Rollouts of a direct predictor by chained windows.

use super::base_rollout::BaseRollout;
use super::forward_pass::ForwardPass;
use super::model::Direct;
use super::window::Window;

impl ForwardPass {
    pub(super) fn scratch(&self, model: &Direct) -> usize {
        model.network.inputs + model.network.outputs + self.hidden() + BaseRollout::scratch(model)
    }

    /// Inputs of the last layer for a window of outputs, past and future commands; the last given command is held.
    pub(super) fn window_features(
        &self,
        model: &Direct,
        [outputs, passed, ahead]: [&[f64]; 3],
        scratch: &mut [f64],
        into: &mut [f64],
    ) {
        let (x, hidden) = scratch.split_at_mut(model.network.inputs);
        let w = Window::of(model);
        let (of_outputs, of_commands) = x.split_at_mut(w.outputs());
        for (i, (x, &y)) in of_outputs.iter_mut().zip(outputs).enumerate() {
            *x = model.scaled_output(i % w.n, y);
        }
        for (i, (x, &c)) in of_commands.iter_mut().zip(passed).enumerate() {
            *x = model.scaled_command(i % w.m, c);
        }
        w.set_commands(x, scaled(model, ahead));
        self.features_of(&model.weights, x, hidden, into);
    }

    /// Predicts as many steps as `y` has rows, from a past in physical units and the memory of the equations.
    pub(super) fn roll(
        &self,
        (model, last_layer): (&Direct, &[f64]),
        (past, memory): (&[f64], &[f64]),
        commands: &[f64],
        scratch: &mut [f64],
        y: &mut [f64],
    ) {
        let w = Window::of(model);
        let (x, rest) = scratch.split_at_mut(model.network.inputs);
        let (hidden, rest) = rest.split_at_mut(self.hidden());
        let (g, rest) = rest.split_at_mut(model.network.outputs);
        w.scale_past(model, past, x);
        let mut below = BaseRollout::begin(model, &past[(w.p - 1) * w.n..w.p * w.n], memory, rest);
        let total = y.len() / w.n;
        let blocks = y.chunks_mut(w.h * w.n);
        let mut first = 0;
        for y in blocks {
            let steps = y.len() / w.n;
            let given = &commands[first * w.m..(first + steps) * w.m];
            w.set_commands(x, scaled(model, given));
            let g = &mut g[..y.len()];
            self.evaluate([&model.weights, last_layer], x, hidden, g);
            below.roll(given, y);
            let present = &x[(w.p - 1) * w.n..w.p * w.n];
            for (i, (y, g)) in y.iter_mut().zip(&*g).enumerate() {
                *y = model.output_of(i % w.n, present[i % w.n], *y, *g);
            }
            first += steps;
            if first < total {
                for (i, (g, &y)) in g.iter_mut().zip(&*y).enumerate() {
                    *g = model.scaled_output(i % w.n, y);
                }
                w.shift(x, g);
                below.advance(given, y);
            }
        }
    }
}

fn scaled<'a>(model: &'a Direct, commands: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    commands.iter().enumerate().map(|(i, &c)| model.scaled_command(i % model.inputs(), c))
}
