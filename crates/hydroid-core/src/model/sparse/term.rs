//! A term of a library: a product of functions of single variables.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::Write;

use super::shape::{Gate, Shape};

/// A function of one variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Factor {
    /// Index of the variable: outputs first, then inputs, then signals.
    pub variable: u16,
    /// The function applied to it.
    pub shape: Shape,
}

/// A product of factors, sorted by variable so that equal terms compare equal; without factors the constant 1.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(from = "Vec<Factor>", into = "Vec<Factor>"))]
pub struct Term {
    factors: Vec<Factor>,
}

impl From<Vec<Factor>> for Term {
    fn from(factors: Vec<Factor>) -> Self {
        Self::new(factors)
    }
}

impl From<Term> for Vec<Factor> {
    fn from(term: Term) -> Self {
        term.factors
    }
}

impl Term {
    /// A product of factors, in any order. It joins powers of a variable, `|x| |x|` to `x^2`, and `x sgn x` to `|x|`.
    pub fn new(mut factors: Vec<Factor>) -> Self {
        factors.sort_unstable();
        let mut normal = Vec::with_capacity(factors.len());
        for of_one in factors.chunk_by(|a, b| a.variable == b.variable) {
            join(of_one, &mut normal);
        }
        Self { factors: normal }
    }

    /// The constant 1.
    pub const fn constant() -> Self {
        Self { factors: Vec::new() }
    }

    /// One function of one variable.
    pub fn of(variable: u16, shape: Shape) -> Self {
        Self::new(alloc::vec![Factor { variable, shape }])
    }

    /// A product of variables; `n` repetitions give the power `n`.
    pub fn monomial(variables: &[u16]) -> Self {
        Self::new(variables.iter().map(|&variable| Factor { variable, shape: Shape::Power(1) }).collect())
    }

    /// The signed product `x |y|`; with `y = x` the signed square.
    pub fn signed_square(x: u16, y: u16) -> Self {
        Self::new(alloc::vec![
            Factor { variable: x, shape: Shape::Power(1) },
            Factor { variable: y, shape: Shape::Abs },
        ])
    }

    /// The product of two terms.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        Self::new(self.factors.iter().chain(&other.factors).copied().collect())
    }

    /// The two terms that replace this one below and above a gate on a variable.
    #[must_use]
    pub fn gated(&self, variable: u16, gate: Gate) -> [Self; 2] {
        [Shape::Below(gate), Shape::Above(gate)].map(|shape| self.times(&Self::of(variable, shape)))
    }

    /// The factors, sorted by variable.
    pub fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// Sum of the degrees of the factors ([`Shape::degree`]).
    pub fn degree(&self) -> i32 {
        self.factors.iter().map(|f| f.shape.degree()).sum()
    }

    /// Whether the term depends on a variable.
    pub fn contains(&self, variable: u16) -> bool {
        self.factors.iter().any(|f| f.variable == variable)
    }

    /// The highest variable, if the term has any.
    pub fn highest_variable(&self) -> Option<u16> {
        self.factors.iter().map(|f| f.variable).max()
    }

    /// Value of the term. A [`Program`](super::Program) evaluates whole libraries.
    pub fn value(&self, variables: &[f64]) -> f64 {
        self.factors.iter().map(|f| f.shape.value(variables[usize::from(f.variable)])).product()
    }

    /// Display name as in PySINDy: `1`, `u`, `u^2`, `u v`, `u |u|`, `u sin(delta)`, `r/u`, `u above(u, 2.5, 12)`.
    pub fn name(&self, names: &[impl AsRef<str>]) -> String {
        let mut text = String::new();
        let below = |shape: &Shape| matches!(shape, Shape::Reciprocal);
        for factor in self.factors.iter().filter(|f| !below(&f.shape)) {
            if !text.is_empty() {
                text.push(' ');
            }
            let name = names.get(usize::from(factor.variable)).map_or("?", AsRef::as_ref);
            // Writing to a String cannot fail.
            let _ = match factor.shape {
                Shape::Power(1) => write!(text, "{name}"),
                Shape::Power(n) => write!(text, "{name}^{n}"),
                Shape::Abs => write!(text, "|{name}|"),
                Shape::Sign => write!(text, "sgn({name})"),
                Shape::Sin => write!(text, "sin({name})"),
                Shape::Cos => write!(text, "cos({name})"),
                Shape::Log => write!(text, "ln({name})"),
                Shape::Above(g) => write!(text, "above({name}, {}, {})", g.centre.0, g.slope.0),
                Shape::Below(g) => write!(text, "below({name}, {}, {})", g.centre.0, g.slope.0),
                Shape::Reciprocal => Ok(()),
            };
        }
        if text.is_empty() {
            text.push('1');
        }
        for factor in self.factors.iter().filter(|f| below(&f.shape)) {
            let name = names.get(usize::from(factor.variable)).map_or("?", AsRef::as_ref);
            let _ = write!(text, "/{name}");
        }
        text
    }

    /// Derivative with respect to a variable, as a sum of multiples of terms. That of `|x|` at 0 is taken as 0.
    pub fn derivative(&self, variable: u16) -> Vec<(f64, Self)> {
        let mut sum: Vec<(f64, Self)> = Vec::new();
        for (position, factor) in self.factors.iter().enumerate().filter(|(_, f)| f.variable == variable) {
            let Some((scale, shapes)) = factor.shape.derivative() else { continue };
            let mut factors = self.factors.clone();
            factors.remove(position);
            factors.extend(shapes.iter().map(|&shape| Factor { variable, shape }));
            let term = Self::new(factors);
            match sum.iter_mut().find(|(_, known)| *known == term) {
                Some((known, _)) => *known += scale,
                None => sum.push((scale, term)),
            }
        }
        sum.retain(|(scale, _)| *scale != 0.0);
        sum
    }
}

impl Shape {
    /// The derivative as a multiple of a product of functions of the same variable; `None` where it is zero.
    fn derivative(self) -> Option<(f64, Vec<Self>)> {
        use alloc::vec;
        match self {
            Self::Power(0) | Self::Sign => None,
            Self::Power(1) => Some((1.0, vec![])),
            Self::Power(n) => Some((f64::from(n), vec![Self::Power(n - 1)])),
            Self::Abs => Some((1.0, vec![Self::Sign])),
            Self::Sin => Some((1.0, vec![Self::Cos])),
            Self::Cos => Some((-1.0, vec![Self::Sin])),
            Self::Reciprocal => Some((-1.0, vec![Self::Reciprocal, Self::Reciprocal])),
            Self::Log => Some((1.0, vec![Self::Reciprocal])),
            Self::Above(gate) => Some((gate.slope.0, vec![self, Self::Below(gate)])),
            Self::Below(gate) => Some((-gate.slope.0, vec![self, Self::Above(gate)])),
        }
    }
}

fn join(factors: &[Factor], normal: &mut Vec<Factor>) {
    let Some(&Factor { variable, .. }) = factors.first() else { return };
    let (mut power, mut abs, mut sign, mut reciprocal) = (0usize, 0usize, 0usize, 0usize);
    let mut others = Vec::new();
    for factor in factors {
        match factor.shape {
            Shape::Power(n) => power += usize::from(n),
            Shape::Abs => abs += 1,
            Shape::Sign => sign += 1,
            Shape::Reciprocal => reciprocal += 1,
            _ => others.push(*factor),
        }
    }
    // Pairs of |x| give x^2. Of signs only the parity of their number matters, except at 0, where a term with a sign is
    // a derivative that does not exist.
    power += abs - abs % 2;
    (abs, sign) = (abs % 2, sign % 2);
    if sign == 1 && abs == 1 {
        (abs, sign, power) = (0, 0, power + 1);
    } else if sign == 1 && power > 0 {
        (abs, sign, power) = (1, 0, power - 1);
    }
    let common = power.min(reciprocal);
    (power, reciprocal) = (power - common, reciprocal - common);
    let mut push = |shape| normal.push(Factor { variable, shape });
    while power > 0 {
        // An exponent is at most 255; larger powers are split.
        let part = u8::try_from(power).unwrap_or(u8::MAX);
        push(Shape::Power(part));
        power -= usize::from(part);
    }
    for (count, shape) in [(abs, Shape::Abs), (sign, Shape::Sign)] {
        if count > 0 {
            push(shape);
        }
    }
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for factor in others {
        if factor.shape < Shape::Reciprocal { before.push(factor) } else { after.push(factor) }
    }
    normal.extend(before);
    normal.extend((0..reciprocal).map(|_| Factor { variable, shape: Shape::Reciprocal }));
    normal.extend(after);
}
