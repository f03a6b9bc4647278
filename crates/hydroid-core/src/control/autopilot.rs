//! A conventional autopilot: line of sight (LOS), heading by PID (pole placement on a Nomoto model), speed by PI.

use num_traits::Float;

use super::actuators::Actuators;
use super::error::{ControlError, at_least, positive};
use super::status::Status;
use super::{Controller, Estimate};
use crate::actuator::{Channel, Limits};
use crate::guidance::{LineOfSight, LineOfSightOptions, Reference};
use crate::memory::Memory;
use crate::vessel::kinematics::{pose_rate, wrap};

/// Gains of the heading controller, in units of the rudder command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadingGains {
    /// Per rad of heading error.
    pub proportional: f64,
    /// Per rad s.
    pub integral: f64,
    /// Per rad/s of error of the yaw rate.
    pub derivative: f64,
    /// Per rad/s of demanded yaw rate (feedforward of a steady turn).
    pub turn: f64,
    /// Speed of these gains \[m/s\]; at `u` they are scaled by `(speed / u)^exponent`.
    pub speed: f64,
    /// 1 for a rudder in the race of the propeller or a moment that grows with the speed, 2 for one with its square.
    pub exponent: f64,
}

impl HeadingGains {
    /// Pole placement for a Nomoto model `T dr/dt + r = K delta` (`gain` \[rad/s per command\], `time_constant` \[s\],
    /// at `speed`) with natural frequency `omega` \[rad/s\] and damping ratio `zeta` (Fossen 2021, section 15.3.4):
    ///
    /// ```text
    /// K_p = omega^2 T / K,   K_d = (2 zeta omega T - 1) / K,   K_i = omega / 10 K_p,   K_turn = 1 / K
    /// ```
    pub fn nomoto(gain: f64, time_constant: f64, omega: f64, zeta: f64, speed: f64) -> Self {
        let proportional = omega * omega * time_constant / gain;
        Self {
            proportional,
            integral: 0.1 * omega * proportional,
            derivative: (2.0 * zeta * omega * time_constant - 1.0) / gain,
            turn: 1.0 / gain,
            speed,
            exponent: 1.0,
        }
    }
}

/// Gains of the speed controller, in units of the propeller command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedGains {
    /// Per m/s.
    pub proportional: f64,
    /// Per m.
    pub integral: f64,
    /// Feedforward: a constant, and per m/s. Steady speeds near that of the other gains.
    pub trim: [f64; 2],
}

/// Options of [`Autopilot`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutopilotOptions {
    /// Guidance.
    pub line_of_sight: LineOfSightOptions,
    /// Heading controller.
    pub heading: HeadingGains,
    /// Speed controller.
    pub speed: SpeedGains,
    /// Minimum speed for steering \[m/s\]. Below it gains stay constant and the status is [`Status::Singular`].
    pub steerage: f64,
    /// Distance from the reference above which the status is [`Status::Lost`] \[m\].
    pub tolerance: f64,
}

/// Line of sight, PID on the heading and PI on the speed, for commands `[propeller, rudder]`.
///
/// # Law
///
/// With `psi_d` and `r_d` of the integral line of sight ([`LineOfSight`]) for the projection onto the path (a
/// [`PathReference`](crate::guidance::PathReference)), `e_psi = psi_d - psi` within half a turn, `e_u = U_d - u`:
///
/// ```text
/// rudder    = (speed / u)^exponent (K_turn r_d + K_p e_psi + K_i integral(e_psi) + K_d (r_d - r))
/// propeller = trim_0 + trim_1 U_d + K_pu e_u + K_iu integral(e_u)
/// ```
///
/// Both integrals follow the limited commands (back-calculation, K. J. Astrom and T. Hagglund, *Advanced PID Control*,
/// 2006, section 3.5). Source: T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2nd ed.,
/// 2021, sections 12.3 (line of sight) and 15.3 (PID autopilots).
///
/// # Tuning
///
/// Heading: a zigzag or a turning circle gives `K` and `T`, [`HeadingGains::nomoto`] the gains, with `omega` below `1 /
/// T` of the steering gear and about `1 / T` of the vessel. Look-ahead: more than twice the speed over `omega`. Speed:
/// `K_pu` a fraction of the mass (in newtons per m/s) over the lag of the propeller, `K_iu` an eighth of it per lag.
///
/// # Failure modes
///
/// Gains hold at one speed and in one mode. The law ignores sway and lags: the vessel leaves the path at the start of a
/// turn. A vessel whose drag falls with speed (at take-off) oscillates with a low speed gain. Without speed there is no
/// steering: [`Status::Singular`].
#[derive(Clone, Debug)]
pub struct Autopilot {
    options: AutopilotOptions,
    sight: LineOfSight,
    actuators: Actuators,
    heading: f64,
    speed: f64,
}

impl Autopilot {
    /// An autopilot with samples of `dt` seconds; `limits` of propeller and rudder.
    ///
    /// # Errors
    /// If options or limits are out of range.
    pub fn new(limits: &[Limits; 2], dt: f64, options: AutopilotOptions) -> Result<Self, ControlError> {
        let AutopilotOptions { line_of_sight, heading, speed, steerage, tolerance } = options;
        positive("the proportional gain of the heading", heading.proportional)?;
        at_least("the integral gain of the heading", heading.integral, 0.0)?;
        at_least("the derivative gain of the heading", heading.derivative, 0.0)?;
        at_least("the gain of the turn", heading.turn, 0.0)?;
        positive("the speed of the gains of the heading", heading.speed)?;
        at_least("the exponent of the speed", heading.exponent, 0.0)?;
        positive("the proportional gain of the speed", speed.proportional)?;
        at_least("the integral gain of the speed", speed.integral, 0.0)?;
        for trim in speed.trim {
            at_least("the magnitude of the trim", trim.abs(), 0.0)?;
        }
        positive("the speed of steerage", steerage)?;
        positive("the tolerance", tolerance)?;
        let lookahead = line_of_sight.lookahead;
        positive("the look-ahead distance", lookahead)?;
        // Only the other option can then be wrong.
        let sight = LineOfSight::new(line_of_sight).map_err(|_| ControlError::Setting {
            what: "the integral gain of the line of sight",
            value: line_of_sight.integral,
            needed: "a number of 0 or more is needed",
        })?;
        let actuators = Actuators::new(&[Channel::default(); 2], limits, dt, 0.0)?;
        Ok(Self { options, sight, actuators, heading: 0.0, speed: 0.0 })
    }
}

impl Controller for Autopilot {
    fn inputs(&self) -> usize {
        2
    }

    fn reset(&mut self) {
        self.sight.reset();
        self.actuators.reset();
        (self.heading, self.speed) = (0.0, 0.0);
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.actuators.visit_state(memory);
        memory.number(self.sight.integral_mut());
        memory.number(&mut self.heading);
        memory.number(&mut self.speed);
    }

    fn command(&mut self, estimate: &Estimate<'_>, reference: &Reference, command: &mut [f64]) -> Status {
        if !(estimate.is_finite() && reference.is_finite()) {
            self.actuators.hold(command);
            return Status::Blind;
        }
        let AutopilotOptions { heading, speed, steerage, tolerance, .. } = self.options;
        let [x, y, psi] = estimate.eta;
        let [u, _, r] = estimate.nu;
        let dt = self.actuators.dt();
        let [north, east, _] = pose_rate(psi, estimate.nu);
        let aim = self.sight.update(&reference.pose(), [x, y], [north, east], dt);

        let off = wrap(aim.heading - psi);
        let scale = Float::powf(heading.speed / u.max(steerage), heading.exponent);
        let rudder = scale
            * (heading.turn * aim.rate
                + heading.proportional * off
                + heading.integral * self.heading
                + heading.derivative * (aim.rate - r));
        let slow = reference.speed - u;
        let propeller = speed.trim[0]
            + speed.trim[1] * reference.speed
            + speed.proportional * slow
            + speed.integral * self.speed;
        let wanted = [propeller, rudder];
        command.copy_from_slice(&wanted);
        let applied = self.actuators.limit(command);
        // Back-calculation: the limited part of the command as an error.
        let taken = |i: usize, gain: f64| (command[i] - wanted[i]) / gain;
        self.speed += dt * (slow + taken(0, speed.proportional));
        self.heading += dt * (off + taken(1, scale * heading.proportional));

        let mut status = Status::Tracking;
        if applied.rate_limited {
            status = status.and(Status::RateLimited);
        }
        if applied.saturated {
            status = status.and(Status::Saturated);
        }
        // Distance from the projection onto the path: the cross-track error, or more if the projection was lost.
        let [ahead, aside] = [x - reference.position[0], y - reference.position[1]];
        if Float::hypot(ahead, aside) > tolerance {
            status = status.and(Status::Lost);
        }
        if u < steerage {
            status = status.and(Status::Singular);
        }
        status
    }
}
