//! Defaults for vessels of any size.

use serde::Serialize;

use crate::manoeuvre::Response;

/// Size of a vessel relative to the boat for which the default settings of controllers and tasks were chosen (the built-in
/// hydrofoil at 4 m/s): a setting with the dimension `m^a s^b` is multiplied by `length^a time^b`, and a length of a task
/// by `radius`.
///
/// The time is that of a small turn, the length the way of the vessel in this time, and the radius that of a turn with the
/// steering hard over:
///
/// ```text
/// t = sqrt(T / K),  l = U t:    K / T is the yaw acceleration with the steering hard over at the speed U
/// ```
///
/// for the Nomoto model of the [`Response`]. A vessel that turns on the spot has a small radius, and needs as much way as
/// another one to come back to its path. Source of the method: dimensional analysis, as in the prime system of Fossen
/// 2021, section 7.2.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Scale {
    /// Lengths in the settings of a controller.
    pub length: f64,
    /// Times.
    pub time: f64,
    /// Lengths of a task.
    pub radius: f64,
}

/// Speed of the boat \[m/s\].
const SPEED_M_S: f64 = 4.0;

/// Turning time of the boat \[s\].
const TIME_S: f64 = 0.4;

/// Turning radius of the boat \[m\].
pub(super) const RADIUS_M: f64 = 5.5;

impl Scale {
    /// The boat itself.
    pub const BOAT: Self = Self { length: 1.0, time: 1.0, radius: 1.0 };

    /// The scale of a vessel.
    pub fn of(response: &Response) -> Self {
        let Response { speed_m_s, turning_radius_m, yaw_gain_rad_s, yaw_time_s, .. } = *response;
        let time = (yaw_time_s / yaw_gain_rad_s.abs()).sqrt() / TIME_S;
        Self { length: time * speed_m_s / SPEED_M_S, time, radius: turning_radius_m / RADIUS_M }
    }
}
