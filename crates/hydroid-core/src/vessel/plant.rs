//! Equations of motion of a 3-DOF vessel with propeller lag and, for a hydrofoil, a flying mode.
#![expect(clippy::inline_always, reason = "inlined into functions compiled for the processor")]

use num_traits::Float;

use super::invalid::InvalidParams;
use super::kinematics::pose_rate;
use super::number::Number;
use super::parameter::{Form, Numbers, Parts, mass_matrix};
use super::params::{Coriolis, RudderLaw, VesselParams};
use super::rk4;
use super::state::{Command, State};

/// A parameter set compiled for speed: inverse mass matrices and reciprocals are computed once.
///
/// # Equations
///
/// State `[x, y, psi, u, v, r, P_f]`, command `[PP, RD]`, `nu = [u, v, r]`. Position north-east, heading clockwise from
/// north; body frame forward, starboard, down; SI units and radians. A positive rudder command turns the bow to
/// starboard while `u > 0`.
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
/// `M = [[m11, 0, 0], [0, m22, m23], [0, m23, m33]]`, and `M_fly` with `k_A` times the added mass. `C` is built from
/// `M` in both modes, as in the thesis; its two forms are described at [`Coriolis`]. Without a flying mode
/// `dnu/dt = f_normal`. The model is that of Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd
/// ed., chapter 6 (manoeuvring models in surge, sway and yaw).
///
/// `T` is a [`Number`]; with [`Dual`](super::Dual) the equations also give derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant<T = f64> {
    mass: [T; 4],
    normal: InverseMass<T>,
    /// `m22 - m11` with the Munk moment, else 0.
    munk: T,
    linear: [[T; 3]; 3],
    quadratic: [[T; 3]; 3],
    rudder_law: RudderLaw,
    rudder_gain: T,
    lag_rate: T,
    flying: Option<FlyingMode<T>>,
}

/// Inverse of a mass matrix whose surge is uncoupled, and the shared entries of its symmetric block.
#[derive(Clone, Copy, Debug, PartialEq)]
struct InverseMass<T> {
    i11: T,
    i22: T,
    i23: T,
    i33: T,
}

impl<T: Number> InverseMass<T> {
    fn new([m11, m22, m23, m33]: [T; 4]) -> Self {
        let determinant = m22 * m33 - m23 * m23;
        Self {
            i11: T::constant(1.0) / m11,
            i22: m33 / determinant,
            i23: -m23 / determinant,
            i33: m22 / determinant,
        }
    }

    #[inline(always)]
    fn apply(&self, [x, y, n]: [T; 3]) -> [T; 3] {
        [self.i11 * x, self.i22 * y + self.i23 * n, self.i23 * y + self.i33 * n]
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct FlyingMode<T> {
    inverse: InverseMass<T>,
    drag_factor: T,
    transition_speed: T,
    slope: T,
}

/// A command in the form of the equations: the sine of the rudder angle is computed once while the command is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuation<T = f64> {
    /// Commanded propeller force \[N\].
    pub pp: T,
    /// Yaw moment per surge velocity \[N s\]: `k RD` or `k sin(RD)`.
    pub moment_per_speed: T,
}

/// [`Plant::motion_rate`] under a held command.
struct MotionRate<'a, T> {
    plant: &'a Plant<T>,
    actuation: &'a Actuation<T>,
}

impl<T: Number> rk4::Rate<T, 4> for MotionRate<'_, T> {
    #[inline(always)]
    fn rate(&self, motion: &[T; 4]) -> [T; 4] {
        self.plant.motion_rate(motion, self.actuation)
    }
}

impl Plant {
    /// Compiles a parameter set.
    ///
    /// # Errors
    /// As [`VesselParams::validate`].
    pub fn new(params: &VesselParams) -> Result<Self, InvalidParams> {
        params.validate()?;
        Ok(Self::assemble(params.form(), &params.numbers()))
    }

    /// `dx/dt = f(x, c)`, in the units of the state per second.
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

    /// State after `h` seconds with the command held: one step of [`rk4`]. The blend into the flying mode is stiff
    /// (slope 12 per m/s in the reference plant), hence reference steps of 10 ms.
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
        self.flying.map_or(0.0, |flying| (flying.slope * (u - flying.transition_speed)).logistic())
    }

    /// Propeller force that holds surge velocity `u` on a straight course \[N\]: the surge drag, blended between the
    /// modes. For a hydrofoil it decreases at take-off.
    pub fn holding_force(&self, u: f64) -> f64 {
        let [drag, ..] = self.drag([u, 0.0, 0.0]);
        let Some(flying) = &self.flying else { return drag };
        let fly = self.flying_weight(u) * flying.inverse.i11;
        let normal = (1.0 - self.flying_weight(u)) * self.normal.i11;
        drag * (fly * flying.drag_factor + normal) / (fly + normal)
    }

    /// Contribution of an external force `[X, Y, N]` \[N, N, N m\], for instance wind on the hull, to `dnu/dt` at surge
    /// velocity `u`, blended between the modes. The motion is linear in the force.
    #[inline]
    pub fn pushed(&self, u: f64, force: [f64; 3]) -> [f64; 3] {
        let normal = self.normal.apply(force);
        let Some(flying) = &self.flying else { return normal };
        let (weight, fly) = (self.flying_weight(u), flying.inverse.apply(force));
        core::array::from_fn(|i| weight * fly[i] + (1.0 - weight) * normal[i])
    }

    /// Mass matrix of the normal mode as `[m11, m22, m23, m33]`; see [`VesselParams::mass_matrix`].
    pub const fn mass_matrix(&self) -> [f64; 4] {
        self.mass
    }
}

impl<T: Number> Plant<T> {
    /// A plant from parameters for which [`is_solvable`](super::is_solvable) holds, without allocating.
    pub fn assemble(form: Form, numbers: &Numbers<T>) -> Self {
        let mass = mass_matrix(numbers, T::constant(1.0));
        let parts = Parts::of(numbers);
        Self {
            mass,
            normal: InverseMass::new(mass),
            munk: match form.coriolis {
                Coriolis::WithoutMunk => T::constant(0.0),
                Coriolis::Full => mass[1] - mass[0],
            },
            linear: parts.linear,
            quadratic: parts.quadratic,
            rudder_law: form.rudder,
            rudder_gain: parts.rudder_gain,
            lag_rate: T::constant(1.0) / parts.lag,
            flying: form.flying.then(|| FlyingMode {
                inverse: InverseMass::new(mass_matrix(numbers, parts.added_mass_factor)),
                drag_factor: parts.drag_factor,
                transition_speed: parts.transition_speed,
                slope: parts.slope,
            }),
        }
    }

    /// Prepares a command for the time over which it is held.
    #[inline]
    pub fn actuation(&self, command: &Command) -> Actuation<T> {
        let rudder = match self.rudder_law {
            RudderLaw::Linear => command.rd,
            RudderLaw::Sine => Float::sin(command.rd),
        };
        Actuation { pp: T::constant(command.pp), moment_per_speed: self.rudder_gain * rudder }
    }

    /// [`advance_under`](Plant::advance_under) for `[u, v, r, P_f]`, without the pose, on which no force depends.
    #[inline(always)]
    pub fn advance_motion(&self, motion: &[T; 4], actuation: &Actuation<T>, h: f64) -> [T; 4] {
        rk4::step(MotionRate { plant: self, actuation }, motion, h)
    }

    /// `d[u, v, r, P_f]/dt`.
    #[inline(always)]
    pub(crate) fn motion_rate(&self, &[u, v, r, p_f]: &[T; 4], actuation: &Actuation<T>) -> [T; 4] {
        let [du, dv, dr] = self.acceleration([u, v, r], p_f, actuation.moment_per_speed);
        [du, dv, dr, (actuation.pp - p_f) * self.lag_rate]
    }

    /// Coriolis and centripetal forces `C(nu) nu` \[N, N, N m\].
    #[inline(always)]
    pub fn coriolis(&self, [u, v, r]: [T; 3]) -> [T; 3] {
        let [m11, m22, m23, _] = self.mass;
        [-(m22 * v + m23 * r) * r, m11 * u * r, self.munk * u * v + m23 * u * r]
    }

    /// Drag `D(nu) nu` of the normal mode \[N, N, N m\].
    #[inline(always)]
    pub fn drag(&self, nu: [T; 3]) -> [T; 3] {
        let [u, v, r] = nu;
        let squared = [u.abs() * u, v.abs() * v, r.abs() * r];
        let Self { linear, quadratic, .. } = self;
        let mut drag = nu;
        for i in 0..3 {
            let (linear, quadratic) = (&linear[i], &quadratic[i]);
            drag[i] = (linear[0] * nu[0] + quadratic[0] * squared[0])
                + (linear[1] * nu[1] + quadratic[1] * squared[1])
                + (linear[2] * nu[2] + quadratic[2] * squared[2]);
        }
        drag
    }

    /// `dnu/dt` \[m/s^2, m/s^2, rad/s^2\] under a propeller force \[N\] and a yaw moment per surge velocity \[N s\].
    #[inline(always)]
    pub fn acceleration(&self, nu: [T; 3], propeller_force: T, moment_per_speed: T) -> [T; 3] {
        let coriolis = self.coriolis(nu);
        let drag = self.drag(nu);
        let driving = [propeller_force - coriolis[0], -coriolis[1], nu[0] * moment_per_speed - coriolis[2]];
        let [x, y, n] = driving;
        let normal = self.normal.apply([x - drag[0], y - drag[1], n - drag[2]]);
        let Some(flying) = &self.flying else { return normal };

        let factor = flying.drag_factor;
        let fly = flying.inverse.apply([x - factor * drag[0], y - factor * drag[1], n - factor * drag[2]]);
        let weight = (flying.slope * (nu[0] - flying.transition_speed)).logistic();
        // sigma(-z) = 1 - sigma(z) saves the second exponential.
        let rest = T::constant(1.0) - weight;
        let mut blended = fly;
        for i in 0..3 {
            blended[i] = weight * fly[i] + rest * normal[i];
        }
        blended
    }
}
