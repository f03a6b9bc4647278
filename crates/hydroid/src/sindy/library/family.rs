//! Families of terms, the components of libraries.

use hydroid_core::model::sparse::{Factor, Shape, Term};

use super::variables::{VariableKind, Variables};

/// A family of terms.
///
/// Sources: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021; M. A.
/// Abkowitz, Lectures on ship hydrodynamics: steering and manoeuvrability, report Hy-5, Lyngby 1964; K. K. Fedyaevsky
/// and G. V. Sobolev, Control and Stability in Ship Design, 1963; N. H. Norrbin, Theory and observation on the use of a
/// mathematical model for ship maneuvering in deep and confined waters, 8th ONR Symposium 1970.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Family {
    /// The constant 1: a steady force or a sensor offset. Without it the origin is an equilibrium for zero commands.
    Constant,
    /// All monomials of degree 1 up to this in outputs and inputs.
    Polynomial {
        /// The highest degree.
        degree: u8,
    },
    /// The signed squares `x |x|` of every variable: quadratic drag (Fossen 2021, section 6.4) and thrust.
    SignedSquares,
    /// The signed products `x |y|` of different outputs: cross-flow drag (Fedyaevsky and Sobolev 1963).
    SignedProducts,
    /// The manoeuvring terms of a surface vessel with quadratic modulus (Fedyaevsky and Sobolev 1963, Norrbin 1970;
    /// Fossen 2021, section 6.5 and chapter 9), with `u` the surge speed:
    ///
    /// - outputs: linear (potential and skin friction), all products of two (Coriolis, centripetal and added mass:
    ///   `v r`, `u r`, `u v`), signed squares (drag), and cross terms such as `v |r|`, `r |v|` among the outputs other
    ///   than the surge speed;
    /// - for each command `c` that is not an angle: `c`, `c |c|` (thrust), `u c` and `u |c|` (thrust falls with the
    ///   advance), `u |u| c` (a force proportional to the dynamic pressure);
    /// - for each command `delta` that is an angle: `sin(delta)`, `u sin(delta)`, `u |u| sin(delta)` (the lift of a
    ///   rudder), and behind a propeller `c |c| sin(delta)`;
    /// - for each wind component: itself.
    ///
    /// If no output is the surge speed, each output replaces it in products with commands.
    Marine,
    /// [`Marine`](Self::Marine) and the cubic terms of a Taylor expansion (Abkowitz 1964): monomials of degree 3 of the
    /// outputs, and of angles `s = sin(delta)` the drag `s^2`, `u s^2` and the cross couplings `v s`, `v r s`, `v s^2`
    /// and similar. `s^3` is omitted: the sine contains a cubic term.
    MarineCubic,
    /// Sines and cosines of angles, and their products with outputs.
    Trigonometric,
    /// Inputs, and their products with outputs.
    InputsTimesOutputs,
    /// Lateral motion over surge speed, for forces that depend on the angle of attack: `v/u` (the drift angle), `r/u`,
    /// `v r/u`, `v^2/u`, `r^2/u`. Undefined at `u = 0`; empty without a surge speed.
    Rational,
    /// Terms listed by the user.
    Listed(Vec<Term>),
}

impl Family {
    /// Upper bound on the number of terms, without the constant; saturates.
    pub(super) fn count_bound(&self, variables: &Variables) -> u128 {
        let (n, outputs) = (variables.len() as u128, variables.outputs().count() as u128);
        let inputs = n - outputs;
        match self {
            Self::Constant => 1,
            Self::Polynomial { degree } => monomials(n, *degree),
            Self::SignedSquares => n,
            Self::SignedProducts | Self::Rational => outputs * outputs + outputs,
            Self::Marine => 2 * outputs * (outputs + 1) + inputs * (2 + 3 * outputs.max(1)) + inputs * inputs,
            Self::MarineCubic => {
                Self::Marine.count_bound(variables)
                    + monomials(outputs, 3)
                    + inputs * (1 + 3 * outputs + outputs * outputs)
            }
            Self::Trigonometric => 2 * n * (1 + outputs),
            Self::InputsTimesOutputs => inputs * (1 + outputs),
            Self::Listed(terms) => terms.len() as u128,
        }
    }

    /// Calls `add` with each term, in any order, possibly more than once.
    pub(super) fn for_each_term(&self, variables: &Variables, add: &mut impl FnMut(Term)) {
        let outputs = || variables.outputs().map(|(v, _)| v);
        match self {
            Self::Constant => add(Term::constant()),
            Self::Polynomial { degree } => {
                let all: Vec<u16> = variables.all().map(|(v, _)| v).collect();
                for_each_monomial(&all, *degree, add);
            }
            Self::SignedSquares => variables.all().for_each(|(v, _)| add(Term::signed_square(v, v))),
            Self::SignedProducts => {
                let outputs: Vec<u16> = outputs().collect();
                for_each_signed_product(&outputs, add);
            }
            Self::Marine => marine(variables, add),
            Self::MarineCubic => {
                marine(variables, add);
                cubic(variables, add);
            }
            Self::Trigonometric => {
                for (angle, _) in variables.all().filter(|(_, kind)| *kind == VariableKind::Angle) {
                    for wave in [Shape::Sin, Shape::Cos].map(|shape| Term::of(angle, shape)) {
                        outputs()
                            .filter(|&y| y != angle)
                            .for_each(|y| add(wave.times(&Term::monomial(&[y]))));
                        add(wave);
                    }
                }
            }
            Self::InputsTimesOutputs => {
                for (c, _) in variables.inputs() {
                    add(Term::monomial(&[c]));
                    outputs().for_each(|y| add(Term::monomial(&[y, c])));
                }
            }
            Self::Rational => {
                let Some(u) = variables.surge() else { return };
                let over_u = Term::of(u, Shape::Reciprocal);
                for_each_monomial(&lateral(variables), 2, &mut |term| add(term.times(&over_u)));
            }
            Self::Listed(terms) => terms.iter().cloned().for_each(add),
        }
    }
}

/// Number of monomials of degree 1 up to `degree` in `n` variables: binomial(n + degree, degree) - 1.
fn monomials(n: u128, degree: u8) -> u128 {
    let all = (1..=u128::from(degree)).try_fold(1u128, |c, k| Some(c.checked_mul(n + k)? / k));
    all.map_or(u128::MAX, |all| all - 1)
}

fn for_each_monomial(variables: &[u16], degree: u8, add: &mut impl FnMut(Term)) {
    if variables.is_empty() {
        return;
    }
    for degree in 1..=usize::from(degree) {
        let mut places = vec![0; degree];
        loop {
            let monomial: Vec<u16> = places.iter().map(|&p| variables[p]).collect();
            add(Term::monomial(&monomial));
            // The next non-decreasing list of indices.
            let Some(last) = places.iter().rposition(|&p| p + 1 < variables.len()) else { break };
            let next = places[last] + 1;
            places[last..].fill(next);
        }
    }
}

fn for_each_signed_product(variables: &[u16], add: &mut impl FnMut(Term)) {
    for &x in variables {
        variables.iter().filter(|&&y| y != x).for_each(|&y| add(Term::signed_square(x, y)));
    }
}

/// Outputs other than the surge speed.
fn lateral(variables: &Variables) -> Vec<u16> {
    variables.outputs().map(|(y, _)| y).filter(|&y| Some(y) != variables.surge()).collect()
}

/// Outputs that multiply commands: the surge speed, or all outputs.
fn advance(variables: &Variables) -> Vec<u16> {
    variables.surge().map_or_else(|| variables.outputs().map(|(y, _)| y).collect(), |u| vec![u])
}

fn sine(angle: u16) -> Term {
    Term::of(angle, Shape::Sin)
}

fn marine(variables: &Variables, add: &mut impl FnMut(Term)) {
    let outputs: Vec<u16> = variables.outputs().map(|(y, _)| y).collect();
    for_each_monomial(&outputs, 2, add);
    for &y in &outputs {
        add(Term::signed_square(y, y));
    }
    for_each_signed_product(&lateral(variables), add);
    let advance = advance(variables);
    let of_kind = |wanted| variables.inputs().filter(move |(_, kind)| *kind == wanted).map(|(c, _)| c);
    for c in of_kind(VariableKind::Plain) {
        let command = Term::monomial(&[c]);
        add(Term::signed_square(c, c));
        for &u in &advance {
            add(Term::monomial(&[u, c]));
            add(Term::signed_square(u, c));
            add(Term::signed_square(u, u).times(&command));
        }
        add(command);
    }
    for delta in of_kind(VariableKind::Angle) {
        let lift = sine(delta);
        for &u in &advance {
            add(Term::monomial(&[u]).times(&lift));
            add(Term::signed_square(u, u).times(&lift));
        }
        of_kind(VariableKind::Plain).for_each(|c| add(Term::signed_square(c, c).times(&lift)));
        add(lift);
    }
    of_kind(VariableKind::Wind).for_each(|wind| add(Term::monomial(&[wind])));
}

fn cubic(variables: &Variables, add: &mut impl FnMut(Term)) {
    let outputs: Vec<u16> = variables.outputs().map(|(y, _)| y).collect();
    for_each_monomial(&outputs, 3, add);
    let (lateral, advance) = (lateral(variables), advance(variables));
    for (delta, _) in variables.inputs().filter(|(_, kind)| *kind == VariableKind::Angle) {
        let lift = sine(delta);
        let square = Term::new(vec![Factor { variable: delta, shape: Shape::Sin }; 2]);
        for_each_monomial(&lateral, 2, &mut |term| add(term.times(&lift)));
        lateral.iter().chain(&advance).for_each(|&y| add(Term::monomial(&[y]).times(&square)));
        add(square);
    }
}
