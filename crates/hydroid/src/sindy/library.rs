//! Libraries: which terms an equation may have.

use hydroid_core::model::sparse::Term;

/// A family of terms over the outputs and inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Library {
    /// All monomials in outputs and inputs up to this degree, the constant included.
    pub degree: u8,
    /// Also the signed squares `x |x|` of every variable: quadratic drag, which acts against the motion
    /// in both directions (Fossen 2021, section 6.4), and thrust, which is quadratic in the command.
    pub signed_squares: bool,
}

impl Library {
    /// A polynomial library.
    pub const fn polynomial(degree: u8) -> Self {
        Self { degree, signed_squares: false }
    }

    /// Number of terms over `variables` variables, without making them: a slip in the degree asks for more
    /// than any memory holds.
    pub fn size(self, variables: u16) -> u128 {
        // C(variables + degree, degree), at most C(65790, 255), which saturates.
        let monomials = (1..=u128::from(self.degree)).try_fold(1u128, |count, degree| {
            Some(count.checked_mul(u128::from(variables) + degree)? / degree)
        });
        let squares = if self.signed_squares { u128::from(variables) } else { 0 };
        monomials.unwrap_or(u128::MAX).saturating_add(squares)
    }

    /// The terms over `variables` variables, in the order of rising degree and then of the variables
    /// (PySINDy's order), signed squares last.
    pub fn terms(self, variables: u16) -> Vec<Term> {
        let mut terms = vec![Term::constant()];
        let highest = if variables == 0 { 0 } else { self.degree };
        for degree in 1..=highest {
            let mut monomial = vec![0; usize::from(degree)];
            loop {
                terms.push(Term::monomial(&monomial));
                // The next non-decreasing list of variables.
                let Some(last) = monomial.iter().rposition(|&v| v + 1 < variables) else { break };
                let next = monomial[last] + 1;
                monomial[last..].fill(next);
            }
        }
        if self.signed_squares {
            terms.extend((0..variables).map(|v| Term::signed_square(v, v)));
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
            text(Library { degree: 2, signed_squares: true }),
            "1, x, y, z, x^2, x y, x z, y^2, y z, z^2, x |x|, y |y|, z |z|"
        );
    }

    #[test]
    fn number_of_monomials_is_the_binomial_coefficient() {
        for (variables, degree, count) in [(6u16, 2, 28), (8, 3, 165), (5, 0, 1), (1, 4, 5), (0, 3, 1)] {
            assert_eq!(Library::polynomial(degree).terms(variables).len(), count);
            assert_eq!(Library::polynomial(degree).size(variables), count as u128);
            let squares = Library { degree, signed_squares: true };
            assert_eq!(squares.size(variables), squares.terms(variables).len() as u128);
        }
    }
}
