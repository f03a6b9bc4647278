//! The element-wise part of a vanilla layer, `h+ = tanh(a)`, and its local derivative `1 - h+^2`.
//!
//! Slices hold `cells x width` numbers row by row; the width is the number of sequences that are walked side by
//! side, and 1 in a single step.

use crate::math::{self, Scalar};

/// `a -> h+` in place.
pub(crate) fn forward<T: Scalar>(a: &mut [T]) {
    math::tanh(a);
}

/// `dL/dh+ -> dL/da` in place.
pub(crate) fn backward<T: Scalar>(next: &[T], d: &mut [T]) {
    for (d, &h) in d.iter_mut().zip(next) {
        *d *= T::one() - h * h;
    }
}
