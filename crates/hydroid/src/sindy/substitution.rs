//! Terms made from other terms: substitution of a variable, and the two modes of a gate.

use hydroid_core::model::sparse::{Factor, Gate, Term};

/// The term with the variable `to` in place of `from`: a lag state in place of its command, or a past value
/// in place of the present one.
pub(super) fn substitute_variable(term: &Term, from: u16, to: u16) -> Term {
    let swap = |f: &Factor| if f.variable == from { Factor { variable: to, ..*f } } else { *f };
    Term::new(term.factors().iter().map(swap).collect())
}

/// Each term below and above a gate on a variable, in place of their sum, the original term.
pub fn gated(terms: &[Term], variable: u16, gate: Gate) -> Vec<Term> {
    terms.iter().flat_map(|term| term.gated(variable, gate)).collect()
}

#[cfg(test)]
mod tests {
    use hydroid_core::model::sparse::{Real, Shape};

    use super::*;

    #[test]
    fn a_replaced_variable_joins_what_is_there() {
        let thrust = Term::signed_square(1, 1).times(&Term::monomial(&[0]));
        assert_eq!(
            substitute_variable(&thrust, 1, 3),
            Term::signed_square(3, 3).times(&Term::monomial(&[0]))
        );
        assert_eq!(substitute_variable(&Term::monomial(&[0, 1]), 1, 0), Term::monomial(&[0, 0]));
        assert_eq!(substitute_variable(&thrust, 2, 5), thrust);
    }

    #[test]
    fn the_modes_of_a_term_add_up_to_it() {
        let gate = Gate { centre: Real(2.5), slope: Real(12.0) };
        let terms = [Term::constant(), Term::of(1, Shape::Sin)];
        let modes = gated(&terms, 0, gate);
        assert_eq!(modes.len(), 4);
        for (pair, term) in modes.chunks(2).zip(&terms) {
            let at = [2.6, 0.3];
            let sum: f64 = pair.iter().map(|t| t.value(&at)).sum();
            assert!((sum - term.value(&at)).abs() < 1e-15);
        }
    }
}
