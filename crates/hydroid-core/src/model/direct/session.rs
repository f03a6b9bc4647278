//! The session of a direct predictor: the last outputs and commands.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::check::DirectError;
use super::model::Direct;
use super::through::Through;
use super::window::{Window, push};
use crate::predict::{Predictor, Source, Workspace, rollout_steps};

/// A run of a [`Direct`] model. A measurement replaces the present output; what is not measured is predicted.
///
/// At the start of a run nothing is known of the past: a value that is measured for the first time stands for those before
/// it, and until as many commands have passed as the history has, values wait as they were measured and rollouts are NaN.
///
/// The snapshot is what it remembers: `history` rows of outputs, the present one last, then `history - 1` rows of commands.
#[derive(Clone, Debug)]
pub struct DirectSession {
    model: Arc<Direct>,
    through: Through,
    window: Window,
    /// Outputs and commands that have passed, in their own units.
    past: Vec<f64>,
    scratch: Vec<f64>,
    /// The present outputs, as they are predicted.
    next: Vec<f64>,
}

impl DirectSession {
    /// A session at the start of a run.
    ///
    /// # Errors
    /// As [`Direct::check`].
    pub fn new(model: Arc<Direct>) -> Result<Self, DirectError> {
        model.check()?;
        let window = Window::of(&model);
        let through = Through::new(&model.network);
        let ends = model.network.inputs + model.network.outputs;
        let scratch = vec![0.0; ends + through.hidden()];
        Ok(Self {
            past: vec![f64::NAN; window.past()],
            next: vec![0.0; window.n],
            model,
            through,
            window,
            scratch,
        })
    }

    /// The model.
    pub fn model(&self) -> &Direct {
        &self.model
    }

    /// The same, as sessions share it.
    pub(super) fn shared_model(&self) -> &Arc<Direct> {
        &self.model
    }

    /// Outputs and commands that have passed, in their own units.
    pub(super) fn past(&self) -> &[f64] {
        &self.past
    }

    /// Whether something of the past is not known.
    fn is_waiting(&self) -> bool {
        self.past.iter().any(|x| x.is_nan())
    }
}

impl Through {
    /// Predictions from a past in its own units, under commands, into `y`: as many steps as it has rows.
    fn roll(&self, model: &Direct, past: &[f64], commands: &[f64], scratch: &mut [f64], y: &mut [f64]) {
        let w = Window::of(model);
        let (x, rest) = scratch.split_at_mut(model.network.inputs);
        let (hidden, g) = rest.split_at_mut(self.hidden());
        w.scale_past(model, past, x);
        let blocks = y.chunks_mut(w.h * w.n);
        let mut first = 0;
        for y in blocks {
            let steps = y.len() / w.n;
            let given = &commands[first * w.m..(first + steps) * w.m];
            w.give(x, given.iter().enumerate().map(|(i, &c)| model.scaled_command(i % w.m, c)));
            let g = &mut g[..y.len()];
            self.evaluate(&model.weights, x, hidden, g);
            let present = &x[(w.p - 1) * w.n..w.p * w.n];
            for (i, (y, g)) in y.iter_mut().zip(&*g).enumerate() {
                *y = model.output_of(i % w.n, present[i % w.n], *g);
            }
            first += steps;
            if steps == w.h {
                for (i, (g, &y)) in g.iter_mut().zip(&*y).enumerate() {
                    *g = model.scaled_output(i % w.n, y);
                }
                w.pass(x, g);
            }
        }
    }
}

impl Predictor for DirectSession {
    fn outputs(&self) -> usize {
        self.window.n
    }

    fn inputs(&self) -> usize {
        self.window.m
    }

    fn warm_up(&self) -> usize {
        self.window.p
    }

    fn reset(&mut self) {
        self.past.fill(f64::NAN);
    }

    fn observe(&mut self, y: &[f64]) {
        let Window { n, p, .. } = self.window;
        let outputs = &mut self.past[..p * n];
        for (c, &y) in y.iter().enumerate().filter(|(_, y)| !y.is_nan()) {
            let present = (p - 1) * n + c;
            if outputs[present].is_nan() {
                // Nothing was known of it.
                for k in 0..p {
                    outputs[k * n + c] = y;
                }
            }
            outputs[present] = y;
        }
    }

    fn advance(&mut self, c: &[f64]) {
        let Window { n, p, .. } = self.window;
        self.next.copy_from_slice(&self.past[(p - 1) * n..p * n]);
        if !self.is_waiting() {
            self.through.roll(&self.model, &self.past, c, &mut self.scratch, &mut self.next);
        }
        let (outputs, commands) = self.past.split_at_mut(p * n);
        push(outputs, &self.next);
        push(commands, c);
    }

    fn output(&self, y: &mut [f64]) {
        let Window { n, p, .. } = self.window;
        y.copy_from_slice(&self.past[(p - 1) * n..p * n]);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, self.window.m, y, self.window.n);
        self.through.roll(&self.model, &self.past, commands, work.take(self.scratch.len()), y);
    }

    fn snapshot_len(&self) -> usize {
        self.past.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        into.copy_from_slice(&self.past);
    }

    fn restore(&mut self, from: &[f64]) {
        self.past.copy_from_slice(from);
    }

    fn source(&self) -> Source<'_> {
        Source::Direct(self)
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}
