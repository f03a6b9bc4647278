//! Kinematics: `eta_dot = R(psi) nu` with `eta = (x, y, psi)` in the north-east frame and `nu = (u, v, r)` in the body
//! frame (thesis eq. 1; Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., section 2.2).

use num_traits::Float;

/// Rotation matrix `R(psi)` from the body frame to the north-east frame, row by row.
///
/// ```text
///          [ cos psi  -sin psi  0 ]
/// R(psi) = [ sin psi   cos psi  0 ]
///          [    0         0     1 ]
/// ```
pub fn rotation(psi: f64) -> [[f64; 3]; 3] {
    let (sin, cos) = Float::sin_cos(psi);
    [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]
}

/// Rate of the pose `eta_dot = R(psi) nu`: `[x_dot, y_dot, psi_dot]` in m/s, m/s, rad/s.
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

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn forward_speed_heading_east_moves_east() {
        let [x, y, psi] = pose_rate(FRAC_PI_2, [2.0, 0.0, 0.1]);
        assert!(x.abs() < 1e-15 && (y - 2.0).abs() < 1e-15 && psi == 0.1);
    }

    #[test]
    fn sway_to_starboard_heading_north_moves_east() {
        assert_eq!(pose_rate(0.0, [0.0, 1.5, 0.0]), [0.0, 1.5, 0.0]);
    }

    #[test]
    fn pose_rate_is_the_rotation_applied() {
        let nu = [1.3, -0.4, 0.2];
        let m = rotation(0.7);
        let product = m.map(|row| row[0] * nu[0] + row[1] * nu[1] + row[2] * nu[2]);
        for (a, b) in pose_rate(0.7, nu).iter().zip(product) {
            assert!((a - b).abs() < 1e-15);
        }
    }

    #[test]
    fn wrap_takes_whole_turns_away() {
        assert!((wrap(7.0 * PI + 0.25) - (0.25 - PI)).abs() < 1e-12);
        assert!((wrap(-0.5) + 0.5).abs() < 1e-15);
        assert!((-PI..PI).contains(&wrap(PI)));
    }
}
