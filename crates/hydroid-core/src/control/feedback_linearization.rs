//! Feedback linearization of a lookahead point.

use super::affine::Affine;
use super::error::{ControlError, at_least, positive};
use super::lookahead_point::{LookaheadPoint, shortened};
use super::status::Status;
use super::{Controller, Estimate};
use crate::actuator::Limits;
use crate::guidance::Reference;
use crate::memory::Memory;

/// Options of [`FeedbackLinearization`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedbackLinearizationOptions {
    /// Distance `l` of the lookahead point from the origin \[m\], at least half a length of the vessel. The heading
    /// follows within about `l / U` seconds.
    pub lookahead: f64,
    /// `k_p` \[1/s^2\].
    pub proportional: f64,
    /// `k_d` \[1/s\].
    pub derivative: f64,
    /// `k_i` \[1/s^3\]; 0 for none. Stability requires `k_i < k_p k_d`; start with a fifth of it.
    pub integral: f64,
    /// Largest closing speed relative to the reference \[m/s\].
    pub closing_speed: f64,
    /// Control authority below which [`allocate`](super::allocate) damps the demand \[m/s^2\] ([`Status::Singular`]).
    pub min_control_authority: f64,
    /// Distance from the reference above which the status is [`Status::Lost`] \[m\].
    pub tolerance: f64,
    /// Response time of the actuators \[s\] ([`Actuators`](super::Actuators)).
    pub response: f64,
    /// Whether the vessel is driven ahead only: a demand to go astern brakes it, with the rate of the velocity error, and no more.
    /// References must move forward; a station needs both directions.
    pub ahead: bool,
}

impl FeedbackLinearizationOptions {
    /// A lookahead distance \[m\], `omega` = 1.5 rad/s and `zeta` = 0.7; no integral.
    pub fn new(lookahead: f64) -> Self {
        Self {
            lookahead,
            proportional: 0.0,
            derivative: 0.0,
            integral: 0.0,
            closing_speed: 1.0,
            min_control_authority: 0.05,
            tolerance: 2.0,
            response: 0.0,
            ahead: false,
        }
        .with_bandwidth(1.5, 0.7)
    }

    /// These options with `k_p = omega^2`, `k_d = 2 zeta omega` for a natural frequency \[rad/s\] and a damping ratio.
    #[must_use]
    pub fn with_bandwidth(self, omega: f64, zeta: f64) -> Self {
        Self { proportional: omega * omega, derivative: 2.0 * zeta * omega, ..self }
    }
}

/// Feedback linearization of a point `l` metres ahead of the origin, on any [`Affine`] model.
///
/// # Law
///
/// With the point `p = [x, y] + l [cos psi, sin psi]`, the error `e = p_d - p`, and `d`, `B` of the model
/// (accelerations of the point in the body frame without efforts, and per unit of effort):
///
/// ```text
/// w    = d2p_d/dt2 + k_d de/dt + k_p e + k_i integral(e)
/// d    = [f_u - r (v + l r), f_v + l f_r + u r]
/// B_i  = [g_iu, g_iv + l g_ir]
/// tau  = B^-1 (R(psi)' w - d),     then actuators: c_i from phi_i and their lags
/// ```
///
/// For a perfect model the error obeys `d2e/dt2 + k_d de/dt + k_p e + k_i integral(e) = 0`. The closing speed, and so
/// `k_p e`, is limited to `closing_speed`.
///
/// Sources: input-output linearization, A. Isidori, *Nonlinear Control Systems*, 3rd ed., 1995, section 5.3 (vector
/// relative degree `[2, 2]`); for marine craft T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion
/// Control*, 2nd ed., 2021, chapter 16 (state feedback linearization).
///
/// # Assumptions
///
/// Pose and velocities over ground are measured; a current, if there is one, is part of the estimate; the model is affine
/// in known maps of its commands. The point is ahead
/// of the pivot point of the rudder, `l > -g_v / g_r`: behind it, the rudder first moves the point the other way. The
/// internal dynamics (heading and sway) are stable in forward motion with damped sway.
///
/// # Tuning
///
/// A model error of `a` m/s^2 causes an error of `a / k_p` metres. White noise of `n` m/s in the velocity of the point
/// at samples of `h` seconds causes `n sqrt(h k_d / (2 k_p))` metres. `omega` must stay below about `0.3 / h` and below
/// the bandwidth of the actuators. The integral compensates constant disturbances (wind) and slows the response.
///
/// # Failure modes
///
/// - Without speed the rudder has no force: [`Status::Singular`]; the propeller acts alone.
/// - In reverse the heading is unstable. References must move forward.
/// - Only [`Status::Lost`] indicates a model error of the size of the demand (a polynomial for a hydrofoil at
///   take-off).
/// - With saturated commands ([`Status::Saturated`]) the integral follows the achieved acceleration (back-calculation,
///   K. J. Astrom and T. Hagglund, *Advanced PID Control*, 2006, section 3.5).
#[derive(Clone, Debug)]
pub struct FeedbackLinearization<M> {
    point: LookaheadPoint<M>,
    options: FeedbackLinearizationOptions,
    integral: [f64; 2],
}

impl<M: Affine> FeedbackLinearization<M> {
    /// A controller with samples of `dt` seconds.
    ///
    /// # Errors
    /// If options, limits or lags are out of range, or the model has fewer than two commands.
    pub fn new(
        model: M,
        limits: &[Limits],
        dt: f64,
        options: FeedbackLinearizationOptions,
    ) -> Result<Self, ControlError> {
        positive("the proportional gain", options.proportional)?;
        positive("the derivative gain", options.derivative)?;
        at_least("the integral gain", options.integral, 0.0)?;
        if options.integral >= options.proportional * options.derivative {
            return Err(ControlError::Setting {
                what: "the integral gain",
                value: options.integral,
                needed: "less than the product of the other two is needed for stability",
            });
        }
        positive("the closing speed", options.closing_speed)?;
        positive("the tolerance", options.tolerance)?;
        let FeedbackLinearizationOptions { lookahead, min_control_authority, response, .. } = options;
        let point = LookaheadPoint::new(model, limits, dt, response, lookahead, min_control_authority)?;
        let point = if options.ahead { point.keep_ahead(options.derivative) } else { point };
        Ok(Self { point, options, integral: [0.0; 2] })
    }

    /// The model.
    pub fn model(&self) -> &M {
        self.point.model()
    }

    /// Changes the model and its channels after an update of an adapted model. Later calls allocate only if
    /// `clone_from` of the model does.
    ///
    /// # Errors
    /// If a channel is not invertible any more. Model and law stay as they were.
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

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.point.visit_state(memory);
        memory.numbers(&mut self.integral);
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

    pub(super) fn velocity(&self, estimate: &Estimate<'_>) -> [f64; 2] {
        self.point.velocity(estimate)
    }

    /// The command against a disturbance acceleration of the point (north, east), and the acceleration that the model
    /// predicts.
    pub(super) fn command_against(
        &mut self,
        estimate: &Estimate<'_>,
        reference: &Reference,
        disturbance: [f64; 2],
        command: &mut [f64],
    ) -> (Status, [f64; 2]) {
        let FeedbackLinearizationOptions { proportional, derivative, integral, .. } = self.options;
        let error = self.point.error(estimate, reference);
        // A limit on the speed: the vessel approaches at the closing speed from any distance.
        let closing =
            shortened(error.position.map(|e| e * (proportional / derivative)), self.options.closing_speed);
        let wanted: [f64; 2] = core::array::from_fn(|i| {
            reference.acceleration[i]
                + derivative * (error.velocity[i] + closing[i])
                + integral * self.integral[i]
                - disturbance[i]
        });
        let (mut status, missing) = self.point.accelerate(estimate, wanted, command);
        if integral > 0.0 {
            // The missing acceleration is removed within the time constant of the proportional part.
            let back = proportional / (derivative * integral);
            for i in 0..2 {
                let rate = closing[i] * (derivative / proportional) + back * missing[i];
                if rate.is_finite() {
                    self.integral[i] += rate * self.point.dt();
                }
            }
        }
        if error.distance() > self.options.tolerance {
            status = status.and(Status::Lost);
        }
        (status, [wanted[0] + missing[0], wanted[1] + missing[1]])
    }
}
