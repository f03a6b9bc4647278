//! Hydrodynamic derivatives: symbols, units, prime system.

use hydroid::model::UnitProduct;
use hydroid_core::model::sparse::{Factor, Shape, Term};

use super::numbers::short;
use crate::name::comment;

/// A force or moment of the hull.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Force {
    /// Surge force `X` \[N\].
    X,
    /// Sway force `Y` \[N\].
    Y,
    /// Yaw moment `N` \[N m\].
    N,
}

impl Force {
    /// All, in the order of `u`, `v`, `r`.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::N];

    pub fn letter(self) -> &'static str {
        ["X", "Y", "N"][self as usize]
    }
}

/// Letters of the velocities.
pub(super) const VELOCITY: [&str; 3] = ["u", "v", "r"];

/// A variable of a model beyond `u`, `v`, `r`: an input, or a signal that is computed from inputs and past samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Its name.
    pub name: String,
    /// Its symbol in LaTeX.
    pub latex: String,
    /// Its unit.
    pub unit: UnitProduct,
    /// The variable whose value it has in a steady motion: itself, or the source of a lag or delay.
    pub source: u16,
}

/// The variable of a derivative.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variable {
    /// The acceleration of `u`, `v` or `r` (0, 1, 2).
    Acceleration(usize),
    /// A product of functions of the variables `u`, `v`, `r` (0, 1, 2) and of the [inputs](Input) after them.
    Product(Term),
}

impl Variable {
    /// A velocity, or the product of several.
    pub fn product(velocities: &[u16]) -> Self {
        Self::Product(Term::monomial(velocities))
    }

    /// `|nu_i| nu_j`.
    pub fn signed(i: u16, j: u16) -> Self {
        Self::Product(Term::signed_square(j, i))
    }

    /// Whether it is an acceleration or a product of powers and magnitudes, of which there is a derivative in the notation of
    /// SNAME.
    pub fn is_polynomial(&self) -> bool {
        let Self::Product(term) = self else { return true };
        term.factors().iter().all(|factor| matches!(factor.shape, Shape::Power(_) | Shape::Abs))
    }

    /// Whether it contains an input.
    pub fn has_input(&self) -> bool {
        matches!(self, Self::Product(term) if term.highest_variable().is_some_and(|highest| highest > 2))
    }

    /// Number of factors of each velocity; an acceleration counts as one of its velocity.
    fn counts(&self) -> [i32; 3] {
        match self {
            Self::Acceleration(i) => std::array::from_fn(|j| i32::from(*i == j)),
            Self::Product(term) => std::array::from_fn(|j| {
                let of = |factor: &&Factor| usize::from(factor.variable) == j;
                term.factors().iter().filter(of).map(|factor| factor.shape.degree()).sum()
            }),
        }
    }

    /// Whether the sign of a product of velocities changes with those of `v` and `r`, as from the frame forward, starboard, down
    /// to the frame forward, port, up.
    fn is_odd(&self) -> bool {
        let magnitude = |factor: &Factor| i32::from(factor.shape == Shape::Abs && factor.variable > 0);
        let magnitudes: i32 = match self {
            Self::Acceleration(_) => 0,
            Self::Product(term) => term.factors().iter().map(magnitude).sum(),
        };
        let [_, v, r] = self.counts();
        (v + r - magnitudes) % 2 != 0
    }

    /// Its value at velocities, followed by inputs where it has any, and accelerations.
    pub fn value(&self, variables: &[f64], nu_dot: [f64; 3]) -> f64 {
        match self {
            Self::Acceleration(i) => nu_dot[*i],
            Self::Product(term) => term.value(variables),
        }
    }

    /// The subscript as text or in LaTeX: magnitudes first, `|u| v`; `0` without factors, as in that of a constant force.
    fn subscript(&self, inputs: &[Input], latex: bool) -> String {
        let name = |index: u16| match usize::from(index).checked_sub(3).and_then(|k| inputs.get(k)) {
            Some(input) if latex => format!(" {}", input.latex),
            Some(input) => format!(" {}", input.name),
            None => {
                VELOCITY.get(usize::from(index)).map_or_else(|| String::from("?"), |&name| name.to_owned())
            }
        };
        let term = match self {
            Self::Acceleration(i) if latex => return format!("\\dot{{{}}}", VELOCITY[*i]),
            Self::Acceleration(i) => return format!("{}dot", VELOCITY[*i]),
            Self::Product(term) => term,
        };
        let (mut first, mut rest) = (String::new(), String::new());
        for factor in term.factors() {
            let name = name(factor.variable);
            match factor.shape {
                Shape::Power(n) => rest.push_str(&name.repeat(usize::from(n))),
                _ if latex => first.extend(["\\lvert ", name.trim_start(), "\\rvert "]),
                _ => first.extend(["|", name.trim_start(), "|"]),
            }
        }
        let text = if latex {
            first.trim_start().to_owned() + rest.trim_start()
        } else {
            (first + &rest).trim_start().to_owned()
        };
        if text.is_empty() { String::from("0") } else { text }
    }
}

/// A hydrodynamic derivative: a force of the hull per variable, as SNAME defines it. Resistance is negative.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivative {
    pub force: Force,
    pub variable: Variable,
    /// Its value in SI units.
    pub value: f64,
    /// Standard deviation of its estimate, if known.
    pub deviation: Option<f64>,
}

impl Derivative {
    /// A derivative without a standard deviation.
    pub fn new(force: Force, variable: Variable, value: f64) -> Self {
        Self { force, variable, value, deviation: None }
    }

    /// `X_udot`, `Y_|u|v`, `N_uu delta`.
    pub fn symbol(&self, inputs: &[Input]) -> String {
        format!("{}_{}", self.force.letter(), self.variable.subscript(inputs, false))
    }

    /// `X_{\dot{u}}`, `Y_{\lvert u\rvert v}`, `N_{uu\delta}`.
    pub fn latex(&self, inputs: &[Input]) -> String {
        format!("{}_{{{}}}", self.force.letter(), self.variable.subscript(inputs, true))
    }

    /// Its unit: that of the force over those of the velocities and inputs of the variable.
    pub fn unit(&self, inputs: &[Input]) -> UnitProduct {
        let [kg, m, s] = self.unit_powers();
        let own = UnitProduct::of_channel("", &format!("kg^{kg} m^{m} s^{s}"));
        let Variable::Product(term) = &self.variable else { return own };
        term.factors().iter().fold(own, |unit, factor| {
            match usize::from(factor.variable).checked_sub(3).and_then(|k| inputs.get(k)) {
                Some(input) => unit.times(&input.unit, -factor.shape.degree()),
                None => unit,
            }
        })
    }

    /// The derivative with its value and unit: `N_uu delta = -0.5 kg`; where the variable is no product of powers, the force of
    /// the term: `N = -0.5 kg m/s times u sin(delta)`.
    pub fn described(&self, inputs: &[Input]) -> String {
        let value = format!("{} {}", short(self.value), self.unit(inputs));
        let text = match &self.variable {
            Variable::Product(term) if !self.variable.is_polynomial() => {
                let names = inputs.iter().map(|input| input.name.as_str());
                let names: Vec<&str> = VELOCITY.into_iter().chain(names).collect();
                format!("{} = {value} times {}", self.force.letter(), term.name(&names))
            }
            _ => format!("{} = {value}", self.symbol(inputs)),
        };
        let deviation = self.deviation.map(|deviation| format!(", standard deviation {deviation:.1e}"));
        comment(&(text + &deviation.unwrap_or_default()))
    }

    /// Powers of kilogram, metre and second of its unit, per unit of the inputs.
    pub fn unit_powers(&self) -> [i32; 3] {
        let [u, v, r] = self.variable.counts();
        let rate = i32::from(matches!(self.variable, Variable::Acceleration(_)));
        let moment = i32::from(self.force == Force::N);
        [1, 1 + moment - u - v, -2 + u + v + r + rate]
    }

    /// Powers of length and speed by which the prime system (SNAME 1950) divides it, together with `rho/2`:
    ///
    /// ```text
    /// a' = a / (rho/2 L^p U^q)
    /// ```
    ///
    /// Forces are per `rho/2 L^2 U^2`, moments per `rho/2 L^3 U^2`, velocities per `U`, the yaw rate per `U/L`,
    /// accelerations per `U^2/L` and `U^2/L^2`. Inputs keep their units.
    pub fn prime_powers(&self) -> [i32; 2] {
        let [u, v, r] = self.variable.counts();
        let rate = i32::from(matches!(self.variable, Variable::Acceleration(_)));
        let moment = i32::from(self.force == Force::N);
        [2 + moment + r + rate, 2 - u - v - r - rate]
    }

    /// The value in the frame forward, port, up: `v`, `r`, `Y` and `N` have the other sign there.
    pub fn forward_port_up(&self) -> f64 {
        let odd = self.variable.is_odd() != (self.force != Force::X);
        if odd { -self.value } else { self.value }
    }
}
