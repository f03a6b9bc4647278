//! The element-wise part of the LSTM ([`Cell::Lstm`](super::super::Cell::Lstm)).

use crate::math::{self, Scalar};

/// From the sums `[i f g o]` (`4 n`) and `c` to the gates, `c+`, `tanh(c+)` and `s(o) . tanh(c+)`, which is `h+`
/// where nothing projects it.
#[inline]
pub(super) fn forward<T: Scalar>(gates: &mut [T], c: &mut [T], tanh_c: &mut [T], shown: &mut [T]) {
    let n = c.len();
    let (input_forget, rest) = gates.split_at_mut(2 * n);
    let (candidate, output) = rest.split_at_mut(n);
    math::sigmoid(input_forget);
    math::tanh(candidate);
    math::sigmoid(output);
    let (input, forget) = input_forget.split_at(n);
    for j in 0..n {
        c[j] = forget[j] * c[j] + input[j] * candidate[j];
    }
    tanh_c.copy_from_slice(c);
    math::tanh(tanh_c);
    for j in 0..n {
        shown[j] = output[j] * tanh_c[j];
    }
}
