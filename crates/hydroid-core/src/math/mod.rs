//! Vector kernels: elementary functions, products and sums on slices, for `f32` and `f64`. The widest vectors of the
//! processor are detected at run time. Results are bit-identical for all vector widths and for all positions in a
//! slice.

#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

pub(crate) mod aligned;
pub(crate) mod functions;
pub(crate) mod kernel;
pub(crate) mod product;
pub(crate) mod rows;
pub(crate) mod slices;
pub(crate) mod vectors;

use num_traits::Float;
use pulp::{Arch, Simd, WithSimd};

use self::kernel::{Kernel, kernels};
use self::slices::{Write, vectors};
use self::vectors::Vectors;

/// A floating-point number of networks: `f32` or `f64`.
pub trait Scalar:
    Float
    + Vectors
    + core::ops::AddAssign
    + core::ops::SubAssign
    + core::ops::MulAssign
    + core::iter::Sum
    + core::fmt::Debug
    + Default
    + Send
    + Sync
    + 'static
{
    /// The nearest number to `x`.
    fn of(x: f64) -> Self;

    /// The number in double precision.
    fn wide(self) -> f64;

    /// Runs a kernel in this precision.
    #[doc(hidden)]
    fn run<K: Kernel>(arch: Arch, kernel: K::Of<'_, Self>) -> K::Output<Self>;
}

kernels! {
    ElementWise: Each;
}

impl Scalar for f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounds to single precision")]
    fn of(x: f64) -> Self {
        x as f32
    }

    fn wide(self) -> f64 {
        f64::from(self)
    }

    fn run<K: Kernel>(arch: Arch, kernel: K::Of<'_, Self>) -> K::Output<Self> {
        K::single(arch, kernel)
    }
}

impl Scalar for f64 {
    fn of(x: f64) -> Self {
        x
    }

    fn wide(self) -> f64 {
        self
    }

    fn run<K: Kernel>(arch: Arch, kernel: K::Of<'_, Self>) -> K::Output<Self> {
        K::double(arch, kernel)
    }
}

/// `x <- e^x`, with a relative error of at most 1.5e-7 (`f32`) or 3e-16 (`f64`); for subnormal results the error is
/// relative to the smallest normal number.
pub fn exp<T: Scalar>(x: &mut [T]) {
    T::run::<ElementWise>(Arch::new(), Each { x, function: Function::Exp });
}

/// `x <- tanh x`, with a relative error of at most 2.5e-7 (`f32`) or 7e-16 (`f64`), at most 1 in size, and exactly odd.
pub fn tanh<T: Scalar>(x: &mut [T]) {
    T::run::<ElementWise>(Arch::new(), Each { x, function: Function::Tanh });
}

/// `x <- 1 / (1 + e^-x)`, with a relative error of at most 2.5e-7 (`f32`) or 5e-16 (`f64`); below 1e-30 (`f32`) or
/// 1e-290 (`f64`) the error is relative to these.
pub fn sigmoid<T: Scalar>(x: &mut [T]) {
    T::run::<ElementWise>(Arch::new(), Each { x, function: Function::Sigmoid });
}

#[derive(Clone, Copy, Debug)]
enum Function {
    Exp,
    Tanh,
    Sigmoid,
}

/// Kernel: an elementary function on each number of a slice.
pub struct Each<'a, T> {
    x: &'a mut [T],
    function: Function,
}

impl<T: Scalar> WithSimd for Each<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let len = self.x.len();
        let mut x = Write::new(simd, self.x);
        match self.function {
            Function::Exp => {
                for k in vectors::<S, T>(len) {
                    x.set(k, functions::exp(simd, x.get(k)));
                }
            }
            Function::Tanh => {
                for k in vectors::<S, T>(len) {
                    x.set(k, functions::tanh(simd, x.get(k)));
                }
            }
            Function::Sigmoid => {
                for k in vectors::<S, T>(len) {
                    x.set(k, functions::sigmoid(simd, x.get(k)));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use alloc::vec::Vec;

    use super::*;

    #[cfg(target_arch = "x86_64")]
    fn paths<T: Scalar>(x: &[T], function: Function) -> Vec<Vec<T>> {
        let mut paths = Vec::from([x.to_vec()]);
        Simd::vectorize(pulp::Scalar::new(), Each { x: &mut paths[0], function });
        if let Some(simd) = pulp::x86::V3::try_new() {
            paths.push(x.to_vec());
            Simd::vectorize(simd, Each { x: &mut paths[1], function });
        }
        if let Some(simd) = pulp::x86::V4::try_new() {
            paths.push(x.to_vec());
            Simd::vectorize(simd, Each { x: &mut paths[2], function });
        }
        paths
    }

    #[cfg(target_arch = "x86_64")]
    fn same_bits<T: Scalar>(x: &[T], bits: fn(T) -> u64) {
        for function in [Function::Exp, Function::Tanh, Function::Sigmoid] {
            for x in x.chunks(997) {
                let paths = paths(x, function);
                for other in &paths[1..] {
                    for ((x, a), b) in x.iter().zip(&paths[0]).zip(other) {
                        let same = bits(*a) == bits(*b) || a.is_nan() && b.is_nan();
                        assert!(same, "{function:?} of {x:?}: {a:?} and {b:?}");
                    }
                }
            }
        }
    }

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn every_path_gives_the_same_bits() {
        let single: Vec<f32> =
            (0..200_000_u32).map(|k| f32::from_bits(k.wrapping_mul(2_654_435_761))).collect();
        same_bits(&single, |x| x.to_bits().into());
        let double: Vec<f64> =
            (0..200_000_u64).map(|k| f64::from_bits(k.wrapping_mul(0x9E37_79B9_7F4A_7C15))).collect();
        same_bits(&double, f64::to_bits);
    }
}
