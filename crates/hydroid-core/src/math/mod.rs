//! Elementary functions on whole slices, for `f32` and `f64`.

use num_traits::Float;

/// A floating-point number that networks are made of: `f32` or `f64`.
pub trait Scalar:
    Float
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

    /// The same number in double precision.
    fn wide(self) -> f64;
}

impl Scalar for f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is asked for")]
    fn of(x: f64) -> Self {
        x as f32
    }

    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Scalar for f64 {
    fn of(x: f64) -> Self {
        x
    }

    fn wide(self) -> f64 {
        self
    }
}

/// `x <- tanh x`.
pub fn tanh<T: Scalar>(x: &mut [T]) {
    for x in x {
        *x = x.tanh();
    }
}

/// `x <- 1 / (1 + e^-x)`.
pub fn sigmoid<T: Scalar>(x: &mut [T]) {
    for x in x {
        *x = (T::one() + (-*x).exp()).recip();
    }
}
