//! A vessel with any set of actuators as a model.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::plant::PlantModelError;
use crate::craft::{Craft, Dynamics, MAX_SERVOS};
use crate::predict::{Predictor, Workspace, rollout_steps};

/// A [`Craft`] over samples with held commands: outputs `u, v, r`, inputs its commands, hidden states the positions of its
/// actuators.
///
/// A sample is a whole number of Runge-Kutta steps. Their number is doubled until twice as many give the same motion to
/// 1e-7 of its range in every sample of the runs from rest to the limits of the commands (step doubling; E. Hairer, S. P.
/// Norsett and G. Wanner, *Solving Ordinary Differential Equations I*, 1993, section II.4).
#[derive(Clone, Debug, PartialEq)]
pub struct CraftModel {
    craft: Craft,
    dynamics: Arc<Dynamics>,
    dt: f64,
    steps: usize,
    ranges: [[f64; 2]; 3],
}

/// Change of a sample by twice as many steps, relative to the range of the motion.
const TOLERANCE: f64 = 1e-7;

/// Shortest integration step relative to the sample.
const MOST_STEPS: usize = 1 << 14;

/// Longest integration step \[s\].
const LONGEST_STEP_S: f64 = 0.5;

/// A run has settled if the motion changed by less than this share of its range over the last quarter.
const SETTLED: f64 = 1e-3;

/// Longest run \[samples\].
const LONGEST_RUN: usize = 20_000;

impl CraftModel {
    /// A model with samples of `dt` seconds.
    ///
    /// # Errors
    /// See [`PlantModelError`].
    pub fn new(craft: Craft, dt: f64) -> Result<Self, PlantModelError> {
        craft.validate().map_err(PlantModelError::Craft)?;
        if !(dt.is_finite() && dt > 0.0 && dt <= 1e4) {
            return Err(PlantModelError::Step(dt));
        }
        let dynamics = Dynamics::new(&craft);
        let mut steps = 1;
        while dt / steps as f64 > LONGEST_STEP_S {
            steps *= 2;
        }
        loop {
            match ranges(&craft, &dynamics, dt, steps) {
                Some((ranges, error)) if error <= TOLERANCE => {
                    return Ok(Self { dynamics: Arc::new(dynamics), craft, dt, steps, ranges });
                }
                _ if steps >= MOST_STEPS => return Err(PlantModelError::Unbounded),
                _ => steps *= 2,
            }
        }
    }

    /// The vessel.
    pub fn craft(&self) -> &Craft {
        &self.craft
    }

    /// The equations of motion.
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// Sample time \[s\].
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Number of integration steps in a sample.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Lowest and highest `u`, `v`, `r` from rest under combinations of the limits of the commands.
    pub fn ranges(&self) -> &[[f64; 2]; 3] {
        &self.ranges
    }
}

/// Combinations of the limits: all high, all low, each alone, and each with the others high.
fn corners(craft: &Craft) -> Vec<Vec<f64>> {
    let all = |end: usize| craft.commands.iter().map(|c| c.limits[end]).collect::<Vec<f64>>();
    let neutral: Vec<f64> = craft.commands.iter().map(|c| c.neutral).collect();
    let mut corners = vec![all(1), all(0)];
    for (index, command) in craft.commands.iter().enumerate() {
        for base in [neutral.clone(), all(1)] {
            for value in command.limits {
                let mut corner = base.clone();
                corner[index] = value;
                corners.push(corner);
            }
        }
    }
    corners
}

/// Ranges of the motion, and the largest change of a sample by twice as many steps; `None` if it is not finite.
fn ranges(craft: &Craft, dynamics: &Dynamics, dt: f64, steps: usize) -> Option<([[f64; 2]; 3], f64)> {
    let mut ranges = [[0.0_f64; 2]; 3];
    let mut errors = [0.0_f64; 3];
    let servos = dynamics.servos();
    for command in corners(craft) {
        let mut nu = [0.0; 3];
        let mut positions = [0.0; MAX_SERVOS];
        let mut before = nu;
        let mut next_check = 64;
        for k in 0..LONGEST_RUN {
            let mut fine = nu;
            let mut fine_positions = positions;
            let h = dt / steps as f64;
            dynamics.advance(&mut fine, &mut fine_positions[..servos], &command, 0.5 * h, 2 * steps);
            dynamics.advance(&mut nu, &mut positions[..servos], &command, h, steps);
            for i in 0..3 {
                if !fine[i].is_finite() || Float::abs(fine[i]) > 1e6 {
                    return None;
                }
                ranges[i] = [ranges[i][0].min(fine[i]), ranges[i][1].max(fine[i])];
                errors[i] = errors[i].max(Float::abs(fine[i] - nu[i]));
            }
            nu = fine;
            positions = fine_positions;
            if 4 * k == 3 * next_check {
                before = nu;
            }
            if k == next_check {
                let moved = |i: usize| Float::abs(nu[i] - before[i]);
                let settled = |i: usize| moved(i) <= SETTLED * (ranges[i][1] - ranges[i][0]);
                if (0..3).all(settled) {
                    break;
                }
                next_check *= 2;
            }
        }
    }
    let error = (0..3).map(|i| errors[i] / (ranges[i][1] - ranges[i][0]).max(1e-9)).fold(0.0, f64::max);
    Some((ranges, error))
}

/// A session of a [`CraftModel`]: `u`, `v` and `r` are measured or predicted. The actuators follow the commands; at the
/// start of a run they are at rest under the first one. The snapshot is `[u, v, r, positions]`, NaN where unknown.
#[derive(Clone, Debug)]
pub struct CraftSession {
    dynamics: Arc<Dynamics>,
    inputs: usize,
    h: f64,
    steps: usize,
    nu: [f64; 3],
    positions: Vec<f64>,
}

impl CraftSession {
    /// A session at the start of a run.
    pub fn new(model: &CraftModel) -> Self {
        Self {
            dynamics: Arc::clone(&model.dynamics),
            inputs: model.craft.commands.len(),
            h: model.dt / model.steps as f64,
            steps: model.steps,
            nu: [f64::NAN; 3],
            positions: vec![f64::NAN; model.dynamics.servos()],
        }
    }

    fn is_waiting(&self) -> bool {
        self.nu.iter().any(|x| x.is_nan())
    }

    fn start(&self, positions: &mut [f64], c: &[f64]) {
        if positions.iter().any(|position| position.is_nan()) {
            self.dynamics.settle(c, positions);
        }
    }
}

impl Predictor for CraftSession {
    fn outputs(&self) -> usize {
        3
    }

    fn inputs(&self) -> usize {
        self.inputs
    }

    fn reset(&mut self) {
        self.nu = [f64::NAN; 3];
        self.positions.fill(f64::NAN);
    }

    fn observe(&mut self, y: &[f64]) {
        for (own, y) in self.nu.iter_mut().zip(y) {
            *own = if y.is_finite() { *y } else { *own };
        }
    }

    fn advance(&mut self, c: &[f64]) {
        if c.iter().any(|c| !c.is_finite()) {
            return self.reset();
        }
        let mut positions = [f64::NAN; MAX_SERVOS];
        let positions = &mut positions[..self.positions.len()];
        positions.copy_from_slice(&self.positions);
        self.start(positions, c);
        if self.is_waiting() {
            // Before the start of a run, measured values are held; the actuators move.
            self.dynamics.move_servos(positions, c, self.h * self.steps as f64);
        } else {
            self.dynamics.advance(&mut self.nu, positions, c, self.h, self.steps);
            if !self.nu.iter().all(|x| x.is_finite()) {
                return self.reset();
            }
        }
        self.positions.copy_from_slice(positions);
    }

    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(&self.nu);
    }

    fn rollout(&self, commands: &[f64], _: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, self.inputs, y, 3);
        let mut nu = self.nu;
        let mut positions = [f64::NAN; MAX_SERVOS];
        let positions = &mut positions[..self.positions.len()];
        positions.copy_from_slice(&self.positions);
        for (c, y) in commands.chunks_exact(self.inputs).zip(y.chunks_exact_mut(3)) {
            self.start(positions, c);
            self.dynamics.advance(&mut nu, positions, c, self.h, self.steps);
            y.copy_from_slice(&nu);
        }
    }

    fn snapshot_len(&self) -> usize {
        3 + self.positions.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        into[..3].copy_from_slice(&self.nu);
        into[3..].copy_from_slice(&self.positions);
    }

    fn restore(&mut self, from: &[f64]) {
        self.nu.copy_from_slice(&from[..3]);
        self.positions.copy_from_slice(&from[3..]);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}
