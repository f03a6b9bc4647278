//! `exp`, `tanh` and the logistic function of a vector, without branches.
//!
//! `e^x = 2^n e^r` with `n` the integer next to `x / ln 2` and `|r| <= ln 2 / 2`, on which a polynomial gives
//! `q = e^r - 1` (Cody and Waite 1980, Muller, Elementary Functions, ch. 11). `e^x - 1 = 2^n q + (2^n - 1)` keeps its
//! digits near zero, and so does `tanh x = (e^2x - 1) / (e^2x - 1 + 2)`.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use pulp::Simd;

use super::vectors::{Pack, Vectors};

#[inline(always)]
fn reduce<S: Simd, T: Vectors>(simd: S, x: Pack<S, T>) -> (Pack<S, T>, Pack<S, T>) {
    let round = Pack::splat(simd, T::ROUND);
    let rounded = x.mul_add(Pack::splat(simd, T::LOG2_E), round);
    let n = rounded - round;
    let r = n.mul_add(Pack::splat(simd, T::MINUS_LN_2[0]), x);
    let r = n.mul_add(Pack::splat(simd, T::MINUS_LN_2[1]), r);
    let (&last, others) = const { T::EXP.split_last().expect("the polynomial has coefficients") };
    let mut p = Pack::splat(simd, last);
    for &c in others.iter().rev() {
        p = p.mul_add(r, Pack::splat(simd, c));
    }
    (rounded, (p * r).mul_add(r, r))
}

#[inline(always)]
pub(crate) fn exp<S: Simd, T: Vectors>(simd: S, x: Pack<S, T>) -> Pack<S, T> {
    let x = x.abs().at_most(T::EXP_END).with_sign_of(x);
    let (rounded, q) = reduce(simd, x);
    // Two factors give subnormal numbers and infinity without special cases.
    let round = Pack::splat(simd, T::ROUND);
    let n = rounded - round;
    let half = n.mul_add(Pack::splat(simd, T::HALF), round);
    let other = (n - (half - round)) + round;
    let first = half.power_of_two();
    q.mul_add(first, first) * other.power_of_two()
}

#[inline(always)]
pub(crate) fn sigmoid<S: Simd, T: Vectors>(simd: S, x: Pack<S, T>) -> Pack<S, T> {
    let (rounded, q) = reduce(simd, x.abs().at_most(T::EXP_NORMAL).with_sign_of(-x));
    let scale = rounded.power_of_two();
    let one = Pack::splat(simd, T::ONE);
    one / (one + q.mul_add(scale, scale))
}

#[inline(always)]
pub(crate) fn tanh<S: Simd, T: Vectors>(simd: S, x: Pack<S, T>) -> Pack<S, T> {
    let size = x.abs().at_most(T::TANH_END);
    let (rounded, q) = reduce(simd, size + size);
    let scale = rounded.power_of_two();
    let e = q.mul_add(scale, scale - Pack::splat(simd, T::ONE));
    (e / (e + Pack::splat(simd, T::TWO))).with_sign_of(x)
}
