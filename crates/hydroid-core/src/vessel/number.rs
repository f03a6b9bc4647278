//! The scalar type of the equations of motion.

use core::ops::{Add, Div, Mul, Neg, Sub};

use num_traits::Float;

/// A real number, or a [`Dual`](super::Dual) with its derivatives: [`Plant`](super::Plant) is generic over both.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A constant.
    fn constant(value: f64) -> Self;

    /// `|x|`; its derivative at zero is taken as zero.
    fn abs(self) -> Self;

    /// `1 / (1 + exp(-x))`.
    fn logistic(self) -> Self;
}

impl Number for f64 {
    #[inline]
    fn constant(value: f64) -> Self {
        value
    }

    #[inline]
    fn abs(self) -> Self {
        Float::abs(self)
    }

    #[inline]
    fn logistic(self) -> Self {
        1.0 / (Float::exp(-self) + 1.0)
    }
}
