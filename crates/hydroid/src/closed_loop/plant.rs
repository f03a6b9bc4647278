//! The true plant under current, wind, mass error and command delay.

use std::collections::VecDeque;

use hydroid_core::current::in_body;
use hydroid_core::vessel::{Command, Plant, State, VesselParams, rk4};

use super::disturbance::{Conditions, Gusts};
use super::error::ClosedLoopError;

/// Integration step \[s\].
pub(super) const STEP_S: f64 = 0.01;

/// A vessel under the conditions of a run.
///
/// The equations of motion use velocities `nu` relative to the water. A steady irrotational current enters the
/// kinematics only, `deta/dt = R(psi) nu + [V_n, V_e, 0]` (Fossen 2021, property 10.1). Wind is a force on the hull.
pub(super) struct PerturbedPlant {
    plant: Plant,
    /// Velocities through the water.
    state: State,
    current: [f64; 2],
    gusts: Gusts,
    /// Samples before the onset of the conditions.
    calm: usize,
    /// Plant and current from the onset on.
    perturbed: Option<(Plant, [f64; 2])>,
    steps: u32,
    h: f64,
    delayed: VecDeque<Command>,
}

impl PerturbedPlant {
    /// Plant at rest; the delay line is filled with `idle`.
    pub(super) fn new(
        vessel: &VesselParams,
        conditions: &Conditions,
        dt_s: f64,
        idle: Command,
    ) -> Result<Self, ClosedLoopError> {
        let mut perturbed = vessel.clone();
        perturbed.rigid_body.mass *= conditions.mass;
        perturbed.rigid_body.i_z *= conditions.mass;
        let perturbed = Plant::new(&perturbed)?;
        let steps = (dt_s / STEP_S).round();
        if !((1.0..1e5).contains(&steps) && (steps * STEP_S - dt_s).abs() <= 1e-9 * dt_s) {
            return Err(ClosedLoopError::Substeps { dt_s, step_s: STEP_S });
        }
        let delay = (conditions.delay_s / dt_s).round();
        if delay > 1e4 {
            return Err(ClosedLoopError::Option {
                what: "the delay",
                value: conditions.delay_s,
                needed: "fewer than 10,000 samples are needed",
            });
        }
        if (delay * dt_s - conditions.delay_s).abs() > 1e-6 * dt_s {
            return Err(ClosedLoopError::Delay { delay_s: conditions.delay_s, dt_s });
        }
        // Both are small and positive.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let (steps, delay, calm) =
            (steps as u32, delay as usize, (conditions.onset_s / dt_s).round() as usize);
        let mut whole = Self {
            plant: Plant::new(vessel)?,
            state: State::REST,
            current: [0.0; 2],
            calm,
            perturbed: Some((perturbed, conditions.current)),
            gusts: Gusts::new(conditions.wind, conditions.seed, dt_s),
            steps,
            h: dt_s / f64::from(steps),
            delayed: std::iter::repeat_n(idle, delay).collect(),
        };
        if calm == 0 {
            whole.perturb();
        }
        Ok(whole)
    }

    /// The conditions set in. The velocity over ground stays.
    fn perturb(&mut self) {
        let Some((plant, current)) = self.perturbed.take() else { return };
        let change = [current[0] - self.current[0], current[1] - self.current[1]];
        let [surge, sway] = in_body(change, self.state.psi);
        self.state.u -= surge;
        self.state.v -= sway;
        (self.plant, self.current) = (plant, current);
    }

    pub(super) fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Sets the state, with velocities through the water.
    pub(super) fn place(&mut self, state: State) {
        self.state = state;
    }

    /// The state with velocities over ground.
    pub(super) fn over_ground(&self) -> State {
        let [surge, sway] = in_body(self.current, self.state.psi);
        State { u: self.state.u + surge, v: self.state.v + sway, ..self.state }
    }

    /// Integrates over one sample; the command acts after the delay.
    pub(super) fn advance(&mut self, command: Command) {
        self.delayed.push_back(command);
        let applied = self.delayed.pop_front().unwrap_or(command);
        let actuation = self.plant.actuation(&applied);
        let (north, east) = (self.current[0], self.current[1]);
        let force = if self.perturbed.is_none() { self.gusts.next() } else { [0.0; 2] };
        let rate = |x: &[f64; State::LEN]| {
            let state = State::from(*x);
            let [ahead, starboard] = in_body(force, state.psi);
            let push = self.plant.pushed(state.u, [ahead, starboard, 0.0]);
            let mut rate = self.plant.derivative_under(&state, &actuation);
            rate.x += north;
            rate.y += east;
            rate.u += push[0];
            rate.v += push[1];
            rate.r += push[2];
            rate.into()
        };
        let mut x: [f64; State::LEN] = self.state.into();
        for _ in 0..self.steps {
            x = rk4::step(rate, &x, self.h);
        }
        self.state = x.into();
        if self.perturbed.is_some() {
            self.calm = self.calm.saturating_sub(1);
            if self.calm == 0 {
                self.perturb();
            }
        }
    }
}
