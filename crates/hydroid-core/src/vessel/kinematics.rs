//! Kinematics: `eta_dot = R(psi) nu` with `eta = (x, y, psi)` in the north-east frame and `nu = (u, v, r)` in the body
//! frame (thesis eq. 1; Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., section 2.2).

use num_traits::Float;

/// Rate of the pose `eta_dot = R(psi) nu`: `[x_dot, y_dot, psi_dot]` in m/s, m/s, rad/s.
///
/// ```text
///          [ cos psi  -sin psi  0 ]
/// R(psi) = [ sin psi   cos psi  0 ]
///          [    0         0     1 ]
/// ```
#[inline]
pub fn pose_rate(psi: f64, [u, v, r]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = Float::sin_cos(psi);
    [u * cos - v * sin, u * sin + v * cos, r]
}

/// Wraps an angle to `[-pi, pi)`, for differences of headings; headings themselves are not wrapped.
pub fn wrap(angle: f64) -> f64 {
    use core::f64::consts::{PI, TAU};
    let turns = Float::floor((angle + PI) / TAU);
    angle - turns * TAU
}
