//! Feedback linearization of a point ahead of the vessel.

use super::affine::Affine;
use super::error::{ControlError, at_least, positive};
use super::lookahead_point::{LookaheadPoint, shortened};
use super::status::Status;
use super::{Controller, Estimate};
use crate::actuator::Limits;
use crate::guidance::Reference;

/// How a point ahead of a vessel is brought to its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedbackLinearizationOptions {
    /// Distance `l` of the point ahead of the origin \[m\]: half a length of the vessel or more. The heading follows
    /// within about `l / U` seconds.
    pub ahead: f64,
    /// `k_p` \[1/s^2\].
    pub proportional: f64,
    /// `k_d` \[1/s\].
    pub derivative: f64,
    /// `k_i` \[1/s^3\]; 0 for none. Less than `k_p k_d`, or the loop is unstable; a tenth of that is a good start.
    pub integral: f64,
    /// The speed over that of the reference at which a distance is closed at most \[m/s\].
    pub closing_speed: f64,
    /// Where all actuators together give less than this acceleration in some direction, the status is
    /// [`Status::Singular`], and what is asked for there is damped \[m/s^2\].
    pub min_control_authority: f64,
    /// Farther than this from the reference, the status is [`Status::Lost`] \[m\].
    pub tolerance: f64,
    /// Time given to actuators with a lag \[s\]: see [`Actuators`](super::Actuators).
    pub response: f64,
}

impl FeedbackLinearizationOptions {
    /// A point so many metres ahead, its error like that of a damped oscillator: `k_p = omega^2`, `k_d = 2 zeta omega`
    /// with `omega` = 1.5 rad/s and `zeta` = 0.7; no integral.
    pub fn new(ahead: f64) -> Self {
        Self {
            ahead,
            proportional: 0.0,
            derivative: 0.0,
            integral: 0.0,
            closing_speed: 1.0,
            min_control_authority: 0.05,
            tolerance: 2.0,
            response: 0.0,
        }
        .with_bandwidth(1.5, 0.7)
    }

    /// With the gains of a natural frequency `omega` \[rad/s\] and a damping ratio `zeta`.
    #[must_use]
    pub fn with_bandwidth(self, omega: f64, zeta: f64) -> Self {
        Self { proportional: omega * omega, derivative: 2.0 * zeta * omega, ..self }
    }
}

/// Feedback linearization of a point `l` metres ahead of the origin, on any [`Affine`] model.
///
/// # Law
///
/// With the point `p = [x, y] + l [cos psi, sin psi]`, the error `e = p_d - p`, and `d`, `B` of the model (accelerations
/// of the point in the body frame without efforts, and what efforts add):
///
/// ```text
/// w    = d2p_d/dt2 + k_d de/dt + k_p e + k_i integral(e)
/// d    = [f_u - r (v + l r), f_v + l f_r + u r]
/// B_i  = [g_iu, g_iv + l g_ir]
/// tau  = B^-1 (R(psi)' w - d),     then actuators: c_i from phi_i and their lags
/// ```
///
/// so that, where model and vessel agree, `d2e/dt2 + k_d de/dt + k_p e + k_i integral(e) = 0`. `k_p e` is kept so short
/// that a distance is closed at `closing_speed` at most.
///
/// Source: input-output linearization, A. Isidori, *Nonlinear Control Systems*, 3rd ed., 1995, section 5.3 (vector
/// relative degree `[2, 2]`); for marine craft T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*,
/// 2nd ed., 2021, chapter 16 (state feedback linearization).
///
/// # Assumptions
///
/// Pose and velocities over ground are measured; the model is affine in known maps of its commands; the vessel moves
/// forward. The point is ahead of the one that a rudder turns the vessel about, `l > -g_v / g_r`: behind it a rudder moves
/// the point the other way first. What the point does not show is the heading, which follows it like a trailer, and sway;
/// both settle in forward motion if sway is damped.
///
/// # Tuning
///
/// `omega` and `zeta`: an error of the model of `a` m/s^2 leaves `a / k_p` metres; white noise of `n` m/s in the velocity
/// of the point at samples of `h` seconds makes `n sqrt(h k_d / (2 k_p))` metres; and `omega` must stay below about `0.3 /
/// h`, and below what the actuators can follow. The integral is for what is constant north and east (wind); it is not
/// needed to track with a good model, and slows the answer.
///
/// # When it fails
///
/// - Without speed the rudder has no force: [`Status::Singular`], the propeller alone does what it can.
/// - Backwards the heading is unstable: the vessel turns round. References shall move forward.
/// - A model with errors of the size of what is asked for (a polynomial for a hydrofoil that takes off) leaves errors of
///   the same size, and none of them shows in the status but by [`Status::Lost`].
/// - Commands at their limits: [`Status::Saturated`]; the integral then follows what was possible (back-calculation, K. J.
///   Astrom and T. Hagglund, *Advanced PID Control*, 2006, section 3.5).
#[derive(Clone, Debug)]
pub struct FeedbackLinearization<M> {
    point: LookaheadPoint<M>,
    settings: FeedbackLinearizationOptions,
    integral: [f64; 2],
}

impl<M: Affine> FeedbackLinearization<M> {
    /// A controller that is asked every `dt` seconds.
    ///
    /// # Errors
    /// If settings, limits or lags are not possible, or the model has fewer than two commands.
    pub fn new(
        model: M,
        limits: &[Limits],
        dt: f64,
        settings: FeedbackLinearizationOptions,
    ) -> Result<Self, ControlError> {
        positive("the proportional gain", settings.proportional)?;
        positive("the derivative gain", settings.derivative)?;
        at_least("the integral gain", settings.integral, 0.0)?;
        if settings.integral >= settings.proportional * settings.derivative {
            return Err(ControlError::Setting {
                what: "the integral gain",
                value: settings.integral,
                needed: "less than the product of the other two is needed for stability",
            });
        }
        positive("the closing speed", settings.closing_speed)?;
        positive("the tolerance", settings.tolerance)?;
        let FeedbackLinearizationOptions { ahead, min_control_authority, response, .. } = settings;
        let point = LookaheadPoint::new(model, limits, dt, response, ahead, min_control_authority)?;
        Ok(Self { point, settings, integral: [0.0; 2] })
    }

    /// The model.
    pub fn model(&self) -> &M {
        self.point.model()
    }

    /// Lets the model change, as one that learns does; its channels are taken over. Nothing is allocated after the first
    /// time, where a model's `clone_from` does not.
    ///
    /// # Errors
    /// If a channel cannot be inverted any more: the model is what it was before, and so is the law.
    pub fn update(&mut self, change: impl FnOnce(&mut M)) -> Result<(), ControlError>
    where
        M: Clone,
    {
        self.point.update(change)
    }
}

impl<M: Affine> Controller for FeedbackLinearization<M> {
    fn inputs(&self) -> usize {
        self.point.inputs()
    }

    fn reset(&mut self) {
        self.point.reset();
        self.integral = [0.0; 2];
    }

    fn command(&mut self, estimate: &Estimate<'_>, reference: &Reference, command: &mut [f64]) -> Status {
        if !(estimate.is_finite() && reference.is_finite()) {
            return self.point.hold(command);
        }
        self.command_against(estimate, reference, [0.0; 2], command).0
    }
}

impl<M: Affine> FeedbackLinearization<M> {
    pub(super) fn dt(&self) -> f64 {
        self.point.dt()
    }

    /// Velocity of the point, north and east.
    pub(super) fn velocity(&self, estimate: &Estimate<'_>) -> [f64; 2] {
        self.point.velocity(estimate)
    }

    /// The command against an acceleration of the point that the model does not know (north, east), and the acceleration
    /// that the model tells of it.
    pub(super) fn command_against(
        &mut self,
        estimate: &Estimate<'_>,
        reference: &Reference,
        disturbance: [f64; 2],
        command: &mut [f64],
    ) -> (Status, [f64; 2]) {
        let FeedbackLinearizationOptions { proportional, derivative, integral, .. } = self.settings;
        let error = self.point.error(estimate, reference);
        // A speed, so that far away the vessel comes at the closing speed, whatever the distance.
        let closing =
            shortened(error.position.map(|e| e * (proportional / derivative)), self.settings.closing_speed);
        let wanted: [f64; 2] = core::array::from_fn(|i| {
            reference.acceleration[i]
                + derivative * (error.velocity[i] + closing[i])
                + integral * self.integral[i]
                - disturbance[i]
        });
        let (mut status, missing) = self.point.accelerate(estimate, wanted, command);
        if integral > 0.0 {
            // What could not be done is taken back within the time constant of the proportional part.
            let back = proportional / (derivative * integral);
            for i in 0..2 {
                let rate = closing[i] * (derivative / proportional) + back * missing[i];
                if rate.is_finite() {
                    self.integral[i] += rate * self.point.dt();
                }
            }
        }
        if error.distance() > self.settings.tolerance {
            status = status.and(Status::Lost);
        }
        (status, [wanted[0] + missing[0], wanted[1] + missing[1]])
    }
}
