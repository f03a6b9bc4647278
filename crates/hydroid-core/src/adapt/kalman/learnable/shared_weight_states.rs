//! Several states with the same weights.

use alloc::vec::Vec;
use core::ops::Range;

use super::Learnable;

/// A model with several states and one set of weights. A step advances the selected state:
///
/// ```text
/// h = [h_0; h_1; ..]        h_i+ = f(h_i, x, theta),  h_j+ = h_j for j != i        y = g(h_i+, theta)
/// ```
///
/// A [`Filter`](super::super::Filter) of it has all states in one covariance with the weights: a correction of the
/// weights also corrects the other states, according to their correlation.
#[derive(Clone, Debug)]
pub struct SharedWeightStates<M> {
    model: M,
    count: usize,
    selected: usize,
}

impl<M> SharedWeightStates<M> {
    /// `count` states, at least one; the first is selected.
    pub fn new(model: M, count: usize) -> Self {
        Self { model, count: count.max(1), selected: 0 }
    }

    /// The model.
    pub fn model(&self) -> &M {
        &self.model
    }

    pub(in super::super) fn select(&mut self, to: usize) {
        self.selected = to.min(self.count - 1);
    }

    /// Range of the selected state in numbers of `len` for each state.
    fn part(&self, len: usize) -> Range<usize> {
        self.selected * len..(self.selected + 1) * len
    }
}

impl<M: Learnable> Learnable for SharedWeightStates<M> {
    fn state_len(&self) -> usize {
        self.count * self.model.state_len()
    }

    fn active_state(&self) -> Range<usize> {
        self.part(self.model.state_len())
    }

    fn inputs(&self) -> usize {
        self.model.inputs()
    }

    fn outputs(&self) -> usize {
        self.model.outputs()
    }

    fn blocks(&self) -> &[Vec<usize>] {
        self.model.blocks()
    }

    fn rows(&self) -> usize {
        self.model.rows()
    }

    fn rows_of(&self, block: usize) -> usize {
        self.model.rows_of(block)
    }

    fn first_output_block(&self) -> usize {
        self.model.first_output_block()
    }

    fn weights(&self) -> &[f64] {
        self.model.weights()
    }

    fn project(&self, weights: &mut [f64]) {
        self.model.project(weights);
    }

    fn set_weights(&mut self, weights: &[f64]) {
        self.model.set_weights(weights);
    }

    fn step(&mut self, h: &mut [f64], x: &[f64]) {
        let part = self.active_state();
        self.model.step(&mut h[part], x);
    }

    fn output(&self, h: &[f64], y: &mut [f64]) {
        self.model.output(&h[self.active_state()], y);
    }

    fn local_jacobian(&self, block: usize, row: usize, into: &mut [f64]) {
        self.model.local_jacobian(block, row, into);
    }

    fn apply_state_jacobian(
        &self,
        state: &[f64],
        local: &[f64],
        columns: usize,
        out: &mut [f64],
        scratch: &mut [f64],
    ) {
        let part = self.part(self.model.state_len() * columns);
        out[..part.start].copy_from_slice(&state[..part.start]);
        out[part.end..].copy_from_slice(&state[part.end..]);
        self.model.apply_state_jacobian(&state[part.clone()], local, columns, &mut out[part], scratch);
    }

    fn apply_output_jacobian(&self, state: &[f64], local: &[f64], columns: usize, out: &mut [f64]) {
        let part = self.part(self.model.state_len() * columns);
        self.model.apply_output_jacobian(&state[part], local, columns, out);
    }

    fn scratch(&self, columns: usize) -> usize {
        self.model.scratch(columns)
    }
}
