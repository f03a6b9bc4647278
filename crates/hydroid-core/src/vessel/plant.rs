//! Equations of motion of a 3-DOF vessel with propeller lag and, for a hydrofoil, a flying mode.

use num_traits::Float;

use super::invalid::InvalidParams;
use super::kinematics::pose_rate;
use super::params::{Coriolis, Drag, RudderLaw, VesselParams};
use super::rk4;
use super::state::{Command, State};

/// A parameter set compiled for speed: inverse mass matrices and reciprocals are computed once.
///
/// # Equations
///
/// State `[x, y, psi, u, v, r, P_f]`, command `[PP, RD]`, `nu = [u, v, r]`. Position north-east, heading
/// clockwise from north; body frame forward, starboard, down; SI units and radians. A positive rudder
/// command turns the bow to starboard while `u > 0`.
///
/// ```text
/// [dx/dt, dy/dt, dpsi/dt] = R(psi) nu                                    thesis eq. 1
/// tau     = [P_f, 0, k u RD]  or  [P_f, 0, k u sin(RD)]                   eq. 2, eq. 7
/// dP_f/dt = (PP - P_f) / T_p                                              eq. 4
/// D(nu)_ij = linear_ij + quadratic_ij |nu_j|
/// f_normal = M^-1     (tau - C(nu) nu -   D(nu) nu)                       eq. 3, 11
/// f_fly    = M_fly^-1 (tau - C(nu) nu - k_D D(nu) nu)                     eq. 12
/// dnu/dt   = sigma(u - u_0) f_fly + sigma(u_0 - u) f_normal               eq. 9, 10
/// sigma(z) = 1 / (1 + exp(-slope z))                                      eq. 8
/// ```
///
/// `M = [[m11, 0, 0], [0, m22, m23], [0, m23, m33]]`, `M_fly` the same with `k_A` times the added mass.
/// `C` is built from `M` in both modes, as in the thesis; its two forms are described at [`Coriolis`].
/// Without a flying mode `dnu/dt = f_normal`. The model is that of Fossen, Handbook of Marine Craft
/// Hydrodynamics and Motion Control, 2nd ed., chapter 6 (manoeuvring models in surge, sway and yaw).
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    mass: [f64; 4],
    normal: InverseMass,
    /// `m22 - m11` where the Munk moment counts, 0 where it is left out.
    munk: f64,
    drag: Drag,
    rudder_law: RudderLaw,
    rudder_gain: f64,
    lag_rate: f64,
    flying: Option<FlyingMode>,
}

/// Inverse of a mass matrix whose surge is uncoupled, and the shared entries of its symmetric block.
#[derive(Clone, Copy, Debug, PartialEq)]
struct InverseMass {
    i11: f64,
    i22: f64,
    i23: f64,
    i33: f64,
}

impl InverseMass {
    fn new([m11, m22, m23, m33]: [f64; 4]) -> Self {
        let determinant = m22 * m33 - m23 * m23;
        Self { i11: 1.0 / m11, i22: m33 / determinant, i23: -m23 / determinant, i33: m22 / determinant }
    }

    #[inline]
    fn apply(&self, [x, y, n]: [f64; 3]) -> [f64; 3] {
        [self.i11 * x, self.i22 * y + self.i23 * n, self.i23 * y + self.i33 * n]
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct FlyingMode {
    inverse: InverseMass,
    drag_factor: f64,
    transition_speed: f64,
    slope: f64,
}

/// A command as the equations use it: the trigonometry of the rudder is done once for as long as the
/// command is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation {
    /// Propeller force asked for \[N\].
    pub pp: f64,
    /// Yaw moment per surge velocity \[N s\]: `k RD` or `k sin(RD)`.
    pub moment_per_speed: f64,
}

impl Plant {
    /// Compiles a parameter set.
    ///
    /// # Errors
    /// What [`VesselParams::validate`] finds.
    pub fn new(params: &VesselParams) -> Result<Self, InvalidParams> {
        params.validate()?;
        let mass = params.mass_matrix(1.0);
        Ok(Self {
            mass,
            normal: InverseMass::new(mass),
            munk: match params.coriolis {
                Coriolis::WithoutMunk => 0.0,
                Coriolis::Full => mass[1] - mass[0],
            },
            drag: params.drag,
            rudder_law: params.rudder.law,
            rudder_gain: params.rudder.gain,
            lag_rate: 1.0 / params.propeller.lag,
            flying: params.flying.map(|flying| FlyingMode {
                inverse: InverseMass::new(params.mass_matrix(flying.added_mass_factor)),
                drag_factor: flying.drag_factor,
                transition_speed: flying.transition_speed,
                slope: flying.slope,
            }),
        })
    }

    /// A command prepared for the time it is held.
    #[inline]
    pub fn actuation(&self, command: &Command) -> Actuation {
        let rudder = match self.rudder_law {
            RudderLaw::Linear => command.rd,
            RudderLaw::Sine => Float::sin(command.rd),
        };
        Actuation { pp: command.pp, moment_per_speed: rudder * self.rudder_gain }
    }

    /// `dx/dt = f(x, c)`: the equations above. Components have the units of the state per second.
    #[inline]
    pub fn derivative(&self, state: &State, command: &Command) -> State {
        self.derivative_under(state, &self.actuation(command))
    }

    /// [`derivative`](Self::derivative) with a command prepared by [`actuation`](Self::actuation).
    #[inline]
    pub fn derivative_under(&self, state: &State, actuation: &Actuation) -> State {
        let nu = state.nu();
        let [x, y, psi] = pose_rate(state.psi, nu);
        let [u, v, r] = self.acceleration(nu, state.p_f, actuation.moment_per_speed);
        State { x, y, psi, u, v, r, p_f: (actuation.pp - state.p_f) * self.lag_rate }
    }

    /// State after `h` seconds with the command held: one step of [`rk4`].
    ///
    /// The blend into the flying mode is stiff (its slope is 12 per m/s in the reference plant): steps of
    /// 10 ms are the reference.
    #[inline]
    pub fn advance(&self, state: &State, command: &Command, h: f64) -> State {
        self.advance_under(state, &self.actuation(command), h)
    }

    /// [`advance`](Self::advance) with a command prepared by [`actuation`](Self::actuation).
    #[inline]
    pub fn advance_under(&self, state: &State, actuation: &Actuation, h: f64) -> State {
        let f = |x: &[f64; State::LEN]| self.derivative_under(&State::from(*x), actuation).into();
        rk4::step(f, &(*state).into(), h).into()
    }

    /// Weight of the flying mode at surge velocity `u`, `sigma(u - u_0)`; 0 without a flying mode.
    #[inline]
    pub fn flying_weight(&self, u: f64) -> f64 {
        self.flying.map_or(0.0, |flying| sigma(flying.slope * (u - flying.transition_speed)))
    }

    /// Coriolis and centripetal forces `C(nu) nu` \[N, N, N m\].
    #[inline]
    pub fn coriolis(&self, [u, v, r]: [f64; 3]) -> [f64; 3] {
        let [m11, m22, m23, _] = self.mass;
        [-(m22 * v + m23 * r) * r, m11 * u * r, self.munk * u * v + m23 * u * r]
    }

    /// Drag `D(nu) nu` of the normal mode \[N, N, N m\].
    #[inline]
    pub fn drag(&self, nu: [f64; 3]) -> [f64; 3] {
        let squared = nu.map(|w| w.abs() * w);
        let row = |linear: &[f64; 3], quadratic: &[f64; 3]| {
            (linear[0] * nu[0] + quadratic[0] * squared[0])
                + (linear[1] * nu[1] + quadratic[1] * squared[1])
                + (linear[2] * nu[2] + quadratic[2] * squared[2])
        };
        let Drag { linear, quadratic } = &self.drag;
        [row(&linear[0], &quadratic[0]), row(&linear[1], &quadratic[1]), row(&linear[2], &quadratic[2])]
    }

    /// Propeller force that holds surge velocity `u` on a straight course \[N\]: the surge drag, between the
    /// modes weighted as the equations weigh it. For a hydrofoil it falls where the vessel takes off.
    pub fn holding_force(&self, u: f64) -> f64 {
        let [drag, ..] = self.drag([u, 0.0, 0.0]);
        let Some(flying) = &self.flying else { return drag };
        let fly = self.flying_weight(u) * flying.inverse.i11;
        let normal = (1.0 - self.flying_weight(u)) * self.normal.i11;
        drag * (fly * flying.drag_factor + normal) / (fly + normal)
    }

    /// Mass matrix of the normal mode as `[m11, m22, m23, m33]`; see [`VesselParams::mass_matrix`].
    pub const fn mass_matrix(&self) -> [f64; 4] {
        self.mass
    }

    /// `dnu/dt` \[m/s^2, m/s^2, rad/s^2\] under a propeller force \[N\] and a yaw moment per surge
    /// velocity \[N s\].
    #[inline]
    pub fn acceleration(&self, nu: [f64; 3], propeller_force: f64, moment_per_speed: f64) -> [f64; 3] {
        let coriolis = self.coriolis(nu);
        let drag = self.drag(nu);
        let driving = [propeller_force - coriolis[0], -coriolis[1], nu[0] * moment_per_speed - coriolis[2]];
        let normal = self.normal.apply(core::array::from_fn(|i| driving[i] - drag[i]));
        let Some(flying) = &self.flying else { return normal };

        let fly = flying.inverse.apply(core::array::from_fn(|i| driving[i] - flying.drag_factor * drag[i]));
        let weight = sigma(flying.slope * (nu[0] - flying.transition_speed));
        // sigma(-z) = 1 - sigma(z) saves the second exponential.
        core::array::from_fn(|i| weight * fly[i] + (1.0 - weight) * normal[i])
    }
}

/// `1 / (1 + exp(-z))`.
#[inline]
fn sigma(z: f64) -> f64 {
    1.0 / (Float::exp(-z) + 1.0)
}
