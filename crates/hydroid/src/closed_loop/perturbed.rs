//! A vessel with given parameters under current, wind, mass error and command delay.

use hydroid_core::craft::{Craft, Dynamics, Posed};
use hydroid_core::current::in_body;
use hydroid_core::model::CraftModel;

use super::disturbance::{Conditions, Gusts};
use super::error::ClosedLoopError;
use super::plant::DelayLine;
use crate::excitation::PropellerRudder;
use crate::plant::PlantError;

/// Longest integration step \[s\].
const STEP_S: f64 = 0.01;

/// A vessel under the conditions of a run.
///
/// The equations of motion use velocities `nu` relative to the water. A steady irrotational current enters the
/// kinematics only, `deta/dt = R(psi) nu + [V_n, V_e, 0]` (Fossen 2021, property 10.1). Wind is a force on the hull.
pub(super) struct PerturbedPlant {
    craft: Craft,
    dynamics: Dynamics,
    /// Velocities through the water.
    state: Posed,
    current: [f64; 2],
    gusts: Gusts,
    /// Samples before the onset of the conditions.
    calm: usize,
    /// Equations of motion and current from the onset on.
    perturbed: Option<(Dynamics, [f64; 2])>,
    steps: usize,
    h: f64,
    idle: Vec<f64>,
    applied: Vec<f64>,
    /// Indices of the thrusters in the order of the outputs.
    forces: Vec<usize>,
    delay: DelayLine,
}

/// Indices of the thrusters: those whose force is measured, then the others.
pub(super) fn forces(craft: &Craft) -> Vec<usize> {
    let mut all: Vec<usize> = (0..craft.thrusters.len()).collect();
    all.sort_by_key(|&index| craft.thrusters[index].force_noise.is_none());
    all
}

impl PerturbedPlant {
    /// Plant at rest.
    pub(super) fn new(
        craft: &Craft,
        conditions: &Conditions,
        dt_s: f64,
        idle: &[f64],
        delay: DelayLine,
    ) -> Result<Self, ClosedLoopError> {
        let mut perturbed = craft.clone();
        perturbed.hull.mass *= conditions.mass;
        perturbed.hull.i_z *= conditions.mass;
        let model = |craft: Craft| CraftModel::new(craft, dt_s).map_err(PlantError::from);
        let (plant, perturbed) = (model(craft.clone())?, model(perturbed)?);
        // Both are positive and bounded, as the sample time is.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let (finest, calm) =
            ((dt_s / STEP_S - 1e-9).ceil() as usize, (conditions.onset_s / dt_s).round() as usize);
        let steps = finest.max(plant.steps()).max(perturbed.steps());
        let mut positions = vec![0.0; plant.dynamics().servos()];
        plant.dynamics().settle(idle, &mut positions);
        let mut whole = Self {
            craft: craft.clone(),
            dynamics: plant.dynamics().clone(),
            state: Posed { eta: [0.0; 3], nu: [0.0; 3], positions },
            current: [0.0; 2],
            calm,
            perturbed: Some((perturbed.dynamics().clone(), conditions.current)),
            gusts: Gusts::new(conditions.wind, conditions.seed, dt_s),
            steps,
            h: dt_s / steps as f64,
            idle: idle.to_vec(),
            applied: idle.to_vec(),
            forces: forces(craft),
            delay,
        };
        if calm == 0 {
            whole.perturb();
        }
        Ok(whole)
    }

    /// The conditions set in. The velocity over ground stays.
    fn perturb(&mut self) {
        let Some((dynamics, current)) = self.perturbed.take() else { return };
        let change = [current[0] - self.current[0], current[1] - self.current[1]];
        let [surge, sway] = in_body(change, self.state.eta[2]);
        self.state.nu[0] -= surge;
        self.state.nu[1] -= sway;
        (self.dynamics, self.current) = (dynamics, current);
    }

    /// Places the vessel at a pose on a straight course, with a surge velocity through the water. A single propeller has the
    /// force that holds the speed, and other actuators are at rest.
    pub(super) fn place(&mut self, eta: [f64; 3], surge: f64) {
        let mut command = self.idle.clone();
        if let Ok(vessel) = PropellerRudder::new(&self.craft) {
            let force = self.dynamics.holding_force(surge);
            command = vessel.row(vessel.held(force)).to_vec();
        }
        self.dynamics.settle(&command, &mut self.state.positions);
        (self.state.eta, self.state.nu) = (eta, [surge, 0.0, 0.0]);
    }

    pub(super) const fn eta(&self) -> [f64; 3] {
        self.state.eta
    }

    /// Velocities over ground.
    pub(super) fn nu(&self) -> [f64; 3] {
        let [surge, sway] = in_body(self.current, self.state.eta[2]);
        let [u, v, r] = self.state.nu;
        [u + surge, v + sway, r]
    }

    pub(super) fn write_outputs(&self, y: &mut [f64]) {
        y[..3].copy_from_slice(&self.nu());
        for (index, force) in self.dynamics.thrusts(self.state.nu, &self.state.positions).enumerate() {
            if let Some(place) = self.forces.iter().position(|&of| of == index) {
                y[3 + place] = force;
            }
        }
    }

    /// Integrates over one sample; the command acts after the delay.
    pub(super) fn advance(&mut self, command: &[f64]) {
        self.applied.copy_from_slice(command);
        self.delay.exchange(&mut self.applied);
        let force = if self.perturbed.is_none() { self.gusts.next() } else { [0.0; 2] };
        let Self { dynamics, state, applied, h, steps, current, .. } = self;
        dynamics.advance_pose(state, applied, *h, *steps, *current, force);
        if self.perturbed.is_some() {
            self.calm = self.calm.saturating_sub(1);
            if self.calm == 0 {
                self.perturb();
            }
        }
    }
}
