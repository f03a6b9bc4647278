//! Matrices with one column for each weight, in panels.

use alloc::vec::Vec;
use core::ops::Range;

use super::super::learnable::Learnable;

/// Neighbouring blocks of weights. A matrix with one column for each weight is stored in panels, row by row.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    start: usize,
    pub(super) width: usize,
    /// Learned blocks: block of the model, first column in the panel, number of weights.
    blocks: Vec<(usize, usize, usize)>,
}

impl Panel {
    /// One panel for every `group` neighbouring blocks with a learned block.
    pub(super) fn all<M: Learnable>(model: &M, learned: &[usize], group: usize) -> Vec<Self> {
        let mut panels: Vec<Self> = Vec::new();
        let mut last = None;
        for &block in learned {
            let start = panels.last().map_or(0, |panel| panel.start + panel.width);
            if last != Some(block / group) {
                panels.push(Self { start, width: 0, blocks: Vec::new() });
                last = Some(block / group);
            }
            if let Some(panel) = panels.last_mut() {
                let len = model.blocks()[block].len();
                panel.blocks.push((block, panel.width, len));
                panel.width += len;
            }
        }
        panels
    }

    pub(super) fn of(&self, rows: usize) -> Range<usize> {
        rows * self.start..rows * (self.start + self.width)
    }

    pub(super) fn places<'a>(&'a self, blocks: &'a [Vec<usize>]) -> impl Iterator<Item = usize> + 'a {
        self.blocks.iter().flat_map(|&(block, ..)| blocks[block].iter().copied())
    }

    /// Local Jacobians of the last step, each block in its own columns (`rows x width`).
    pub(super) fn linearize<M: Learnable>(&self, model: &M, local: &mut [f64]) {
        for &(block, column, len) in &self.blocks {
            for (row, local) in local.chunks_exact_mut(self.width).enumerate() {
                model.local_jacobian(block, row, &mut local[column..column + len]);
            }
        }
    }

    /// The local Jacobians in the local rows of all blocks (`all_rows x width`), zero outside of each block.
    pub(super) fn expand(&self, local: &[f64], into: &mut [f64]) {
        into.fill(0.0);
        let rows = local.len() / self.width;
        for &(block, column, len) in &self.blocks {
            for (row, local) in local.chunks_exact(self.width).enumerate() {
                let at = (block * rows + row) * self.width + column;
                into[at..at + len].copy_from_slice(&local[column..column + len]);
            }
        }
    }
}
