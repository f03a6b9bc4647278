//! The interface between the filter and a model.

mod equations;
mod network;
pub(super) mod plant;
pub(super) mod plant_parameters;
mod shared_weight_states;

use alloc::vec::Vec;
use core::ops::Range;

pub use equations::LearnableEquations;
pub use network::LearnableNetwork;
pub use plant::LearnablePlant;
pub use shared_weight_states::SharedWeightStates;

/// A step model whose weights a [`Filter`](super::Filter) can learn: `h+ = f(h, x, theta)`, `y = g(h+, theta)`.
///
/// The weights come in blocks. The step depends on the weights of block `b` only through [`rows`](Self::rows) local
/// numbers, its local rows:
///
/// ```text
/// dh+/dtheta = C L        dy/dtheta = D L        L = diag(L_1, L_2, ..),  L_b: rows x weights of block b
/// ```
///
/// `L` is given by [`local_jacobian`](Self::local_jacobian). `C` and `D` are applied by
/// [`apply_state_jacobian`](Self::apply_state_jacobian) and [`apply_output_jacobian`](Self::apply_output_jacobian) and
/// are not stored: a unit of a network has its own weights in its gates, while the projection or the next layers mix
/// all units. A model without such structure is one block whose local rows are its state.
///
/// Matrices are stored row by row. No method allocates.
pub trait Learnable: Clone + Send + Sync {
    /// Length of the state `h`.
    fn state_len(&self) -> usize;

    /// The part of the state that a step changes; the rest is constant and without noise.
    fn active_state(&self) -> Range<usize> {
        0..self.state_len()
    }

    /// Length of the input `x`.
    fn inputs(&self) -> usize;

    /// Length of the output `y`.
    fn outputs(&self) -> usize;

    /// Indices of the weights of each block. No weight is in two blocks.
    fn blocks(&self) -> &[Vec<usize>];

    /// Number of local rows of every block; a block with fewer has zero rows.
    fn rows(&self) -> usize;

    /// Number of local rows of a block that are not zero: the first ones.
    fn rows_of(&self, _block: usize) -> usize {
        self.rows()
    }

    /// The first block with a direct effect on the output: `D` is zero in the rows of the blocks before.
    fn first_output_block(&self) -> usize {
        0
    }

    /// All weights.
    fn weights(&self) -> &[f64];

    /// Projects corrected weights onto the set that the model accepts, which contains the current ones. The default
    /// accepts all.
    fn project(&self, _weights: &mut [f64]) {}

    /// Sets the weights. The Jacobians of the last step stay.
    fn set_weights(&mut self, weights: &[f64]);

    /// `h <- f(h, x)`; stores what the Jacobians need.
    fn step(&mut self, h: &mut [f64], x: &[f64]);

    /// `y = g(h)`.
    fn output(&self, h: &[f64], y: &mut [f64]);

    /// Derivatives of a local row of the last step with respect to the weights of its block.
    fn local_jacobian(&self, block: usize, row: usize, into: &mut [f64]);

    /// `out = df/dh state + C local` of the last step with the current weights; `state` and `out` are `state x
    /// columns`, `local` is `blocks rows x columns`.
    fn apply_state_jacobian(
        &self,
        state: &[f64],
        local: &[f64],
        columns: usize,
        out: &mut [f64],
        scratch: &mut [f64],
    );

    /// `out = dg/dh state + D local` at the state after the last step; `out` is `outputs x columns`.
    fn apply_output_jacobian(&self, state: &[f64], local: &[f64], columns: usize, out: &mut [f64]);

    /// Scratch of [`apply_state_jacobian`](Self::apply_state_jacobian) for a number of columns.
    fn scratch(&self, columns: usize) -> usize;
}
