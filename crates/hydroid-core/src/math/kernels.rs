//! What is compiled for each processor, compiled here and nowhere else.
//!
//! What is generic is compiled again in every crate and every test that uses it, and kernels, three times each for as many
//! kinds of vectors, are most of what there is to compile. So none is called through a function that is generic: there is one
//! for each kernel and precision ([`Kernels`]), to which other crates are linked. What calls a kernel may be generic; it should
//! be little.

use pulp::Arch;

use super::vectors::Vectors;
use crate::adapt::kalman::reduced::structure;
use crate::adapt::kalman::{full, reduced, triangle};

/// `name: kernel => output`: a function of that name which runs the kernel on vectors that the processor has.
macro_rules! kernels {
    ($($name:ident: $kernel:ty => $output:ty;)*) => {
        /// The kernels of a precision; `f32` and `f64` have them.
        pub trait Kernels: Vectors {
            $(fn $name(arch: Arch, kernel: $kernel) -> $output;)*
        }

        kernels!(in f32: $($name: $kernel => $output;)*);
        kernels!(in f64: $($name: $kernel => $output;)*);
    };
    (in $scalar:ident: $($name:ident: $kernel:ty => $output:ty;)*) => {
        impl Kernels for $scalar {
            $(
                // Inlined, it would be compiled where it is called.
                #[inline(never)]
                fn $name(arch: Arch, kernel: $kernel) -> $output {
                    arch.dispatch(kernel)
                }
            )*
        }
    };
}

kernels! {
    triangle_pass: triangle::Part<'_, '_, Self> => ();
    triangle_quadratic: triangle::Quadratic<'_, Self> => Self;
    full_products: full::Products<'_, Self> => ();
    full_spread: full::Spread<'_, Self> => ();
    full_correct: full::Correct<'_, Self> => ();
    reduced_advance: structure::Advance<'_, Self> => ();
    reduced_times: structure::Times<'_, Self> => ();
    reduced_scale: reduced::Scale<'_, Self> => ();
    reduced_expect: reduced::Expect<'_, Self> => ();
    reduced_correct: reduced::Correct<'_, Self> => bool;
}
