//! What the filter asks of a model.

use alloc::vec::Vec;
use core::ops::Range;

use crate::math::Scalar;

/// A step model whose weights a [`Filter`](super::Filter) can learn: `h+ = f(h, x, theta)`, `y = g(h+, theta)`.
///
/// Its weights come in blocks. Block `b` works through [`rows`](Self::rows) numbers of its own, its local rows, and a step
/// is made of nothing but the state and these:
///
/// ```text
/// dh+/dtheta = C L        dy/dtheta = D L        L = diag(L_1, L_2, ..),  L_b: rows x weights of block b
/// ```
///
/// `L` is given by [`local`](Self::local), `C` and `D` are applied by [`chain`](Self::chain) and
/// [`output_chain`](Self::output_chain) and stand nowhere: a unit of a network has its gates' weights to itself, while
/// the projection or the layers above mix all of them. A model without such structure is one block whose rows are its
/// state.
///
/// Matrices are row by row. Nothing allocates.
pub trait Learnable<T: Scalar>: Clone + Send + Sync {
    /// Length of the state `h`.
    fn state_len(&self) -> usize;

    /// Which part of the state a step moves; the rest stays as it is, without noise.
    fn moving(&self) -> Range<usize> {
        0..self.state_len()
    }

    /// Length of the input `x`.
    fn inputs(&self) -> usize;

    /// Length of the output `y`.
    fn outputs(&self) -> usize;

    /// Where the weights of each block stand among [`weights`](Self::weights). No weight is in two blocks.
    fn blocks(&self) -> &[Vec<usize>];

    /// Local rows of every block; what a block has less is zero.
    fn rows(&self) -> usize;

    /// How many weights of a block, the first, work through its first local row alone, if the others do through its second
    /// alone; `None` if that is not so, or not known.
    fn split(&self, block: usize) -> Option<usize> {
        let _ = block;
        None
    }

    /// The first block through which the output depends on weights by itself: `D` is zero in the rows of those before.
    fn shown(&self) -> usize {
        0
    }

    /// All weights.
    fn weights(&self) -> &[T];

    /// Brings weights that a correction has made back to what the model can take; those that it has are such. Most models take
    /// whatever they are given.
    fn admit(&self, _weights: &mut [T]) {}

    /// Takes other weights into use; the partials of the last step stay those of the weights it was made with.
    fn set_weights(&mut self, weights: &[T]);

    /// `h <- f(h, x)`, keeping what its partials are made of.
    fn step(&mut self, h: &mut [T], x: &[T]);

    /// `y = g(h)`.
    fn output(&self, h: &[T], y: &mut [T]);

    /// Partials of a local row of the last step with respect to the weights of its block.
    fn local(&self, block: usize, row: usize, into: &mut [T]);

    /// `out = df/dh state + C local` of the last step, with the weights that the model has: `state` is
    /// `state x columns`, `local` is `blocks rows x columns`, `out` is `state x columns`.
    fn chain(&self, state: &[T], local: &[T], columns: usize, out: &mut [T], scratch: &mut [T]);

    /// `out = dg/dh state + D local` at the state after the last step; `out` is `outputs x columns`.
    fn output_chain(&self, state: &[T], local: &[T], columns: usize, out: &mut [T]);

    /// Numbers of scratch that [`chain`](Self::chain) wants for so many columns.
    fn scratch(&self, columns: usize) -> usize;
}
