//! Rollouts of a direct predictor for many command sequences side by side.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::batch::Batch;
use super::model::Direct;
use super::session::DirectSession;
use super::window::Window;
use crate::model::sparse;

/// Scratch memory for rollouts of one session under many command sequences at once: the weights, hundreds of kilobytes,
/// are read once for all of them. Results equal sequential rollouts up to the order of sums.
#[derive(Clone, Debug)]
pub(super) struct BatchRollout {
    sequences: usize,
    model: Arc<Direct>,
    /// Weights of the model with the last layer of the session.
    weights: Vec<f64>,
    window: Window,
    batch: Batch<f64>,
    equations: Option<sparse::BatchRollout>,
    /// State of the equations: the present outputs, then their memory.
    below: Vec<f64>,
    past: Vec<f64>,
    windows: Vec<f64>,
    predicted: Vec<f64>,
}

impl BatchRollout {
    /// Memory for `sequences` sequences. `None`, without allocating, for past values in the base, rolled out one by
    /// one.
    pub(super) fn new(session: &DirectSession, sequences: usize) -> Option<Self> {
        let model = Arc::clone(session.shared_model());
        let equations = match model.equations() {
            Some(equations) => Some(sparse::BatchRollout::new(equations, sequences)?),
            None => None,
        };
        let window = Window::of(&model);
        Some(Self {
            sequences,
            window,
            batch: Batch::new(&model.network, sequences),
            equations,
            below: vec![0.0; model.below()],
            past: vec![0.0; window.past()],
            windows: vec![0.0; sequences * model.network.inputs],
            predicted: vec![0.0; model.network.outputs],
            weights: model.weights.clone(),
            model,
        })
    }

    pub(super) fn fits(&self, session: &DirectSession, count: usize) -> bool {
        let model = session.shared_model();
        count <= self.sequences && (Arc::ptr_eq(model, &self.model) || **model == *self.model)
    }

    fn load(&mut self, session: &DirectSession) {
        let Window { n, p, .. } = self.window;
        self.window.scale_past(&self.model, session.whole_past(), &mut self.past);
        if !self.below.is_empty() {
            self.below[..n].copy_from_slice(&session.whole_past()[(p - 1) * n..p * n]);
            self.below[n..].copy_from_slice(session.memory());
        }
        let last_layer = session.last_layer();
        let from = self.weights.len() - last_layer.len();
        self.weights[from..].copy_from_slice(last_layer);
    }

    /// Rolls out `count` sequences from the state of a session: `commands` are `count x steps x inputs`, `y` are
    /// `count x steps x outputs`.
    ///
    /// # Panics
    /// If the slices do not hold whole sequences of the same number of steps.
    pub(super) fn rollout(&mut self, session: &DirectSession, count: usize, commands: &[f64], y: &mut [f64]) {
        self.load(session);
        let Self { model, weights, window: w, batch, equations, below, past, windows, predicted, .. } = self;
        let (n, m, reads) = (w.n, w.m, model.network.inputs);
        batch.set_windows(count);
        let lanes = batch.lanes();
        let steps = y.len() / (n * count);
        assert!(y.len() == steps * n * count && commands.len() == steps * m * count, "whole sequences");
        for x in windows[..count * reads].chunks_exact_mut(reads) {
            x[..past.len()].copy_from_slice(past);
        }
        if let Some(equations) = equations {
            equations.begin(below, count);
        }
        let mut first = 0;
        while first < steps {
            let here = w.h.min(steps - first);
            if let (Some(room), Some(equations)) = (equations.as_mut(), model.equations()) {
                for step in first..first + here {
                    room.step(equations, count, |i, j| commands[(i * steps + step) * m + j]);
                    let rows = room.outputs_mut(n, count).chunks_exact(count);
                    for (c, row) in rows.enumerate() {
                        row.iter().enumerate().for_each(|(i, &e)| y[(i * steps + step) * n + c] = e);
                    }
                }
            }
            for (i, x) in windows[..count * reads].chunks_exact_mut(reads).enumerate() {
                let given = &commands[(i * steps + first) * m..][..here * m];
                w.set_commands(x, given.iter().enumerate().map(|(k, &c)| model.scaled_command(k % m, c)));
                for (row, &x) in batch.input_mut().chunks_exact_mut(lanes).zip(&*x) {
                    row[i] = x;
                }
            }
            batch.forward(weights);
            for (i, x) in windows[..count * reads].chunks_exact_mut(reads).enumerate() {
                let y = &mut y[(i * steps + first) * n..][..here * n];
                let present = &x[(w.p - 1) * n..w.p * n];
                let given = batch.output().iter().skip(i).step_by(lanes);
                for (k, (y, &g)) in y.iter_mut().zip(given).enumerate() {
                    *y = model.output_of(k % n, present[k % n], *y, g);
                }
                if first + here < steps {
                    for (k, (z, &y)) in predicted.iter_mut().zip(&*y).enumerate() {
                        *z = model.scaled_output(k % n, y);
                    }
                    w.shift(x, predicted);
                }
            }
            first += here;
            if let Some(room) = equations {
                // The next horizon begins at the predicted outputs; lags depend on commands alone.
                for (c, row) in room.outputs_mut(n, count).chunks_exact_mut(count).enumerate() {
                    row.iter_mut().enumerate().for_each(|(i, now)| *now = y[(i * steps + first - 1) * n + c]);
                }
            }
        }
    }
}
