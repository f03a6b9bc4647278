//! Several numbers side by side, for rollouts of many command sequences.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use core::ops::{Add, Div, Mul, Neg, Sub};

use super::number::Number;
use crate::math::sigmoid;

/// `N` numbers. Results equal those of plain numbers up to the last digits of the logistic function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lanes<const N: usize>(pub(crate) [f64; N]);

impl<const N: usize> Lanes<N> {
    #[inline(always)]
    fn join(self, b: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        let mut into = self;
        for (into, b) in into.0.iter_mut().zip(b.0) {
            *into = of(*into, b);
        }
        into
    }
}

impl<const N: usize> Add for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.join(b, |a, b| a + b)
    }
}

impl<const N: usize> Sub for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.join(b, |a, b| a - b)
    }
}

impl<const N: usize> Mul for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.join(b, |a, b| a * b)
    }
}

impl<const N: usize> Mul<f64> for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self.join(self, |a, _| a * factor)
    }
}

impl<const N: usize> Div for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.join(b, |a, b| a / b)
    }
}

impl<const N: usize> Neg for Lanes<N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.join(self, |a, _| -a)
    }
}

impl<const N: usize> Number for Lanes<N> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.join(self, |a, _| a.abs())
    }

    #[inline(always)]
    fn logistic(mut self) -> Self {
        sigmoid(&mut self.0);
        self
    }
}
