//! The scalar type of the equations of motion.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use core::ops::{Add, Div, Mul, Neg, Sub};

use num_traits::Float;

/// A real number, a [`Dual`](super::Dual) with its derivatives, or several numbers side by side: the motion of a
/// [`Craft`](crate::craft::Craft) is generic over them.
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

/// A [`Number`] with one value, on which equations can branch, and further functions.
pub trait Real: Number {
    /// The number without its derivatives.
    fn value(self) -> f64;

    /// `sqrt(x)`; its derivative at zero is taken as zero.
    fn sqrt(self) -> Self;

    /// `exp(x)`.
    fn exp(self) -> Self;

    /// `sin(x)` and `cos(x)`.
    fn sin_cos(self) -> (Self, Self);
}

impl Number for f64 {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Float::abs(self)
    }

    #[inline(always)]
    fn logistic(self) -> Self {
        1.0 / (Float::exp(-self) + 1.0)
    }
}

impl Real for f64 {
    #[inline]
    fn value(self) -> f64 {
        self
    }

    #[inline]
    fn sqrt(self) -> Self {
        Float::sqrt(self)
    }

    #[inline]
    fn exp(self) -> Self {
        Float::exp(self)
    }

    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        Float::sin_cos(self)
    }
}
