//! The true plant under current, wind, mass error and command delay.

use std::collections::VecDeque;

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
        let mut vessel = vessel.clone();
        vessel.rigid_body.mass *= conditions.mass;
        vessel.rigid_body.i_z *= conditions.mass;
        let plant = Plant::new(&vessel)?;
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
        let (steps, delay) = (steps as u32, delay as usize);
        Ok(Self {
            plant,
            state: State::REST,
            current: conditions.current,
            gusts: Gusts::new(conditions.wind, conditions.seed, dt_s),
            steps,
            h: dt_s / f64::from(steps),
            delayed: std::iter::repeat_n(idle, delay).collect(),
        })
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
        let (sin, cos) = self.state.psi.sin_cos();
        let [north, east] = self.current;
        State {
            u: self.state.u + (north * cos + east * sin),
            v: self.state.v + (east * cos - north * sin),
            ..self.state
        }
    }

    /// Integrates over one sample; the command acts after the delay.
    pub(super) fn advance(&mut self, command: Command) {
        self.delayed.push_back(command);
        let applied = self.delayed.pop_front().unwrap_or(command);
        let actuation = self.plant.actuation(&applied);
        let ([north, east], [to_north, to_east]) = (self.current, self.gusts.next());
        let rate = |x: &[f64; State::LEN]| {
            let state = State::from(*x);
            let (sin, cos) = state.psi.sin_cos();
            let force = [to_north * cos + to_east * sin, to_east * cos - to_north * sin, 0.0];
            let push = self.plant.pushed(state.u, force);
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
    }
}
