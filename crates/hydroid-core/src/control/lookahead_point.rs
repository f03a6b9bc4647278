//! The lookahead point, which two commands can accelerate in any direction.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::Estimate;
use super::actuators::Actuators;
use super::affine::{Affine, Motion, check_count};
use super::allocate::allocate_within;
use super::error::{ControlError, positive};
use super::status::Status;
use crate::actuator::Limits;
use crate::guidance::Reference;
use crate::memory::Memory;

/// The point `p` of [`FeedbackLinearization`](super::FeedbackLinearization), `l` metres ahead of the origin of a model,
/// with `d2p/dt2 = R(psi) (d + B tau)`, and the commands that accelerate it.
///
/// `B` has rank 2 if the rudder has force, because `l g_ir` does not vanish: the point is fully actuated. The internal
/// dynamics are the heading, which follows the point like a trailer: `d psi/dt = (U sin(chi - psi) - v) / l` for a
/// point with speed `U` and course `chi`.
#[derive(Clone, Debug)]
pub(super) struct LookaheadPoint<M> {
    model: M,
    /// The model before an update; allocated by the first update.
    before: Option<M>,
    motion: Motion,
    actuators: Actuators,
    columns: Vec<[f64; 2]>,
    spans: Vec<f64>,
    bounds: Vec<[f64; 2]>,
    efforts: Vec<f64>,
    distance: f64,
    min_control_authority: f64,
    braking: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PointError {
    /// Reference minus point, north and east \[m\].
    pub(super) position: [f64; 2],
    /// Rate of the position error \[m/s\].
    pub(super) velocity: [f64; 2],
}

impl PointError {
    pub(super) fn distance(&self) -> f64 {
        Float::hypot(self.position[0], self.position[1])
    }
}

impl<M: Affine> LookaheadPoint<M> {
    /// `distance` metres ahead; `min_control_authority` \[m/s^2\] as for [`allocate_within`].
    pub(super) fn new(
        model: M,
        limits: &[Limits],
        dt: f64,
        response: f64,
        distance: f64,
        min_control_authority: f64,
    ) -> Result<Self, ControlError> {
        positive("the lookahead distance", distance)?;
        positive("the minimum control authority", min_control_authority)?;
        check_count(model.channels(), limits)?;
        // A command without a range has no share in the demand.
        if let Some(channel) = limits.iter().position(Limits::are_held) {
            return Err(ControlError::Limits { channel });
        }
        let inputs = limits.len();
        let actuators = Actuators::new(model.channels(), limits, dt, response)?;
        let spans = (0..inputs).map(|i| actuators.span(i)).collect();
        Ok(Self {
            model,
            before: None,
            motion: Motion::new(inputs),
            actuators,
            columns: vec![[0.0; 2]; inputs],
            spans,
            bounds: vec![[0.0; 2]; inputs],
            efforts: vec![0.0; inputs],
            distance,
            min_control_authority,
            braking: None,
        })
    }

    /// Does not drive the vessel astern: the speed through the water `u >= 0` is kept invariant by the barrier
    /// `du/dt >= -rate u` on the demand (A. D. Ames, S. Coogan, M. Egerstedt, G. Notomista, K. Sreenath and P. Tabuada, *Control
    /// barrier functions: theory and applications*, European Control Conference, 2019).
    pub(super) fn keep_ahead(self, rate: f64) -> Self {
        Self { braking: Some(rate), ..self }
    }

    pub(super) fn model(&self) -> &M {
        &self.model
    }

    /// Changes the model, or restores it if a channel is not invertible any more.
    pub(super) fn update(&mut self, change: impl FnOnce(&mut M)) -> Result<(), ControlError>
    where
        M: Clone,
    {
        let Self { model, before, actuators, .. } = self;
        match before {
            Some(before) => before.clone_from(model),
            None => *before = Some(model.clone()),
        }
        change(model);
        if let Err(error) = actuators.set_channels(model.channels()) {
            if let Some(before) = before {
                core::mem::swap(model, before);
            }
            return Err(error);
        }
        for (i, span) in self.spans.iter_mut().enumerate() {
            *span = self.actuators.span(i);
        }
        Ok(())
    }

    pub(super) fn inputs(&self) -> usize {
        self.spans.len()
    }

    pub(super) fn dt(&self) -> f64 {
        self.actuators.dt()
    }

    pub(super) fn reset(&mut self) {
        self.actuators.reset();
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.actuators.visit_state(memory);
    }

    pub(super) fn hold(&mut self, command: &mut [f64]) -> Status {
        self.actuators.hold(command);
        Status::Blind
    }

    pub(super) fn error(&self, estimate: &Estimate<'_>, reference: &Reference) -> PointError {
        let [x, y, psi] = estimate.eta;
        let l = self.distance;
        let (sin, cos) = Float::sin_cos(psi);
        let point = [x + l * cos, y + l * sin];
        let velocity = self.velocity(estimate);
        PointError {
            position: core::array::from_fn(|i| reference.position[i] - point[i]),
            velocity: core::array::from_fn(|i| reference.velocity[i] - velocity[i]),
        }
    }

    pub(super) fn velocity(&self, estimate: &Estimate<'_>) -> [f64; 2] {
        let [u, v, r] = estimate.nu;
        let (sin, cos) = Float::sin_cos(estimate.eta[2]);
        let side = v + self.distance * r;
        [u * cos - side * sin, u * sin + side * cos]
    }

    /// Accelerates the point by `wanted` (north, east) \[m/s^2\] within the limits of the actuators. Returns the
    /// status, and the achieved acceleration minus `wanted`.
    ///
    /// A frame that drifts with a constant current is an inertial frame: the acceleration of the point is that in the
    /// water, with velocities through the water.
    pub(super) fn accelerate(
        &mut self,
        estimate: &Estimate<'_>,
        wanted: [f64; 2],
        command: &mut [f64],
    ) -> (Status, [f64; 2]) {
        let [_, _, psi] = estimate.eta;
        let nu = estimate.through_water();
        let [u, v, r] = nu;
        let l = self.distance;
        self.actuators.observe(estimate.actuators);
        self.model.evaluate(nu, &mut self.motion);
        let [f_u, f_v, f_r] = self.motion.f;
        for (column, [g_u, g_v, g_r]) in self.columns.iter_mut().zip(&self.motion.g) {
            *column = [*g_u, g_v + l * g_r];
        }
        let (sin, cos) = Float::sin_cos(psi);
        let [north, east] = wanted;
        let least = self.braking.map_or(f64::NEG_INFINITY, |rate| -rate * u);
        let surge = north * cos + east * sin + r * (v + l * r);
        let body = [surge.max(least) - f_u, east * cos - north * sin - (f_v + l * f_r + u * r)];
        for (i, bounds) in self.bounds.iter_mut().enumerate() {
            *bounds = self.actuators.reach(i);
        }
        let Self { columns, spans, bounds, efforts, .. } = self;
        let sigma = allocate_within(columns, spans, bounds, body, self.min_control_authority, efforts);
        let applied = self.actuators.apply(&self.efforts, command);
        let mut missing = [f_u - surge, -body[1]];
        for (i, [g_u, g_v, g_r]) in self.motion.g.iter().enumerate() {
            let effort = self.actuators.effort(i);
            missing = [missing[0] + g_u * effort, missing[1] + (g_v + l * g_r) * effort];
        }
        let [x, y] = missing;
        let mut status = Status::Tracking;
        if applied.rate_limited {
            status = status.and(Status::RateLimited);
        }
        if applied.saturated {
            status = status.and(Status::Saturated);
        }
        // NaN, from a diverged model, is singular as well.
        if sigma.is_nan() || sigma < self.min_control_authority {
            status = status.and(Status::Singular);
        }
        (status, [x * cos - y * sin, x * sin + y * cos])
    }
}

/// The vector, scaled to a norm of at most `most`.
#[inline]
pub(super) fn shortened([x, y]: [f64; 2], most: f64) -> [f64; 2] {
    let length = Float::hypot(x, y);
    if length > most { [x * (most / length), y * (most / length)] } else { [x, y] }
}
