//! Long short-term memory (LSTM): element-wise part of the cell, gates to state, and its local derivatives.
//!
//! ```text
//! i = s(a_i)  f = s(a_f)  g = tanh(a_g)  o = s(a_o)
//! c+ = f . c + i . g,   t = tanh(c+),   m = o . t
//! ```
//!
//! Slices hold `cells x width` numbers with one sequence per column, the record `[i f g o t]` five times as many.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::Simd;

use crate::math::Scalar;
use crate::math::functions::{sigmoid, tanh};
use crate::math::slices::{Read, Write, vectors};
use crate::math::vectors::Pack;

/// `[a_i a_f a_g a_o .] -> [i f g o t]` in the record, then `c+` and `m`.
#[inline(always)]
pub(crate) fn forward<S: Simd, T: Scalar>(
    simd: S,
    record: &mut [T],
    cell: &[T],
    next: &mut [T],
    shown: &mut [T],
) {
    let n = cell.len();
    let [mut i, mut f, mut g, mut o, mut t] = parts(simd, record, n);
    let (mut next, mut m) = (Write::new(simd, &mut next[..n]), Write::new(simd, &mut shown[..n]));
    let c = Read::new(simd, cell);
    for k in vectors::<S, T>(n) {
        let (input, forget) = (sigmoid(simd, i.get(k)), sigmoid(simd, f.get(k)));
        let (new, output) = (tanh(simd, g.get(k)), sigmoid(simd, o.get(k)));
        let cell = forget.mul_add(c.get(k), input * new);
        let bounded = tanh(simd, cell);
        i.set(k, input);
        f.set(k, forget);
        g.set(k, new);
        o.set(k, output);
        next.set(k, cell);
        t.set(k, bounded);
        m.set(k, output * bounded);
    }
}

/// From `dm = dL/dm` and `dL/dc+` in `dcell`: `dL/da` replaces the gates in the record, and `dcell` becomes `dL/dc`.
#[inline(always)]
pub(crate) fn backward<S: Simd, T: Scalar>(simd: S, record: &mut [T], cell: &[T], dm: &[T], dcell: &mut [T]) {
    let n = cell.len();
    let [mut i, mut f, mut g, mut o, t] = parts(simd, record, n);
    let (c, dm) = (Read::new(simd, cell), Read::new(simd, &dm[..n]));
    let mut dcell = Write::new(simd, &mut dcell[..n]);
    let one = Pack::splat(simd, T::one());
    for k in vectors::<S, T>(n) {
        let (input, forget, new, output) = (i.get(k), f.get(k), g.get(k), o.get(k));
        let (bounded, dm) = (t.get(k), dm.get(k));
        let dc = (dm * output).mul_add(one - bounded * bounded, dcell.get(k));
        i.set(k, dc * new * input * (one - input));
        f.set(k, dc * c.get(k) * forget * (one - forget));
        g.set(k, dc * input * (one - new * new));
        o.set(k, dm * bounded * output * (one - output));
        dcell.set(k, dc * forget);
    }
}

#[inline(always)]
fn parts<S: Simd, T: Scalar>(simd: S, record: &mut [T], n: usize) -> [Write<'_, S, T>; 5] {
    let (i, rest) = record.split_at_mut(n);
    let (f, rest) = rest.split_at_mut(n);
    let (g, rest) = rest.split_at_mut(n);
    let (o, t) = rest.split_at_mut(n);
    [
        Write::new(simd, i),
        Write::new(simd, f),
        Write::new(simd, g),
        Write::new(simd, o),
        Write::new(simd, &mut t[..n]),
    ]
}
