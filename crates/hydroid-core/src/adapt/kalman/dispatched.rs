//! Parts of a step as what [`Arch`](pulp::Arch) compiles for the processor.

/// `Name = method(arguments) -> output`: a type of that name which has the arguments, and calls the method of `own`.
/// Methods must be inlined.
macro_rules! dispatched {
    ($own:ident<$life:lifetime>: $($name:ident = $method:ident($($argument:ident: $type:ty),*) -> $output:ty;)*) => {
        $(
            struct $name<$life, T, M> {
                own: &$life mut $own<T>,
                $($argument: $type),*
            }

            impl<$life, T: Scalar, M: Learnable<T>> WithSimd for $name<$life, T, M> {
                type Output = $output;

                #[inline(always)]
                fn with_simd<S: Simd>(self, simd: S) -> $output {
                    self.own.$method(simd, $(self.$argument),*)
                }
            }
        )*
    };
}

pub(super) use dispatched;
