//! Parameters of a vessel, in SI units and radians. With the `serde` feature every type is read from and written to
//! files; an unknown key is an error, so that misspelt keys are found.

use alloc::string::String;

#[cfg(feature = "serde")]
use serde::{Deserialize, Serialize};

/// All parameters of the parametric 3-DOF [`Plant`](super::Plant). The reference plants are [`simple`](Self::simple),
/// [`hydrofoil`](Self::hydrofoil) and [`hydrofoil_low_speed`](Self::hydrofoil_low_speed).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct VesselParams {
    /// Display name of the vessel.
    pub name: String,
    /// Form of the Coriolis and centripetal forces.
    pub coriolis: Coriolis,
    /// Rigid body.
    pub rigid_body: RigidBody,
    /// Hydrodynamic coefficients: added mass (normal mode).
    pub added_mass: AddedMass,
    /// Hydrodynamic drag (normal mode).
    pub drag: Drag,
    /// Yaw moment of the rudder.
    pub rudder: Rudder,
    /// Lag of the propeller force, and whether the force is measured.
    pub propeller: Propeller,
    /// The flying mode of a hydrofoil; without it the vessel only has the normal mode.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub flying: Option<Flying>,
    /// Names, units and limits of the two commands.
    pub commands: Commands,
    /// Standard deviation of the measurement noise.
    pub noise: Noise,
}

/// Rigid body about the origin CO (amidships on the centreline).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct RigidBody {
    /// Mass `m` \[kg\].
    pub mass: f64,
    /// Centre of gravity ahead of CO, `x_g` \[m\].
    pub x_g: f64,
    /// Yaw inertia about CO, `I_z` \[kg m^2\] (the inertia about the centre of gravity plus `m x_g^2`).
    pub i_z: f64,
}

/// Added mass as hydrodynamic derivatives in SNAME notation: a force per acceleration, hence **not positive** on the
/// diagonal; `a11 = -x_udot`, `a22 = -y_vdot`, `a33 = -n_rdot`, `a23 = a32 = -y_rdot`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct AddedMass {
    /// `X_udot` \[kg\].
    pub x_udot: f64,
    /// `Y_vdot` \[kg\].
    pub y_vdot: f64,
    /// `N_rdot` \[kg m^2\].
    pub n_rdot: f64,
    /// `Y_rdot = N_vdot` \[kg m\].
    pub y_rdot: f64,
}

/// Drag `D(nu) nu`, a resistance: positive on the diagonal. Rows are surge force, sway force, yaw moment; columns are
/// `u`, `v`, `r`. Component `i` is the sum over `j` of `(linear[i][j] + quadratic[i][j] |nu_j|) nu_j`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Drag {
    /// Linear part \[N s/m, N s, N m s\].
    pub linear: [[f64; 3]; 3],
    /// Quadratic part \[N s^2/m^2, N s^2, N m s^2\].
    pub quadratic: [[f64; 3]; 3],
}

/// Form of the Coriolis and centripetal matrix `C(nu)`, built from the mass matrix of the normal mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "snake_case"))]
pub enum Coriolis {
    /// `C nu = [-(m22 v + m23 r) r, m11 u r, m23 u r]` (thesis eq. 3), without the Munk moment `(m22 - m11) u v`:
    /// `nu' C nu = (m11 - m22) u v r`.
    WithoutMunk,
    /// `C nu = [-(m22 v + m23 r) r, m11 u r, (m22 - m11) u v + m23 u r]` (Fossen, skew-symmetric parameterisation); it
    /// does no work, `nu' C nu = 0`.
    Full,
}

/// Yaw moment of the rudder.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Rudder {
    /// Law of the yaw moment.
    pub law: RudderLaw,
    /// Factor `k` of the law (1 for the simple plant, \[N s\] for the sine).
    pub gain: f64,
}

/// How the rudder command enters the yaw moment, which grows with `u` and reverses with its sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(rename_all = "snake_case"))]
pub enum RudderLaw {
    /// `N = k u RD` (thesis eq. 2).
    Linear,
    /// `N = k u sin(RD)`, `RD` an angle \[rad\] (thesis eq. 7).
    Sine,
}

/// Propeller: a first-order lag, `dP_f/dt = (PP - P_f) / lag` (thesis eq. 4).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Propeller {
    /// Time constant `T_p` \[s\].
    pub lag: f64,
    /// Whether the actual force `P_f` is among the measurements.
    pub force_measured: bool,
}

/// The flying mode of a hydrofoil: less added mass and drag, blended in by a sigmoid of the speed (thesis eq. 8-12).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Flying {
    /// Factor on the added mass.
    pub added_mass_factor: f64,
    /// Factor on the drag.
    pub drag_factor: f64,
    /// Transition speed `u_0` \[m/s\].
    pub transition_speed: f64,
    /// Slope of the blend `sigma(z) = 1 / (1 + exp(-slope z))` \[s/m\].
    pub slope: f64,
}

/// The two commands.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Commands {
    /// Propeller command `PP`.
    pub propeller: CommandChannel,
    /// Rudder command `RD`.
    pub rudder: CommandChannel,
}

/// A command: name, unit and limits.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct CommandChannel {
    /// Name in a log.
    pub name: String,
    /// Unit in a log.
    pub unit: String,
    /// Lower and upper limit, in that unit.
    pub limits: [f64; 2],
}

impl CommandChannel {
    /// Clamps a value to the limits.
    pub fn clamp(&self, value: f64) -> f64 {
        value.clamp(self.limits[0], self.limits[1])
    }
}

/// Standard deviations of the white Gaussian measurement noise; independent between channels.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(Serialize, Deserialize), serde(deny_unknown_fields))]
pub struct Noise {
    /// On surge \[m/s\].
    pub u: f64,
    /// On sway \[m/s\].
    pub v: f64,
    /// On yaw rate \[rad/s\].
    pub r: f64,
    /// On the propeller force, where it is measured \[N\].
    #[cfg_attr(feature = "serde", serde(default))]
    pub p_f: f64,
}
