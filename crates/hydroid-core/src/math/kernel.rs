//! Compilation of vector kernels, once for each processor feature and precision.
//!
//! A generic function is compiled again in every crate that uses it, and a kernel once for each vector width. Kernels
//! are therefore called through functions without generics, which [`kernels!`] declares in the module of the kernel;
//! generic code calls them by [`Scalar::run`].

use pulp::{Arch, WithSimd};

use super::Scalar;

/// A kernel for both precisions.
pub trait Kernel {
    type Of<'a, T: Scalar>: WithSimd<Output = Self::Output<T>>;

    type Output<T: Scalar>;

    fn single(arch: Arch, kernel: Self::Of<'_, f32>) -> Self::Output<f32>;

    fn double(arch: Arch, kernel: Self::Of<'_, f64>) -> Self::Output<f64>;
}

/// `Name: Arguments;` declares the [`Kernel`] `Name` of the type `Arguments<'_, T>`, whose result is `()`.
macro_rules! kernels {
    ($($name:ident: $kernel:ident;)*) => {$(
        #[doc = concat!("Runs [`", stringify!($kernel), "`] without generics.")]
        #[derive(Debug)]
        pub(crate) enum $name {}

        impl $crate::math::kernel::Kernel for $name {
            type Of<'a, T: $crate::math::Scalar> = $kernel<'a, T>;
            type Output<T: $crate::math::Scalar> = ();

            // Inlined, the kernel would be compiled in the calling crate.
            #[inline(never)]
            fn single(arch: pulp::Arch, kernel: $kernel<'_, f32>) {
                arch.dispatch(kernel);
            }

            #[inline(never)]
            fn double(arch: pulp::Arch, kernel: $kernel<'_, f64>) {
                arch.dispatch(kernel);
            }
        }
    )*};
}

pub(crate) use kernels;
