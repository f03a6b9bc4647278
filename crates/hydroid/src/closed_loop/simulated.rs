//! An identified model as the true plant.

use std::sync::Arc;

use rand_distr::{Distribution as _, StandardNormal};

use super::disturbance::{Conditions, Wind};
use super::error::ClosedLoopError;
use super::plant::DelayLine;
use super::random::{Purpose, stream};
use crate::model::Model;
use crate::plant::{Simulation, middle, process_deviations};

/// A model that runs freely, under current, process noise and command delay.
pub(super) struct SimulatedModel {
    simulation: Simulation,
    model: Arc<Model>,
    current: [f64; 2],
    /// Samples before the onset of the current.
    calm: usize,
    /// Standard deviations of the process noise in a sample.
    process: Option<Vec<f64>>,
    shift: Vec<f64>,
    random: rand_chacha::ChaCha8Rng,
    idle: Vec<f64>,
    applied: Vec<f64>,
    delay: DelayLine,
}

impl SimulatedModel {
    pub(super) fn new(
        model: &Arc<Model>,
        conditions: &Conditions,
        dt_s: f64,
        idle: &[f64],
        delay: DelayLine,
    ) -> Result<Self, ClosedLoopError> {
        let own = model.description.dt;
        if (dt_s / own - 1.0).abs() > 1e-6 {
            return Err(ClosedLoopError::PlantStep { dt_s, own_s: own });
        }
        for (what, given) in
            [("wind", conditions.wind != Wind::CALM), ("another mass", conditions.mass != 1.0)]
        {
            if given {
                return Err(ClosedLoopError::NeedsVessel { what });
            }
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked, not negative")]
        let calm = (conditions.onset_s / dt_s).round() as usize;
        let mut simulation = Simulation::new(model)?;
        if calm == 0 {
            simulation = simulation.with_current(conditions.current);
        }
        Ok(Self {
            simulation,
            model: Arc::clone(model),
            current: conditions.current,
            calm,
            process: process_deviations(model, conditions.process_noise),
            shift: vec![0.0; model.description.outputs.len()],
            random: stream(conditions.seed, Purpose::Process),
            idle: idle.to_vec(),
            applied: idle.to_vec(),
            delay,
        })
    }

    pub(super) fn place(&mut self, eta: [f64; 3], surge: f64) {
        let mut y = middle(&self.model);
        self.simulation.on_course(&mut y, surge);
        self.simulation.start(eta, &y, &self.idle);
    }

    pub(super) const fn eta(&self) -> [f64; 3] {
        self.simulation.eta()
    }

    pub(super) fn nu(&self) -> [f64; 3] {
        self.simulation.nu_over_ground()
    }

    pub(super) fn write_outputs(&self, y: &mut [f64]) {
        y.copy_from_slice(&self.simulation.outputs_over_ground());
    }

    pub(super) fn advance(&mut self, command: &[f64]) {
        self.applied.copy_from_slice(command);
        self.delay.exchange(&mut self.applied);
        self.simulation.advance(&self.applied);
        if let Some(process) = &self.process {
            for (shift, sigma) in self.shift.iter_mut().zip(process) {
                let white: f64 = StandardNormal.sample(&mut self.random);
                *shift = sigma * white;
            }
            self.simulation.shift(&self.shift);
        }
        if self.calm > 0 {
            self.calm -= 1;
            if self.calm == 0 {
                self.simulation.change_current(self.current);
            }
        }
    }
}
