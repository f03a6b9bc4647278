//! Dual numbers: values with their partial derivatives (forward-mode automatic differentiation).
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use core::ops::{Add, Div, Mul, Neg, Sub};

use super::number::{Number, Real};

/// A number and its partial derivatives with respect to `N` variables: forward-mode differentiation (Griewank and
/// Walther, *Evaluating Derivatives*, 2nd ed., 2008, chapter 3). The value is bit-identical to that of plain numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<const N: usize> {
    /// The number.
    pub value: f64,
    /// `d value / d variable`.
    pub partials: [f64; N],
}

impl<const N: usize> Dual<N> {
    /// A number whose only non-zero partial is `partial`, of `variable`; a constant where there is no such variable.
    pub fn along(value: f64, variable: usize, partial: f64) -> Self {
        let mut partials = [0.0; N];
        if let Some(place) = partials.get_mut(variable) {
            *place = partial;
        }
        Self { value, partials }
    }

    /// Chain rule: a function's `value` and its `slope` at this number.
    #[inline(always)]
    fn through(self, value: f64, slope: f64) -> Self {
        Self { value, partials: join(&self.partials, &self.partials, |p, _| slope * p) }
    }
}

/// A loop, because the closures of `from_fn` and `map` are not always inlined.
#[inline(always)]
fn join<const N: usize>(a: &[f64; N], b: &[f64; N], of: impl Fn(f64, f64) -> f64) -> [f64; N] {
    let mut into = [0.0; N];
    for ((into, a), b) in into.iter_mut().zip(a).zip(b) {
        *into = of(*a, *b);
    }
    into
}

#[inline(always)]
fn of_product(dx: f64, y: f64, x: f64, dy: f64) -> f64 {
    dx * y + x * dy
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;

    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self { value: self.value + b.value, partials: join(&self.partials, &b.partials, |a, b| a + b) }
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self { value: self.value - b.value, partials: join(&self.partials, &b.partials, |a, b| a - b) }
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        let partials = join(&self.partials, &b.partials, |p, q| of_product(p, b.value, self.value, q));
        Self { value: self.value * b.value, partials }
    }
}

impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self.through(self.value * factor, factor)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;

    #[inline(always)]
    fn div(self, b: Self) -> Self {
        let value = self.value / b.value;
        let by = 1.0 / b.value;
        Self { value, partials: join(&self.partials, &b.partials, |p, q| (p - value * q) * by) }
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, partials: join(&self.partials, &self.partials, |p, _| -p) }
    }
}

impl<const N: usize> Number for Dual<N> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self { value, partials: [0.0; N] }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        let slope = if self.value == 0.0 { 0.0 } else { self.value.signum() };
        self.through(self.value.abs(), slope)
    }

    #[inline(always)]
    fn logistic(self) -> Self {
        // From the value: where the exponential overflows, its derivative is not finite.
        let value = Number::logistic(self.value);
        self.through(value, value * (1.0 - value))
    }
}

impl<const N: usize> Real for Dual<N> {
    #[inline(always)]
    fn value(self) -> f64 {
        self.value
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = Real::sqrt(self.value);
        self.through(root, if root > 0.0 { 0.5 / root } else { 0.0 })
    }

    #[inline(always)]
    fn exp(self) -> Self {
        let value = Real::exp(self.value);
        self.through(value, value)
    }

    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = Real::sin_cos(self.value);
        (self.through(sin, cos), self.through(cos, -sin))
    }
}
