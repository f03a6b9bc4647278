//! Integral line-of-sight guidance.

use num_traits::Float;

use super::error::{PathError, positive};
use super::piece::Pose;

/// How a vessel is brought onto its path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineOfSightOptions {
    /// Look-ahead distance `Delta` \[m\]: two to five lengths of the vessel, and more than its speed times the time that
    /// its heading takes to follow. Short is sharp, and overshoots where the heading is slow.
    pub lookahead: f64,
    /// Integral gain `sigma` \[m/s\]; 0 for none. The law is proven stable where it is less than the speed that is left
    /// when the drift has been taken off; a tenth of the speed is a good start.
    pub integral: f64,
}

/// Integral line-of-sight guidance (ILOS).
///
/// With the cross-track error `e` (positive to starboard of the path) and the course of the path `gamma`:
///
/// ```text
/// psi_d   = gamma - atan((e + sigma y_int) / Delta)
/// y_int'  = Delta e / (Delta^2 + (e + sigma y_int)^2)
/// ```
///
/// E. Borhaug, A. Pavlov, K. Y. Pettersen, *Integral LOS control for path following of underactuated marine surface
/// vessels in the presence of constant ocean currents*, 47th IEEE Conference on Decision and Control, 2008; T. I. Fossen,
/// *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd ed., 2021, section 12.3 (proportional law eq. 12.78,
/// integral law eq. 12.108, there with `kappa` for `sigma`). The integral moves slowly where the error is large, so that
/// it does not wind up on the way to the path: no other limit is needed.
///
/// What it does: on a straight line a vessel whose heading is `psi_d` comes to the path and stays on it under a constant
/// drift across it that is slower than the vessel; without the integral it stays off by `Delta V / sqrt(U^2 - V^2)`. In a
/// turn the sideslip of the turn is such a drift, as long as it lasts; where turns change the integral takes `Delta /
/// sigma` seconds, in the order of magnitude, to follow.
///
/// What it assumes: a heading that follows. When it fails: near the centre of a turn (the foot of the path jumps); drift
/// faster than the vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineOfSight {
    settings: LineOfSightOptions,
    integral: f64,
}

/// Where the bow shall point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingReference {
    /// Heading `psi_d` \[rad\], within a quarter of a turn of the path's course; not wrapped.
    pub heading: f64,
    /// Its rate \[rad/s\]: of the vessel as it moves now, along the path as it turns here.
    pub rate: f64,
    /// Cross-track error, positive to starboard of the path \[m\].
    pub cross_track: f64,
}

impl LineOfSight {
    /// Guidance with no integral yet.
    ///
    /// # Errors
    /// If the look-ahead distance is not positive, or the integral gain negative or not finite.
    pub fn new(settings: LineOfSightOptions) -> Result<Self, PathError> {
        positive("the look-ahead distance", settings.lookahead)?;
        if !(settings.integral.is_finite() && settings.integral >= 0.0) {
            return Err(PathError::NotPositive {
                what: "the integral gain of the line of sight",
                value: settings.integral,
            });
        }
        Ok(Self { settings, integral: 0.0 })
    }

    /// What it has integrated, `y_int` \[s\]; times `sigma` it is a distance.
    pub const fn integral(&self) -> f64 {
        self.integral
    }

    /// Forgets the integral: on another path, the drift across it is another.
    pub fn reset(&mut self) {
        self.integral = 0.0;
    }

    /// The aim of a vessel at `position` \[m\] that moves over ground with `velocity` \[m/s\] (both north, east), where
    /// `pose` is the foot of its position on the path; then the integral moves on by `dt` seconds.
    pub fn update(
        &mut self,
        pose: &Pose,
        position: [f64; 2],
        velocity: [f64; 2],
        dt: f64,
    ) -> HeadingReference {
        let LineOfSightOptions { lookahead, integral: sigma } = self.settings;
        let e = pose.cross_track(position);
        let off = e + sigma * self.integral;
        let square = lookahead * lookahead + off * off;
        let grows = lookahead * e / square;

        let (sin, cos) = Float::sin_cos(pose.course);
        let along = velocity[0] * cos + velocity[1] * sin;
        let across = velocity[1] * cos - velocity[0] * sin;
        // The foot moves faster than a vessel inside of the turn; at its centre it has no speed.
        let foot = along / (1.0 - pose.curvature * e).max(0.1);
        let rate = pose.curvature * foot - lookahead * (across + sigma * grows) / square;

        if grows.is_finite() {
            self.integral += grows * dt;
        }
        HeadingReference { heading: pose.course - Float::atan(off / lookahead), rate, cross_track: e }
    }
}
