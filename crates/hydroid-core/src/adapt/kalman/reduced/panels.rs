//! Columns of weights, side by side.

use alloc::vec::Vec;
use core::ops::Range;

use super::super::learnable::Learnable;
use crate::math::Scalar;

/// Neighbouring blocks of weights.
///
/// Matrices with a column for each weight are kept in panels, each row by row: what works on a panel's columns finds them
/// side by side.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    /// Its first column among all.
    start: usize,
    pub(super) width: usize,
    /// Blocks that are learned: which, its first column in the panel, its number of weights.
    blocks: Vec<(usize, usize, usize)>,
}

impl Panel {
    /// Of every `group` neighbouring blocks those that are learned; what has none is left out.
    pub(super) fn all<T: Scalar, M: Learnable<T>>(model: &M, learned: &[usize], group: usize) -> Vec<Self> {
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

    /// Its part of a matrix of so many rows.
    pub(super) fn of(&self, rows: usize) -> Range<usize> {
        rows * self.start..rows * (self.start + self.width)
    }

    /// Where its weights stand among the weights.
    pub(super) fn places<'a>(&'a self, blocks: &'a [Vec<usize>]) -> impl Iterator<Item = usize> + 'a {
        self.blocks.iter().flat_map(|&(block, ..)| blocks[block].iter().copied())
    }

    /// Partials of the local rows of the step that was just made, each block's in its own columns (`rows x width`).
    pub(super) fn linearize<T: Scalar, M: Learnable<T>>(&self, model: &M, local: &mut [T]) {
        for &(block, column, len) in &self.blocks {
            for (row, local) in local.chunks_exact_mut(self.width).enumerate() {
                model.local(block, row, &mut local[column..column + len]);
            }
        }
    }

    /// The same as a matrix of all local rows of all blocks (`all_rows x width`), zero outside the blocks' own.
    pub(super) fn expand<T: Scalar>(&self, local: &[T], into: &mut [T]) {
        into.fill(T::zero());
        let rows = local.len() / self.width;
        for &(block, column, len) in &self.blocks {
            for (row, local) in local.chunks_exact(self.width).enumerate() {
                let at = (block * rows + row) * self.width + column;
                into[at..at + len].copy_from_slice(&local[column..column + len]);
            }
        }
    }
}
