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
    /// A product of factors, in any order; powers of one variable are joined.
    pub fn new(mut factors: Vec<Factor>) -> Self {
        factors.sort_unstable();
        let mut joined: Vec<Factor> = Vec::with_capacity(factors.len());
        for factor in factors {
            let sum = match (joined.last(), factor.shape) {
                (Some(Factor { variable, shape: Shape::Power(a) }), Shape::Power(b))
                    if *variable == factor.variable =>
                {
                    // Beyond what an exponent holds the two stay apart, which is as true.
                    a.checked_add(b)
                }
                _ => None,
            };
            match (joined.last_mut(), sum) {
                (Some(last), Some(sum)) => last.shape = Shape::Power(sum),
                _ => joined.push(factor),
            }
        }
        Self { factors: joined }
    }

    /// The constant 1.
    pub const fn constant() -> Self {
        Self { factors: Vec::new() }
    }

    /// The product of some variables; one that is named `n` times stands to the power `n`.
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

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    #[test]
    fn powers_of_one_variable_are_joined_however_they_are_given() {
        let power = |variable, n| Factor { variable, shape: Shape::Power(n) };
        let abs = |variable| Factor { variable, shape: Shape::Abs };
        assert_eq!(
            Term::new(vec![power(1, 1), power(0, 2), power(1, 1)]).factors(),
            [power(0, 2), power(1, 2)]
        );
        assert_eq!(Term::monomial(&[1, 0, 1, 0]), Term::new(vec![power(0, 2), power(1, 2)]));
        assert_eq!(Term::new(vec![abs(0), power(0, 1), power(0, 1)]).factors(), [power(0, 2), abs(0)]);
        // More than an exponent holds.
        let large = Term::new(vec![power(0, 200), power(0, 100)]);
        assert_eq!((large.degree(), large.value(&[1.01])), (300, 1.01f64.powi(200) * 1.01f64.powi(100)));
    }
}
