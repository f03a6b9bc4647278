//! The element-wise part of the LSTM cell: gates to state, and its local derivatives.
//!
//! ```text
//! i = s(a_i)  f = s(a_f)  g = tanh(a_g)  o = s(a_o)
//! c+ = f . c + i . g,   t = tanh(c+),   m = o . t
//! ```
//!
//! Every slice holds `cells x width` numbers row by row, gates `4 cells x width` in the order i, f, g, o; the width
//! is the number of sequences that are walked side by side, and 1 in a single step.

use crate::math::{self, Scalar};

/// `[a_i a_f a_g a_o] -> [i f g o]` in place, then `c+`, `t` and `m`.
pub(crate) fn forward<T: Scalar>(
    gates: &mut [T],
    cell: &[T],
    next: &mut [T],
    tanh: &mut [T],
    shown: &mut [T],
) {
    let n = cell.len();
    math::sigmoid(&mut gates[..2 * n]);
    math::tanh(&mut gates[2 * n..3 * n]);
    math::sigmoid(&mut gates[3 * n..4 * n]);
    for j in 0..n {
        next[j] = gates[n + j].mul_add(cell[j], gates[j] * gates[2 * n + j]);
    }
    tanh.copy_from_slice(next);
    math::tanh(tanh);
    for j in 0..n {
        shown[j] = gates[3 * n + j] * tanh[j];
    }
}

/// From `dm = dL/dm` and, in `dcell`, `dL/dc+`: the adjoints of `a` in place of the gates, and `dL/dc` in `dcell`.
pub(crate) fn backward<T: Scalar>(gates: &mut [T], cell: &[T], tanh: &[T], dm: &[T], dcell: &mut [T]) {
    let n = cell.len();
    let one = T::one();
    for j in 0..n {
        let (i, f, g, o) = (gates[j], gates[n + j], gates[2 * n + j], gates[3 * n + j]);
        let t = tanh[j];
        let dc = dcell[j] + dm[j] * o * (one - t * t);
        gates[j] = dc * g * i * (one - i);
        gates[n + j] = dc * cell[j] * f * (one - f);
        gates[2 * n + j] = dc * i * (one - g * g);
        gates[3 * n + j] = dm[j] * t * o * (one - o);
        dcell[j] = dc * f;
    }
}
