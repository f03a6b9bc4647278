//! Weights in the memory layout of one step of one sequence.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use alloc::vec;
use alloc::vec::Vec;

use pulp::{Arch, Simd, WithSimd};

use super::super::layout::Layout;
use super::super::network::{Cell, Network};
use super::super::{gru, lstm, vanilla};
use super::gates::Gates;

use crate::math::rows::product;

/// A network's weights in the layout of a step of one sequence: rows of the gates in blocks that are summed side by
/// side, and the two biases as one sum. A step is `state+ = f(state, x)`, `y = g(state+)`, with the state in the layout
/// of [`Cell`]. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug, PartialEq)]
pub struct Packed {
    network: Network,
    layout: Layout,
    /// In the order of [`Network::tensors`].
    weights: Vec<f64>,
    layers: Vec<Gates>,
}

pub(crate) struct Step<'a> {
    packed: &'a Packed,
    state: &'a mut [f64],
    x: &'a [f64],
    scratch: &'a mut [f64],
}

impl WithSimd for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.packed.step_with(simd, self.state, self.x, self.scratch);
    }
}

impl Packed {
    /// Packs the weights of a network.
    ///
    /// # Panics
    /// If there are not [`Network::weights`] numbers, or the network is invalid ([`Network::check`]).
    pub fn new(network: Network, weights: &[f64]) -> Self {
        if let Err(error) = network.check() {
            panic!("{error}");
        }
        let layout = Layout::new(&network);
        let layers = layout.layers.iter().map(|layer| Gates::new(network.cell, layer)).collect();
        let mut packed = Self { network, layout, weights: vec![0.0; network.weights()], layers };
        packed.set_weights(weights);
        packed
    }

    /// Replaces the weights, without allocating.
    ///
    /// # Panics
    /// If there are not [`Network::weights`] numbers.
    pub fn set_weights(&mut self, weights: &[f64]) {
        self.weights.copy_from_slice(weights);
        for (gates, layer) in self.layers.iter_mut().zip(&self.layout.layers) {
            gates.fill(layer, weights);
        }
    }

    /// The weights in the order of [`Network::tensors`].
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The network.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Offsets of the weights.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Length of the scratch of [`step`](Self::step).
    pub fn scratch(&self) -> usize {
        match self.network.cell {
            Cell::Lstm { hidden, .. } => 7 * hidden,
            Cell::Gru { hidden } => 5 * hidden,
            Cell::Vanilla { hidden, .. } => hidden,
        }
    }

    pub(super) fn layer_state(&self) -> usize {
        self.network.state_len() / self.layers.len()
    }

    /// `state <- f(state, x)`.
    ///
    /// # Panics
    /// If a slice is shorter than documented: `state` [`Network::state_len`], `x` [`Network::inputs`], `scratch`
    /// [`scratch`](Self::scratch).
    #[inline(never)]
    pub fn step(&self, state: &mut [f64], x: &[f64], scratch: &mut [f64]) {
        Arch::new().dispatch(Step { packed: self, state, x, scratch });
    }

    #[inline(always)]
    fn step_with<S: Simd>(&self, simd: S, state: &mut [f64], x: &[f64], scratch: &mut [f64]) {
        let len = self.layer_state();
        for layer in 0..self.layers.len() {
            let (below, own) = state.split_at_mut(layer * len);
            let x = if layer == 0 { x } else { &below[below.len() - len..] };
            self.layer_step(simd, layer, x, &mut own[..len], scratch);
        }
    }

    /// A step of one layer. For the derivatives it leaves in `scratch` the gates and, of an LSTM, `tanh(c+)` and the
    /// input of the projection; then the previous state of the element-wise functions.
    #[inline(always)]
    pub(super) fn layer_step<S: Simd>(
        &self,
        simd: S,
        layer: usize,
        x: &[f64],
        state: &mut [f64],
        scratch: &mut [f64],
    ) {
        let maps = &self.layers[layer];
        let x = &x[..self.layout.layers[layer].reads];
        match self.network.cell {
            Cell::Lstm { hidden, .. } => {
                let (record, rest) = scratch.split_at_mut(5 * hidden);
                let (shown, rest) = rest.split_at_mut(hidden);
                let (c, h) = state.split_at_mut(hidden);
                maps.sums(x, h, &mut record[..4 * hidden]);
                let before = &mut rest[..hidden];
                before.copy_from_slice(c);
                lstm::forward(simd, record, before, c, shown);
                match &self.layout.projection {
                    Some(place) => product(&self.weights[place.clone()], shown, h),
                    None => h.copy_from_slice(shown),
                }
            }
            Cell::Gru { hidden } => {
                let (gates, rest) = scratch.split_at_mut(4 * hidden);
                maps.sums(x, state, gates);
                let before = &mut rest[..hidden];
                before.copy_from_slice(state);
                gru::forward(simd, gates, before, state);
            }
            Cell::Vanilla { hidden, .. } => {
                let sums = &mut scratch[..hidden];
                maps.sums(x, state, sums);
                vanilla::forward(simd, sums);
                state.copy_from_slice(sums);
            }
        }
    }

    /// `h` of the last layer, the input of the read-out.
    #[inline]
    pub fn shown<'a>(&self, state: &'a [f64]) -> &'a [f64] {
        &state[self.network.state_len() - self.network.cell.shown()..]
    }

    /// `y = g(state)`.
    ///
    /// # Panics
    /// If `y` has not [`Network::outputs`] numbers.
    #[inline]
    pub fn output(&self, state: &[f64], y: &mut [f64]) {
        let shown = self.shown(state);
        match &self.layout.read_out {
            Some((weight, bias)) => {
                product(&self.weights[weight.clone()], shown, y);
                for (y, &b) in y.iter_mut().zip(&self.weights[bias.clone()]) {
                    *y += b;
                }
            }
            None => y.copy_from_slice(shown),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn every_processor_gives_the_same_bits() {
        for cell in [
            Cell::Lstm { hidden: 11, projection: Some(3) },
            Cell::Gru { hidden: 13 },
            Cell::Vanilla { hidden: 9, layers: 2 },
        ] {
            let network = Network { cell, inputs: 5, outputs: 2, read_out: true };
            let numbers = |count: usize| (0..count).map(|k| (k * k % 101) as f64 / 101.0 - 0.5);
            let packed = Packed::new(network, &numbers(network.weights()).collect::<Vec<_>>());
            let run = |step: &dyn Fn(Step<'_>)| {
                let mut state = vec![0.0; network.state_len()];
                let mut scratch = vec![0.0; packed.scratch()];
                let x: Vec<f64> = numbers(30 * 5).collect();
                for x in x.chunks_exact(5) {
                    step(Step { packed: &packed, state: &mut state, x, scratch: &mut scratch });
                }
                state
            };
            let scalar = run(&|step| pulp::Scalar::new().vectorize(step));
            if let Some(simd) = pulp::x86::V3::try_new() {
                assert_eq!(scalar, run(&|step| Simd::vectorize(simd, step)));
            }
            if let Some(simd) = pulp::x86::V4::try_new() {
                assert_eq!(scalar, run(&|step| Simd::vectorize(simd, step)));
            }
        }
    }
}
