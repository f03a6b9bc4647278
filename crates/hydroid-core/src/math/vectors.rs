//! Vectors of the width of the processor, with operators.
//!
//! Each operation acts on each number alone with IEEE 754 rounding; [`Pack::mul_add`] is fused on every path, in
//! software where the processor lacks the instruction. On 32-bit ARM and in WebAssembly, where the software is forty times
//! as slow, product and sum are rounded. Only [`Pack::sum`] depends on the vector width.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use core::fmt::Debug;
use core::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

/// The operations of [`Pack`] on `f32` and `f64`.
pub trait Vectors: Copy + 'static {
    type V<S: Simd>: Copy + Debug;

    const HALF: Self;
    const ONE: Self;
    const TWO: Self;
    /// `1.5 * 2^(digits - 1)`: added to a small number it leaves the nearest integer in the last bits.
    const ROUND: Self;
    const LOG2_E: Self;
    /// `-ln 2` in two parts; the first has few digits, so that its product with an exponent is exact.
    const MINUS_LN_2: [Self; 2];
    /// `c` in `e^r = 1 + r + r^2 (c_0 + c_1 r + ..)` for `|r| <= ln 2 / 2`: interpolation at Chebyshev nodes.
    const EXP: &'static [Self];
    /// `e^x` is infinite above it, and zero below its negative.
    const EXP_END: Self;
    /// For `|x|` up to it, `e^x` is a normal number.
    const EXP_NORMAL: Self;
    /// `tanh x` is 1 from it on.
    const TANH_END: Self;
    /// Numbers in 64 bytes, a cache line and the widest register.
    const LINE: usize = 64 / size_of::<Self>();

    fn whole<S: Simd>(x: &[Self]) -> (&[Self::V<S>], &[Self]);
    fn whole_mut<S: Simd>(x: &mut [Self]) -> (&mut [Self::V<S>], &mut [Self]);
    fn load_part<S: Simd>(simd: S, from: &[Self]) -> Self::V<S>;
    fn store_part<S: Simd>(simd: S, to: &mut [Self], x: Self::V<S>);
    fn splat<S: Simd>(simd: S, x: Self) -> Self::V<S>;
    fn add<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>) -> Self::V<S>;
    fn sub<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>) -> Self::V<S>;
    fn mul<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>) -> Self::V<S>;
    fn div<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>) -> Self::V<S>;
    fn neg<S: Simd>(simd: S, a: Self::V<S>) -> Self::V<S>;
    fn abs<S: Simd>(simd: S, a: Self::V<S>) -> Self::V<S>;
    fn mul_add<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>, c: Self::V<S>) -> Self::V<S>;
    fn at_most<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>) -> Self::V<S>;
    fn with_sign_of<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>) -> Self::V<S>;
    fn power_of_two<S: Simd>(simd: S, rounded: Self::V<S>) -> Self::V<S>;
    fn sum<S: Simd>(simd: S, a: Self::V<S>) -> Self;
    /// Sums of the first lines of [`LINE`](Self::LINE) numbers, one for each of `sums`, independent of the vector
    /// width.
    fn line_sums<S: Simd>(simd: S, lines: &[Self], sums: &mut [Self]);
}

macro_rules! operations {
    ($scalar:ident, $v:ident, $as_simd:ident, $as_mut_simd:ident, $one:expr, $two_to_the_mantissa:expr,
        $load:ident, $store:ident, $splat:ident, $sum:ident, $mul_add:ident,
        $greater:ident, $select:ident, $rotate:ident, $or:ident, $and:ident, $xor:ident,
        $splat_bits:ident, $add_bits:ident, $mul_bits:ident, $to_bits:ident, $from_bits:ident,
        $($own:ident: $operator:ident),*) => {
        type V<S: Simd> = S::$v;

        #[inline(always)]
        fn whole<S: Simd>(x: &[Self]) -> (&[S::$v], &[Self]) {
            S::$as_simd(x)
        }

        #[inline(always)]
        fn whole_mut<S: Simd>(x: &mut [Self]) -> (&mut [S::$v], &mut [Self]) {
            S::$as_mut_simd(x)
        }

        #[inline(always)]
        fn load_part<S: Simd>(simd: S, from: &[Self]) -> S::$v {
            simd.$load(from)
        }

        #[inline(always)]
        fn store_part<S: Simd>(simd: S, to: &mut [Self], x: S::$v) {
            simd.$store(to, x);
        }

        #[inline(always)]
        fn splat<S: Simd>(simd: S, x: Self) -> S::$v {
            simd.$splat(x)
        }

        $(
            #[inline(always)]
            fn $own<S: Simd>(simd: S, a: S::$v, b: S::$v) -> S::$v {
                simd.$operator(a, b)
            }
        )*

        // The same functions of pulp are not inlined into functions compiled for the processor.
        #[inline(always)]
        fn neg<S: Simd>(simd: S, a: S::$v) -> S::$v {
            simd.$xor(a, simd.$splat(-0.0))
        }

        #[inline(always)]
        fn abs<S: Simd>(simd: S, a: S::$v) -> S::$v {
            simd.$xor(a, simd.$and(a, simd.$splat(-0.0)))
        }

        #[inline(always)]
        fn mul_add<S: Simd>(simd: S, a: S::$v, b: S::$v, c: S::$v) -> S::$v {
            if cfg!(any(target_arch = "arm", target_arch = "wasm32")) {
                <Self as Vectors>::add(simd, <Self as Vectors>::mul(simd, a, b), c)
            } else {
                simd.$mul_add(a, b, c)
            }
        }

        #[inline(always)]
        fn at_most<S: Simd>(simd: S, a: S::$v, b: S::$v) -> S::$v {
            simd.$select(simd.$greater(a, b), b, a)
        }

        #[inline(always)]
        fn with_sign_of<S: Simd>(simd: S, a: S::$v, b: S::$v) -> S::$v {
            simd.$or(a, simd.$and(b, simd.$splat(-0.0)))
        }

        #[inline(always)]
        fn sum<S: Simd>(simd: S, a: S::$v) -> Self {
            simd.$sum(a)
        }

        #[inline(always)]
        fn line_sums<S: Simd>(simd: S, lines: &[Self], sums: &mut [Self]) {
            const LINE: usize = <$scalar as Vectors>::LINE;
            // Neighbouring lines are merged, each into alternate places of one line. After log2(LINE) rounds, one line
            // has the sum of each line in its own place.
            if size_of::<S::$v>() == 64 {
                let mut folded = [simd.$splat(0.0); LINE];
                folded.copy_from_slice(&S::$as_simd(lines).0[..LINE]);
                let mut step = 1;
                while step < LINE {
                    let mut places = [0.0; LINE];
                    for l in 0..LINE {
                        places[l] = if l & step == 0 { 0.0 } else { 1.0 };
                    }
                    let other = simd.$greater(S::$as_simd(&places).0[0], simd.$splat(0.0));
                    for k in 0..LINE / 2 / step {
                        let (a, b) = (folded[2 * k], folded[2 * k + 1]);
                        let (stays, moves) = (simd.$select(other, b, a), simd.$select(other, a, b));
                        folded[k] = <Self as Vectors>::add(simd, stays, simd.$rotate(moves, step));
                    }
                    step *= 2;
                }
                simd.$store(sums, folded[0]);
            } else {
                let mut folded = [[0.0; LINE]; LINE];
                folded.as_flattened_mut().copy_from_slice(&lines[..LINE * LINE]);
                let mut step = 1;
                while step < LINE {
                    for k in 0..LINE / 2 / step {
                        let (a, b) = (folded[2 * k], folded[2 * k + 1]);
                        for l in 0..LINE {
                            let own = if l & step == 0 { &a } else { &b };
                            folded[k][l] = own[l] + own[(l + step) % LINE];
                        }
                    }
                    step *= 2;
                }
                sums.copy_from_slice(&folded[0][..sums.len()]);
            }
        }

        #[inline(always)]
        fn power_of_two<S: Simd>(simd: S, rounded: S::$v) -> S::$v {
            // The product is a left shift, which keeps the last bits, the exponent.
            let exponent = simd.$mul_bits(simd.$to_bits(rounded), simd.$splat_bits($two_to_the_mantissa));
            simd.$from_bits(simd.$add_bits(exponent, simd.$splat_bits($one)))
        }
    };
}

impl Vectors for f32 {
    const HALF: Self = 0.5;
    const ONE: Self = 1.0;
    const TWO: Self = 2.0;
    const ROUND: Self = 12_582_912.0;
    const LOG2_E: Self = core::f32::consts::LOG2_E;
    const MINUS_LN_2: [Self; 2] = [-0.693_145_75, -1.428_606_8e-6];
    const EXP: &'static [Self] = &[0.5, 0.166_665_77, 0.041_666_555, 0.008_363_179, 0.001_392_618_4];
    const EXP_END: Self = 104.0;
    const EXP_NORMAL: Self = 87.0;
    const TANH_END: Self = 10.0;

    operations!(
        f32, f32s, as_simd_f32s, as_mut_simd_f32s, 1_f32.to_bits(), 1 << 23,
        partial_load_f32s, partial_store_f32s, splat_f32s, reduce_sum_f32s, mul_add_f32s,
        greater_than_f32s, select_f32s, rotate_left_f32s, or_f32s, and_f32s, xor_f32s,
        splat_u32s, add_u32s, mul_u32s, transmute_u32s_f32s, transmute_f32s_u32s,
        add: add_f32s, sub: sub_f32s, mul: mul_f32s, div: div_f32s
    );
}

impl Vectors for f64 {
    const HALF: Self = 0.5;
    const ONE: Self = 1.0;
    const TWO: Self = 2.0;
    const ROUND: Self = 6_755_399_441_055_744.0;
    const LOG2_E: Self = core::f64::consts::LOG2_E;
    const MINUS_LN_2: [Self; 2] = [-0.693_147_180_485_539_1, -7.440_617_110_012_397e-11];
    const EXP: &'static [Self] = &[
        0.500_000_000_000_000_1,
        0.166_666_666_666_666_69,
        0.041_666_666_666_624_13,
        0.008_333_333_333_330_062,
        0.001_388_888_891_721_371_7,
        0.000_198_412_698_630_536_18,
        2.480_152_129_595_437_6e-05,
        2.755_726_845_999_706_4e-06,
        2.762_008_844_540_974_6e-07,
        2.510_038_549_551_032e-08,
    ];
    const EXP_END: Self = 746.0;
    const EXP_NORMAL: Self = 708.0;
    const TANH_END: Self = 20.0;

    operations!(
        f64, f64s, as_simd_f64s, as_mut_simd_f64s, 1_f64.to_bits(), 1 << 52,
        partial_load_f64s, partial_store_f64s, splat_f64s, reduce_sum_f64s, mul_add_f64s,
        greater_than_f64s, select_f64s, rotate_left_f64s, or_f64s, and_f64s, xor_f64s,
        splat_u64s, add_u64s, mul_u64s, transmute_u64s_f64s, transmute_f64s_u64s,
        add: add_f64s, sub: sub_f64s, mul: mul_f64s, div: div_f64s
    );
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Pack<S: Simd, T: Vectors> {
    simd: S,
    pub(crate) v: T::V<S>,
}

impl<S: Simd, T: Vectors> Pack<S, T> {
    #[inline(always)]
    pub(crate) fn new(simd: S, v: T::V<S>) -> Self {
        Self { simd, v }
    }

    #[inline(always)]
    pub(crate) fn splat(simd: S, x: T) -> Self {
        Self::new(simd, T::splat(simd, x))
    }

    #[inline(always)]
    pub(crate) fn mul_add(self, b: Self, c: Self) -> Self {
        Self::new(self.simd, T::mul_add(self.simd, self.v, b.v, c.v))
    }

    #[inline(always)]
    pub(crate) fn abs(self) -> Self {
        Self::new(self.simd, T::abs(self.simd, self.v))
    }

    /// The smaller of both; NaN stays NaN.
    #[inline(always)]
    pub(crate) fn at_most(self, largest: T) -> Self {
        Self::new(self.simd, T::at_most(self.simd, self.v, T::splat(self.simd, largest)))
    }

    /// A non-negative number with the sign of another.
    #[inline(always)]
    pub(crate) fn with_sign_of(self, other: Self) -> Self {
        Self::new(self.simd, T::with_sign_of(self.simd, self.v, other.v))
    }

    /// The sum of all numbers; its rounding depends on the vector width.
    #[inline(always)]
    pub(crate) fn sum(self) -> T {
        T::sum(self.simd, self.v)
    }

    /// `2^n` from `n + ROUND` where the result is a normal number.
    #[inline(always)]
    pub(crate) fn power_of_two(self) -> Self {
        Self::new(self.simd, T::power_of_two(self.simd, self.v))
    }
}

macro_rules! operator {
    ($($trait:ident: $method:ident),*) => {
        $(
            impl<S: Simd, T: Vectors> $trait for Pack<S, T> {
                type Output = Self;

                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    Self::new(self.simd, T::$method(self.simd, self.v, other.v))
                }
            }
        )*
    };
}

operator!(Add: add, Sub: sub, Mul: mul, Div: div);

impl<S: Simd, T: Vectors> Neg for Pack<S, T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(self.simd, T::neg(self.simd, self.v))
    }
}

#[cfg(test)]
#[cfg(target_arch = "x86_64")]
mod tests {
    use alloc::vec;
    use alloc::vec::Vec;

    use pulp::WithSimd;

    use super::*;
    use crate::math::Scalar;

    struct Lines<'a, T> {
        lines: &'a [T],
        sums: &'a mut [T],
    }

    impl<T: Scalar> WithSimd for Lines<'_, T> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            T::line_sums(simd, self.lines, self.sums);
        }
    }

    fn check<T: Scalar>(count: usize) {
        let line = T::LINE;
        let lines: Vec<T> = (0..line * line).map(|k| T::of((1.7 * k as f64).sin())).collect();
        let mut paths = vec![vec![T::nan(); count]];
        Simd::vectorize(pulp::Scalar::new(), Lines { lines: &lines, sums: &mut paths[0] });
        if let Some(simd) = pulp::x86::V3::try_new() {
            paths.push(vec![T::nan(); count]);
            Simd::vectorize(simd, Lines { lines: &lines, sums: &mut paths[1] });
        }
        if let Some(simd) = pulp::x86::V4::try_new() {
            paths.push(vec![T::nan(); count]);
            Simd::vectorize(simd, Lines { lines: &lines, sums: &mut paths[2] });
        }
        for (k, (&sum, of)) in paths[0].iter().zip(lines.chunks_exact(line)).enumerate() {
            let plain: f64 = of.iter().map(|x| x.wide()).sum();
            assert!((sum.wide() - plain).abs() < 1e-5, "line {k}: {sum:?}, not {plain}");
        }
        for path in &paths[1..] {
            assert_eq!(path, &paths[0], "{count} of {line}");
        }
    }

    #[test]
    fn sums_of_lines_are_the_same_on_every_path() {
        (0..=8).for_each(check::<f64>);
        (0..=16).for_each(check::<f32>);
    }
}
