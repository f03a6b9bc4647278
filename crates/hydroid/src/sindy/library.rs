//! Libraries: which terms an equation may have.

use hydroid_core::model::sparse::Term;

/// A family of terms over the outputs and inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Library {
    /// All monomials in outputs and inputs of degree 1 up to this.
    pub degree: u8,
    /// Also the constant 1. Without it a vessel at rest without commands stays at rest, as it does where
    /// no current, wind or offset of a sensor moves it.
    pub constant: bool,
    /// Also the signed squares `x |x|` of every variable: quadratic drag, which acts against the motion
    /// in both directions (Fossen 2021, section 6.4), and thrust, which is quadratic in the command.
    pub signed_squares: bool,
}

impl Library {
    /// All monomials up to a degree, the constant included.
    pub const fn polynomial(degree: u8) -> Self {
        Self { degree, constant: true, signed_squares: false }
    }

    /// Number of terms over `variables` variables, without making them; saturates.
    pub fn count(self, variables: u16) -> usize {
        let n = u128::from(variables);
        // Monomials up to a degree: binomial(n + degree, degree), built up without a fraction.
        let monomials =
            (1..=u128::from(self.degree)).try_fold(1, |c: u128, k| Some(c.checked_mul(n + k)? / k));
        let others = u128::from(!self.constant);
        let squares = if self.signed_squares { n } else { 0 };
        let total = monomials.and_then(|m| (m - others).checked_add(squares));
        total.and_then(|t| usize::try_from(t).ok()).unwrap_or(usize::MAX)
    }

    /// The terms over `variables` variables, in the order of rising degree and then of the variables
    /// (PySINDy's order). Signed squares stand before the terms of degree 2: where a log tells the two not
    /// apart, because a propeller never turned astern, the earlier one stays, and `n |n|` is thrust.
    pub fn terms(self, variables: u16) -> Vec<Term> {
        let mut terms = Vec::new();
        if self.constant {
            terms.push(Term::constant());
        }
        let highest = if variables == 0 { 0 } else { self.degree };
        let squares = |terms: &mut Vec<Term>| {
            if self.signed_squares {
                terms.extend((0..variables).map(|v| Term::signed_square(v, v)));
            }
        };
        for degree in 1..=highest {
            if degree == 2 {
                squares(&mut terms);
            }
            let mut monomial = vec![0; usize::from(degree)];
            loop {
                terms.push(Term::monomial(&monomial));
                // The next non-decreasing list of variables.
                let Some(last) = monomial.iter().rposition(|&v| v + 1 < variables) else { break };
                let next = monomial[last] + 1;
                monomial[last..].fill(next);
            }
        }
        if highest < 2 {
            squares(&mut terms);
        }
        terms
    }
}

impl std::fmt::Display for Library {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "polynomial of degree {}", self.degree)?;
        if self.signed_squares {
            write!(f, " with signed squares")?;
        }
        if !self.constant {
            write!(f, ", no constant")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_is_that_of_pysindy() {
        let names = ["x", "y", "z"];
        let text = |l: Library| l.terms(3).iter().map(|t| t.name(&names)).collect::<Vec<_>>().join(", ");
        assert_eq!(
            text(Library { degree: 2, constant: true, signed_squares: true }),
            "1, x, y, z, x |x|, y |y|, z |z|, x^2, x y, x z, y^2, y z, z^2"
        );
    }

    #[test]
    fn number_of_monomials_is_the_binomial_coefficient() {
        for (variables, degree, count) in [(6u16, 2, 28), (8, 3, 165), (5, 0, 1), (1, 4, 5), (0, 3, 1)] {
            assert_eq!(Library::polynomial(degree).terms(variables).len(), count);
        }
    }

    #[test]
    fn counting_needs_no_terms() {
        for degree in 0..5 {
            for variables in 0..6 {
                for (constant, signed_squares) in [(true, true), (true, false), (false, true), (false, false)]
                {
                    let library = Library { degree, constant, signed_squares };
                    assert_eq!(library.count(variables), library.terms(variables).len());
                }
            }
        }
        assert_eq!(Library::polynomial(255).count(u16::MAX), usize::MAX);
    }
}
