//! Constraints mapped to the terms of a structure: lag states replace commands, and constraints hold in both modes.

use hydroid_core::model::sparse::Term;

use super::constraints::{Coefficient, Constraints, Equality, Sign};
use super::expression::{Constraint, Relation};
use super::library::Variables;
use super::structure::Structure;

/// Whether the solver supports a constraint: an equality, or the sign of one coefficient.
pub(crate) fn is_supported(rule: &Constraint) -> bool {
    rule.relation == Relation::Equal || rule.sum.len() == 1 && rule.bound == 0.0
}

/// Whether a constraint couples the equations of several outputs.
pub(super) fn couples_outputs(rule: &Constraint) -> bool {
    rule.sum.windows(2).any(|pair| pair[0].1.output != pair[1].1.output)
}

/// Dissipative damping: the coefficients of `y` and of `y |y|` in the equation of each output `y` are not positive.
pub fn dissipative(variables: &Variables) -> Vec<Constraint> {
    let of = |(output, term)| Constraint {
        sum: vec![(1.0, super::expression::Coefficient { output, term })],
        relation: Relation::AtMost,
        bound: 0.0,
    };
    let damping =
        |(y, _)| [Term::monomial(&[y]), Term::signed_square(y, y)].map(|term| (usize::from(y), term));
    variables.outputs().flat_map(damping).map(of).collect()
}

impl Structure {
    /// The constraints on the terms of this structure; other terms are zero and satisfy every constraint.
    pub fn constraints(&self, rules: &[Constraint], variables: &Variables) -> Constraints {
        let mut constraints = Constraints::default();
        if rules.is_empty() {
            return constraints;
        }
        let terms = self.terms(variables);
        let modes = if self.gate.is_some() { 2 } else { 1 };
        for (rule, mode) in rules.iter().flat_map(|rule| (0..modes).map(move |mode| (rule, mode))) {
            let place = |(factor, at): &(f64, super::expression::Coefficient)| {
                let own = self.mode_terms(&at.term, variables).into_iter().nth(mode)?;
                let term = terms.iter().position(|term| *term == own)?;
                Some((Coefficient { equation: at.output, term }, *factor))
            };
            let weights: Vec<(Coefficient, f64)> = rule.sum.iter().filter_map(place).collect();
            match (rule.relation, &weights[..]) {
                (_, []) => {}
                (Relation::Equal, _) => {
                    constraints.equalities.push(Equality { weights, value: rule.bound });
                }
                (relation, &[(at, factor), ..]) => {
                    let positive = (relation == Relation::AtLeast) == (factor > 0.0);
                    constraints
                        .signs
                        .push((at, if positive { Sign::NotNegative } else { Sign::NotPositive }));
                }
            }
        }
        constraints
    }
}

#[cfg(test)]
mod tests {
    use super::super::expression::ExpressionParser;
    use super::super::library::Library;
    use super::super::structure::{GateSpec, Lag};
    use super::*;

    #[test]
    fn rules_follow_terms_through_lags_and_modes() {
        let variables = Variables::plain(2, 1);
        let mut parser = ExpressionParser::new(["u", "r", "n"], 2, 0.1);
        let rules: Vec<Constraint> = ["u: n >= 0", "r: u^2 <= 0", "u: r = r: u", "0 <= -2 u: u"]
            .iter()
            .map(|text| parser.constraint(text).unwrap())
            .collect();
        let structure = Structure {
            lags: vec![Lag { input: 0, time_constant_s: 2.0 }],
            gate: Some(GateSpec::new(0, 1.0, 5.0)),
            ..Structure::from(Library::polynomial(1))
        };
        let constraints = structure.constraints(&rules, &variables);
        let names = ["u", "r", "n", "lag"];
        let terms = structure.terms(&variables);
        let found: Vec<(String, Sign)> =
            constraints.signs.iter().map(|(at, sign)| (terms[at.term].name(&names), *sign)).collect();
        assert_eq!(
            found,
            [
                (String::from("below(u, 1, 5) lag"), Sign::NotNegative),
                (String::from("above(u, 1, 5) lag"), Sign::NotNegative),
                (String::from("u below(u, 1, 5)"), Sign::NotPositive),
                (String::from("u above(u, 1, 5)"), Sign::NotPositive),
            ]
        );
        // In each mode by itself; the library has no u^2.
        assert_eq!(constraints.equalities.len(), 2);
        assert!(couples_outputs(&rules[2]) && !couples_outputs(&rules[0]));
        assert!(rules.iter().all(is_supported));
        assert!(!is_supported(&parser.constraint("u: u <= -1").unwrap()));
        assert_eq!(dissipative(&variables).len(), 4);
    }
}
