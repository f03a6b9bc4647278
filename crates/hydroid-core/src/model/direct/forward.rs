//! A window through the layers of a direct predictor, and rollouts that chain windows.

#![expect(
    clippy::inline_always,
    reason = "must become a part of the function that was compiled for the processor"
)]

use alloc::sync::Arc;

use pulp::{Arch, Simd, WithSimd};

use super::model::Direct;
use super::perceptron::Layer;
use super::window::Window;
use crate::math::{Scalar, functions, product, slices};

/// Where a rollout works: what the network reads, its layers, what it gives.
#[derive(Clone, Debug)]
pub(super) struct Forward {
    layers: Arc<[Layer]>,
    /// Longest hidden layer.
    widest: usize,
    arch: Arch,
}

impl Forward {
    pub(super) fn new(model: &Direct) -> Self {
        let widest = model.network.hidden.iter().copied().max().unwrap_or(0);
        Self { layers: model.network.layers().into(), widest, arch: Arch::new() }
    }

    /// Numbers that a rollout needs.
    pub(super) fn scratch(&self) -> usize {
        let ends = self.layers.first().map_or(0, |l| l.reads) + self.layers.last().map_or(0, |l| l.gives);
        ends + 2 * self.widest
    }

    /// How many numbers the last layer reads.
    pub(super) fn features(&self) -> usize {
        self.layers.last().map_or(0, |layer| layer.reads)
    }

    /// The last layer of all weights: its matrix row by row, then its bias.
    pub(super) fn read_out<'a>(&self, weights: &'a [f64]) -> &'a [f64] {
        &weights[self.layers.last().map_or(0, |layer| layer.at)..]
    }

    /// What the last layer reads of a window: outputs, commands that have passed, commands to come.
    pub(super) fn look(
        &self,
        model: &Direct,
        [outputs, passed, ahead]: [&[f64]; 3],
        scratch: &mut [f64],
        into: &mut [f64],
    ) {
        let (x, hidden) = scratch.split_at_mut(self.layers[0].reads);
        let w = Window::of(model);
        read_past(model, &w, outputs, passed, x);
        w.give(x, scaled(model, ahead));
        let weights = (&*model.weights, &[][..]);
        self.arch.dispatch(Through { forward: self, weights, x, hidden, g: &mut [] });
        let inner = self.layers.len() - 1;
        // Layers write to one half and to the other in turn.
        let h = if inner == 0 { x } else { &mut hidden[(inner % 2) * self.widest..] };
        into.copy_from_slice(&h[..into.len()]);
    }

    /// The read-out of what [`look`](Self::look) gives, its first numbers.
    pub(super) fn give(&self, read_out: &[f64], features: &[f64], g: &mut [f64]) {
        let Some(layer) = self.layers.last() else { return };
        self.arch.dispatch(ReadOut { layer, weights: read_out, x: features, g });
    }

    /// Predictions from a past in its own units, under commands, into `y`: as many steps as it has rows.
    pub(super) fn roll(
        &self,
        (model, read_out): (&Direct, &[f64]),
        past: &[f64],
        commands: &[f64],
        scratch: &mut [f64],
        y: &mut [f64],
    ) {
        let w = Window::of(model);
        let s = &model.scaling;
        let (x, rest) = scratch.split_at_mut(self.layers[0].reads);
        let (hidden, g) = rest.split_at_mut(2 * self.widest);
        let (outputs, passed) = past.split_at(w.outputs());
        read_past(model, &w, outputs, passed, x);
        let blocks = y.chunks_mut(w.h * w.n);
        let mut first = 0;
        for y in blocks {
            let steps = y.len() / w.n;
            w.give(x, scaled(model, &commands[first * w.m..(first + steps) * w.m]));
            let g = &mut g[..y.len()];
            self.arch.dispatch(Through { forward: self, weights: (&model.weights, read_out), x, hidden, g });
            let present = &x[(w.p - 1) * w.n..w.p * w.n];
            for (i, (y, g)) in y.iter_mut().zip(&*g).enumerate() {
                let c = i % w.n;
                let base = if model.hold { present[c] * s.output_scale[c] } else { 0.0 };
                *y = s.output_mean[c] + base + s.correction_scale[c] * g;
            }
            first += steps;
            if steps == w.h {
                for (i, (g, &y)) in g.iter_mut().zip(&*y).enumerate() {
                    *g = (y - s.output_mean[i % w.n]) / s.output_scale[i % w.n];
                }
                w.pass(x, g);
            }
        }
    }
}

/// Outputs and commands that have passed, scaled, into a window.
fn read_past(model: &Direct, w: &Window, outputs: &[f64], passed: &[f64], x: &mut [f64]) {
    let s = &model.scaling;
    let (z, rest) = x.split_at_mut(w.outputs());
    for (i, (z, &y)) in z.iter_mut().zip(outputs).enumerate() {
        *z = (y - s.output_mean[i % w.n]) / s.output_scale[i % w.n];
    }
    for (x, c) in rest.iter_mut().zip(scaled(model, passed)) {
        *x = c;
    }
}

/// Commands in the scale of the network.
fn scaled<'a>(model: &'a Direct, commands: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    let (s, m) = (&model.scaling, model.inputs());
    commands.iter().enumerate().map(move |(i, &c)| (c - s.input_mean[i % m]) / s.input_scale[i % m])
}

/// `g <- f(x)`, its first numbers alone where `g` is shorter than what the network gives; the read-out has weights of its own.
struct Through<'a, T> {
    forward: &'a Forward,
    weights: (&'a [T], &'a [T]),
    x: &'a [T],
    hidden: &'a mut [T],
    g: &'a mut [T],
}

impl<T: Scalar> WithSimd for Through<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Forward { layers, widest, .. } = self.forward;
        let (weights, read_out) = self.weights;
        let Some((last, inner)) = layers.split_last() else { return };
        let (mut here, mut there) = self.hidden.split_at_mut(*widest);
        for (l, layer) in inner.iter().enumerate() {
            let x = if l == 0 { self.x } else { &here[..layer.reads] };
            let h = &mut there[..layer.gives];
            product::affine(layer.matrix(weights), layer.bias(weights), x, h);
            let mut h = slices::Write::new(simd, h);
            for k in slices::vectors::<S, T>(layer.gives) {
                h.set(k, functions::tanh(simd, h.get(k)));
            }
            core::mem::swap(&mut here, &mut there);
        }
        let x = if inner.is_empty() { self.x } else { &here[..last.reads] };
        if !self.g.is_empty() {
            ReadOut { layer: last, weights: read_out, x, g: self.g }.with_simd(simd);
        }
    }
}

/// The last layer by itself.
struct ReadOut<'a, T> {
    layer: &'a Layer,
    weights: &'a [T],
    x: &'a [T],
    g: &'a mut [T],
}

impl<T: Scalar> WithSimd for ReadOut<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (matrix, bias) = self.weights.split_at(self.layer.reads * self.layer.gives);
        product::affine(matrix, bias, self.x, self.g);
    }
}
