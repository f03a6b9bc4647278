//! Dual numbers: values with their partial derivatives (forward-mode automatic differentiation).

use core::ops::{Add, Div, Mul, Neg, Sub};

use super::number::Number;

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
    #[inline]
    fn through(self, value: f64, slope: f64) -> Self {
        Self { value, partials: self.partials.map(|p| slope * p) }
    }
}

#[inline]
fn join<const N: usize>(a: &[f64; N], b: &[f64; N], of: impl Fn(f64, f64) -> f64) -> [f64; N] {
    core::array::from_fn(|i| of(a[i], b[i]))
}

#[inline]
fn of_product(dx: f64, y: f64, x: f64, dy: f64) -> f64 {
    dx * y + x * dy
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;

    #[inline]
    fn add(self, b: Self) -> Self {
        Self { value: self.value + b.value, partials: join(&self.partials, &b.partials, |a, b| a + b) }
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;

    #[inline]
    fn sub(self, b: Self) -> Self {
        Self { value: self.value - b.value, partials: join(&self.partials, &b.partials, |a, b| a - b) }
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;

    #[inline]
    fn mul(self, b: Self) -> Self {
        let partials = join(&self.partials, &b.partials, |p, q| of_product(p, b.value, self.value, q));
        Self { value: self.value * b.value, partials }
    }
}

impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        self.through(self.value * factor, factor)
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;

    #[inline]
    fn div(self, b: Self) -> Self {
        let value = self.value / b.value;
        let by = 1.0 / b.value;
        Self { value, partials: join(&self.partials, &b.partials, |p, q| (p - value * q) * by) }
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;

    #[inline]
    fn neg(self) -> Self {
        Self { value: -self.value, partials: self.partials.map(|p| -p) }
    }
}

impl<const N: usize> Number for Dual<N> {
    #[inline]
    fn constant(value: f64) -> Self {
        Self { value, partials: [0.0; N] }
    }

    #[inline]
    fn abs(self) -> Self {
        let slope = if self.value == 0.0 { 0.0 } else { self.value.signum() };
        self.through(self.value.abs(), slope)
    }

    #[inline]
    fn logistic(self) -> Self {
        // From the value: where the exponential overflows, its derivative is not finite.
        let value = Number::logistic(self.value);
        self.through(value, value * (1.0 - value))
    }

    #[inline]
    fn value(self) -> f64 {
        self.value
    }

    #[inline]
    fn sqrt(self) -> Self {
        let root = Number::sqrt(self.value);
        self.through(root, if root > 0.0 { 0.5 / root } else { 0.0 })
    }

    #[inline]
    fn exp(self) -> Self {
        let value = Number::exp(self.value);
        self.through(value, value)
    }

    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = Number::sin_cos(self.value);
        (self.through(sin, cos), self.through(cos, -sin))
    }
}
