//! Integral line-of-sight guidance (LOS, ILOS).

use num_traits::Float;

use super::error::{PathError, positive};
use super::piece::Pose;

/// Options of [`LineOfSight`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineOfSightOptions {
    /// Look-ahead distance `Delta` \[m\]: two to five lengths of the vessel, and more than the speed times the response
    /// time of the heading. A short distance converges fast and overshoots with a slow heading.
    pub lookahead: f64,
    /// Integral gain `sigma` \[m/s\]; 0 for none. The law is proven stable for gains below the speed minus the drift; a
    /// tenth of the speed is a good start.
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
/// vessels in the presence of constant ocean currents*, 47th IEEE Conference on Decision and Control, 2008; T. I.
/// Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd ed., 2021, section 12.3 (proportional law
/// eq. 12.78, integral law eq. 12.108, with `kappa` for `sigma`). The integral needs no anti-windup.
///
/// On a straight line, a vessel with heading `psi_d` converges to the path under a constant drift `V` across it that is
/// slower than the speed `U`. Without the integral, the error remains `Delta V / sqrt(U^2 - V^2)`. In a turn the
/// sideslip acts as such a drift; the integral converges within about `Delta / sigma` seconds.
///
/// Assumption: the heading follows its reference. Failure modes: the centre of a turn, where the projection jumps, and
/// a drift faster than the vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineOfSight {
    options: LineOfSightOptions,
    integral: f64,
}

/// Heading reference of line-of-sight guidance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingReference {
    /// Heading `psi_d` \[rad\], within 90 degrees of the course of the path; not wrapped.
    pub heading: f64,
    /// Rate of the heading reference \[rad/s\], for the present motion of the vessel along the path.
    pub rate: f64,
    /// Cross-track error, positive to starboard of the path \[m\].
    pub cross_track: f64,
}

impl LineOfSight {
    /// Guidance with a zero integral.
    ///
    /// # Errors
    /// If the look-ahead distance is not positive, or the integral gain negative or not finite.
    pub fn new(options: LineOfSightOptions) -> Result<Self, PathError> {
        positive("the look-ahead distance", options.lookahead)?;
        if !(options.integral.is_finite() && options.integral >= 0.0) {
            return Err(PathError::NotPositive {
                what: "the integral gain of the line of sight",
                value: options.integral,
            });
        }
        Ok(Self { options, integral: 0.0 })
    }

    /// Integral `y_int` \[s\]; a distance after multiplication by `sigma`.
    pub const fn integral(&self) -> f64 {
        self.integral
    }

    /// Resets the integral, as for a new path.
    pub fn reset(&mut self) {
        self.integral = 0.0;
    }

    /// The integral of the cross-track error, to save or restore it.
    pub const fn integral_mut(&mut self) -> &mut f64 {
        &mut self.integral
    }

    /// Heading reference of a vessel at `position` \[m\] with `velocity` over ground \[m/s\] (both north, east), where
    /// `pose` is the projection of the position onto the path; then advances the integral by `dt` seconds.
    pub fn update(
        &mut self,
        pose: &Pose,
        position: [f64; 2],
        velocity: [f64; 2],
        dt: f64,
    ) -> HeadingReference {
        let LineOfSightOptions { lookahead, integral: sigma } = self.options;
        let e = pose.cross_track(position);
        let off = e + sigma * self.integral;
        let square = lookahead * lookahead + off * off;
        let grows = lookahead * e / square;

        let (sin, cos) = Float::sin_cos(pose.course);
        let along = velocity[0] * cos + velocity[1] * sin;
        let across = velocity[1] * cos - velocity[0] * sin;
        // The projection moves faster than a vessel inside the turn; the centre of the turn is singular.
        let projection_speed = along / (1.0 - pose.curvature * e).max(0.1);
        let rate = pose.curvature * projection_speed - lookahead * (across + sigma * grows) / square;

        if grows.is_finite() {
            self.integral += grows * dt;
        }
        HeadingReference { heading: pose.course - Float::atan(off / lookahead), rate, cross_track: e }
    }
}
