//! The session of a direct predictor: the last outputs and commands.

#![expect(
    clippy::inline_always,
    reason = "must become a part of the function that was compiled for the processor"
)]

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use pulp::{Arch, Simd, WithSimd};

use super::check::DirectError;
use super::model::Direct;
use super::perceptron::Layer;
use super::window::{Window, push};
use crate::math::{Scalar, functions, product, slices};
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
    forward: Forward,
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
        let forward = Forward::new(&model);
        let scratch = vec![0.0; forward.scratch()];
        Ok(Self {
            past: vec![f64::NAN; window.past()],
            next: vec![0.0; window.n],
            model,
            forward,
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

/// Where a rollout works: what the network reads, its layers, what it gives.
#[derive(Clone, Debug)]
struct Forward {
    layers: Arc<[Layer]>,
    /// Longest hidden layer.
    widest: usize,
    arch: Arch,
}

impl Forward {
    fn new(model: &Direct) -> Self {
        let widest = model.network.hidden.iter().copied().max().unwrap_or(0);
        Self { layers: model.network.layers().into(), widest, arch: Arch::new() }
    }

    /// Numbers that a rollout needs.
    fn scratch(&self) -> usize {
        let ends = self.layers.first().map_or(0, |l| l.reads) + self.layers.last().map_or(0, |l| l.gives);
        ends + 2 * self.widest
    }

    /// Predictions from a past in its own units, under commands, into `y`: as many steps as it has rows.
    fn roll(&self, model: &Direct, past: &[f64], commands: &[f64], scratch: &mut [f64], y: &mut [f64]) {
        let w = Window::of(model);
        let (x, rest) = scratch.split_at_mut(self.layers[0].reads);
        let (hidden, g) = rest.split_at_mut(2 * self.widest);
        w.scale_past(model, past, x);
        let blocks = y.chunks_mut(w.h * w.n);
        let mut first = 0;
        for y in blocks {
            let steps = y.len() / w.n;
            let given = &commands[first * w.m..(first + steps) * w.m];
            w.give(x, given.iter().enumerate().map(|(i, &c)| model.scaled_command(i % w.m, c)));
            let g = &mut g[..y.len()];
            self.arch.dispatch(Through { forward: self, weights: &model.weights, x, hidden, g });
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

/// `g <- f(x)`, its first numbers alone where `g` is shorter than what the network gives.
struct Through<'a, T> {
    forward: &'a Forward,
    weights: &'a [T],
    x: &'a [T],
    hidden: &'a mut [T],
    g: &'a mut [T],
}

impl<T: Scalar> WithSimd for Through<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Forward { layers, widest, .. } = self.forward;
        let Some((read_out, inner)) = layers.split_last() else { return };
        let (mut here, mut there) = self.hidden.split_at_mut(*widest);
        for (l, layer) in inner.iter().enumerate() {
            let x = if l == 0 { self.x } else { &here[..layer.reads] };
            let h = &mut there[..layer.gives];
            product::affine(layer.matrix(self.weights), layer.bias(self.weights), x, h);
            let mut h = slices::Write::new(simd, h);
            for k in slices::vectors::<S, T>(layer.gives) {
                h.set(k, functions::tanh(simd, h.get(k)));
            }
            core::mem::swap(&mut here, &mut there);
        }
        let x = if inner.is_empty() { self.x } else { &here[..read_out.reads] };
        product::affine(read_out.matrix(self.weights), read_out.bias(self.weights), x, self.g);
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
            self.forward.roll(&self.model, &self.past, c, &mut self.scratch, &mut self.next);
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
        self.forward.roll(&self.model, &self.past, commands, work.take(self.scratch.len()), y);
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
