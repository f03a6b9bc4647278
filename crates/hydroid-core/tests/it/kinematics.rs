//! Kinematics against values by hand.

use std::f64::consts::{FRAC_PI_2, PI};

use hydroid_core::vessel::kinematics::{pose_rate, wrap};

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
fn wrap_takes_whole_turns_away() {
    assert!((wrap(7.0 * PI + 0.25) - (0.25 - PI)).abs() < 1e-12);
    assert!((wrap(-0.5) + 0.5).abs() < 1e-15);
    assert!((-PI..PI).contains(&wrap(PI)));
}
