//! A model's equations in LaTeX; they need the package amsmath.

mod symbol;

use hydroid_core::model::sparse::{Gate, Shape, Signal, Term};

use super::text::{active, seconds};
use super::units::UnitProduct;
use super::{Body, Model};
use symbol::{Symbol, magnitude, shortest, unit};

/// Significant digits of a coefficient.
const DIGITS: usize = 4;

/// Terms on a line.
const ON_A_LINE: usize = 5;

impl Model {
    /// The equations of motion as an `align*` block: one for each output, then what the signals are that stand in
    /// them, then the logistic function if they have gates. A lag state wears a hat, and its time constant
    /// where its input has several.
    pub fn equations_latex(&self) -> String {
        let Body::Equations(equations) = &self.body;
        let variables = self.latex_variables();
        let mut lines = Vec::new();
        let mut gates = false;
        for i in 0..equations.outputs() {
            let mut line = format!("{} &=", variables[i].dotted());
            for (position, (coefficient, term)) in active(equations, i).enumerate() {
                if position > 0 && position % ON_A_LINE == 0 {
                    line.push_str(" \\\\\n  &\\quad {}");
                }
                line.push_str(match (coefficient < 0.0, position) {
                    (true, _) => " - ",
                    (false, 0) => " ",
                    (false, _) => " + ",
                });
                line.push_str(&magnitude(coefficient, DIGITS));
                if !term.factors().is_empty() {
                    line.push_str("\\,");
                    line.push_str(&product(term, &variables));
                }
                gates |= term.factors().iter().any(|f| matches!(f.shape, Shape::Above(_) | Shape::Below(_)));
            }
            if active(equations, i).next().is_none() {
                line.push_str(" 0");
            }
            lines.push(line);
        }
        for (variable, signal) in self.used_signals() {
            let (own, source) = (&variables[variable], &variables[usize::from(signal.source())]);
            lines.push(match signal {
                Signal::Lag { time_constant_s, .. } => format!(
                    "{}\\,{} &= {} - {}",
                    time(time_constant_s.0),
                    own.dotted(),
                    source.plain(),
                    own.plain()
                ),
                // It says itself what it is.
                Signal::Past { .. } => continue,
            });
        }
        if gates {
            lines.push(String::from("\\sigma(x) &= \\frac{1}{1 + e^{-x}}"));
        }
        format!("\\begin{{align*}}\n  {}\n\\end{{align*}}\n", lines.join(" \\\\\n  "))
    }

    /// The units of the variables as a sentence in LaTeX, to stand below the equations.
    pub fn units_latex(&self) -> String {
        let d = &self.description;
        let variables = self.latex_variables();
        let channels = d.outputs.iter().chain(&d.inputs).map(|port| &port.channel);
        let mut units: Vec<(&str, Vec<String>)> = Vec::new();
        for (channel, variable) in channels.zip(&variables) {
            let symbol = format!("${}$", variable.plain());
            match units.iter_mut().find(|(unit, _)| *unit == channel.unit) {
                Some((_, symbols)) => symbols.push(symbol),
                None => units.push((&channel.unit, vec![symbol])),
            }
        }
        let mut text = String::from("Time in seconds");
        for (of, symbols) in units {
            let symbols = symbols.join(", ");
            let clause = match of {
                "" => format!("; {symbols} without a stated unit"),
                "rad" | "rad/s" => format!("; {symbols} in ${}$", radians(of)),
                _ => format!("; {symbols} in ${}$", unit(&UnitProduct::of_channel("", of))),
            };
            text.push_str(&clause);
        }
        text.push_str(".\n");
        text
    }

    fn latex_variables(&self) -> Vec<Variable> {
        let Body::Equations(equations) = &self.body;
        let d = &self.description;
        let channels = d.outputs.iter().chain(&d.inputs).map(|port| &port.channel.name);
        let mut variables: Vec<Variable> =
            channels.map(|name| Variable { symbol: Symbol::of(name), role: Role::Channel }).collect();
        for signal in equations.signals() {
            let symbol = variables[usize::from(signal.source())].symbol.clone();
            let role = match *signal {
                Signal::Lag { input, time_constant_s } => {
                    let of_it =
                        |s: &&Signal| matches!(s, Signal::Lag { input: other, .. } if *other == input);
                    let alone = equations.signals().iter().filter(of_it).count() == 1;
                    Role::Lag((!alone).then(|| time(time_constant_s.0)))
                }
                Signal::Past { samples, .. } => Role::Past(time(f64::from(samples) * d.dt)),
            };
            variables.push(Variable { symbol, role });
        }
        variables
    }
}

fn radians(text: &str) -> &'static str {
    if text == "rad" { "\\mathrm{rad}" } else { "\\mathrm{rad}\\,\\mathrm{s}^{-1}" }
}

fn time(value: f64) -> String {
    format!("{}\\,\\mathrm{{s}}", shortest(seconds(value)))
}

/// A variable as a formula has it.
struct Variable {
    symbol: Symbol,
    role: Role,
}

enum Role {
    Channel,
    /// With its time constant, if it must be told.
    Lag(Option<String>),
    /// So long ago.
    Past(String),
}

impl Variable {
    fn plain(&self) -> String {
        self.with(&[])
    }

    fn dotted(&self) -> String {
        self.with(&["\\dot"])
    }

    fn with(&self, accents: &[&str]) -> String {
        match &self.role {
            Role::Channel => self.symbol.accented(accents),
            Role::Lag(constant) => {
                let text = self.symbol.accented(&[&["\\hat"], accents].concat());
                match constant {
                    Some(constant) => format!("{text}^{{({constant})}}"),
                    None => text,
                }
            }
            Role::Past(ago) => format!("{}(t - {ago})", self.symbol.accented(accents)),
        }
    }

    /// To a power, in brackets where it has a superscript or an argument already.
    fn to(&self, power: usize) -> String {
        let text = self.plain();
        match (power, &self.role) {
            (1, _) => text,
            (n, Role::Channel | Role::Lag(None)) => format!("{text}^{{{n}}}"),
            (n, _) => format!("\\left({text}\\right)^{{{n}}}"),
        }
    }
}

/// A term that is not the constant.
fn product(term: &Term, variables: &[Variable]) -> String {
    let (mut above, mut below) = (Vec::new(), Vec::new());
    // Equal factors stand side by side.
    for equal in term.factors().chunk_by(|a, b| a == b) {
        let (factor, count) = (equal[0], equal.len());
        let variable = &variables[usize::from(factor.variable)];
        let function = |name: &str| match count {
            1 => format!("{name}({})", variable.plain()),
            n => format!("{name}^{{{n}}}({})", variable.plain()),
        };
        let times = |text: String| vec![text; count].join("\\,");
        match factor.shape {
            Shape::Power(n) => above.push(variable.to(usize::from(n) * count)),
            Shape::Reciprocal => below.push(variable.to(count)),
            Shape::Abs => above.push(times(format!("\\lvert {}\\rvert", variable.plain()))),
            Shape::Sign => above.push(function("\\operatorname{sgn}")),
            Shape::Sin => above.push(function("\\sin")),
            Shape::Cos => above.push(function("\\cos")),
            Shape::Log => above.push(function("\\ln")),
            Shape::Above(gate) => above.push(times(sigma(variable, gate))),
            Shape::Below(gate) => above.push(times(format!("\\left(1 - {}\\right)", sigma(variable, gate)))),
        }
    }
    let above = if above.is_empty() { String::from("1") } else { above.join("\\,") };
    if below.is_empty() { above } else { format!("\\frac{{{above}}}{{{}}}", below.join("\\,")) }
}

/// `\sigma(12(u - 2.5))`.
fn sigma(variable: &Variable, gate: Gate) -> String {
    let (centre, slope) = (gate.centre.0, gate.slope.0);
    let of = match centre {
        0.0 => variable.plain(),
        _ if centre < 0.0 => format!("{} + {}", variable.plain(), shortest(-centre)),
        _ => format!("{} - {}", variable.plain(), shortest(centre)),
    };
    format!("\\sigma({}({of}))", shortest(slope))
}
