//! The parameters of a vessel as a flat array.

use super::number::Number;
use super::params::{Coriolis, RudderLaw, VesselParams};

/// A parameter of the equations of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Path in a vessel's file, for instance `rigid_body.mass`.
    pub path: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Whether the sign is free. It is fixed by physics for masses, added masses, direct damping, gains and times.
    pub signed: bool,
}

/// Number of parameters, those of the flying mode included.
pub const PARAMETERS: usize = 31;

/// One number for each parameter of [`PARAMETER`].
pub type Numbers<T = f64> = [T; PARAMETERS];

const fn fixed(path: &'static str, unit: &'static str) -> Parameter {
    Parameter { path, unit, signed: false }
}

const fn signed(path: &'static str, unit: &'static str) -> Parameter {
    Parameter { path, unit, signed: true }
}

/// All parameters, in the order of [`VesselParams::numbers`].
pub const PARAMETER: [Parameter; PARAMETERS] = [
    fixed("rigid_body.mass", "kg"),
    signed("rigid_body.x_g", "m"),
    fixed("rigid_body.i_z", "kg m^2"),
    fixed("added_mass.x_udot", "kg"),
    fixed("added_mass.y_vdot", "kg"),
    fixed("added_mass.n_rdot", "kg m^2"),
    signed("added_mass.y_rdot", "kg m"),
    fixed("drag.linear[0][0]", "N s/m"),
    signed("drag.linear[0][1]", "N s/m"),
    signed("drag.linear[0][2]", "N s"),
    signed("drag.linear[1][0]", "N s/m"),
    fixed("drag.linear[1][1]", "N s/m"),
    signed("drag.linear[1][2]", "N s"),
    signed("drag.linear[2][0]", "N s"),
    signed("drag.linear[2][1]", "N s"),
    fixed("drag.linear[2][2]", "N m s"),
    fixed("drag.quadratic[0][0]", "N s^2/m^2"),
    signed("drag.quadratic[0][1]", "N s^2/m^2"),
    signed("drag.quadratic[0][2]", "N s^2"),
    signed("drag.quadratic[1][0]", "N s^2/m^2"),
    fixed("drag.quadratic[1][1]", "N s^2/m^2"),
    signed("drag.quadratic[1][2]", "N s^2"),
    signed("drag.quadratic[2][0]", "N s^2/m"),
    signed("drag.quadratic[2][1]", "N s^2/m"),
    fixed("drag.quadratic[2][2]", "N m s^2"),
    fixed("rudder.gain", "N s or 1"),
    fixed("propeller.lag", "s"),
    fixed("flying.added_mass_factor", "1"),
    fixed("flying.drag_factor", "1"),
    fixed("flying.transition_speed", "m/s"),
    fixed("flying.slope", "s/m"),
];

/// The discrete part of a vessel's equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// Form of the Coriolis and centripetal forces.
    pub coriolis: Coriolis,
    /// Rudder law.
    pub rudder: RudderLaw,
    /// Whether there is a flying mode.
    pub flying: bool,
}

#[derive(Clone, Copy)]
pub(super) struct Parts<T> {
    pub(super) linear: [[T; 3]; 3],
    pub(super) quadratic: [[T; 3]; 3],
    pub(super) rudder_gain: T,
    pub(super) lag: T,
    pub(super) added_mass_factor: T,
    pub(super) drag_factor: T,
    pub(super) transition_speed: T,
    pub(super) slope: T,
}

impl<T: Number> Parts<T> {
    pub(super) fn of(numbers: &Numbers<T>) -> Self {
        let matrix =
            |first: usize| core::array::from_fn(|i| core::array::from_fn(|j| numbers[first + 3 * i + j]));
        let [rudder_gain, lag, added_mass_factor, drag_factor, transition_speed, slope] =
            core::array::from_fn(|k| numbers[25 + k]);
        let (linear, quadratic) = (matrix(7), matrix(16));
        Self { linear, quadratic, rudder_gain, lag, added_mass_factor, drag_factor, transition_speed, slope }
    }
}

/// Mass matrix as `[m11, m22, m23, m33]` with the added mass times `added`; see [`VesselParams::mass_matrix`].
pub(super) fn mass_matrix<T: Number>(numbers: &Numbers<T>, added: T) -> [T; 4] {
    let &[mass, x_g, i_z, x_udot, y_vdot, n_rdot, y_rdot, ..] = numbers;
    [mass - added * x_udot, mass - added * y_vdot, mass * x_g - added * y_rdot, i_z - added * n_rdot]
}

/// Whether equations of this form can be solved: all numbers are finite, the yaw inertia exceeds `m x_g^2`, and the
/// mass matrix of each mode is positive definite. Signs are not checked.
pub fn is_solvable(form: Form, numbers: &Numbers) -> bool {
    let &[mass, x_g, i_z, ..] = numbers;
    let definite = |added: f64| {
        let [m11, m22, m23, m33] = mass_matrix(numbers, added);
        m11 > 0.0 && m22 > 0.0 && m22 * m33 - m23 * m23 > 1e-12 * m22 * m33
    };
    numbers.iter().all(|number| number.is_finite())
        && i_z > mass * x_g * x_g
        && definite(1.0)
        && (!form.flying || definite(Parts::of(numbers).added_mass_factor))
}

impl VesselParams {
    /// The form of the equations.
    pub fn form(&self) -> Form {
        Form { coriolis: self.coriolis, rudder: self.rudder.law, flying: self.flying.is_some() }
    }

    /// The parameters in the order of [`PARAMETER`]; those of a missing flying mode are zero.
    pub fn numbers(&self) -> Numbers {
        let mut own = self.clone();
        let mut places = own.places();
        core::array::from_fn(|_| places.next().map_or(0.0, |place| *place))
    }

    /// Replaces the parameters.
    pub fn set_numbers(&mut self, numbers: &Numbers) {
        for (place, number) in self.places().zip(numbers) {
            *place = *number;
        }
    }

    fn places(&mut self) -> impl Iterator<Item = &mut f64> {
        let (body, added, drag) = (&mut self.rigid_body, &mut self.added_mass, &mut self.drag);
        let flying = self.flying.as_mut().map(|flying| {
            [
                &mut flying.added_mass_factor,
                &mut flying.drag_factor,
                &mut flying.transition_speed,
                &mut flying.slope,
            ]
        });
        [&mut body.mass, &mut body.x_g, &mut body.i_z]
            .into_iter()
            .chain([&mut added.x_udot, &mut added.y_vdot, &mut added.n_rdot, &mut added.y_rdot])
            .chain(drag.linear.as_flattened_mut())
            .chain(drag.quadratic.as_flattened_mut())
            .chain([&mut self.rudder.gain, &mut self.propeller.lag])
            .chain(flying.into_iter().flatten())
    }
}
