//! Functions of one variable, the factors of terms.

use core::cmp::Ordering;
use core::hash::{Hash, Hasher};

use num_traits::Float;

/// A parameter of a function: a number that is ordered and compared by its bits, so that terms can be.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(transparent))]
pub struct Real(pub f64);

impl PartialEq for Real {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Real {}

impl PartialOrd for Real {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Real {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Hash for Real {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.to_bits().hash(state);
    }
}

/// A change of mode: `sigma(slope (x - centre))` with the logistic function `sigma`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Gate {
    /// Centre, where both modes have the same weight \[unit of the variable\].
    pub centre: Real,
    /// Slope of the change \[1 / unit of the variable\].
    pub slope: Real,
}

impl Gate {
    /// Weight of the mode above the centre.
    pub fn above(self, x: f64) -> f64 {
        1.0 / (1.0 + Float::exp(-self.slope.0 * (x - self.centre.0)))
    }
}

/// The function of one variable in a factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Shape {
    /// `x^n`, `n >= 1`.
    Power(u8),
    /// `|x|`; with `Power(1)` of the same variable `x |x|`, as in quadratic drag (Fossen 2021, section 6.4).
    Abs,
    /// The sign of `x`, 0 at 0: the derivative of `|x|`.
    Sign,
    /// `sin x`; of a rudder angle \[rad\], the direction of its force.
    Sin,
    /// `cos x`.
    Cos,
    /// `1 / x`; undefined at 0.
    Reciprocal,
    /// `ln x`; undefined at 0 and below.
    Log,
    /// The weight of the mode above a gate: `sigma(k (x - s0))`.
    Above(Gate),
    /// The weight of the mode below a gate: `1 - sigma(k (x - s0))`.
    Below(Gate),
}

impl Shape {
    /// The value; not finite where the function is undefined.
    pub fn value(self, x: f64) -> f64 {
        match self {
            Self::Power(n) => (0..n).fold(1.0, |p, _| p * x),
            Self::Abs => x.abs(),
            Self::Sign => sign(x),
            Self::Sin => Float::sin(x),
            Self::Cos => Float::cos(x),
            Self::Reciprocal => 1.0 / x,
            Self::Log => Float::ln(x),
            Self::Above(gate) => gate.above(x),
            Self::Below(gate) => 1.0 - gate.above(x),
        }
    }

    /// Exponent of the unit, `unit(f(x)) = unit(x)^degree`; 0 for functions of angles, logarithms and gates.
    pub fn degree(self) -> i32 {
        match self {
            Self::Power(n) => i32::from(n),
            Self::Abs => 1,
            Self::Reciprocal => -1,
            Self::Sign | Self::Sin | Self::Cos | Self::Log | Self::Above(_) | Self::Below(_) => 0,
        }
    }

    /// Whether the parameters are finite.
    pub fn is_finite(self) -> bool {
        match self {
            Self::Above(gate) | Self::Below(gate) => gate.centre.0.is_finite() && gate.slope.0.is_finite(),
            _ => true,
        }
    }
}

/// The sign, 0 at 0 and NaN at NaN.
pub(super) fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { Float::signum(x) }
}
