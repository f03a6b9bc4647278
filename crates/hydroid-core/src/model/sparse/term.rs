//! A term of a library: a product of simple functions of single variables.

use alloc::string::String;
use alloc::vec::Vec;
use core::fmt::Write;

/// The function of one variable in a factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Shape {
    /// `x^n`, `n >= 1`.
    Power(u8),
    /// `|x|`; with `Power(1)` of the same variable the signed square `x |x|` of quadratic drag
    /// (Fossen 2021, section 6.4).
    Abs,
}

/// A function of one variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Factor {
    /// Index of the variable: outputs first, then inputs.
    pub variable: u16,
    /// The function applied to it.
    pub shape: Shape,
}

/// A product of factors; without factors the constant 1.
///
/// The factors are kept sorted by variable, so that equal terms compare equal.
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
    /// A product of factors, in any order.
    pub fn new(mut factors: Vec<Factor>) -> Self {
        factors.sort_unstable();
        Self { factors }
    }

    /// The constant 1.
    pub const fn constant() -> Self {
        Self { factors: Vec::new() }
    }

    /// The monomial `prod x_i^{n_i}`, given as pairs of variable and exponent; a variable may repeat.
    pub fn monomial(variables: &[u16]) -> Self {
        let mut factors: Vec<Factor> = Vec::new();
        let mut sorted = variables.to_vec();
        sorted.sort_unstable();
        for variable in sorted {
            match factors.last_mut() {
                Some(Factor { variable: v, shape: Shape::Power(n) }) if *v == variable => *n += 1,
                _ => factors.push(Factor { variable, shape: Shape::Power(1) }),
            }
        }
        Self { factors }
    }

    /// The signed product `x |y|`; with `y = x` the signed square.
    pub fn signed_square(x: u16, y: u16) -> Self {
        Self::new(alloc::vec![
            Factor { variable: x, shape: Shape::Power(1) },
            Factor { variable: y, shape: Shape::Abs },
        ])
    }

    /// The factors, sorted by variable.
    pub fn factors(&self) -> &[Factor] {
        &self.factors
    }

    /// Sum of the powers; `|x|` counts as one. The unit of the term is the product of its variables'
    /// units to these powers.
    pub fn degree(&self) -> usize {
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

    /// Value of the term. For one term at a time; libraries are evaluated by a
    /// [`Program`](super::Program).
    pub fn value(&self, variables: &[f64]) -> f64 {
        self.factors.iter().map(|f| f.shape.value(variables[usize::from(f.variable)])).product()
    }

    /// The term in words that a person and PySINDy's users read: `1`, `u`, `u^2`, `u v`, `u |u|`.
    pub fn name(&self, names: &[impl AsRef<str>]) -> String {
        if self.factors.is_empty() {
            return String::from("1");
        }
        let mut text = String::new();
        for factor in &self.factors {
            if !text.is_empty() {
                text.push(' ');
            }
            let name = names.get(usize::from(factor.variable)).map_or("?", AsRef::as_ref);
            // Writing to a String cannot fail.
            let _ = match factor.shape {
                Shape::Power(1) => write!(text, "{name}"),
                Shape::Power(n) => write!(text, "{name}^{n}"),
                Shape::Abs => write!(text, "|{name}|"),
            };
        }
        text
    }
}

impl Shape {
    /// The function's value.
    pub fn value(self, x: f64) -> f64 {
        match self {
            Self::Power(n) => (0..n).fold(1.0, |p, _| p * x),
            Self::Abs => x.abs(),
        }
    }

    /// How it scales with its variable: `f(s x) = s^degree f(x)` for `s > 0`.
    pub fn degree(self) -> usize {
        match self {
            Self::Power(n) => usize::from(n),
            Self::Abs => 1,
        }
    }
}
