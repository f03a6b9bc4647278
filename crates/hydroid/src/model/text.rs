//! A model's equations as text.

use hydroid_core::model::sparse::{Equations, Signal, Term};

use super::uncertainty::rounded;
use super::{Mode, NamedEquations};

const DIGITS: usize = 4;

impl NamedEquations<'_> {
    /// Names of the variables: outputs, inputs, signals.
    pub fn variable_names(&self) -> Vec<String> {
        let d = self.description;
        let mut names: Vec<String> =
            d.outputs.iter().chain(&d.inputs).map(|port| port.channel.name.clone()).collect();
        let equations = self.equations;
        let signals: Vec<String> = equations.signals().iter().map(|s| s.name(&names, d.dt)).collect();
        names.extend(signals);
        names
    }

    /// The equations of motion in physical units, one line for each output: `du/dt = -0.907 u + ...`. Gated terms are
    /// grouped, `(1 - s) [...] + s [...]`. Then one line for each gate and each active signal.
    pub fn equations_text(&self) -> Vec<String> {
        let equations = self.equations;
        let names = self.variable_names();
        let modes = self.modes();
        let right = |i: usize| {
            let mut text = String::new();
            for (mode, terms) in modes.grouped(active(equations, i).map(|(c, term)| (c, term.clone()))) {
                let own = sum(terms.iter().map(|(c, term)| (*c, term)), &names, DIGITS);
                text.push_str(if text.is_empty() { "" } else { " + " });
                match mode {
                    Mode::All => text.push_str(&own),
                    mode => text.extend([modes.weight(mode).as_str(), " [", &own, "]"]),
                }
            }
            if text.is_empty() { String::from("0") } else { text }
        };
        let outputs = (0..equations.outputs()).map(|i| format!("d{}/dt = {}", names[i], right(i)));
        outputs.chain(self.gates_text()).chain(self.signals_text()).collect()
    }

    /// Definitions of the active signals: `d lag(n, 1.5 s)/dt = (n - lag(n, 1.5 s)) / 1.5 s`, and rate limits of inputs.
    pub fn signals_text(&self) -> Vec<String> {
        let names = self.variable_names();
        let text = |(variable, signal): (usize, Signal)| {
            let (name, source) = (&names[variable], &names[usize::from(signal.source())]);
            match signal {
                Signal::Lag { time_constant_s, .. } => {
                    format!("d {name}/dt = ({source} - {name}) / {} s", seconds(time_constant_s.0))
                }
                Signal::Past { samples: 1, .. } => format!("{name} = {source} one sample ago"),
                Signal::Past { samples, .. } => format!("{name} = {source} {samples} samples ago"),
            }
        };
        self.used_signals().into_iter().map(text).chain(self.description.rate_limits_text()).collect()
    }

    /// The unit of each coefficient: a heading, then a line for each active term, with a column for each output.
    pub fn units_text(&self) -> Vec<String> {
        let equations = self.equations;
        let names = self.variable_names();
        let modes = self.modes();
        let mut rows = vec![vec![String::from("term")]];
        rows[0].extend(names[..equations.outputs()].iter().map(|name| format!("d{name}/dt")));
        for (j, term) in equations.terms().iter().enumerate() {
            let unit = |i: usize| match equations.coefficient(i, j) {
                0.0 => String::from("-"),
                _ => self.coefficient_unit(i, term).to_string(),
            };
            let units: Vec<String> = (0..equations.outputs()).map(unit).collect();
            if units.iter().any(|unit| unit != "-") {
                rows.push(std::iter::once(modes.name(term, &names)).chain(units).collect());
            }
        }
        aligned(&rows)
    }

    /// The coefficients with standard errors and units: a heading, then a line for each; empty without standard errors.
    pub fn coefficients_text(&self) -> Vec<String> {
        let Some(uncertainty) = self.coefficient_uncertainty() else { return Vec::new() };
        let (names, modes) = (self.variable_names(), self.modes());
        let mut rows = vec![["equation", "term", "coefficient", "unit"].map(str::to_owned).to_vec()];
        for (i, equation) in uncertainty.iter().enumerate() {
            for (&j, error) in equation.terms.iter().zip(&equation.standard_errors) {
                let term = &self.equations.terms()[j];
                rows.push(vec![
                    format!("d{}/dt", names[i]),
                    modes.name(term, &names),
                    estimate(self.equations.coefficient(i, j), *error),
                    self.coefficient_unit(i, term).to_string(),
                ]);
            }
        }
        aligned(&rows)
    }

    /// Pairs of strongly correlated coefficients, a line for each: `du/dt: u and u |u| (-0.97)`.
    pub fn correlations_text(&self) -> Vec<String> {
        let (names, modes) = (self.variable_names(), self.modes());
        let name = |j: usize| modes.name(&self.equations.terms()[j], &names);
        let mut lines = Vec::new();
        for (output, equation) in names.iter().zip(self.coefficient_uncertainty().unwrap_or_default()) {
            for (i, j, correlation) in equation.strongly_correlated() {
                lines.push(format!("d{output}/dt: {} and {} ({correlation:.2})", name(i), name(j)));
            }
        }
        lines
    }

    /// Active signals with their variables.
    pub(super) fn used_signals(&self) -> Vec<(usize, Signal)> {
        let equations = self.equations;
        let first = equations.outputs() + equations.inputs();
        let is_used = |variable: usize| {
            (0..equations.outputs())
                .flat_map(|i| active(equations, i))
                .any(|(_, term)| term.factors().iter().any(|factor| usize::from(factor.variable) == variable))
        };
        let signals = (first..).zip(equations.signals().iter().copied());
        signals.filter(|(variable, _)| is_used(*variable)).collect()
    }
}

pub(super) fn active(equations: &Equations, output: usize) -> impl Iterator<Item = (f64, &Term)> {
    let terms = equations.terms().iter().enumerate();
    terms.map(move |(j, term)| (equations.coefficient(output, j), term)).filter(|(c, _)| *c != 0.0)
}

/// Rows of equal length as lines with columns of equal width.
fn aligned(rows: &[Vec<String>]) -> Vec<String> {
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default();
    let widths: Vec<usize> = (0..rows.first().map_or(0, Vec::len)).map(width).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(cell, &width)| format!("{cell:<width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

/// `-0.412 ± 0.013`, `(-4.12 ± 0.13)e-7`; the value alone without a standard error.
fn estimate(value: f64, error: Option<f64>) -> String {
    match error.map(|error| rounded(value, error)) {
        None => format!("{}{}", if value < 0.0 { "-" } else { "" }, significant(value.abs(), DIGITS)),
        Some((value, error, 0)) => format!("{value} ± {error}"),
        Some((value, error, power)) => format!("({value} ± {error})e{power}"),
    }
}

/// `-0.907 u + 0.1 u |u|`; 0 without terms.
pub(super) fn sum<'a>(
    terms: impl Iterator<Item = (f64, &'a Term)>,
    names: &[String],
    digits: usize,
) -> String {
    let mut text = String::new();
    for (coefficient, term) in terms {
        text.push_str(match (coefficient < 0.0, text.is_empty()) {
            (true, true) => "-",
            (false, true) => "",
            (true, false) => " - ",
            (false, false) => " + ",
        });
        text.push_str(&significant(coefficient.abs(), digits));
        if !term.factors().is_empty() {
            text.push(' ');
            text.push_str(&term.name(names));
        }
    }
    if text.is_empty() { String::from("0") } else { text }
}

/// Significant digits, without an exponent from 1e-4 to 1e5: `0.9070`, `1.234e-7`.
pub(super) fn significant(x: f64, digits: usize) -> String {
    let mantissa = digits.saturating_sub(1);
    if (1e-4..1e5).contains(&x) {
        // The number of digits is a small integer.
        #[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap)]
        let decimals = mantissa as i32 - x.log10().floor() as i32;
        let decimals = usize::try_from(decimals).unwrap_or(0);
        format!("{x:.decimals$}")
    } else {
        format!("{x:.mantissa$e}")
    }
}

pub(super) fn seconds(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}
