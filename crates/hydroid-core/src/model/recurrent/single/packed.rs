//! Weights laid out for one step of one sequence.

use alloc::vec;
use alloc::vec::Vec;

use super::super::layout::{LayerLayout, Layout};
use super::super::network::{Cell, Network};
use super::{gru, lstm, vanilla};
use crate::math::Scalar;

/// A network's weights as a step of one sequence reads them fastest: the gates' matrices column by column, so that
/// their rows are summed side by side, and biases that are always added together as one.
///
/// ```text
/// step:    state+ = f(state, x)          output:  y = g(state+)
/// ```
///
/// The state is laid out as [`Cell`] says. Nothing here allocates but [`new`](Self::new).
#[derive(Clone, Debug, PartialEq)]
pub struct Packed<T> {
    network: Network,
    layout: Layout,
    /// As [`Network::tensors`] has them.
    weights: Vec<T>,
    layers: Vec<Columns<T>>,
}

/// A layer's gates. `sums = bias`, then `sums[..input rows] += input x`, `sums[hidden_at..] += hidden h`.
#[derive(Clone, Debug, PartialEq)]
struct Columns<T> {
    bias: Vec<T>,
    input: Vec<T>,
    hidden: Vec<T>,
    /// Where the rows of `hidden` begin among the sums.
    hidden_at: usize,
    /// Row of the weights that is the first among the rows of `input`.
    first_input: usize,
}

impl<T: Scalar> Columns<T> {
    /// The GRU's sums stand as [`gru::forward`] wants them: `[a_n r z b_n]`.
    fn new(cell: Cell, layer: &LayerLayout) -> Self {
        let (hidden_at, first_input) =
            if let Cell::Gru { hidden } = cell { (hidden, 2 * hidden) } else { (0, 0) };
        Self {
            bias: vec![T::zero(); layer.rows + hidden_at],
            input: vec![T::zero(); layer.rows * layer.reads],
            hidden: vec![T::zero(); layer.rows * layer.shown],
            hidden_at,
            first_input,
        }
    }

    fn fill(&mut self, layer: &LayerLayout, weights: &[T]) {
        let rows = layer.rows;
        let (input, hidden) = (&weights[layer.weight_ih.clone()], &weights[layer.weight_hh.clone()]);
        let (bias_ih, bias_hh) = (&weights[layer.bias_ih.clone()], &weights[layer.bias_hh.clone()]);
        self.bias.fill(T::zero());
        for row in 0..rows {
            let from = (row + self.first_input) % rows;
            self.bias[row] += bias_ih[from];
            self.bias[self.hidden_at + row] += bias_hh[row];
            for k in 0..layer.reads {
                self.input[k * rows + row] = input[from * layer.reads + k];
            }
            for k in 0..layer.shown {
                self.hidden[k * rows + row] = hidden[row * layer.shown + k];
            }
        }
    }

    #[inline]
    fn sums(&self, rows: usize, x: &[T], h: &[T], sums: &mut [T]) {
        sums.copy_from_slice(&self.bias);
        add_product(&mut sums[..rows], &self.input, x);
        add_product(&mut sums[self.hidden_at..], &self.hidden, h);
    }
}

impl<T: Scalar> Packed<T> {
    /// Packs the weights of a network.
    ///
    /// # Panics
    /// If there are not [`Network::weights`] numbers.
    pub fn new(network: Network, weights: &[T]) -> Self {
        let layout = Layout::new(&network);
        let layers = layout.layers.iter().map(|layer| Columns::new(network.cell, layer)).collect();
        let mut packed = Self { network, layout, weights: vec![T::zero(); network.weights()], layers };
        packed.set_weights(weights);
        packed
    }

    /// Replaces the weights.
    ///
    /// # Panics
    /// If there are not [`Network::weights`] numbers.
    pub fn set_weights(&mut self, weights: &[T]) {
        self.weights.copy_from_slice(weights);
        for (columns, layer) in self.layers.iter_mut().zip(&self.layout.layers) {
            columns.fill(layer, weights);
        }
    }

    /// The weights as [`Network::tensors`] has them.
    pub fn weights(&self) -> &[T] {
        &self.weights
    }

    /// The network.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Where each weight stands.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Numbers of scratch that [`step`](Self::step) needs.
    pub fn scratch(&self) -> usize {
        match self.network.cell {
            Cell::Lstm { hidden, .. } => 6 * hidden,
            Cell::Gru { hidden } => 4 * hidden,
            Cell::Vanilla { hidden, .. } => hidden,
        }
    }

    /// Length of a layer's part of the state.
    pub(super) fn layer_state(&self) -> usize {
        self.network.state_len() / self.layers.len()
    }

    /// `state <- f(state, x)`.
    ///
    /// # Panics
    /// If a slice is shorter than documented: `state` [`Network::state_len`], `x` [`Network::inputs`], `scratch`
    /// [`scratch`](Self::scratch).
    #[inline]
    pub fn step(&self, state: &mut [T], x: &[T], scratch: &mut [T]) {
        let len = self.layer_state();
        for layer in 0..self.layers.len() {
            let (below, own) = state.split_at_mut(layer * len);
            let x = if layer == 0 { x } else { &below[below.len() - len..] };
            self.layer_step(layer, x, &mut own[..len], scratch);
        }
    }

    /// A step of one layer. It leaves in `scratch` what derivatives want: the gates as the cell's `forward` says,
    /// and of an LSTM `tanh(c+)` and what is projected.
    #[inline]
    pub(super) fn layer_step(&self, layer: usize, x: &[T], state: &mut [T], scratch: &mut [T]) {
        let (columns, rows) = (&self.layers[layer], self.layout.layers[layer].rows);
        let x = &x[..self.layout.layers[layer].reads];
        let (sums, rest) = scratch.split_at_mut(columns.bias.len());
        match self.network.cell {
            Cell::Lstm { hidden, .. } => {
                let (c, h) = state.split_at_mut(hidden);
                let (tanh_c, rest) = rest.split_at_mut(hidden);
                let shown = &mut rest[..hidden];
                columns.sums(rows, x, h, sums);
                lstm::forward(sums, c, tanh_c, shown);
                match &self.layout.projection {
                    Some(place) => product(&self.weights[place.clone()], shown, h),
                    None => h.copy_from_slice(shown),
                }
            }
            Cell::Gru { .. } => {
                columns.sums(rows, x, state, sums);
                gru::forward(sums, state);
            }
            Cell::Vanilla { .. } => {
                columns.sums(rows, x, state, sums);
                vanilla::forward(sums, state);
            }
        }
    }

    /// `h` of the last layer, which the read-out reads.
    #[inline]
    pub fn shown<'a>(&self, state: &'a [T]) -> &'a [T] {
        &state[self.network.state_len() - self.network.cell.shown()..]
    }

    /// `y = g(state)`.
    ///
    /// # Panics
    /// If `y` has not [`Network::outputs`] numbers.
    #[inline]
    pub fn output(&self, state: &[T], y: &mut [T]) {
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

/// `sums += columns x`, four columns at a time: each pass over the sums costs a load and a store of all of them.
#[inline]
fn add_product<T: Scalar>(sums: &mut [T], columns: &[T], x: &[T]) {
    let n = sums.len();
    let mut fours = columns.chunks_exact(4 * n);
    let mut values = x.chunks_exact(4);
    for (four, x) in (&mut fours).zip(&mut values) {
        let (left, right) = four.split_at(2 * n);
        let ((a, b), (c, d)) = (left.split_at(n), right.split_at(n));
        for i in 0..n {
            sums[i] += (a[i] * x[0] + b[i] * x[1]) + (c[i] * x[2] + d[i] * x[3]);
        }
    }
    for (column, &x) in fours.remainder().chunks_exact(n).zip(values.remainder()) {
        for (sum, &w) in sums.iter_mut().zip(column) {
            *sum += w * x;
        }
    }
}

/// `y = W x`, `W` row by row; four sums side by side, or each addition would wait for the last.
#[inline]
fn product<T: Scalar>(weights: &[T], x: &[T], y: &mut [T]) {
    for (y, row) in y.iter_mut().zip(weights.chunks_exact(x.len())) {
        let mut sums = [T::zero(); 4];
        let (mut left, mut right) = (row.chunks_exact(4), x.chunks_exact(4));
        for (w, x) in (&mut left).zip(&mut right) {
            for lane in 0..4 {
                sums[lane] += w[lane] * x[lane];
            }
        }
        for (lane, (&w, &x)) in left.remainder().iter().zip(right.remainder()).enumerate() {
            sums[lane] += w * x;
        }
        *y = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    }
}
