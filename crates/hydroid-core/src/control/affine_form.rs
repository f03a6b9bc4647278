//! Decomposition of equations into motion and efforts.

use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

use crate::actuator::{Channel, Lag, Map};
use crate::model::sparse::{Equations, Factor, ProgramError, Shape, Signal, Term};

/// Reasons why equations are not of the form `f(nu) + sum g_i(nu) phi_i(a_i)`.
#[derive(Clone, Debug, PartialEq)]
pub enum NotAffine {
    /// The outputs for `u`, `v` and `r` are not three different outputs.
    Motion,
    /// A term is not affine in one invertible function of a command.
    Term {
        /// The equation.
        output: usize,
        /// The term.
        term: Term,
    },
    /// A term has past values, which a control law cannot invert.
    Past {
        /// The equation.
        output: usize,
        /// The term.
        term: Term,
    },
    /// A command enters in two ways: as two functions, or with and without its lag.
    TwoWays {
        /// The equation.
        output: usize,
        /// A term with the second way.
        term: Term,
        /// The command, from 0.
        input: usize,
    },
    /// An output other than `u`, `v`, `r` is in the equations but is not an actuator: its equation is not linear in itself,
    /// one command and a constant.
    Output {
        /// The output.
        output: usize,
        /// The excess term; none if the command is missing.
        term: Option<Term>,
    },
    /// Fewer than two commands affect the motion.
    TooFewInputs {
        /// Their number.
        given: usize,
    },
    /// The terms do not compile.
    Program(ProgramError),
}

impl NotAffine {
    /// The reason with the names of outputs, inputs and signals, in the order of the variables.
    pub fn with_names(&self, names: &[impl AsRef<str>]) -> String {
        let name = |variable: usize| names.get(variable).map_or("?", AsRef::as_ref);
        match self {
            Self::Term { output, term } => format!(
                "the term {} of d{}/dt is not affine in one known function (c, sin(c) or c |c|) of a command",
                term.name(names),
                name(*output)
            ),
            Self::Past { output, term } => format!(
                "the term {} of d{}/dt has past values, which a control law cannot invert: identify without them (method sindy)",
                term.name(names),
                name(*output)
            ),
            Self::TwoWays { output, term, input } => format!(
                "command {input} enters in two ways; the second is in the term {} of d{}/dt",
                term.name(names),
                name(*output)
            ),
            Self::Output { output, term: Some(term) } => format!(
                "{} is neither u, v, r nor an actuator: its equation has the term {}, and an actuator's has itself, one command and a constant",
                name(*output),
                term.name(names)
            ),
            Self::Output { output, term: None } => {
                format!("{} is neither u, v, r nor an actuator: it follows no command", name(*output))
            }
            Self::Motion => String::from("u, v and r must be three different outputs of the equations"),
            Self::TooFewInputs { given } => {
                format!("{given} of the commands move the vessel: a point in the plane needs at least 2")
            }
            Self::Program(error) => format!("{error}"),
        }
    }
}

/// With `x0, x1 ..` for outputs, inputs and signals.
impl core::fmt::Display for NotAffine {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let names: Vec<String> = (0..64).map(|k| format!("x{k}")).collect();
        f.write_str(&self.with_names(&names))
    }
}

impl core::error::Error for NotAffine {}

pub(super) struct Part {
    pub(super) row: usize,
    pub(super) channel: Option<usize>,
    pub(super) term: usize,
    pub(super) place: usize,
}

pub(super) struct AffineForm {
    pub(super) parts: Vec<Part>,
    /// Terms in `u`, `v`, `r` (variables 0, 1, 2).
    pub(super) terms: Vec<Term>,
    pub(super) channels: Vec<Channel>,
    /// For a channel that is an output: indices of the coefficients of itself, its command and 1.
    pub(super) measured: Vec<Option<[Option<usize>; 3]>>,
}

/// How a command enters.
#[derive(Clone, Copy, Default)]
struct Way {
    /// The variable that carries the command, and its map.
    of: Option<(u16, Map)>,
}

pub(super) fn affine_form(equations: &Equations, motion: [usize; 3]) -> Result<AffineForm, NotAffine> {
    let (outputs, inputs) = (equations.outputs(), equations.inputs());
    let distinct = motion[0] != motion[1] && motion[1] != motion[2] && motion[0] != motion[2];
    if !distinct || motion.iter().any(|&output| output >= outputs) {
        return Err(NotAffine::Motion);
    }
    let count = equations.terms().len();
    let mut measured = vec![None; inputs];
    let mut carries: Vec<Option<usize>> = vec![None; equations.variables()];
    for input in 0..inputs {
        carries[outputs + input] = Some(input);
    }
    for (index, signal) in equations.signals().iter().enumerate() {
        if let Signal::Lag { input, .. } = *signal {
            carries[outputs + inputs + index] = Some(usize::from(input) - outputs);
        }
    }
    for output in (0..outputs).filter(|output| !motion.contains(output)) {
        if is_used(equations, motion, output) {
            let (input, places) = actuator(equations, output)?;
            carries[output] = Some(input);
            measured[input] = Some(places);
        }
    }

    let mut ways = vec![Way::default(); inputs];
    let mut found = AffineForm { parts: Vec::new(), terms: Vec::new(), channels: Vec::new(), measured };
    for (row, &output) in motion.iter().enumerate() {
        for (j, term) in equations.terms().iter().enumerate() {
            if equations.coefficient(output, j) == 0.0 {
                continue;
            }
            let past = |factor: &Factor| {
                let of = usize::from(factor.variable);
                carries[of].is_none() && !motion.contains(&of)
            };
            if term.factors().iter().any(past) {
                return Err(NotAffine::Past { output, term: term.clone() });
            }
            let of_motion = |factor: &Factor| motion.iter().position(|&m| m == usize::from(factor.variable));
            let rest = Term::new(
                term.factors()
                    .iter()
                    .filter_map(|factor| {
                        let variable = u16::try_from(of_motion(factor)?).ok()?;
                        Some(Factor { variable, shape: factor.shape })
                    })
                    .collect(),
            );
            let effort: Vec<Factor> =
                term.factors().iter().copied().filter(|f| of_motion(f).is_none()).collect();
            let channel = match effort.first() {
                None => None,
                Some(first) => {
                    let map =
                        map_of(&effort).ok_or_else(|| NotAffine::Term { output, term: term.clone() })?;
                    // All other variables have been refused as past values.
                    let input = carries[usize::from(first.variable)].unwrap_or_default();
                    let way = (first.variable, map);
                    if *ways[input].of.get_or_insert(way) != way {
                        return Err(NotAffine::TwoWays { output, term: term.clone(), input });
                    }
                    Some(input)
                }
            };
            let known = found.terms.iter().position(|known| *known == rest);
            let term = known.unwrap_or_else(|| {
                found.terms.push(rest);
                found.terms.len() - 1
            });
            found.parts.push(Part { row, channel, term, place: output * count + j });
        }
    }
    let given = ways.iter().filter(|way| way.of.is_some()).count();
    if given < 2 {
        return Err(NotAffine::TooFewInputs { given });
    }
    for (input, way) in ways.iter().enumerate() {
        let (variable, map) = way.of.unwrap_or((0, Map::Identity));
        let lag = usize::from(variable).checked_sub(outputs + inputs).map(|index| equations.signals()[index]);
        let lag = match lag {
            Some(Signal::Lag { time_constant_s, .. }) => Lag::of_time_constant(time_constant_s.0),
            // The lag of an output follows from its coefficients, which can change.
            _ => Lag::None,
        };
        if way.of.is_none() || usize::from(variable) >= outputs {
            found.measured[input] = None;
        }
        found.channels.push(Channel { lag, map });
    }
    Ok(found)
}

fn is_used(equations: &Equations, motion: [usize; 3], output: usize) -> bool {
    let Ok(variable) = u16::try_from(output) else { return true };
    let terms = || equations.terms().iter().enumerate();
    terms().any(|(j, term)| {
        term.contains(variable) && motion.iter().any(|&row| equations.coefficient(row, j) != 0.0)
    })
}

/// The command of an actuator, and the indices of the coefficients of itself, the command and 1.
fn actuator(equations: &Equations, output: usize) -> Result<(usize, [Option<usize>; 3]), NotAffine> {
    let (outputs, inputs) = (equations.outputs(), equations.inputs());
    let count = equations.terms().len();
    let mut places = [None; 3];
    let mut command = None;
    for (j, term) in equations.terms().iter().enumerate() {
        if equations.coefficient(output, j) == 0.0 {
            continue;
        }
        let place = Some(output * count + j);
        let too_much = || NotAffine::Output { output, term: Some(term.clone()) };
        match term.factors() {
            [] => places[2] = place,
            [Factor { variable, shape: Shape::Power(1) }] => {
                let variable = usize::from(*variable);
                if variable == output {
                    places[0] = place;
                } else if (outputs..outputs + inputs).contains(&variable) && command.is_none() {
                    (command, places[1]) = (Some(variable - outputs), place);
                } else {
                    return Err(too_much());
                }
            }
            _ => return Err(too_much()),
        }
    }
    command.map(|input| (input, places)).ok_or(NotAffine::Output { output, term: None })
}

fn map_of(factors: &[Factor]) -> Option<Map> {
    match factors {
        [Factor { shape: Shape::Power(1), .. }] => Some(Map::Identity),
        [Factor { shape: Shape::Sin, .. }] => Some(Map::Sine),
        [Factor { variable, shape: Shape::Power(1) }, Factor { variable: same, shape: Shape::Abs }]
            if variable == same =>
        {
            Some(Map::SignedSquare)
        }
        _ => None,
    }
}
