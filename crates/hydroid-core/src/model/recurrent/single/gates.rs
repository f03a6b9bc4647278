//! The sums of a layer's gates from packed weights.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use alloc::vec;
use alloc::vec::Vec;

use super::super::layout::LayerLayout;
use super::super::network::Cell;

const ROWS: usize = 8;

/// The affine maps of a layer's gates: `[i f g o]` of an LSTM, the sums of a vanilla layer, or `[r z]`, `a_n` (of the
/// input alone) and `b_n` (of the state alone) of a GRU.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Gates {
    maps: Vec<Map>,
}

/// `W_ih x + W_hh h + b` for some rows; either matrix may be missing.
#[derive(Clone, Debug, PartialEq)]
struct Map {
    first: usize,
    rows: usize,
    reads_x: bool,
    reads_h: bool,
    /// Blocks of [`ROWS`] rows, padded with zeros: the biases, then column by column.
    blocks: Vec<f64>,
}

impl Gates {
    pub(super) fn new(cell: Cell, layer: &LayerLayout) -> Self {
        let map = |first: usize, rows: usize, reads_x: bool, reads_h: bool| {
            let columns = 1 + if reads_x { layer.reads } else { 0 } + if reads_h { layer.shown } else { 0 };
            let blocks = vec![0.0; rows.next_multiple_of(ROWS) * columns];
            Map { first, rows, reads_x, reads_h, blocks }
        };
        let maps = if let Cell::Gru { hidden: n } = cell {
            [map(0, 2 * n, true, true), map(2 * n, n, true, false), map(2 * n, n, false, true)].into()
        } else {
            [map(0, layer.rows, true, true)].into()
        };
        Self { maps }
    }

    pub(super) fn fill(&mut self, layer: &LayerLayout, weights: &[f64]) {
        for map in &mut self.maps {
            let (reads, shown) =
                (if map.reads_x { layer.reads } else { 0 }, if map.reads_h { layer.shown } else { 0 });
            for (block, rows) in
                map.blocks.chunks_exact_mut(ROWS * (1 + reads + shown)).zip((0..map.rows).step_by(ROWS))
            {
                for lane in 0..ROWS.min(map.rows - rows) {
                    let row = layer.row(map.first + rows + lane);
                    let bias = |given: bool, at: usize| if given { weights[at] } else { 0.0 };
                    block[lane] = bias(map.reads_x, row.bias_ih) + bias(map.reads_h, row.bias_hh);
                    let columns =
                        weights[row.weight_ih][..reads].iter().chain(&weights[row.weight_hh][..shown]);
                    for (column, &w) in block[ROWS..].chunks_exact_mut(ROWS).zip(columns) {
                        column[lane] = w;
                    }
                }
            }
        }
    }

    #[inline(always)]
    pub(super) fn sums(&self, x: &[f64], h: &[f64], mut sums: &mut [f64]) {
        for map in &self.maps {
            let (own, rest) = sums.split_at_mut(map.rows);
            map.apply(if map.reads_x { x } else { &[] }, if map.reads_h { h } else { &[] }, own);
            sums = rest;
        }
    }
}

impl Map {
    #[inline(always)]
    fn apply(&self, x: &[f64], h: &[f64], sums: &mut [f64]) {
        let mut blocks = self.blocks.chunks_exact(ROWS * (1 + x.len() + h.len()));
        let mut whole = sums.chunks_exact_mut(ROWS);
        for (sums, block) in (&mut whole).zip(&mut blocks) {
            sums.copy_from_slice(&block_sums(block, x, h));
        }
        if let Some(block) = blocks.next() {
            for (sum, rest) in whole.into_remainder().iter_mut().zip(block_sums(block, x, h)) {
                *sum = rest;
            }
        }
    }
}

#[inline(always)]
fn block_sums(block: &[f64], x: &[f64], h: &[f64]) -> [f64; ROWS] {
    let mut sums = [0.0; ROWS];
    let (bias, columns) = block.split_at(ROWS);
    sums.copy_from_slice(bias);
    let (of_x, of_h) = columns.split_at(ROWS * x.len());
    for (columns, x) in [(of_x, x), (of_h, h)] {
        for (column, &x) in columns.chunks_exact(ROWS).zip(x) {
            for lane in 0..ROWS {
                sums[lane] += column[lane] * x;
            }
        }
    }
    sums
}
