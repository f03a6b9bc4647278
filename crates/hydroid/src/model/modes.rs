//! Modes of gated equations: a gate is written once, not in every term.

use hydroid_core::model::sparse::{Equations, Gate, Shape, Term};

use super::NamedEquations;
use super::text::{active, significant};

/// Mode in which a term is active.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Mode {
    /// All modes.
    All,
    /// Below a gate of the list, with the weight `1 - s`.
    Below(usize),
    /// Above it, with the weight `s`.
    Above(usize),
}

/// A gate of the equations, and the letter of its weight `s = sigma(slope (x - centre))`.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedGate {
    /// Index of its variable.
    pub variable: usize,
    /// Centre and slope.
    pub gate: Gate,
    /// Letter of its weight; no channel has this name.
    pub letter: String,
}

impl NamedGate {
    /// Half the width over which the weight changes from 10 to 90 %: `ln 9 = 2.2` over the slope.
    pub fn half_width(&self) -> f64 {
        9f64.ln() / self.gate.slope.0.abs()
    }
}

/// The gates of a model's equations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Modes {
    gates: Vec<NamedGate>,
}

/// Position of the gate of a term; none for a term with two gates, which is written out.
fn gate(term: &Term) -> Option<usize> {
    let is_gate = |shape: Shape| matches!(shape, Shape::Above(_) | Shape::Below(_));
    let mut places = term.factors().iter().enumerate().filter(|(_, f)| is_gate(f.shape)).map(|(i, _)| i);
    let first = places.next();
    first.filter(|_| places.next().is_none())
}

impl Modes {
    fn new(equations: &Equations, names: &[String]) -> Self {
        let mut found: Vec<(usize, Gate)> = Vec::new();
        for (_, term) in (0..equations.outputs()).flat_map(|i| active(equations, i)) {
            let Some(factor) = gate(term).map(|place| term.factors()[place]) else { continue };
            if let Shape::Above(gate) | Shape::Below(gate) = factor.shape
                && !found.contains(&(usize::from(factor.variable), gate))
            {
                found.push((usize::from(factor.variable), gate));
            }
        }
        let several = found.len() > 1;
        let letters = |base: &str| -> Vec<String> {
            let letter = |i| if several { format!("{base}{}", i + 1) } else { base.to_owned() };
            (0..found.len()).map(letter).collect()
        };
        let free = |letters: &Vec<String>| letters.iter().all(|letter| !names.contains(letter));
        let letters = ["s", "z", "gate"].map(letters).into_iter().find(free).unwrap_or_else(|| letters("g_"));
        let named = |((variable, gate), letter)| NamedGate { variable, gate, letter };
        Self { gates: found.into_iter().zip(letters).map(named).collect() }
    }

    /// The gates in the order of the equations.
    pub fn gates(&self) -> &[NamedGate] {
        &self.gates
    }

    /// The mode of a term, and the term without its gate.
    pub fn of(&self, term: &Term) -> (Mode, Term) {
        let whole = || (Mode::All, term.clone());
        let Some(place) = gate(term) else { return whole() };
        let mut factors = term.factors().to_vec();
        let factor = factors.remove(place);
        let known = |gate: Gate| {
            let is_it = |g: &NamedGate| g.variable == usize::from(factor.variable) && g.gate == gate;
            self.gates.iter().position(is_it)
        };
        match factor.shape {
            Shape::Above(gate) => known(gate).map(|g| (Mode::Above(g), Term::new(factors))),
            Shape::Below(gate) => known(gate).map(|g| (Mode::Below(g), Term::new(factors))),
            _ => None,
        }
        .unwrap_or_else(whole)
    }

    /// Weight of a mode; empty for all modes.
    pub fn weight(&self, mode: Mode) -> String {
        match mode {
            Mode::All => String::new(),
            Mode::Below(g) => format!("(1 - {})", self.gates[g].letter),
            Mode::Above(g) => self.gates[g].letter.clone(),
        }
    }

    /// The name of a term with the letter of its gate: `(1 - s) u |u|`.
    pub fn name(&self, term: &Term, names: &[String]) -> String {
        match self.of(term) {
            (Mode::All, term) => term.name(names),
            (mode, rest) if rest.factors().is_empty() => self.weight(mode),
            (mode, rest) => format!("{} {}", self.weight(mode), rest.name(names)),
        }
    }

    /// Terms of an equation by mode: those of all modes first, then gate by gate, below before above.
    pub fn grouped<T>(&self, terms: impl Iterator<Item = (T, Term)>) -> Vec<(Mode, Vec<(T, Term)>)> {
        let pairs = (0..self.gates.len()).flat_map(|g| [Mode::Below(g), Mode::Above(g)]);
        let mut groups: Vec<(Mode, Vec<(T, Term)>)> =
            std::iter::once(Mode::All).chain(pairs).map(|mode| (mode, Vec::new())).collect();
        for (coefficient, term) in terms {
            let (mode, rest) = self.of(&term);
            if let Some((_, group)) = groups.iter_mut().find(|(known, _)| *known == mode) {
                group.push((coefficient, rest));
            }
        }
        groups.retain(|(_, terms)| !terms.is_empty());
        groups
    }
}

impl NamedEquations<'_> {
    /// The modes of the equations.
    pub fn modes(&self) -> Modes {
        let equations = self.equations;
        Modes::new(equations, &self.variable_names())
    }

    /// Definitions of the gates, rounded: `s = sigma(11.88 (u - 2.500)), with sigma(x) = 1 / (1 + exp(-x))`.
    pub fn gates_text(&self) -> Vec<String> {
        let names = self.variable_names();
        let modes = self.modes();
        let line = |(i, named): (usize, &NamedGate)| {
            let NamedGate { variable, gate, letter } = named;
            let (name, centre, slope) = (&names[*variable], gate.centre.0, gate.slope.0);
            let sign = if slope < 0.0 { "-" } else { "" };
            let slope = significant(slope.abs(), 4);
            let argument = match centre {
                0.0 => format!("{sign}{slope} {name}"),
                c if c < 0.0 => format!("{sign}{slope} ({name} + {})", significant(-c, 4)),
                c => format!("{sign}{slope} ({name} - {})", significant(c, 4)),
            };
            let sigma = if i == 0 { ", with sigma(x) = 1 / (1 + exp(-x))" } else { "" };
            format!("{letter} = sigma({argument}){sigma}")
        };
        modes.gates().iter().enumerate().map(line).collect()
    }
}
