//! The same model on several courses.

use alloc::vec::Vec;
use core::ops::Range;

use super::learnable::Learnable;
use crate::math::Scalar;

/// A model that is on several courses with the same weights, of which one moves at a time:
///
/// ```text
/// h = [h_0; h_1; ..]        h_i+ = f(h_i, x, theta),  h_j+ = h_j for j other than i        y = g(h_i+, theta)
/// ```
///
/// A [`Filter`](super::Filter) of it has the states of all courses in one covariance with the weights: what is learned on
/// one corrects the states of the others as far as they depend on the same weights, and nothing has to be put aside.
#[derive(Clone, Debug)]
pub struct Courses<M> {
    model: M,
    count: usize,
    at: usize,
}

impl<M> Courses<M> {
    /// So many courses, at least one; the first moves.
    pub fn new(model: M, count: usize) -> Self {
        Self { model, count: count.max(1), at: 0 }
    }

    /// The model.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// Another one moves from the next step on.
    pub(super) fn turn(&mut self, to: usize) {
        self.at = to.min(self.count - 1);
    }

    /// Where the state of a course stands, `len` being that of the model's.
    fn part(&self, len: usize) -> Range<usize> {
        self.at * len..(self.at + 1) * len
    }
}

impl<T: Scalar, M: Learnable<T>> Learnable<T> for Courses<M> {
    fn state_len(&self) -> usize {
        self.count * self.model.state_len()
    }

    fn moving(&self) -> Range<usize> {
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

    fn split(&self, block: usize) -> Option<usize> {
        self.model.split(block)
    }

    fn shown(&self) -> usize {
        self.model.shown()
    }

    fn weights(&self) -> &[T] {
        self.model.weights()
    }

    fn admit(&self, weights: &mut [T]) {
        self.model.admit(weights);
    }

    fn set_weights(&mut self, weights: &[T]) {
        self.model.set_weights(weights);
    }

    fn step(&mut self, h: &mut [T], x: &[T]) {
        let part = self.moving();
        self.model.step(&mut h[part], x);
    }

    fn output(&self, h: &[T], y: &mut [T]) {
        self.model.output(&h[self.moving()], y);
    }

    fn local(&self, block: usize, row: usize, into: &mut [T]) {
        self.model.local(block, row, into);
    }

    fn chain(&self, state: &[T], local: &[T], columns: usize, out: &mut [T], scratch: &mut [T]) {
        let part = self.part(self.model.state_len() * columns);
        out[..part.start].copy_from_slice(&state[..part.start]);
        out[part.end..].copy_from_slice(&state[part.end..]);
        self.model.chain(&state[part.clone()], local, columns, &mut out[part], scratch);
    }

    fn output_chain(&self, state: &[T], local: &[T], columns: usize, out: &mut [T]) {
        let part = self.part(self.model.state_len() * columns);
        self.model.output_chain(&state[part], local, columns, out);
    }

    fn scratch(&self, columns: usize) -> usize {
        self.model.scratch(columns)
    }
}
