//! Groups of weights that act on the same results of a step.

use alloc::vec::Vec;

use super::super::network::{Cell, Network};
use super::linearization::Linearization;
use super::packed::Packed;

/// The weights of a network in blocks. Each block acts on rows of results that no other block changes.
///
/// | block | weights | rows |
/// | --- | --- | --- |
/// | each unit of each layer | its row of every gate: `W_ih`, `W_hh`, `b_ih`, `b_hh` | its results: of an LSTM `c+`, and `s(o) tanh(c+)` changed by `o` alone; `h+` of the others |
/// | each row of an LSTM's projection | its row of `W_hr` | `h+` |
/// | each output of the read-out | its row of `W`, and of `b` | `y` |
///
/// The effect of a weight change on a step is its effect on these rows ([`Linearization::local`]: block by block, a few
/// numbers for each weight), times the effect of the rows on the step ([`Change::local`](super::Change)). A filter on
/// the weights multiplies the covariance of all weights by the first factor alone. Every block has the same number of
/// rows; missing rows are zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blocks {
    rows: usize,
    places: Vec<Vec<usize>>,
    /// Number of blocks of the units and of the projection; the blocks of the read-out follow.
    transition: usize,
    projection: usize,
    last_layer: usize,
}

impl Blocks {
    /// The blocks of a packed network.
    pub fn new(packed: &Packed) -> Self {
        let (layout, Network { cell, .. }) = (packed.layout(), packed.network());
        let (units, gates, rows) = match *cell {
            Cell::Lstm { hidden, .. } => (hidden, 4, 2),
            Cell::Gru { hidden } => (hidden, 3, 1),
            Cell::Vanilla { hidden, .. } => (hidden, 1, 1),
        };
        let mut places = Vec::new();
        for layer in &layout.layers {
            for unit in 0..units {
                let of_gate = |gate: usize| {
                    let row = layer.row(gate * units + unit);
                    row.weight_ih.chain(row.weight_hh).chain([row.bias_ih, row.bias_hh])
                };
                places.push((0..gates).flat_map(of_gate).collect());
            }
        }
        let last_layer = (layout.layers.len() - 1) * units;
        let units_end = places.len();
        if let Some(projection) = &layout.projection {
            places.extend(projection.clone().collect::<Vec<_>>().chunks(units).map(<[usize]>::to_vec));
        }
        let transition = places.len();
        if let Some((weight, bias)) = &layout.read_out {
            let shown = cell.shown();
            places.extend(bias.clone().enumerate().map(|(i, bias)| {
                (weight.start + i * shown..weight.start + (i + 1) * shown).chain([bias]).collect::<Vec<_>>()
            }));
        }
        Self { rows, places, transition, projection: units_end, last_layer }
    }

    /// Number of rows of every block.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of nonzero local rows of a block.
    pub fn rows_of(&self, block: usize) -> usize {
        if block < self.projection { self.rows } else { 1 }
    }

    /// Offsets of the weights of each block in the flat weights.
    pub fn places(&self) -> &[Vec<usize>] {
        &self.places
    }

    /// Number of blocks on which the state depends; the others only change the outputs.
    pub fn transition(&self) -> usize {
        self.transition
    }

    /// The first block of the read-out, or of the projection where it is the output.
    pub fn read_out(&self) -> usize {
        if self.transition < self.places.len() {
            self.transition
        } else {
            self.projection.min(self.transition)
        }
    }

    /// The first block of the last layer.
    pub fn last_layer(&self) -> usize {
        self.last_layer
    }
}

impl Linearization {
    pub(super) fn first_output_block(&self) -> usize {
        let units = self.layers[0].units();
        // A projection is shorter than the vector that it projects.
        let projected = if self.shown().len() == units { 0 } else { self.shown().len() };
        self.layers.len() * units + projected
    }

    /// Partial derivatives of a row of a block with respect to the block's weights, in their order ([`Blocks`]).
    ///
    /// # Panics
    /// If there is no such block, or `into` has not one number for each of its weights.
    pub fn local(&self, block: usize, row: usize, into: &mut [f64]) {
        let units = self.layers[0].units();
        let Some(layer) = self.layers.get(block / units).filter(|layer| row < layer.results()) else {
            return self.local_of_output(block, row, into);
        };
        let unit = block % units;
        let (x, h) = (layer.x(), layer.h());
        let own = layer.own_gates(row);
        for (gate, into) in into.chunks_exact_mut(x.len() + h.len() + 2).enumerate() {
            if !own.contains(&gate) {
                into.fill(0.0);
                continue;
            }
            let (a, b) = (layer.input(row, gate)[unit], layer.hidden(row, gate)[unit]);
            let (of_x, rest) = into.split_at_mut(x.len());
            let (of_h, biases) = rest.split_at_mut(h.len());
            of_x.iter_mut().zip(x).for_each(|(into, &x)| *into = a * x);
            of_h.iter_mut().zip(h).for_each(|(into, &h)| *into = b * h);
            biases.copy_from_slice(&[a, b]);
        }
    }

    /// [`local`](Self::local) for the projection and the read-out, which have one row.
    fn local_of_output(&self, block: usize, row: usize, into: &mut [f64]) {
        if row > 0 {
            into.fill(0.0);
        } else if block < self.first_output_block() {
            into.copy_from_slice(self.layers[0].projected());
        } else {
            let (weights, bias) = into.split_at_mut(self.shown().len());
            weights.copy_from_slice(self.shown());
            bias.fill(1.0);
        }
    }
}
