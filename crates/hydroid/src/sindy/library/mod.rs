//! Libraries: the candidate terms of the equations.

mod family;
mod text;
mod variables;

use std::collections::HashSet;

use hydroid_core::model::sparse::{Shape, Term};
use serde::{Deserialize, Serialize};

pub use family::Family;
pub(crate) use text::UnknownLibrary;
pub use variables::{VariableKind, Variables};

/// The union of families of terms.
///
/// ```
/// use hydroid::sindy::{Family, Library, Variables};
///
/// let library = Library::polynomial(2).with(Family::SignedSquares);
/// assert_eq!(library.to_string(), "degree 2 + x|x|");
/// assert_eq!(library.count(&Variables::plain(3, 2)), 26);
/// assert_eq!("degree 2 + x|x|".parse::<Library>().unwrap(), library);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Library {
    families: Vec<Family>,
}

/// Largest number of terms outside the polynomials for which [`Library::count`] is exact.
const EXACT_COUNT_LIMIT: u128 = 20_000;

impl Library {
    /// The union of families, in any order.
    pub fn new(families: Vec<Family>) -> Self {
        Self { families }
    }

    /// All monomials up to a degree, the constant included.
    pub fn polynomial(degree: u8) -> Self {
        Self::new(vec![Family::Constant, Family::Polynomial { degree }])
    }

    /// The terms of a surface vessel ([`Family::Marine`]), the constant included.
    pub fn marine() -> Self {
        Self::new(vec![Family::Constant, Family::Marine])
    }

    /// A library of exactly these terms.
    pub fn listed(terms: Vec<Term>) -> Self {
        Self::new(vec![Family::Listed(terms)])
    }

    /// Adds a family.
    pub fn with(mut self, family: Family) -> Self {
        if !self.families.contains(&family) {
            self.families.push(family);
        }
        self
    }

    /// Removes the constant.
    pub fn without_constant(mut self) -> Self {
        self.families.retain(|family| *family != Family::Constant);
        self
    }

    /// The families.
    pub fn families(&self) -> &[Family] {
        &self.families
    }

    /// Number of terms, without generating the monomials; an upper bound for very many other terms.
    pub fn count(&self, variables: &Variables) -> usize {
        let is_polynomial = |family: &Family| matches!(family, Family::Polynomial { .. });
        let degrees = self.families.iter().filter_map(|family| match family {
            Family::Polynomial { degree } => Some(*degree),
            _ => None,
        });
        let degree = degrees.max().unwrap_or(0);
        let polynomial = Family::Polynomial { degree }.count_bound(variables);
        let others = || self.families.iter().filter(|family| !is_polynomial(family));
        let bound = others().fold(0u128, |sum, family| sum.saturating_add(family.count_bound(variables)));
        let others = if bound > EXACT_COUNT_LIMIT {
            bound
        } else {
            let mut seen = HashSet::new();
            others().for_each(|family| {
                family.for_each_term(variables, &mut |term| {
                    if !is_monomial(&term, degree, variables) {
                        seen.insert(term);
                    }
                });
            });
            seen.len() as u128
        };
        usize::try_from(polynomial.saturating_add(others)).unwrap_or(usize::MAX)
    }

    /// The terms without duplicates, ordered by degree (the sine of an angle has degree 1), then signed squares, signed
    /// products, other terms and fractions, then by variables. Monomials are ordered as in PySINDy.
    ///
    /// If two terms are linearly dependent on a log, the regression keeps the earlier one: `n |n|` instead of `n^2` if
    /// a propeller never turns astern.
    pub fn terms(&self, variables: &Variables) -> Vec<Term> {
        let mut terms = Vec::new();
        self.families.iter().for_each(|family| family.for_each_term(variables, &mut |term| terms.push(term)));
        terms.sort_by_cached_key(order_key);
        terms.dedup();
        terms
    }
}

fn is_monomial(term: &Term, degree: u8, variables: &Variables) -> bool {
    let powers = term.factors().iter().all(|f| matches!(f.shape, Shape::Power(_)));
    powers
        && (1..=i32::from(degree)).contains(&term.degree())
        && term.highest_variable().is_none_or(|v| usize::from(v) < variables.len())
}

fn order_key(term: &Term) -> (usize, u8, Vec<u16>, Term) {
    // Each variable is repeated by its power: x x before x y before y y.
    let mut product = Vec::new();
    for factor in term.factors() {
        let times = match factor.shape {
            Shape::Power(n) => usize::from(n),
            Shape::Above(_) | Shape::Below(_) | Shape::Sign => 0,
            Shape::Abs | Shape::Sin | Shape::Cos | Shape::Reciprocal | Shape::Log => 1,
        };
        product.extend(std::iter::repeat_n(factor.variable, times));
    }
    let has = |wanted: fn(&Shape) -> bool| term.factors().iter().any(|f| wanted(&f.shape));
    // A modulus of the same variable as the power is a signed square.
    let signed = term
        .factors()
        .windows(2)
        .any(|pair| pair[0].variable == pair[1].variable && pair[1].shape == Shape::Abs);
    let class = if has(|s| matches!(s, Shape::Reciprocal | Shape::Log)) {
        3
    } else if signed {
        0
    } else if has(|s| matches!(s, Shape::Abs)) {
        1
    } else {
        2
    };
    (product.len(), class, product, term.clone())
}
