//! The element-wise part of a vanilla layer, `h+ = tanh(a)`, and its local derivative `1 - h+^2`.
//!
//! Slices hold `cells x width` numbers, with one sequence per column.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::Simd;

use crate::math::Scalar;
use crate::math::functions::tanh;
use crate::math::slices::{Read, Write, vectors};
use crate::math::vectors::Pack;

/// `a -> h+` in place.
#[inline(always)]
pub(crate) fn forward<S: Simd, T: Scalar>(simd: S, a: &mut [T]) {
    let n = a.len();
    let mut a = Write::new(simd, a);
    for k in vectors::<S, T>(n) {
        a.set(k, tanh(simd, a.get(k)));
    }
}

/// `dL/da` from `h+` and `dL/dh+`.
#[inline(always)]
pub(crate) fn backward<S: Simd, T: Scalar>(simd: S, next: &[T], dnext: &[T], da: &mut [T]) {
    let n = next.len();
    let (h, d, mut da) =
        (Read::new(simd, next), Read::new(simd, &dnext[..n]), Write::new(simd, &mut da[..n]));
    let one = Pack::splat(simd, T::one());
    for k in vectors::<S, T>(n) {
        da.set(k, d.get(k) * (one - h.get(k) * h.get(k)));
    }
}
