//! A step and its derivatives, as a product of row-sparse stages.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::super::layout::LayerLayout;
use super::super::network::Cell;
use super::super::{gru, lstm, vanilla};
use super::packed::Packed;
use crate::math::rows::add_rows;

/// The partial derivatives of one step, `state+ = f(state, x, weights)` and `y = g(state+, weights)`.
///
/// They are kept as the sparse stages of a step and applied stage by stage, because the Jacobian of an LSTM's projected
/// state is dense. For each layer ([`LayerPartials`])
///
/// ```text
/// a = W_ih x + b_ih,  b = W_hh h + b_hh                  sums: row j of a gate has weights that no other row has
/// dr_j = sum_gates (input_j da_j + hidden_j db_j) + carry_j ds_j        results of unit j: local
/// h+ = r, or W_hr r                                       projection; x of the next layer
/// y = h+, or W h+ + b                                     read-out
/// ```
///
/// with the results `r` of a unit (`c+` and `s(o) . tanh(c+)` of an LSTM, `h+` of the others) and its carried state `s`
/// (`c` of an LSTM, `h` of a GRU).
///
/// [`step`](Self::step) computes them. The products with the Jacobian (jvp: [`times`](Self::times),
/// [`output_times`](Self::output_times)) and with its transpose (vjp: [`transposed_times`](Self::transposed_times),
/// [`output_transposed_times`](Self::output_transposed_times)) take the same weights as the step, and several vectors
/// at a time. Only [`new`](Self::new) and the dense matrices allocate.
#[derive(Clone, Debug)]
pub struct Linearization {
    pub(super) layers: Vec<LayerPartials>,
    pub(super) shown: Vec<f64>,
}

/// Local partial derivatives of one layer. Row `gate n + j` of the gates belongs to unit `j`;
/// [`LayerLayout::row`](super::super::LayerLayout::row) gives its weights.
#[derive(Clone, Debug)]
pub struct LayerPartials {
    units: usize,
    gates: usize,
    results: usize,
    x: Vec<f64>,
    before: Vec<f64>,
    h_at: usize,
    input: Vec<f64>,
    hidden: Vec<f64>,
    carry: Vec<f64>,
    /// Partials of the results with respect to `h` and `x` through their own gates: `results units x h` and `x reads`.
    of_h: Vec<f64>,
    of_x: Vec<f64>,
    /// Partials of `s(o) tanh(c+)` with respect to `c+`, for each unit of an LSTM.
    through: Vec<f64>,
    /// Scratch of [`Packed::layer_step`], with its results.
    scratch: Vec<f64>,
    /// An adjoint of the results, one number for each unit, and the record of an LSTM's backward pass.
    adjoint: Vec<f64>,
    record: Vec<f64>,
}

impl LayerPartials {
    /// Number of units `n`.
    pub fn units(&self) -> usize {
        self.units
    }

    /// Number of gates: 4 (LSTM), 3 (GRU), 1 (vanilla).
    pub fn gates(&self) -> usize {
        self.gates
    }

    /// Number of results of a unit: 2 (LSTM), 1 (GRU, vanilla).
    pub fn results(&self) -> usize {
        self.results
    }

    /// Input of the layer, which multiplies `weight_ih`.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// `h` before the step, which multiplies `weight_hh`.
    pub fn h(&self) -> &[f64] {
        &self.before[self.h_at..]
    }

    pub(super) fn h_at(&self) -> usize {
        self.h_at
    }

    /// Input of an LSTM's projection, `s(o) . tanh(c+)` (`n` numbers): the last result.
    pub fn projected(&self) -> &[f64] {
        &self.scratch[5 * self.units..][..self.units]
    }

    /// Partials of a result of each unit with respect to its row of `a = W_ih x + b_ih` of a gate (zero for `c+`,
    /// output gate).
    pub fn input(&self, result: usize, gate: usize) -> &[f64] {
        &self.input[(result * self.gates + gate) * self.units..][..self.units]
    }

    /// As [`input`](Self::input) for `b = W_hh h + b_hh`; they differ in the GRU's `n`, because of the reset gate.
    pub fn hidden(&self, result: usize, gate: usize) -> &[f64] {
        &self.hidden[(result * self.gates + gate) * self.units..][..self.units]
    }

    /// Gates on which a result of a unit depends directly: `i f g` for `c+` of an LSTM, and `o` for `s(o) tanh(c+)`,
    /// besides its dependence on `c+` ([`through`](Self::through)). No weight of a unit belongs to two of its results.
    pub(super) fn own_gates(&self, result: usize) -> Range<usize> {
        match (self.results, result) {
            (2, 0) => 0..self.gates - 1,
            (2, _) => self.gates - 1..self.gates,
            _ => 0..self.gates,
        }
    }

    /// Partials of the last result of each unit with respect to the one before; empty where there is none.
    pub(super) fn through(&self) -> &[f64] {
        &self.through
    }

    /// Partials of a result of each unit with respect to its carried state; zero for a vanilla network.
    pub fn carry(&self, result: usize) -> &[f64] {
        &self.carry[result * self.units..][..self.units]
    }
}

impl LayerPartials {
    /// Partials of the last step, by the backward pass of the cell from unit adjoints.
    #[inline(always)]
    fn differentiate<S: Simd>(&mut self, simd: S, cell: Cell, after: &[f64]) {
        let (n, one, adjoint) = (self.units, 1.0, &mut self.adjoint);
        match cell {
            Cell::Lstm { .. } => {
                let record = self.scratch[3 * n..5 * n].split_at(n);
                for ((through, &o), &t) in self.through.iter_mut().zip(record.0).zip(record.1) {
                    *through = o * (one - t * t);
                }
                let results = self.input.chunks_exact_mut(4 * n).zip(self.carry.chunks_exact_mut(n));
                for (result, (partials, carry)) in results.enumerate() {
                    self.record.copy_from_slice(&self.scratch[..5 * n]);
                    adjoint.fill(if result == 0 { 0.0 } else { one });
                    carry.fill(if result == 0 { one } else { 0.0 });
                    lstm::backward(simd, &mut self.record, &self.before[..n], adjoint, carry);
                    partials.copy_from_slice(&self.record[..4 * n]);
                }
                self.hidden.copy_from_slice(&self.input);
            }
            Cell::Gru { .. } => {
                let gates = &mut self.scratch[..4 * n];
                self.carry.fill(one);
                gru::backward(simd, gates, &self.before, &mut self.carry);
                self.input.copy_from_slice(&gates[..3 * n]);
                self.hidden[..2 * n].copy_from_slice(&gates[..2 * n]);
                self.hidden[2 * n..].copy_from_slice(&gates[3 * n..]);
            }
            Cell::Vanilla { .. } => {
                adjoint.fill(one);
                vanilla::backward(simd, after, adjoint, &mut self.input);
                self.hidden.copy_from_slice(&self.input);
            }
        }
    }
}

impl LayerPartials {
    /// Multiplies the partials of the gates by their weights: [`of_h`](Self::of_h) and [`of_x`](Self::of_x).
    #[inline(always)]
    fn gather(&mut self, weights: &[f64], place: &LayerLayout) {
        let (units, reads, shown) = (self.units, self.x.len(), place.shown);
        self.of_h.fill(0.0);
        self.of_x.fill(0.0);
        for at in 0..self.results * units {
            let (result, unit) = (at / units, at % units);
            for gate in self.own_gates(result) {
                let row = place.row(gate * units + unit);
                let (a, b) = (self.input(result, gate)[unit], self.hidden(result, gate)[unit]);
                add_rows(&mut self.of_x[at * reads..(at + 1) * reads], &weights[row.weight_ih], &[a]);
                add_rows(&mut self.of_h[at * shown..(at + 1) * shown], &weights[row.weight_hh], &[b]);
            }
        }
    }

    /// Partials of a result of each unit with respect to `h` before the step, through its own gates: `units x h`.
    pub(super) fn of_h(&self, result: usize) -> &[f64] {
        let len = self.units * self.h().len();
        &self.of_h[result * len..][..len]
    }

    /// Partials with respect to `x`: `units x reads`.
    pub(super) fn of_x(&self, result: usize) -> &[f64] {
        let len = self.units * self.x.len();
        &self.of_x[result * len..][..len]
    }
}

pub(crate) struct Step<'a> {
    linear: &'a mut Linearization,
    packed: &'a Packed,
    state: &'a mut [f64],
    x: &'a [f64],
}

impl WithSimd for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.linear.step_with(simd, self.packed, self.state, self.x);
    }
}

impl Linearization {
    /// A linearization for networks of this size.
    pub fn new(packed: &Packed) -> Self {
        let cell = packed.network().cell;
        let (units, gates, results, h_at) = match cell {
            Cell::Lstm { hidden, .. } => (hidden, 4, 2, hidden),
            Cell::Gru { hidden } => (hidden, 3, 1, 0),
            Cell::Vanilla { hidden, .. } => (hidden, 1, 1, 0),
        };
        let layer = |reads: usize| LayerPartials {
            units,
            gates,
            results,
            x: vec![0.0; reads],
            before: vec![0.0; packed.layer_state()],
            h_at,
            input: vec![0.0; results * gates * units],
            hidden: vec![0.0; results * gates * units],
            carry: vec![0.0; results * units],
            of_h: vec![0.0; results * units * cell.shown()],
            of_x: vec![0.0; results * units * reads],
            through: vec![0.0; if results == 2 { units } else { 0 }],
            scratch: vec![0.0; packed.scratch()],
            adjoint: vec![0.0; units],
            record: vec![0.0; 5 * units],
        };
        let layers = packed.layout().layers.iter().map(|place| layer(place.reads)).collect();
        Self { layers, shown: vec![0.0; cell.shown()] }
    }

    /// `state <- f(state, x)`, bit-identical to [`Packed::step`], with its partial derivatives.
    ///
    /// # Panics
    /// If `state` or `x` is shorter than for [`Packed::step`], or the network has another size.
    #[inline(never)]
    pub fn step(&mut self, packed: &Packed, state: &mut [f64], x: &[f64]) {
        Arch::new().dispatch(Step { linear: self, packed, state, x });
    }

    #[inline(always)]
    fn step_with<S: Simd>(&mut self, simd: S, packed: &Packed, state: &mut [f64], x: &[f64]) {
        let len = packed.layer_state();
        for (index, layer) in self.layers.iter_mut().enumerate() {
            let (below, own) = state.split_at_mut(index * len);
            let (x, own) = (if index == 0 { x } else { &below[below.len() - len..] }, &mut own[..len]);
            let reads = layer.x.len();
            layer.x.copy_from_slice(&x[..reads]);
            layer.before.copy_from_slice(own);
            packed.layer_step(simd, index, x, own, &mut layer.scratch);
            layer.differentiate(simd, packed.network().cell, own);
            layer.gather(packed.weights(), &packed.layout().layers[index]);
        }
        self.shown.copy_from_slice(packed.shown(state));
    }

    /// Partials of a layer.
    ///
    /// # Panics
    /// If there is no such layer.
    pub fn layer(&self, layer: usize) -> &LayerPartials {
        &self.layers[layer]
    }

    /// `h+` of the last layer, which multiplies the read-out's weights.
    pub fn shown(&self) -> &[f64] {
        &self.shown
    }
}
