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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gates_are_the_rows_of_sigmoids() {
        let lstm = Network {
            cell: Cell::Lstm { hidden: 2, projection: Some(1) },
            inputs: 1,
            outputs: 1,
            read_out: false,
        };
        // W_ih 8 x 1, W_hh 8 x 1, two biases of 8; g is the third pair of rows.
        let g = |at: &usize| matches!(at % 8, 4 | 5);
        let mut gates = Layout::new(&lstm).gates(lstm.cell);
        gates.sort_unstable();
        let expected: Vec<usize> = (0..32).filter(|at| !g(at)).collect();
        assert_eq!(gates, expected);
        let gru = Network { cell: Cell::Gru { hidden: 2 }, inputs: 1, outputs: 1, read_out: true };
        // W_ih 6 x 1, W_hh 6 x 2, two biases of 6; n is the last third of each.
        let mut gates = Layout::new(&gru).gates(gru.cell);
        gates.sort_unstable();
        let expected: Vec<usize> = (0..4).chain(6..14).chain(18..22).chain(24..28).collect();
        assert_eq!(gates, expected);
        let vanilla =
            Network { cell: Cell::Vanilla { hidden: 2, layers: 2 }, inputs: 1, outputs: 1, read_out: true };
        assert!(Layout::new(&vanilla).gates(vanilla.cell).is_empty());
    }

    /// The layout (offsets) agrees with the tensors (names).
    #[test]
    fn places_are_those_of_the_tensors() {
        for cell in [
            Cell::Lstm { hidden: 5, projection: Some(2) },
            Cell::Lstm { hidden: 5, projection: None },
            Cell::Gru { hidden: 4 },
            Cell::Vanilla { hidden: 3, layers: 3 },
        ] {
            let network = Network { cell, inputs: 2, outputs: 2, read_out: true };
            let layout = Layout::new(&network);
            let mut places: Vec<Range<usize>> = Vec::new();
            for layer in &layout.layers {
                places.extend(
                    [&layer.weight_ih, &layer.weight_hh, &layer.bias_ih, &layer.bias_hh].map(Clone::clone),
                );
            }
            places.extend(layout.projection);
            places.extend(layout.read_out.into_iter().flat_map(|(weight, bias)| [weight, bias]));
            let tensors: Vec<Range<usize>> =
                network.tensors().iter().map(super::super::Tensor::range).collect();
            assert_eq!(places, tensors);
        }
    }
}
