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

/// Local partials of `c+` and of `s(o) . tanh(c+)` with respect to the sums `[i f g o]` (each result `4 n`) and to
/// `c` (each `n`), from what [`forward`] left; `c` is that of before.
pub(super) fn partials<T: Scalar>(gates: &[T], tanh_c: &[T], c: &[T], sums: &mut [T], carry: &mut [T]) {
    let (n, one) = (c.len(), T::one());
    let (of_c, of_shown) = sums.split_at_mut(4 * n);
    for j in 0..n {
        let (i, f, g, o) = (gates[j], gates[n + j], gates[2 * n + j], gates[3 * n + j]);
        let through_c = o * (one - tanh_c[j] * tanh_c[j]);
        let on_c = [g * i * (one - i), c[j] * f * (one - f), i * (one - g * g)];
        for (gate, partial) in on_c.into_iter().enumerate() {
            of_c[gate * n + j] = partial;
            of_shown[gate * n + j] = through_c * partial;
        }
        of_c[3 * n + j] = T::zero();
        of_shown[3 * n + j] = tanh_c[j] * o * (one - o);
        carry[j] = f;
        carry[n + j] = through_c * f;
    }
}
