//! A recurrent network as a learnable model.

use alloc::vec::Vec;

use super::Learnable;
use crate::model::recurrent::{Blocks, Change, Linearization, Packed};

/// A recurrent network with the Jacobians of its last step.
#[derive(Clone, Debug)]
pub struct LearnableNetwork {
    packed: Packed,
    linear: Linearization,
    blocks: Blocks,
}

impl LearnableNetwork {
    /// From a network with its weights.
    pub fn new(packed: Packed) -> Self {
        Self { linear: Linearization::new(&packed), blocks: Blocks::new(&packed), packed }
    }

    /// The network with its current weights.
    pub fn packed(&self) -> &Packed {
        &self.packed
    }

    /// The blocks of weights.
    pub fn structure(&self) -> &Blocks {
        &self.blocks
    }
}

impl Learnable for LearnableNetwork {
    fn state_len(&self) -> usize {
        self.packed.network().state_len()
    }

    fn inputs(&self) -> usize {
        self.packed.network().inputs
    }

    fn outputs(&self) -> usize {
        self.packed.network().outputs
    }

    fn blocks(&self) -> &[Vec<usize>] {
        self.blocks.places()
    }

    fn rows(&self) -> usize {
        self.blocks.rows()
    }

    fn rows_of(&self, block: usize) -> usize {
        self.blocks.rows_of(block)
    }

    fn first_output_block(&self) -> usize {
        self.blocks.transition()
    }

    fn weights(&self) -> &[f64] {
        self.packed.weights()
    }

    fn set_weights(&mut self, weights: &[f64]) {
        self.packed.set_weights(weights);
    }

    fn step(&mut self, h: &mut [f64], x: &[f64]) {
        self.linear.step(&self.packed, h, x);
    }

    fn output(&self, h: &[f64], y: &mut [f64]) {
        self.packed.output(h, y);
    }

    fn local_jacobian(&self, block: usize, row: usize, into: &mut [f64]) {
        self.linear.local(block, row, into);
    }

    fn apply_state_jacobian(
        &self,
        state: &[f64],
        local: &[f64],
        columns: usize,
        out: &mut [f64],
        scratch: &mut [f64],
    ) {
        let change = Change { state: Some(state), local: Some(local), ..Change::default() };
        self.linear.times(&self.packed, change, columns, out, scratch);
    }

    fn apply_output_jacobian(&self, state: &[f64], local: &[f64], columns: usize, out: &mut [f64]) {
        let change = Change { state: Some(state), local: Some(local), ..Change::default() };
        self.linear.output_times(&self.packed, change, columns, out);
    }

    fn scratch(&self, columns: usize) -> usize {
        self.linear.scratch(columns)
    }
}
