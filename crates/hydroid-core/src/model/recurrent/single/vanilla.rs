//! The element-wise part of the vanilla network ([`Cell::Vanilla`](super::super::Cell::Vanilla)).

use crate::math::{self, Scalar};

/// From the sums (`n`) to `h+`.
#[inline]
pub(super) fn forward<T: Scalar>(sums: &mut [T], h: &mut [T]) {
    math::tanh(sums);
    h.copy_from_slice(sums);
}
