//! Gated recurrent unit (GRU): element-wise part of the cell, gates to state, and its local derivatives.
//!
//! ```text
//! r = s(a_r)  z = s(a_z)  n = tanh(a_n + r . b_n)
//! h+ = (1 - z) . n + z . h
//! ```
//!
//! `a_r` and `a_z` sum the contributions of input and state. Slices hold `cells x width` numbers, with one sequence per
//! column.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::Simd;

use crate::math::Scalar;
use crate::math::functions::{sigmoid, tanh};
use crate::math::slices::{Read, Write, vectors};
use crate::math::vectors::Pack;

/// `[a_r a_z a_n b_n] -> [r z n b_n]` in place, then `h+`.
#[inline(always)]
pub(crate) fn forward<S: Simd, T: Scalar>(simd: S, gates: &mut [T], h: &[T], next: &mut [T]) {
    let len = h.len();
    let [mut r, mut z, mut n, b] = quarters(simd, gates, len);
    let (h, mut next) = (Read::new(simd, h), Write::new(simd, &mut next[..len]));
    for k in vectors::<S, T>(len) {
        let (reset, update) = (sigmoid(simd, r.get(k)), sigmoid(simd, z.get(k)));
        let new = tanh(simd, reset.mul_add(b.get(k), n.get(k)));
        r.set(k, reset);
        z.set(k, update);
        n.set(k, new);
        next.set(k, update.mul_add(h.get(k) - new, new));
    }
}

/// From `dL/dh+` in `dh`: the adjoints of `a_r, a_z, a_n, b_n` replace the gates, and `dh` becomes the part of `dL/dh`
/// that does not pass through the gates.
#[inline(always)]
pub(crate) fn backward<S: Simd, T: Scalar>(simd: S, gates: &mut [T], h: &[T], dh: &mut [T]) {
    let len = h.len();
    let [mut r, mut z, mut n, mut b] = quarters(simd, gates, len);
    let (h, mut dh) = (Read::new(simd, h), Write::new(simd, &mut dh[..len]));
    let one = Pack::splat(simd, T::one());
    for k in vectors::<S, T>(len) {
        let (reset, update, new, recalled) = (r.get(k), z.get(k), n.get(k), b.get(k));
        let dnext = dh.get(k);
        let da = dnext * (one - update) * (one - new * new);
        r.set(k, da * recalled * reset * (one - reset));
        z.set(k, dnext * (h.get(k) - new) * update * (one - update));
        n.set(k, da);
        b.set(k, da * reset);
        dh.set(k, dnext * update);
    }
}

#[inline(always)]
fn quarters<S: Simd, T: Scalar>(simd: S, gates: &mut [T], n: usize) -> [Write<'_, S, T>; 4] {
    let (r, rest) = gates.split_at_mut(n);
    let (z, rest) = rest.split_at_mut(n);
    let (new, b) = rest.split_at_mut(n);
    [Write::new(simd, r), Write::new(simd, z), Write::new(simd, new), Write::new(simd, &mut b[..n])]
}
