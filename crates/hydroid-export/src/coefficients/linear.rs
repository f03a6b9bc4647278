//! Linear derivatives of a straight course.

use hydroid::model::{Model, NamedEquations};
use hydroid_core::craft::{Craft, Dynamics, Servo};
use hydroid_core::model::sparse::Term;
use hydroid_core::vessel::{Dual, Number};

use super::equations::{self, mass_rows, motion, place, reordered};
use super::{Coefficients, Derivative, Force, Inertia, Variable, values};
use crate::ExportError;

/// The smallest positive number: a function is differentiated on both sides of a kink at 0.
const BESIDE: f64 = f64::from_bits(1);

/// Largest difference of the derivatives on both sides, relative to them, that is rounding.
const ROUNDING: f64 = 1e-12;

/// A linear derivative of a straight course.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Its symbol in LaTeX: `Y_v(U)`, `N_{\delta}(U)`; `X^{+}_{n}(U)` and `X^{-}_{n}(U)` on the two sides of a kink.
    pub latex: String,
    /// Force per velocity or input. The value is NaN if there is no derivative, because the force jumps or is not defined.
    pub derivative: Derivative,
}

/// Linear derivatives at `nu = (U, 0, 0)` with the inputs at their neutral values, and their standard deviations, those of equations
/// from the members of the bootstrap, with all correlations:
///
/// ```text
/// X_u(U) = dX/du    Y_v(U) = dY/dv    Y_r(U) - m U = dY/dr - m U    N_v(U) = dN/dv    N_r(U) - m x_g U = dN/dr - m x_g U
/// X_c(U) = dX/dc    Y_c(U) = dY/dc    N_c(U) = dN/dc                                          for each input c
/// ```
///
/// The forces by velocities are those of the [derivatives](Coefficients::with_centripetal), by inputs those of all actuators
/// too. Actuators, lags and delays are settled. Where the derivatives on both sides differ, there are both.
///
/// # Errors
/// If the boat of the model contradicts itself.
pub fn straight_course(
    model: &Model,
    coefficients: &Coefficients,
    speed: f64,
) -> Result<Vec<Linear>, ExportError> {
    let neutral: Vec<f64> = values(model, "latex")?.iter().map(|value| value.neutral).collect();
    let at: Vec<f64> = [speed, 0.0, 0.0].into_iter().chain(neutral.iter().copied()).collect();
    let all = coefficients.with_centripetal();
    let named = model.equations();
    let order = motion(model).unwrap_or([0, 1, 2]);
    let matrix = mass_rows(coefficients.inertia.mass_matrix());
    let slope = |force: Force, by: u16, side: f64| {
        let slope = |term: &Term| slope(&settled(term, coefficients), by, &at, side);
        let (mut value, mut deviation) = (0.0, 0.0_f64);
        for derivative in all.iter().filter(|derivative| derivative.force == force) {
            let Variable::Product(term) = &derivative.variable else { continue };
            let slope = slope(term);
            value += derivative.value * slope;
            deviation = deviation.hypot(derivative.deviation.unwrap_or(0.0) * slope);
        }
        let of_equations = |named: &NamedEquations<'_>| {
            let slope = |term: &Term| slope(&reordered(term, |index| place(index, order)));
            equations::deviation(named, order, &matrix[force as usize], slope).unwrap_or(0.0)
        };
        (value, named.as_ref().map_or(deviation, of_equations))
    };
    let Inertia { mass, x_g, .. } = coefficients.inertia;
    let mut rows = Vec::new();
    for (force, j, rest, of_mass) in [
        (Force::X, 0, "_u(U)", 0.0),
        (Force::Y, 1, "_v(U)", 0.0),
        (Force::Y, 2, "_r(U) - m U", mass * speed),
        (Force::N, 1, "_v(U)", 0.0),
        (Force::N, 2, "_r(U) - m x_g U", mass * x_g * speed),
    ] {
        let sides = [-1.0, 1.0].map(|side| slope(force, j, side)).map(|(value, d)| (value - of_mass, d));
        push(&mut rows, force, j, rest, sides);
    }
    for ((k, by), input) in (0..neutral.len()).zip(3..).zip(&coefficients.inputs) {
        // Nothing is known of the effect of an input that never moved.
        if model.equations().is_some() && is_constant(model, k) {
            continue;
        }
        let sides = [-1.0, 1.0].map(|side| {
            let of_actuators =
                model.craft().map_or([0.0; 3], |craft| actuators(craft, &neutral, k, speed, side));
            Force::ALL.map(|force| {
                let (value, deviation) = slope(force, by, side);
                (value + of_actuators[force as usize], deviation)
            })
        });
        let rest = format!("_{{{}}}(U)", input.latex);
        for (i, force) in Force::ALL.into_iter().enumerate() {
            push(&mut rows, force, by, &rest, sides.map(|side| side[i]));
        }
    }
    Ok(rows)
}

/// Whether an input was constant in the training.
pub(super) fn is_constant(model: &Model, input: usize) -> bool {
    let port = &model.description.inputs[input];
    let range = port.training_range.unwrap_or(port.range);
    range.low == range.high
}

/// Adds a derivative from the derivatives on both sides and their standard deviations.
fn push(rows: &mut Vec<Linear>, force: Force, by: u16, rest: &str, [below, above]: [(f64, f64); 2]) {
    let mut row = |side: &str, (value, deviation): (f64, f64)| {
        // The rest of a power at the smallest number.
        let value = if value.is_subnormal() { 0.0 } else { value };
        let value = if value.is_finite() { value } else { f64::NAN };
        let deviation = (deviation > f64::MIN_POSITIVE).then_some(deviation);
        let derivative = Derivative { force, variable: Variable::product(&[by]), value, deviation };
        rows.push(Linear { latex: format!("{}{side}{rest}", force.letter()), derivative });
    };
    if (above.0 - below.0).abs() > ROUNDING * above.0.abs().max(below.0.abs()) + f64::MIN_POSITIVE {
        row("^{+}", above);
        row("^{-}", below);
    } else {
        row("", above);
    }
}

/// A term in a steady motion: lags and delays have the values of their sources.
fn settled(term: &Term, coefficients: &Coefficients) -> Term {
    let source = |index: u16| usize::from(index).checked_sub(3).and_then(|k| coefficients.inputs.get(k));
    reordered(term, |index| source(index).map_or(index, |input| input.source))
}

/// The derivative of a term on one side; NaN if it jumps.
fn slope(term: &Term, by: u16, at: &[f64], side: f64) -> f64 {
    let beside = |side: f64| {
        let mut variables = at.to_vec();
        variables[usize::from(by)] += side * BESIDE;
        variables
    };
    let [here, there] = [side, -side].map(beside);
    if (term.value(&here) - term.value(&there)).abs() > f64::MIN_POSITIVE {
        return f64::NAN;
    }
    term.derivative(by).iter().map(|(scale, term)| scale * term.value(&here)).sum()
}

/// Derivatives of the forces of all actuators by a command on one side, with dual numbers.
fn actuators(craft: &Craft, commands: &[f64], by: usize, speed: f64, side: f64) -> [f64; 3] {
    let numbers: Vec<Dual<1>> =
        craft.parameters().iter().map(|(_, number)| Dual::constant(*number)).collect();
    let dynamics = Dynamics::new(&craft.with_numbers(&numbers));
    let position = |servo: &Servo| {
        let order = &servo.order;
        let value = order.value(commands);
        let of = order.terms.iter().filter(|(command, ..)| *command == by);
        let rate: f64 = of.map(|(_, _, gain)| side * gain).sum();
        let [low, high] = order.limits;
        if rate == 0.0 || (rate > 0.0 && value >= high) || (rate < 0.0 && value <= low) {
            return Dual::constant(value);
        }
        Dual::along(value + BESIDE.copysign(rate), 0, rate)
    };
    let thrusters =
        craft.thrusters.iter().flat_map(|thruster| [Some(&thruster.servo), thruster.steering.as_ref()]);
    let servos = thrusters.flatten().chain(craft.rudders.iter().map(|rudder| &rudder.servo));
    let positions: Vec<Dual<1>> = servos.map(position).collect();
    let nu_dot = dynamics.acceleration([speed, 0.0, 0.0].map(Dual::constant), &positions);
    let [x, y, n] = nu_dot.map(|rate| side * rate.partials[0]);
    let [m11, m22, m23, m33] = craft.hull.mass_matrix();
    [m11 * x, m22 * y + m23 * n, m23 * y + m33 * n]
}
