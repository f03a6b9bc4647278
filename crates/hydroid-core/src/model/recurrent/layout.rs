//! Offsets of weights in the flat weights of a network.

use alloc::vec::Vec;
use core::ops::Range;

use super::network::{Cell, Network};

/// Offsets of all weights, in the order of [`Network::tensors`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Layers, from the input on.
    pub layers: Vec<LayerLayout>,
    /// `W_hr` of an LSTM's projection, row by row.
    pub projection: Option<Range<usize>>,
    /// `W` and `b` of the read-out.
    pub read_out: Option<(Range<usize>, Range<usize>)>,
}

/// Offsets of the weights of one layer, matrices row by row with [`rows`](Self::rows) rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerLayout {
    /// Rows of all gates.
    pub rows: usize,
    /// Length of the input of the layer: the input of the network, or the `h` of the layer before.
    pub reads: usize,
    /// Length of the layer's `h`.
    pub shown: usize,
    /// `W_ih`, `rows x reads`.
    pub weight_ih: Range<usize>,
    /// `W_hh`, `rows x shown`.
    pub weight_hh: Range<usize>,
    /// `b_ih`.
    pub bias_ih: Range<usize>,
    /// `b_hh`.
    pub bias_hh: Range<usize>,
}

/// The weights of one row of a layer's gates; rows do not share weights.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GateRow {
    /// Row of `W_ih`.
    pub weight_ih: Range<usize>,
    /// Row of `W_hh`.
    pub weight_hh: Range<usize>,
    /// Element of `b_ih`.
    pub bias_ih: usize,
    /// Element of `b_hh`.
    pub bias_hh: usize,
}

impl LayerLayout {
    /// The weights of a row of the gates.
    pub fn row(&self, row: usize) -> GateRow {
        let run = |of: &Range<usize>, len: usize| of.start + row * len..of.start + (row + 1) * len;
        GateRow {
            weight_ih: run(&self.weight_ih, self.reads),
            weight_hh: run(&self.weight_hh, self.shown),
            bias_ih: self.bias_ih.start + row,
            bias_hh: self.bias_hh.start + row,
        }
    }
}

impl Layout {
    /// The layout of a network.
    pub fn new(network: &Network) -> Self {
        let (cell, mut end) = (network.cell, 0);
        let mut next = |len: usize| {
            end += len;
            end - len..end
        };
        let (rows, shown) = (cell.gate_rows(), cell.shown());
        let layers = (0..cell.layers())
            .map(|layer| {
                let reads = if layer == 0 { network.inputs } else { shown };
                let (weight_ih, weight_hh) = (next(rows * reads), next(rows * shown));
                let (bias_ih, bias_hh) = (next(rows), next(rows));
                LayerLayout { rows, reads, shown, weight_ih, weight_hh, bias_ih, bias_hh }
            })
            .collect();
        let projection = match cell {
            Cell::Lstm { hidden, projection: Some(projection) } => Some(next(projection * hidden)),
            _ => None,
        };
        let read_out = network.read_out.then(|| (next(network.outputs * shown), next(network.outputs)));
        Self { layers, projection, read_out }
    }

    /// Weights of the sigmoid gates: `i`, `f` and `o` of an LSTM, `r` and `z` of a GRU, none of a vanilla network.
    pub fn gates(&self, cell: Cell) -> Vec<usize> {
        let (parts, sigmoid): (usize, &[usize]) = match cell {
            Cell::Lstm { .. } => (4, &[0, 1, 3]),
            Cell::Gru { .. } => (3, &[0, 1]),
            Cell::Vanilla { .. } => (1, &[]),
        };
        let of_layer = |layer: &LayerLayout| {
            let kept = (0..layer.rows).filter(|row| sigmoid.contains(&(row * parts / layer.rows)));
            let rows = kept.map(|row| layer.row(row));
            let places =
                rows.flat_map(|row| row.weight_ih.chain(row.weight_hh).chain([row.bias_ih, row.bias_hh]));
            places.collect::<Vec<_>>()
        };
        self.layers.iter().flat_map(of_layer).collect()
    }
}
