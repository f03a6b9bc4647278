//! Units of terms and coefficients from the units of the channels.

use std::fmt;

use hydroid_core::model::sparse::Term;
use serde::Serialize;

use super::NamedEquations;
use super::text::active;

/// A product of powers of unit symbols, in order of appearance: `m/s^2`, `kn/s/N`.
///
/// The radian is 1, as in SI. A channel without a unit is a unit symbol itself: `m/s^2/[n]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct UnitProduct {
    powers: Vec<(String, i32)>,
}

impl UnitProduct {
    /// The unit of a channel; text that is not a product of symbols is one symbol.
    pub fn of_channel(name: &str, unit: &str) -> Self {
        let unit = unit.trim();
        let mut product = Self::default();
        if unit.is_empty() {
            product.multiply(&format!("[{name}]"), 1);
        } else if let Some(powers) = parse(unit) {
            for (symbol, power) in powers {
                product.multiply(symbol, power);
            }
        } else {
            product.multiply(&format!("({unit})"), 1);
        }
        product
    }

    /// Symbols with their powers, none of them 0.
    pub fn powers(&self) -> &[(String, i32)] {
        &self.powers
    }

    /// This times a power of another.
    #[must_use]
    pub fn times(mut self, other: &Self, power: i32) -> Self {
        other.powers.iter().for_each(|(symbol, own)| self.multiply(symbol, own.saturating_mul(power)));
        self
    }

    /// This per second.
    #[must_use]
    pub fn per_second(mut self) -> Self {
        self.multiply("s", -1);
        self
    }

    fn multiply(&mut self, symbol: &str, power: i32) {
        match self.powers.iter_mut().find(|(known, _)| known == symbol) {
            Some((_, known)) => *known = known.saturating_add(power),
            None => self.powers.push((symbol.to_owned(), power)),
        }
        self.powers.retain(|(_, power)| *power != 0);
    }
}

/// A coefficient of an equation, with all its digits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TermCoefficient {
    /// Output of the equation.
    pub output: String,
    /// The term.
    pub term: String,
    /// Its value.
    pub value: f64,
    /// Its standard error, in the same unit; `None` without an ensemble, or if all members agree.
    pub standard_error: Option<f64>,
    /// Its unit.
    pub unit: String,
}

/// Symbols and powers of `m/s^2`, `N m`, `ms-1`; none for other text.
fn parse(unit: &str) -> Option<Vec<(&str, i32)>> {
    let mut powers = Vec::new();
    for (i, part) in unit.split('/').enumerate() {
        let mut factors = part.split([' ', '*', '·', '⋅']).filter(|factor| !factor.is_empty()).peekable();
        factors.peek()?;
        for factor in factors {
            let end =
                factor.find(|c: char| !(c.is_alphabetic() || matches!(c, '°' | '%'))).unwrap_or(factor.len());
            let (symbol, power) = factor.split_at(end);
            if symbol.is_empty() {
                // The 1 in 1/s, or the unit of a pure number.
                if power != "1" {
                    return None;
                }
                continue;
            }
            let power = power.strip_prefix('^').unwrap_or(power);
            let power: i32 = if power.is_empty() { 1 } else { power.parse().ok()? };
            if !(-100..=100).contains(&power) {
                return None;
            }
            if symbol != "rad" {
                powers.push((symbol, if i == 0 { power } else { -power }));
            }
        }
    }
    Some(powers)
}

impl fmt::Display for UnitProduct {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let exponent = |power: i32| match power.unsigned_abs() {
            1 => String::new(),
            n => format!("^{n}"),
        };
        let above = self.powers.iter().filter(|(_, power)| *power > 0);
        let above: Vec<String> =
            above.map(|(symbol, power)| format!("{symbol}{}", exponent(*power))).collect();
        f.write_str(if above.is_empty() { "1" } else { "" })?;
        f.write_str(&above.join(" "))?;
        for (symbol, power) in self.powers.iter().filter(|(_, power)| *power < 0) {
            write!(f, "/{symbol}{}", exponent(*power))?;
        }
        Ok(())
    }
}

impl NamedEquations<'_> {
    /// Units of the variables: outputs, inputs, signals.
    pub fn variable_units(&self) -> Vec<UnitProduct> {
        let d = self.description;
        let channels = d.outputs.iter().chain(&d.inputs).map(|port| &port.channel);
        let mut units: Vec<UnitProduct> =
            channels.map(|channel| UnitProduct::of_channel(&channel.name, &channel.unit)).collect();
        let equations = self.equations;
        let signals: Vec<UnitProduct> =
            equations.signals().iter().map(|signal| units[usize::from(signal.source())].clone()).collect();
        units.extend(signals);
        units
    }

    /// All non-zero coefficients, equation by equation.
    pub fn coefficients(&self) -> Vec<TermCoefficient> {
        let equations = self.equations;
        let names = self.variable_names();
        let uncertainty = self.coefficient_uncertainty();
        let of = |i: usize| {
            let (names, uncertainty) = (&names, &uncertainty);
            active(equations, i).enumerate().map(move |(k, (value, term))| TermCoefficient {
                output: names[i].clone(),
                term: term.name(names),
                value,
                standard_error: uncertainty.as_ref().and_then(|of| of[i].standard_errors[k]),
                unit: self.coefficient_unit(i, term).to_string(),
            })
        };
        (0..equations.outputs()).flat_map(of).collect()
    }

    /// The unit of a term's coefficient in the equation of an output: `unit of the output / (s unit of the term)`.
    ///
    /// # Panics
    /// If the output or a variable of the term does not exist.
    pub fn coefficient_unit(&self, output: usize, term: &Term) -> UnitProduct {
        let units = self.variable_units();
        units[output].clone().per_second().times(&of_term(&units, term), -1)
    }
}

fn of_term(units: &[UnitProduct], term: &Term) -> UnitProduct {
    term.factors().iter().fold(UnitProduct::default(), |product, factor| {
        product.times(&units[usize::from(factor.variable)], factor.shape.degree())
    })
}
