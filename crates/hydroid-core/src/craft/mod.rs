//! Vessels with any set of actuators: thrusters, fixed or steerable, and rudders, on a hull in three degrees of freedom.
//!
//! A [`Craft`] holds the numbers of a vessel file. [`Dynamics`] is a craft compiled for speed: it integrates the body
//! velocities and the positions of the actuators over a step with the command held. Both are generic over the
//! [`Real`](crate::vessel::Real) type, so that the derivatives with respect to the numbers come from dual numbers.
//!
//! # Equations
//!
//! `nu = (u, v, r)` relative to the water \[m/s, m/s, rad/s\]; body frame forward, starboard, down; SI units and radians.
//!
//! ```text
//! M dnu/dt + C(nu) nu + D(nu) nu = sum of thrusters + sum of rudders
//!
//! M = [[m11, 0, 0], [0, m22, m23], [0, m23, m33]]        m11 = m - X_udot        m22 = m - Y_vdot
//!                                                        m23 = m x_g - Y_rdot    m33 = I_z - N_rdot
//! C nu = [-(m22 v + m23 r) r,  m11 u r,  (m22 - m11) u v + m23 u r]     Munk moment (m22 - m11) u v: see Coriolis
//! D nu = linear nu + quadratic (|nu_j| nu_j) + |u| lift [v, r]
//!        + 1/2 rho T C_d integral over -L/2..L/2 of |v + x r| (v + x r) [0, 1, x] dx
//! ```
//!
//! (T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd edition, 2021, chapter 6; cross-flow
//! drag: section 6.4.) A thruster at `(x, y)` pushes along the angle `alpha` from forward towards starboard:
//!
//! ```text
//! T = k_f n^2 - k_u n u_a  (n > 0),    T = -k_b n^2 - k_u |n| u_a  (n < 0)          quadratic law
//! T = k_f n - k_u n u_a    (n > 0),    T = k_b n - k_u |n| u_a     (n < 0)          linear law
//! u_a = (u - y r) cos alpha + (v + x r) sin alpha
//! tau = T [cos alpha,  sin alpha,  x sin alpha - y cos alpha]
//! ```
//!
//! where `n` is the position of its order, less the dead band (Fossen 2021, section 9.1). A rudder at `(x, y)` with the angle `delta`, positive for a turn to starboard ahead:
//!
//! ```text
//! u_R = (1 - w)(u - y r) + kappa (sqrt(u_a^2 + 2 T / (rho pi D^2 / 4)) - |u_a|)      in the race of a thruster, T > 0
//! v_R = gamma (v + x r)
//! F_N = 1/2 rho A f_alpha sqrt(u_R^2 + v_R^2) (u_R sin delta + v_R cos delta)
//! tau = -F_N [(1 - t_R) sin delta,  (1 + a_H) cos delta,  (x + a_H x_H) cos delta - y (1 - t_R) sin delta]
//! ```
//!
//! the normal force of the MMG standard method (H. Yasukawa and Y. Yoshimura, *Introduction of MMG standard method for
//! ship maneuvering predictions*, J. Mar. Sci. Technol. 20 (2015) 37, equations 17 to 24), with the velocity in the race
//! from the momentum theory of an actuator disc. Other laws of the rudder ([`RudderLaw`]) are a yaw moment alone:
//! `N = k u delta` or `N = k u sin delta`. Positions of actuators follow their orders with a first-order lag and a limit of
//! the rate ([`Servo`]).
//!
//! A hydrofoil has a flying mode ([`Flying`]): its acceleration is a blend of two, the second one with `k_A` times the added
//! mass in the mass matrix and `k_D` times the damping. `C` is that of the normal mode in both.
//!
//! ```text
//! dnu/dt = sigma(u_0 - u) f_normal + sigma(u - u_0) f_fly        sigma(z) = 1 / (1 + exp(-slope z))
//! ```

mod batch;
mod channels;
mod dynamics;
mod invalid;
mod motion;
mod parameters;
mod reference;
mod servo;
mod validate;

use alloc::string::String;
use alloc::vec::Vec;

pub(crate) use batch::{BatchRollout, LANES};
pub use channels::{CraftChannel, Effect, NotAffineCraft};
pub use dynamics::{Dynamics, MAX_SERVOS, Posed};
pub use invalid::{InvalidCraft, Mode};
pub use parameters::CraftParameter;
pub use servo::{Order, Servo};

/// A vessel with any set of actuators. `T` is the type of its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Craft<T = f64> {
    /// Name of the vessel.
    pub name: String,
    /// Density of the water \[kg/m^3\].
    pub water_density: f64,
    /// Hull.
    pub hull: Hull<T>,
    /// Flying mode of a hydrofoil; none for other vessels.
    pub flying: Option<Flying<T>>,
    /// Commands, in the order of the inputs.
    pub commands: Vec<CommandInput>,
    /// Thrusters.
    pub thrusters: Vec<Thruster<T>>,
    /// Rudders.
    pub rudders: Vec<Rudder<T>>,
    /// Standard deviations of the measurement noise of `u`, `v`, `r` \[m/s, m/s, rad/s\].
    pub noise: [f64; 3],
}

/// Mass and hydrodynamic derivatives of a hull about the origin of the body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hull<T = f64> {
    /// Length, beam and draught \[m\], if known.
    pub size: Option<[f64; 3]>,
    /// Mass \[kg\].
    pub mass: T,
    /// Centre of gravity ahead of the origin \[m\].
    pub x_g: T,
    /// Yaw inertia about the origin \[kg m^2\].
    pub i_z: T,
    /// `X_udot` \[kg\], not positive: added mass is its negative.
    pub x_udot: T,
    /// `Y_vdot` \[kg\], not positive.
    pub y_vdot: T,
    /// `Y_rdot = N_vdot` \[kg m\].
    pub y_rdot: T,
    /// `N_rdot` \[kg m^2\], not positive.
    pub n_rdot: T,
    /// Linear damping: rows surge, sway, yaw; columns `u`, `v`, `r`.
    pub linear: [[T; 3]; 3],
    /// Quadratic damping: entry `(i, j)` resists with `|nu_j| nu_j`.
    pub quadratic: [[T; 3]; 3],
    /// Damping of sway and yaw (rows) by `|u| v` and `|u| r` (columns).
    pub lift: [[T; 2]; 2],
    /// Cross-flow drag coefficient `C_d`.
    pub cross_flow: T,
    /// Form of the Coriolis and centripetal forces.
    pub coriolis: Coriolis,
}

/// Form of the Coriolis and centripetal matrix `C(nu)`, built from the mass matrix of the normal mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coriolis {
    /// `C nu = [-(m22 v + m23 r) r, m11 u r, m23 u r]` (thesis eq. 3), without the Munk moment `(m22 - m11) u v`:
    /// `nu' C nu = (m11 - m22) u v r`.
    WithoutMunk,
    /// `C nu = [-(m22 v + m23 r) r, m11 u r, (m22 - m11) u v + m23 u r]` (Fossen, skew-symmetric parameterisation); it
    /// does no work, `nu' C nu = 0`.
    Full,
}

/// The flying mode of a hydrofoil: other added mass and damping, blended in by a sigmoid of the speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flying<T = f64> {
    /// Factor `k_A` of the added mass.
    pub added_mass_factor: T,
    /// Factor `k_D` of the damping.
    pub drag_factor: T,
    /// Transition speed `u_0` \[m/s\].
    pub transition_speed: T,
    /// Slope of the blend \[s/m\].
    pub slope: T,
}

/// A command.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandInput {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Lowest and highest value.
    pub limits: [f64; 2],
    /// Value without effect.
    pub neutral: f64,
}

impl CommandInput {
    /// Clamps a value to the limits.
    pub fn clamp(&self, value: f64) -> f64 {
        value.clamp(self.limits[0], self.limits[1])
    }
}

/// Relation of thrust and order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ThrustLaw {
    /// Thrust with the square of the order, as of a propeller with its shaft speed.
    #[default]
    Quadratic,
    /// Thrust proportional to the order.
    Linear,
}

/// A thruster: fixed or tunnel thruster, azimuth, outboard or water jet.
#[derive(Clone, Debug, PartialEq)]
pub struct Thruster<T = f64> {
    /// Name.
    pub name: String,
    /// Place \[m\]: forward, starboard of the origin.
    pub position: [T; 2],
    /// Direction of the thrust, from forward towards starboard \[rad\].
    pub angle: T,
    /// Order and its servo; the unit of the order is that of the coefficients.
    pub servo: Servo<T>,
    /// Orders below this magnitude have no effect; greater ones are reduced by it.
    pub dead_band: f64,
    /// Relation of thrust and order.
    pub law: ThrustLaw,
    /// Thrust ahead at the order 1 \[N\].
    pub forward: T,
    /// Thrust astern at the order -1 \[N\].
    pub reverse: T,
    /// Loss of thrust with the speed of advance at the order 1 \[N s/m\].
    pub speed_loss: T,
    /// Diameter \[m\], for a rudder in its race.
    pub diameter: Option<f64>,
    /// Steering of the thrust, added to the angle \[rad\].
    pub steering: Option<Servo<T>>,
    /// Standard deviation of the noise of the measured thrust \[N\]; none if the thrust is not measured.
    pub force_noise: Option<f64>,
}

/// A rudder.
#[derive(Clone, Debug, PartialEq)]
pub struct Rudder<T = f64> {
    /// Name.
    pub name: String,
    /// Order, an angle \[rad\] but for [`RudderLaw::Linear`], and its servo; positive for a turn to starboard ahead.
    pub servo: Servo<T>,
    /// Law of its force.
    pub law: RudderLaw<T>,
}

/// Force of a rudder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RudderLaw<T = f64> {
    /// Normal force in the flow.
    Normal(NormalForce<T>),
    /// Yaw moment `k u delta`, with the gain `k`; the unit of the order is that of the gain.
    Linear(T),
    /// Yaw moment `k u sin delta`, with the gain `k` \[N s\].
    Sine(T),
}

/// Normal force of a rudder in the flow (MMG standard method).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalForce<T = f64> {
    /// Place \[m\]: forward, starboard of the origin.
    pub position: [T; 2],
    /// Area \[m^2\].
    pub area: f64,
    /// Slope `f_alpha` of the coefficient of the normal force \[1/rad\].
    pub lift_slope: T,
    /// Wake fraction `w`.
    pub wake: T,
    /// Flow straightening coefficient `gamma`.
    pub straightening: T,
    /// Deduction `t_R` of the drag.
    pub drag_deduction: T,
    /// Increase `a_H` of the lateral force by the hull.
    pub hull_force: T,
    /// Place `x_H` of this additional force \[m\].
    pub hull_position: T,
    /// Index of the thruster in whose race the rudder is.
    pub thruster: Option<usize>,
    /// Share `kappa` of the additional velocity in the race.
    pub race: T,
}
