//! Batches of sequences, with a record for backpropagation through time ([`Tape`]) or without ([`Rollout`]).
//!
//! Matrices are `features x lanes`, row by row, one sequence in each lane. The number of lanes is the number of
//! sequences rounded up to a multiple of [`LANES`]; the padding lanes have no effect.

mod affine;
pub(crate) mod cells;
mod kernel;
mod rollout;
mod tape;

pub use rollout::Rollout;
pub use tape::Tape;

/// Block of lanes: the widest vector of single-precision numbers.
pub const LANES: usize = 16;

fn padded(sequences: usize) -> usize {
    sequences.next_multiple_of(LANES)
}

fn clear_padding<T: crate::math::Scalar>(rows: &mut [T], sequences: usize) {
    let lanes = padded(sequences);
    if lanes > sequences {
        for row in rows.chunks_exact_mut(lanes) {
            row[sequences..].fill(T::zero());
        }
    }
}
