//! One input through a perceptron.

#![expect(
    clippy::inline_always,
    reason = "must become a part of the function that was compiled for the processor"
)]

use alloc::sync::Arc;

use pulp::{Arch, Simd, WithSimd};

use super::perceptron::{Layer, Perceptron};
use crate::math::{Scalar, functions, product, slices};

/// The way through a [`Perceptron`], one input at a time.
#[derive(Clone, Debug)]
pub(crate) struct Through {
    layers: Arc<[Layer]>,
    /// Longest hidden layer.
    widest: usize,
    arch: Arch,
}

impl Through {
    pub(crate) fn new(network: &Perceptron) -> Self {
        let widest = network.hidden.iter().copied().max().unwrap_or(0);
        Self { layers: network.layers().into(), widest, arch: Arch::new() }
    }

    /// Numbers of hidden layers that [`evaluate`](Self::evaluate) needs.
    pub(crate) fn hidden(&self) -> usize {
        2 * self.widest
    }

    /// `g <- f(x)`, its first numbers alone where `g` is shorter than what the network gives.
    pub(crate) fn evaluate<T: Scalar>(&self, weights: &[T], x: &[T], hidden: &mut [T], g: &mut [T]) {
        self.arch.dispatch(Step { through: self, weights, x, hidden, g });
    }
}

/// What is compiled for the processor.
struct Step<'a, T> {
    through: &'a Through,
    weights: &'a [T],
    x: &'a [T],
    hidden: &'a mut [T],
    g: &'a mut [T],
}

impl<T: Scalar> WithSimd for Step<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Through { layers, widest, .. } = self.through;
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
