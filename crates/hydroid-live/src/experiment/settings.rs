//! Inputs and limits of an experiment.

use super::allocation::Allocation;
use super::fence::Fence;
use crate::Axis;

/// Settings of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The inputs in the units of the model, in the order of the commands.
    pub inputs: Vec<Axis>,
    /// Inputs that push ahead, with weight: 1, or -1 for a reversed input.
    pub push: Vec<(usize, f64)>,
    /// Inputs that turn to starboard, with weight. Two thrusters push with `left, right` and turn with `left, -right`.
    pub turn: Vec<(usize, f64)>,
    /// Area that the boat must not leave.
    pub fence: Fence,
    /// Largest speed over ground \[m/s\].
    pub max_speed_m_s: f64,
    /// Largest yaw rate \[rad/s\].
    pub max_yaw_rate_rad_s: f64,
    /// Longest duration, pauses included \[s\].
    pub duration_s: f64,
    /// Expected time between two steps \[s\].
    pub dt_s: f64,
    /// Seed of the random levels.
    pub seed: u64,
    /// Share of the range that is used for pushing, up to 1. See [`Settings::DEFAULT_LEVEL`].
    pub level: f64,
}

/// Time for which the position may be unknown \[s\].
pub(super) const UNKNOWN_S: f64 = 2.0;
/// Shortest experiment \[s\].
const SHORTEST_S: f64 = 30.0;
/// Longest time between two steps \[s\].
const SLOWEST_S: f64 = 1.0;

impl Settings {
    /// Default of [`Settings::level`].
    pub const DEFAULT_LEVEL: f64 = 0.8;

    /// Checks the settings, and returns the allocation of push and turn to the inputs.
    pub(super) fn check(&self) -> Result<Allocation, String> {
        let allocation = Allocation::new(&self.inputs, &self.push, &self.turn)?;
        self.fence.check()?;
        for (name, value, unit) in [
            ("max_speed_m_s", self.max_speed_m_s, "m/s"),
            ("max_yaw_rate_rad_s", self.max_yaw_rate_rad_s, "rad/s"),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(format!("{name} is {value}; give a limit greater than 0 {unit}"));
            }
        }
        if !(self.dt_s > 0.0 && self.dt_s <= SLOWEST_S) {
            return Err(format!(
                "dt_s is {}; an experiment needs a step every 0.01 to {SLOWEST_S} s",
                self.dt_s
            ));
        }
        if !(self.duration_s.is_finite() && self.duration_s >= SHORTEST_S) {
            return Err(format!("duration_s is {}; give at least {SHORTEST_S} s", self.duration_s));
        }
        if !(self.level > 0.0 && self.level <= 1.0) {
            return Err(format!(
                "level is {}; give a share of the range greater than 0, up to 1",
                self.level
            ));
        }
        // At the speed limit, half of the radius must suffice for the time in which the position may be unknown.
        let size = self.fence.size();
        if size < 2.0 * UNKNOWN_S * self.max_speed_m_s {
            return Err(format!(
                "the fence is too small for the speed limit: at {:.1} m/s the boat moves {:.0} m in the {UNKNOWN_S} s \
                 for which its position may be unknown, more than half of the radius of {size:.0} m. Give a radius of \
                 at least {:.0} m, or a speed limit of at most {:.2} m/s",
                self.max_speed_m_s,
                UNKNOWN_S * self.max_speed_m_s,
                2.0 * UNKNOWN_S * self.max_speed_m_s,
                size / (2.0 * UNKNOWN_S)
            ));
        }
        Ok(allocation)
    }
}
