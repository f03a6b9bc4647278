//! Many sequences walked side by side: with a record for backpropagation through time ([`Tape`]), or without one
//! ([`Rollout`]).
//!
//! Matrices are `features x lanes`, row by row, one sequence in each lane, so that every instruction works on many
//! sequences. The number of lanes is the number of sequences rounded up to a multiple of [`LANES`]; what stands in the
//! lanes beyond the sequences has no effect on anything.

mod affine;
pub(crate) mod cells;
mod kernel;
mod rollout;
mod tape;

pub use rollout::Rollout;
pub use tape::Tape;

/// Lanes come in multiples of this many: the widest vector of single-precision numbers.
pub const LANES: usize = 16;

/// Number of sequences rounded up to whole blocks of lanes.
fn padded(sequences: usize) -> usize {
    sequences.next_multiple_of(LANES)
}

/// Zero in the lanes beyond the sequences, in each row.
fn clear_padding<T: crate::math::Scalar>(rows: &mut [T], sequences: usize) {
    let lanes = padded(sequences);
    if lanes > sequences {
        for row in rows.chunks_exact_mut(lanes) {
            row[sequences..].fill(T::zero());
        }
    }
}
