//! The forward pass of a perceptron for one input.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use alloc::sync::Arc;

use pulp::{Arch, Simd, WithSimd};

use super::perceptron::{Layer, Perceptron};
use crate::math::{functions, product, slices};

#[derive(Clone, Debug)]
pub(crate) struct ForwardPass {
    layers: Arc<[Layer]>,
    widest: usize,
    arch: Arch,
}

impl ForwardPass {
    pub(crate) fn new(network: &Perceptron) -> Self {
        let widest = network.hidden.iter().copied().max().unwrap_or(0);
        Self { layers: network.layers().into(), widest, arch: Arch::new() }
    }

    pub(crate) fn hidden(&self) -> usize {
        2 * self.widest
    }

    pub(super) fn features(&self) -> usize {
        self.layers.last().map_or(0, |layer| layer.reads)
    }

    /// Weights of the last layer: its matrix row by row, then its bias.
    pub(crate) fn last_layer<'a>(&self, weights: &'a [f64]) -> &'a [f64] {
        &weights[self.layers.last().map_or(0, |layer| layer.at)..]
    }

    /// `g <- f(x)`, as many outputs as `g` has; the weights of the last layer are given separately.
    pub(crate) fn evaluate(
        &self,
        [weights, last_layer]: [&[f64]; 2],
        x: &[f64],
        hidden: &mut [f64],
        g: &mut [f64],
    ) {
        self.arch.dispatch(Step { forward: self, weights, last_layer, x, hidden, g });
    }

    /// Inputs of the last layer, given `x`.
    pub(super) fn features_of(&self, weights: &[f64], x: &[f64], hidden: &mut [f64], into: &mut [f64]) {
        self.evaluate([weights, &[]], x, hidden, &mut []);
        let inner = self.layers.len() - 1;
        let h = if inner == 0 { x } else { &hidden[(inner % 2) * self.widest..] };
        into.copy_from_slice(&h[..into.len()]);
    }

    /// Applies the last layer to its inputs, as many outputs as `g` has.
    pub(super) fn apply_last_layer(&self, last_layer: &[f64], features: &[f64], g: &mut [f64]) {
        let Some(layer) = self.layers.last() else { return };
        self.arch.dispatch(LastLayer { layer, weights: last_layer, x: features, g });
    }
}

pub(crate) struct Step<'a> {
    forward: &'a ForwardPass,
    weights: &'a [f64],
    last_layer: &'a [f64],
    x: &'a [f64],
    hidden: &'a mut [f64],
    g: &'a mut [f64],
}

impl WithSimd for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let ForwardPass { layers, widest, .. } = self.forward;
        let Some((last, inner)) = layers.split_last() else { return };
        let (mut here, mut there) = self.hidden.split_at_mut(*widest);
        for (l, layer) in inner.iter().enumerate() {
            let x = if l == 0 { self.x } else { &here[..layer.reads] };
            let h = &mut there[..layer.gives];
            product::affine(layer.matrix(self.weights), layer.bias(self.weights), x, h);
            let mut h = slices::Write::new(simd, h);
            for k in slices::vectors::<S, f64>(layer.gives) {
                h.set(k, functions::tanh(simd, h.get(k)));
            }
            core::mem::swap(&mut here, &mut there);
        }
        let x = if inner.is_empty() { self.x } else { &here[..last.reads] };
        if !self.g.is_empty() {
            LastLayer { layer: last, weights: self.last_layer, x, g: self.g }.with_simd(simd);
        }
    }
}

pub(crate) struct LastLayer<'a> {
    layer: &'a Layer,
    weights: &'a [f64],
    x: &'a [f64],
    g: &'a mut [f64],
}

impl WithSimd for LastLayer<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (matrix, bias) = self.weights.split_at(self.layer.reads * self.layer.gives);
        product::affine(matrix, bias, self.x, self.g);
    }
}
