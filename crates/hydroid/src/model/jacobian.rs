//! Jacobian of a model's equations as text.

use hydroid_core::model::sparse::Term;
use serde::Serialize;

use super::NamedEquations;
use super::text::{active, sum};

/// Significant digits in the text of an entry; the coefficients in the list of terms are exact.
const DIGITS: usize = 7;

/// `d f_i / d x_j` of `dy/dt = f(y, c, s)`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JacobianEntry {
    /// Output of the equation.
    pub output: String,
    /// Variable of the derivative: output, input or signal.
    pub variable: String,
    /// Its unit.
    pub unit: String,
    /// Sum of its terms as text; `0` if the equation does not depend on the variable.
    pub text: String,
    /// Coefficients and terms of the sum.
    pub terms: Vec<(f64, String)>,
}

/// Blocks of the Jacobian, row by row.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[allow(non_snake_case, reason = "standard names of control engineering")]
pub struct JacobianText {
    /// With respect to the outputs.
    pub A: Vec<Vec<JacobianEntry>>,
    /// With respect to the inputs, at fixed signals.
    pub B: Vec<Vec<JacobianEntry>>,
    /// With respect to signals; [`NamedEquations::signals_text`] defines them.
    pub signals: Vec<Vec<JacobianEntry>>,
}

impl NamedEquations<'_> {
    /// The Jacobian as text; at the kink of `|x|` the derivative is that of 0.
    pub fn jacobian_text(&self) -> JacobianText {
        let equations = self.equations;
        let (outputs, inputs) = (equations.outputs(), equations.inputs());
        let (names, units) = (self.variable_names(), self.variable_units());
        let entry = |i: usize, variable: usize| {
            let mut terms: Vec<(f64, Term)> = Vec::new();
            // Terms have at most 65,536 variables.
            for (coefficient, term) in u16::try_from(variable).iter().flat_map(|&v| {
                active(equations, i).flat_map(move |(coefficient, term)| {
                    term.derivative(v).into_iter().map(move |(scale, term)| (scale * coefficient, term))
                })
            }) {
                match terms.iter_mut().find(|(_, known)| *known == term) {
                    Some((known, _)) => *known += coefficient,
                    None => terms.push((coefficient, term)),
                }
            }
            terms.retain(|(coefficient, _)| *coefficient != 0.0);
            JacobianEntry {
                output: names[i].clone(),
                variable: names[variable].clone(),
                unit: units[i].clone().per_second().times(&units[variable], -1).to_string(),
                text: sum(terms.iter().map(|(c, term)| (*c, term)), &names, DIGITS),
                terms: terms.iter().map(|(c, term)| (*c, term.name(&names))).collect(),
            }
        };
        let part = |from: usize, to: usize| {
            let row = |i: usize| (from..to).map(|variable| entry(i, variable)).collect();
            (0..outputs).map(row).collect()
        };
        JacobianText {
            A: part(0, outputs),
            B: part(outputs, outputs + inputs),
            signals: part(outputs + inputs, equations.variables()),
        }
    }
}
