//! A model's equations in LaTeX; they need the package amsmath.

mod coefficients;
mod symbol;

use hydroid_core::model::sparse::{Gate, Shape, Signal, Term};

use super::text::{active, seconds};
use super::units::UnitProduct;
use super::{Mode, Modes, NamedEquations};
use symbol::{Symbol, magnitude, shortest, unit};

pub use coefficients::estimate as latex_estimate;
pub use symbol::{escaped as latex_text, symbol as latex_symbol, unit as latex_unit};

const DIGITS: usize = 4;

const ON_A_LINE: usize = 5;

impl NamedEquations<'_> {
    /// The equations of motion as an `align*` block, with gates, signals and the logistic function. A lag state has a
    /// hat.
    pub fn equations_latex(&self) -> String {
        let equations = self.equations;
        let variables = self.latex_variables();
        let mut lines = Vec::new();
        let modes = self.modes();
        let is_gate = |shape: &Shape| matches!(shape, Shape::Above(_) | Shape::Below(_));
        let mut active_terms = (0..equations.outputs()).flat_map(|i| active(equations, i));
        let gates = active_terms.any(|(_, term)| term.factors().iter().any(|f| is_gate(&f.shape)));
        for i in 0..equations.outputs() {
            let mut line = format!("{} &=", variables[i].dotted());
            let groups = modes.grouped(active(equations, i).map(|(c, term)| (c, term.clone())));
            let mut position = 0;
            for (group, (mode, terms)) in groups.iter().enumerate() {
                if *mode != Mode::All {
                    let plus = if group == 0 { "" } else { " \\\\\n  &\\quad {} +" };
                    line.push_str(plus);
                    line.push(' ');
                    line.push_str(&weight(&modes, *mode));
                    line.push_str("\\,\\bigl[");
                    position = 0;
                }
                for (first, (coefficient, term)) in terms.iter().enumerate() {
                    if position > 0 && position % ON_A_LINE == 0 {
                        line.push_str(" \\\\\n  &\\quad {}");
                    }
                    line.push_str(match (*coefficient < 0.0, first) {
                        (true, _) => " - ",
                        (false, 0) => " ",
                        (false, _) => " + ",
                    });
                    line.push_str(&magnitude(*coefficient, DIGITS));
                    if !term.factors().is_empty() {
                        line.push_str("\\,");
                        line.push_str(&product(term, &variables));
                    }
                    position += 1;
                }
                if *mode != Mode::All {
                    line.push_str(" \\bigr]");
                }
            }
            if groups.is_empty() {
                line.push_str(" 0");
            }
            lines.push(line);
        }
        for (g, named) in modes.gates().iter().enumerate() {
            let of = sigma(&variables[named.variable], named.gate, Some(DIGITS));
            lines.push(format!("{} &= {of}", letter(&modes, g)));
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
                // The symbol contains its definition.
                Signal::Past { .. } => continue,
            });
        }
        // The equations are in the position of the actuator.
        for (port, input) in self.description.inputs.iter().zip(&variables[equations.outputs()..]) {
            if let Some(rate) = port.rate_limit {
                let per_second = unit(&UnitProduct::of_channel("", &port.channel.unit).per_second());
                lines.push(format!("|{}| &\\le {}\\,{per_second}", input.dotted(), magnitude(rate, DIGITS)));
            }
        }
        if gates {
            lines.push(String::from("\\sigma(x) &= \\frac{1}{1 + e^{-x}}"));
        }
        format!("\\begin{{align*}}\n  {}\n\\end{{align*}}\n", lines.join(" \\\\\n  "))
    }

    /// The units of the variables as a sentence in LaTeX.
    pub fn units_latex(&self) -> String {
        let d = self.description;
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

    /// Symbols of the variables in mathematics mode: outputs, inputs, signals.
    pub fn variables_latex(&self) -> Vec<String> {
        self.latex_variables().iter().map(Variable::plain).collect()
    }

    fn latex_variables(&self) -> Vec<Variable> {
        let equations = self.equations;
        let d = self.description;
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

struct Variable {
    symbol: Symbol,
    role: Role,
}

enum Role {
    Channel,
    /// With its time constant, if its input has several lags.
    Lag(Option<String>),
    /// With its delay.
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

    /// To a power, in brackets after a superscript or an argument.
    fn to(&self, power: usize) -> String {
        let text = self.plain();
        match (power, &self.role) {
            (1, _) => text,
            (n, Role::Channel | Role::Lag(None)) => format!("{text}^{{{n}}}"),
            (n, _) => format!("\\left({text}\\right)^{{{n}}}"),
        }
    }
}

fn product(term: &Term, variables: &[Variable]) -> String {
    let (mut above, mut below) = (Vec::new(), Vec::new());
    // Equal factors are adjacent.
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
            Shape::Above(gate) => above.push(times(sigma(variable, gate, None))),
            Shape::Below(gate) => {
                above.push(times(format!("\\left(1 - {}\\right)", sigma(variable, gate, None))));
            }
        }
    }
    let above = if above.is_empty() { String::from("1") } else { above.join("\\,") };
    if below.is_empty() { above } else { format!("\\frac{{{above}}}{{{}}}", below.join("\\,")) }
}

/// `\sigma(12(u - 2.5))`, rounded where digits are given.
fn sigma(variable: &Variable, gate: Gate, digits: Option<usize>) -> String {
    let (centre, slope) = (gate.centre.0, gate.slope.0);
    let number = |x: f64| digits.map_or_else(|| shortest(x), |digits| magnitude(x, digits));
    let of = match centre {
        0.0 => variable.plain(),
        _ if centre < 0.0 => format!("{} + {}", variable.plain(), number(-centre)),
        _ => format!("{} - {}", variable.plain(), number(centre)),
    };
    let sign = if slope < 0.0 && digits.is_some() { "-" } else { "" };
    format!("\\sigma({sign}{}({of}))", number(slope))
}

fn weight(modes: &Modes, mode: Mode) -> String {
    match mode {
        Mode::All => String::new(),
        Mode::Below(g) => format!("\\left(1 - {}\\right)", letter(modes, g)),
        Mode::Above(g) => letter(modes, g),
    }
}

fn letter(modes: &Modes, gate: usize) -> String {
    Symbol::of(&modes.gates()[gate].letter).accented(&[])
}
