//! The element-wise part of the GRU cell: gates to state, and its local derivatives.
//!
//! ```text
//! r = s(a_r)  z = s(a_z)  n = tanh(a_n + r . b_n)
//! h+ = (1 - z) . n + z . h
//! ```
//!
//! with `a_r`, `a_z` the sums of what comes from the input and from the state. Every slice holds `cells x width`
//! numbers row by row; the width is the number of sequences that are walked side by side, and 1 in a single step.

use crate::math::{self, Scalar};

/// `[a_r a_z a_n b_n] -> [r z n b_n]` in place, then `h+`.
pub(crate) fn forward<T: Scalar>(gates: &mut [T], h: &[T], next: &mut [T]) {
    let n = h.len();
    math::sigmoid(&mut gates[..2 * n]);
    for j in 0..n {
        gates[2 * n + j] += gates[j] * gates[3 * n + j];
    }
    math::tanh(&mut gates[2 * n..3 * n]);
    for j in 0..n {
        let (z, new) = (gates[n + j], gates[2 * n + j]);
        next[j] = new + z * (h[j] - new);
    }
}

/// From `dL/dh+` in `dh`: the adjoints of `a_r, a_z, a_n, b_n` in place of the gates, and in `dh` the part of
/// `dL/dh` that does not pass through the gates.
pub(crate) fn backward<T: Scalar>(gates: &mut [T], h: &[T], dh: &mut [T]) {
    let n = h.len();
    let one = T::one();
    for j in 0..n {
        let (r, z, new, b) = (gates[j], gates[n + j], gates[2 * n + j], gates[3 * n + j]);
        let da = dh[j] * (one - z) * (one - new * new);
        gates[j] = da * b * r * (one - r);
        gates[n + j] = dh[j] * (h[j] - new) * z * (one - z);
        gates[2 * n + j] = da;
        gates[3 * n + j] = da * r;
        dh[j] *= z;
    }
}
