//! Checks that a parameter set describes a vessel.

use super::invalid::{InvalidParams, Mode};
use super::parameter::mass_matrix;
use super::params::{Commands, Flying, RudderLaw, VesselParams};

const LINEAR: [[&str; 3]; 3] = [
    ["drag.linear[0][0]", "drag.linear[0][1]", "drag.linear[0][2]"],
    ["drag.linear[1][0]", "drag.linear[1][1]", "drag.linear[1][2]"],
    ["drag.linear[2][0]", "drag.linear[2][1]", "drag.linear[2][2]"],
];
const QUADRATIC: [[&str; 3]; 3] = [
    ["drag.quadratic[0][0]", "drag.quadratic[0][1]", "drag.quadratic[0][2]"],
    ["drag.quadratic[1][0]", "drag.quadratic[1][1]", "drag.quadratic[1][2]"],
    ["drag.quadratic[2][0]", "drag.quadratic[2][1]", "drag.quadratic[2][2]"],
];

impl VesselParams {
    /// Finds the first invalid parameter.
    ///
    /// # Errors
    /// See [`InvalidParams`]: numbers that are not finite; mass, yaw inertia, lag, rudder gain, transition speed or
    /// slope not positive; added mass of the wrong sign; a mass matrix that is not positive definite; negative drag on
    /// the diagonal, negative factors or noise; reversed limits; rudder angles in degrees.
    pub fn validate(&self) -> Result<(), InvalidParams> {
        let body = &self.rigid_body;
        positive("rigid_body.mass", body.mass)?;
        finite("rigid_body.x_g", body.x_g)?;
        positive("rigid_body.i_z", body.i_z)?;
        let least = body.mass * body.x_g * body.x_g;
        if body.i_z <= least {
            return Err(InvalidParams::YawInertia { i_z: body.i_z, least });
        }

        let added = &self.added_mass;
        not_above_zero("added_mass.x_udot", added.x_udot)?;
        not_above_zero("added_mass.y_vdot", added.y_vdot)?;
        not_above_zero("added_mass.n_rdot", added.n_rdot)?;
        finite("added_mass.y_rdot", added.y_rdot)?;
        self.check_mass_matrix(Mode::Normal, 1.0)?;

        for i in 0..3 {
            for j in 0..3 {
                finite(LINEAR[i][j], self.drag.linear[i][j])?;
                finite(QUADRATIC[i][j], self.drag.quadratic[i][j])?;
            }
            not_below_zero(LINEAR[i][i], self.drag.linear[i][i])?;
            not_below_zero(QUADRATIC[i][i], self.drag.quadratic[i][i])?;
        }

        positive("rudder.gain", self.rudder.gain)?;
        positive("propeller.lag", self.propeller.lag)?;
        if let Some(flying) = &self.flying {
            check_flying(flying)?;
            self.check_mass_matrix(Mode::Flying, flying.added_mass_factor)?;
        }
        self.commands.check(self.rudder.law)?;

        not_below_zero("noise.u", self.noise.u)?;
        not_below_zero("noise.v", self.noise.v)?;
        not_below_zero("noise.r", self.noise.r)?;
        not_below_zero("noise.p_f", self.noise.p_f)
    }

    /// Mass matrix `[[m11, 0, 0], [0, m22, m23], [0, m23, m33]]` as `[m11, m22, m23, m33]`: `m11 = m + a11`,
    /// `m22 = m + a22`, `m23 = m x_g + a23`, `m33 = I_z + a33`, the added mass times `added` (1 in the normal mode).
    pub fn mass_matrix(&self, added: f64) -> [f64; 4] {
        mass_matrix(&self.numbers(), added)
    }

    fn check_mass_matrix(&self, mode: Mode, added: f64) -> Result<(), InvalidParams> {
        let [_, m22, m23, m33] = self.mass_matrix(added);
        let determinant = m22 * m33 - m23 * m23;
        // Relative, because a determinant of the size of rounding errors is as singular as zero.
        if determinant.is_finite() && determinant > 1e-12 * m22 * m33 {
            Ok(())
        } else {
            Err(InvalidParams::MassMatrix { mode, determinant })
        }
    }
}

impl Commands {
    fn check(&self, law: RudderLaw) -> Result<(), InvalidParams> {
        for (command, name, limits) in [
            (&self.propeller, "commands.propeller.name", "commands.propeller.limits"),
            (&self.rudder, "commands.rudder.name", "commands.rudder.limits"),
        ] {
            if command.name.trim().is_empty() {
                return Err(InvalidParams::EmptyName { field: name });
            }
            let [low, high] = command.limits;
            finite(limits, low)?;
            finite(limits, high)?;
            if low >= high {
                return Err(InvalidParams::Limits { field: limits, low, high });
            }
        }
        if law == RudderLaw::Sine {
            for limit in self.rudder.limits {
                if limit.abs() > core::f64::consts::FRAC_PI_2 {
                    return Err(InvalidParams::RudderAngle { limit });
                }
            }
        }
        Ok(())
    }
}

fn check_flying(flying: &Flying) -> Result<(), InvalidParams> {
    not_below_zero("flying.added_mass_factor", flying.added_mass_factor)?;
    not_below_zero("flying.drag_factor", flying.drag_factor)?;
    positive("flying.transition_speed", flying.transition_speed)?;
    positive("flying.slope", flying.slope)
}

fn finite(field: &'static str, value: f64) -> Result<(), InvalidParams> {
    if value.is_finite() { Ok(()) } else { Err(InvalidParams::NotFinite { field, value }) }
}

fn positive(field: &'static str, value: f64) -> Result<(), InvalidParams> {
    finite(field, value)?;
    if value > 0.0 { Ok(()) } else { Err(InvalidParams::NotPositive { field, value }) }
}

fn not_below_zero(field: &'static str, value: f64) -> Result<(), InvalidParams> {
    finite(field, value)?;
    if value >= 0.0 { Ok(()) } else { Err(InvalidParams::Negative { field, value }) }
}

fn not_above_zero(field: &'static str, value: f64) -> Result<(), InvalidParams> {
    finite(field, value)?;
    if value <= 0.0 { Ok(()) } else { Err(InvalidParams::PositiveAddedMass { field, value }) }
}
