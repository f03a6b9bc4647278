//! Terms made from other terms: substitution of a variable, and the two modes of a gate.

use hydroid_core::model::sparse::{Factor, Gate, Term};

/// The term with the variable `to` in place of `from`: a lag state in place of its command, or a past value
/// in place of the present one.
pub fn substitute_variable(term: &Term, from: u16, to: u16) -> Term {
    let swap = |f: &Factor| if f.variable == from { Factor { variable: to, ..*f } } else { *f };
    Term::new(term.factors().iter().map(swap).collect())
}

/// Each term below and above a gate on a variable, in place of their sum, the original term.
pub fn gated(terms: &[Term], variable: u16, gate: Gate) -> Vec<Term> {
    terms.iter().flat_map(|term| term.gated(variable, gate)).collect()
}
