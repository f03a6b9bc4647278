//! Recurrent networks.

use alloc::vec::Vec;

use super::learnable::Learnable;
use crate::math::Scalar;
use crate::model::recurrent::{Blocks, Change, Linearization, Packed};

/// A recurrent network with the partials of its last step.
#[derive(Clone, Debug)]
pub struct LearnableNetwork<T> {
    packed: Packed<T>,
    linear: Linearization<T>,
    blocks: Blocks,
}

impl<T: Scalar> LearnableNetwork<T> {
    /// A network with its weights.
    pub fn new(packed: Packed<T>) -> Self {
        Self { linear: Linearization::new(&packed), blocks: Blocks::new(&packed), packed }
    }

    /// The network with the weights of the moment.
    pub fn packed(&self) -> &Packed<T> {
        &self.packed
    }

    /// Its blocks.
    pub fn structure(&self) -> &Blocks {
        &self.blocks
    }
}

impl<T: Scalar> Learnable<T> for LearnableNetwork<T> {
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

    fn split(&self, block: usize) -> Option<usize> {
        Some(self.blocks.split(block))
    }

    fn shown(&self) -> usize {
        self.blocks.transition()
    }

    fn weights(&self) -> &[T] {
        self.packed.weights()
    }

    fn set_weights(&mut self, weights: &[T]) {
        self.packed.set_weights(weights);
    }

    fn step(&mut self, h: &mut [T], x: &[T]) {
        self.linear.step(&self.packed, h, x);
    }

    fn output(&self, h: &[T], y: &mut [T]) {
        self.packed.output(h, y);
    }

    fn local(&self, block: usize, row: usize, into: &mut [T]) {
        self.linear.local(block, row, into);
    }

    fn chain(&self, state: &[T], local: &[T], columns: usize, out: &mut [T], scratch: &mut [T]) {
        let change = Change { state: Some(state), local: Some(local), ..Change::default() };
        self.linear.times(&self.packed, change, columns, out, scratch);
    }

    fn output_chain(&self, state: &[T], local: &[T], columns: usize, out: &mut [T]) {
        let change = Change { state: Some(state), local: Some(local), ..Change::default() };
        self.linear.output_times(&self.packed, change, columns, out);
    }

    fn scratch(&self, columns: usize) -> usize {
        self.linear.scratch(columns)
    }
}
