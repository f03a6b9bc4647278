//! A vessel with given parameters under current, wind, mass error and command delay.

use hydroid_core::current::in_body;
use hydroid_core::vessel::{Command, Plant, State, VesselParams, rk4};

use super::disturbance::{Conditions, Gusts};
use super::error::ClosedLoopError;
use super::plant::DelayLine;

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
    delay: DelayLine,
}

impl PerturbedPlant {
    /// Plant at rest.
    pub(super) fn new(
        vessel: &VesselParams,
        conditions: &Conditions,
        dt_s: f64,
        delay: DelayLine,
    ) -> Result<Self, ClosedLoopError> {
        let mut perturbed = vessel.clone();
        perturbed.rigid_body.mass *= conditions.mass;
        perturbed.rigid_body.i_z *= conditions.mass;
        let perturbed = Plant::new(&perturbed)?;
        let steps = (dt_s / STEP_S).round();
        if !((1.0..1e5).contains(&steps) && (steps * STEP_S - dt_s).abs() <= 1e-9 * dt_s) {
            return Err(ClosedLoopError::Substeps { dt_s, step_s: STEP_S });
        }
        // Both are small and positive.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let (steps, calm) = (steps as u32, (conditions.onset_s / dt_s).round() as usize);
        let mut whole = Self {
            plant: Plant::new(vessel)?,
            state: State::REST,
            current: [0.0; 2],
            calm,
            perturbed: Some((perturbed, conditions.current)),
            gusts: Gusts::new(conditions.wind, conditions.seed, dt_s),
            steps,
            h: dt_s / f64::from(steps),
            delay,
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

    /// Places the vessel at a pose on a steady course, with a surge velocity through the water.
    pub(super) fn place(&mut self, [x, y, psi]: [f64; 3], surge: f64) {
        let p_f = self.plant.holding_force(surge);
        self.state = State { x, y, psi, u: surge, p_f, ..State::REST };
    }

    pub(super) const fn eta(&self) -> [f64; 3] {
        [self.state.x, self.state.y, self.state.psi]
    }

    /// Velocities over ground.
    pub(super) fn nu(&self) -> [f64; 3] {
        let [surge, sway] = in_body(self.current, self.state.psi);
        [self.state.u + surge, self.state.v + sway, self.state.r]
    }

    pub(super) fn write_outputs(&self, y: &mut [f64]) {
        let [u, v, r] = self.nu();
        y.copy_from_slice(&[u, v, r, self.state.p_f]);
    }

    /// Integrates over one sample; the command acts after the delay.
    pub(super) fn advance(&mut self, command: Command) {
        let mut applied = [command.pp, command.rd];
        self.delay.exchange(&mut applied);
        let actuation = self.plant.actuation(&Command { pp: applied[0], rd: applied[1] });
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
