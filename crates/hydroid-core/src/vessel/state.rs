//! State and command of a 3-DOF plant.

/// State of a vessel, or its time derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Position north \[m\].
    pub x: f64,
    /// Position east \[m\].
    pub y: f64,
    /// Heading, clockwise from north seen from above, not wrapped \[rad\].
    pub psi: f64,
    /// Surge velocity, positive forward \[m/s\].
    pub u: f64,
    /// Sway velocity, positive to starboard \[m/s\].
    pub v: f64,
    /// Yaw rate, positive to starboard \[rad/s\].
    pub r: f64,
    /// Actual propeller force, positive forward \[N\].
    pub p_f: f64,
}

impl State {
    /// Number of components.
    pub const LEN: usize = 7;

    /// At rest at the origin, heading north, no propeller force.
    pub const REST: Self = Self { x: 0.0, y: 0.0, psi: 0.0, u: 0.0, v: 0.0, r: 0.0, p_f: 0.0 };

    /// Body velocities `nu = [u, v, r]`.
    pub const fn nu(&self) -> [f64; 3] {
        [self.u, self.v, self.r]
    }

    /// Whether every component is finite.
    pub const fn is_finite(&self) -> bool {
        self.x.is_finite()
            && self.y.is_finite()
            && self.psi.is_finite()
            && self.u.is_finite()
            && self.v.is_finite()
            && self.r.is_finite()
            && self.p_f.is_finite()
    }
}

impl From<[f64; Self::LEN]> for State {
    /// From `[x, y, psi, u, v, r, P_f]`.
    fn from([x, y, psi, u, v, r, p_f]: [f64; Self::LEN]) -> Self {
        Self { x, y, psi, u, v, r, p_f }
    }
}

impl From<State> for [f64; State::LEN] {
    /// `[x, y, psi, u, v, r, P_f]`.
    fn from(s: State) -> Self {
        [s.x, s.y, s.psi, s.u, s.v, s.r, s.p_f]
    }
}

/// Command of a vessel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Commanded propeller force, positive forward \[N\].
    pub pp: f64,
    /// Rudder command: an angle \[rad\] where the rudder law is the sine, \[N s\] where it is linear with gain 1.
    /// Positive turns the bow to starboard while `u > 0`.
    pub rd: f64,
}
