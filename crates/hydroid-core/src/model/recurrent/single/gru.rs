//! The element-wise part of the GRU ([`Cell::Gru`](super::super::Cell::Gru)).

use crate::math::{self, Scalar};

/// From the sums `[a_n r z b_n]` (`4 n`) and `h` to the gates, with `n` in the place of `a_n`, and `h+`.
///
/// In this order the sums of the input and those of the state are each in one piece.
#[inline]
pub(super) fn forward<T: Scalar>(gates: &mut [T], h: &mut [T]) {
    let n = h.len();
    let (candidate, rest) = gates.split_at_mut(n);
    let (reset_update, recurrent) = rest.split_at_mut(2 * n);
    math::sigmoid(reset_update);
    let (reset, update) = reset_update.split_at(n);
    for j in 0..n {
        candidate[j] += reset[j] * recurrent[j];
    }
    math::tanh(candidate);
    for j in 0..n {
        h[j] = candidate[j] + update[j] * (h[j] - candidate[j]);
    }
}
