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

/// Local partials of `h+` with respect to the input's sums `a` and the state's sums `b`, both `[r z n]` (`3 n`), and
/// to `h` by itself, from what [`forward`] left; `h` is that of before.
pub(super) fn partials<T: Scalar>(gates: &[T], h: &[T], a: &mut [T], b: &mut [T], carry: &mut [T]) {
    let (len, one) = (h.len(), T::one());
    for j in 0..len {
        let (n, r, z, b_n) = (gates[j], gates[len + j], gates[2 * len + j], gates[3 * len + j]);
        let of_n = (one - z) * (one - n * n);
        let of_r = of_n * b_n * r * (one - r);
        let of_z = (h[j] - n) * z * (one - z);
        (a[j], a[len + j], a[2 * len + j]) = (of_r, of_z, of_n);
        (b[j], b[len + j], b[2 * len + j]) = (of_r, of_z, of_n * r);
        carry[j] = z;
    }
}
