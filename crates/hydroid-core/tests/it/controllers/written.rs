//! The built-in vessels as sparse equations with exact coefficients.
#![allow(unreachable_pub)] // a module of tests and benchmarks has no outside

use hydroid_core::craft::{Craft, RudderLaw};
use hydroid_core::model::sparse::{Equations, Factor, Gate, Real, Shape, Signal, Term};

/// Form of the propeller force in the equations.
#[derive(Clone, Copy, PartialEq)]
pub enum Force {
    /// A hidden lag of the command.
    Hidden,
    /// The fourth output.
    Measured,
}

fn f(variable: u16, shape: Shape) -> Factor {
    Factor { variable, shape }
}

/// `d nu/dt` of a vessel without Munk moment; variables `u, v, r, (P_f,) PP, RD (, lag of PP)`.
pub fn equations(vessel: &Craft, force: Force) -> Equations {
    let outputs: u16 = if force == Force::Measured { 4 } else { 3 };
    let (pp, rd) = (outputs, outputs + 1);
    let thrust = if force == Force::Measured { 3 } else { outputs + 2 };
    let one = Shape::Power(1);
    let (rudder, gain) = match vessel.rudders[0].law {
        RudderLaw::Linear(gain) => (one, gain),
        RudderLaw::Sine(gain) => (Shape::Sin, gain),
        RudderLaw::Normal(_) => panic!("a yaw moment"),
    };
    let mut library = vec![Term::monomial(&[0]), Term::monomial(&[1]), Term::monomial(&[2])];
    library.extend((0..3).map(|w| Term::signed_square(w, w)));
    library.extend([Term::monomial(&[0, 2]), Term::monomial(&[1, 2]), Term::monomial(&[2, 2])]);
    library.push(Term::monomial(&[thrust]));
    library.push(Term::new(vec![f(0, one), f(rd, rudder)]));

    // Forces of each term, before the inverse of the mass matrix; `C` is that of displacement mode in both modes.
    let hull = &vessel.hull;
    let mass = |k: f64| {
        let m23 = hull.mass * hull.x_g - k * hull.y_rdot;
        [hull.mass - k * hull.x_udot, hull.mass - k * hull.y_vdot, m23, hull.i_z - k * hull.n_rdot]
    };
    let [m11, m22, m23, _] = mass(1.0);
    let rows = |added_factor: f64, drag_factor: f64| -> Vec<[f64; 3]> {
        let [a, b, c, d] = mass(added_factor);
        let determinant = b * d - c * c;
        let solve =
            |[x, y, n]: [f64; 3]| [x / a, (d * y - c * n) / determinant, (b * n - c * y) / determinant];
        let drag = |table: &[[f64; 3]; 3], j: usize| [0, 1, 2].map(|i| -drag_factor * table[i][j]);
        let mut forces: Vec<[f64; 3]> = (0..3).map(|j| drag(&vessel.hull.linear, j)).collect();
        forces.extend((0..3).map(|j| drag(&vessel.hull.quadratic, j)));
        forces.push([0.0, -m11, -m23]);
        forces.push([m22, 0.0, 0.0]);
        forces.push([m23, 0.0, 0.0]);
        forces.push([1.0, 0.0, 0.0]);
        forces.push([0.0, 0.0, gain]);
        forces.into_iter().map(solve).collect()
    };

    let mut terms = Vec::new();
    let mut columns: Vec<[f64; 3]> = Vec::new();
    match &vessel.flying {
        None => (terms, columns) = (library, rows(1.0, 1.0)),
        Some(flying) => {
            let gate = Gate { centre: Real(flying.transition_speed), slope: Real(flying.slope) };
            let below = rows(1.0, 1.0);
            let above = rows(flying.added_mass_factor, flying.drag_factor);
            for (j, term) in library.iter().enumerate() {
                terms.extend(term.gated(0, gate));
                columns.extend([below[j], above[j]]);
            }
        }
    }
    let lag = vessel.thrusters[0].servo.lag;
    let mut signals = Vec::new();
    let mut last = Vec::new();
    match force {
        Force::Hidden => signals.push(Signal::Lag { input: pp, time_constant_s: Real(lag) }),
        Force::Measured => {
            terms.extend([Term::monomial(&[3]), Term::monomial(&[pp])]);
            columns.extend([[0.0; 3]; 2]);
            last = vec![0.0; terms.len()];
            let count = terms.len();
            (last[count - 2], last[count - 1]) = (-1.0 / lag, 1.0 / lag);
        }
    }
    let mut coefficients: Vec<f64> = (0..3).flat_map(|i| columns.iter().map(move |c| c[i])).collect();
    coefficients.extend(last);
    Equations::with_signals(terms, coefficients, usize::from(outputs), 2, signals, 0.1, 10).unwrap()
}
