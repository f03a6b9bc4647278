//! The coefficients with their standard errors as a table in LaTeX.

use super::symbol::{magnitude, unit};
use super::{DIGITS, product, weight};
use crate::model::uncertainty::rounded;
use crate::model::{Mode, NamedEquations};

impl NamedEquations<'_> {
    /// The coefficients with standard errors and units as a `tabular`, one row for each; empty without standard errors.
    pub fn coefficients_latex(&self) -> String {
        let Some(uncertainty) = self.coefficient_uncertainty() else { return String::new() };
        let variables = self.latex_variables();
        let modes = self.modes();
        let mut rows = Vec::new();
        for (i, equation) in uncertainty.iter().enumerate() {
            for (&j, error) in equation.terms.iter().zip(&equation.standard_errors) {
                let term = &self.equations.terms()[j];
                let symbol = match modes.of(term) {
                    (Mode::All, term) => product(&term, &variables),
                    (mode, rest) if rest.factors().is_empty() => weight(&modes, mode),
                    (mode, rest) => format!("{}\\,{}", weight(&modes, mode), product(&rest, &variables)),
                };
                rows.push(format!(
                    "  ${}$ & ${symbol}$ & ${}$ & ${}$ \\\\\n",
                    variables[i].dotted(),
                    estimate(self.equations.coefficient(i, j), *error),
                    unit(&self.coefficient_unit(i, term))
                ));
            }
        }
        let rows = rows.concat();
        format!(
            "\n% Coefficients and standard errors (block bootstrap).\n\\begin{{tabular}}{{llrl}}\n  \\hline\n  \
             equation & term & coefficient & unit \\\\\n  \\hline\n{rows}  \\hline\n\\end{{tabular}}\n"
        )
    }
}

/// `-0.412 \pm 0.013`, `(-4.12 \pm 0.13) \times 10^{-7}`; the value alone without a standard error.
pub fn estimate(value: f64, error: Option<f64>) -> String {
    match error.map(|error| rounded(value, error)) {
        None => format!("{}{}", if value < 0.0 { "-" } else { "" }, magnitude(value, DIGITS)),
        Some((value, error, 0)) => format!("{value} \\pm {error}"),
        Some((value, error, power)) => format!("({value} \\pm {error}) \\times 10^{{{power}}}"),
    }
}
