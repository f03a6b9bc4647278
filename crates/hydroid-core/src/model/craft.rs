//! A vessel with any set of actuators as a model.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;
use pulp::Arch;

use crate::craft::{BatchRollout, Craft, Dynamics, LANES, MAX_SERVOS};
use crate::predict::{Predictor, Workspace, plain, rollout_each, rollout_steps};
use crate::vessel::Dual;

/// Reasons why a vessel cannot be a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum CraftModelError {
    #[error(transparent)]
    Craft(crate::craft::InvalidCraft),
    #[error("a sample time of {0} s is out of range: give a positive number of seconds")]
    Step(f64),
    #[error(
        "the speeds of the vessel diverge within the limits of its commands: check drag, thrust, and the limits of the commands"
    )]
    Unbounded,
}

/// A [`Craft`] over samples with held commands: outputs `u, v, r`, inputs its commands, hidden states the positions of its
/// actuators.
///
/// A sample is a whole number of Runge-Kutta steps `h` with `h lambda <= 0.2`, where `lambda` bounds the eigenvalues of the
/// equations of motion and the reciprocals of the lags, in runs from rest to the limits of the commands. The local error of
/// such a step is about `(h lambda)^5 / 120 = 3e-6` of the change of the motion.
#[derive(Clone, Debug, PartialEq)]
pub struct CraftModel {
    craft: Craft,
    dynamics: Arc<Dynamics>,
    dt: f64,
    steps: usize,
    ranges: [[f64; 2]; 3],
    position_ranges: Vec<[f64; 2]>,
    learned: Vec<Vec<usize>>,
}

/// Step relative to the shortest time constant.
const RELATIVE_STEP: f64 = 0.2;

/// Longest integration step \[s\].
const LONGEST_STEP_S: f64 = 0.5;

/// Largest number of steps in a sample.
const MOST_STEPS: f64 = 1e4;

/// A run has settled if the motion changed by less than this share of its range over the last quarter.
const SETTLED: f64 = 1e-3;

/// Longest run \[steps\].
const LONGEST_RUN: usize = 1 << 14;

impl CraftModel {
    /// Outputs: `u`, `v`, `r`.
    pub const OUTPUTS: usize = 3;

    /// A model with samples of `dt` seconds.
    ///
    /// # Errors
    /// See [`CraftModelError`].
    pub fn new(craft: Craft, dt: f64) -> Result<Self, CraftModelError> {
        craft.validate().map_err(CraftModelError::Craft)?;
        if !(dt.is_finite() && dt > 0.0 && dt <= 1e4) {
            return Err(CraftModelError::Step(dt));
        }
        let dynamics = Dynamics::new(&craft);
        let (ranges, step) = explore(&craft, &dynamics).ok_or(CraftModelError::Unbounded)?;
        let steps = Float::ceil(dt / step - 1e-9).max(1.0);
        if steps.is_nan() || steps > MOST_STEPS {
            return Err(CraftModelError::Step(dt));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 1 and 10,000")]
        let steps = steps as usize;
        let position_ranges = orders(&craft, &dynamics);
        let learned = craft.adaptable().into_iter().map(|index| vec![index]).collect();
        Ok(Self { dynamics: Arc::new(dynamics), craft, dt, steps, ranges, position_ranges, learned })
    }

    /// The model with other numbers for an [adaptation](crate::adapt::kalman::LearnablePlant): their indices in
    /// [`Craft::parameters`], those that are equal in one group.
    ///
    /// # Panics
    /// If a group is empty, or an index is not one of a number.
    #[must_use]
    pub fn with_learned(self, learned: Vec<Vec<usize>>) -> Self {
        let count = self.craft.parameters().len();
        let valid = |group: &Vec<usize>| !group.is_empty() && group.iter().all(|&index| index < count);
        assert!(learned.iter().all(valid), "groups of indices of numbers");
        Self { learned, ..self }
    }

    /// Indices of the numbers that an adaptation learns, in [`Craft::parameters`]; those of one group are equal.
    pub fn learned(&self) -> &[Vec<usize>] {
        &self.learned
    }

    /// Lowest and highest order of each servo under combinations of the limits of the commands, in the order of
    /// [`Dynamics`].
    pub fn position_ranges(&self) -> &[[f64; 2]] {
        &self.position_ranges
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

fn orders(craft: &Craft, dynamics: &Dynamics) -> Vec<[f64; 2]> {
    let mut positions = [0.0; MAX_SERVOS];
    let mut ranges = vec![[0.0, 0.0]; dynamics.servos()];
    for corner in corners(craft) {
        dynamics.settle(&corner, &mut positions);
        for ([low, high], order) in ranges.iter_mut().zip(positions) {
            (*low, *high) = (low.min(order), high.max(order));
        }
    }
    ranges
}

/// Largest row sum of the Jacobian of the equations of motion \[1/s\], with the yaw rate times the radius of gyration.
fn stiffness(dynamics: &Dynamics<Dual<3>>, radius: f64, nu: [f64; 3], positions: &[f64]) -> f64 {
    let scale = [1.0, 1.0, 1.0 / radius];
    let nu = core::array::from_fn(|i| Dual::along(nu[i], i, scale[i]));
    let mut at = [Dual::along(0.0, 3, 0.0); MAX_SERVOS];
    for (at, position) in at.iter_mut().zip(positions) {
        *at = Dual::along(*position, 3, 0.0);
    }
    let rates = dynamics.acceleration(nu, &at[..positions.len()]);
    let row = |i: usize| rates[i].partials.iter().map(|p| Float::abs(*p)).sum::<f64>() / scale[i];
    (0..3).map(row).fold(0.0, f64::max)
}

/// Ranges of the motion, and the integration step; `None` if the motion is not finite.
fn explore(craft: &Craft, dynamics: &Dynamics) -> Option<([[f64; 2]; 3], f64)> {
    let [_, m22, _, m33] = craft.hull.mass_matrix();
    let radius = Float::sqrt(m33 / m22);
    let differentiated: Dynamics<Dual<3>> = {
        let numbers: Vec<Dual<3>> =
            craft.parameters().iter().map(|(_, number)| Dual::along(*number, 3, 0.0)).collect();
        Dynamics::new(&craft.with_numbers(&numbers))
    };
    let slowest = RELATIVE_STEP * dynamics.shortest_lag();
    let mut ranges = [[0.0_f64; 2]; 3];
    let mut shortest = LONGEST_STEP_S.min(slowest);
    let servos = dynamics.servos();
    for command in corners(craft) {
        let mut nu = [0.0; 3];
        let mut positions = [0.0; MAX_SERVOS];
        let mut before = nu;
        let mut next_check = 64;
        for k in 0..LONGEST_RUN {
            let lambda = stiffness(&differentiated, radius, nu, &positions[..servos]);
            let step = (RELATIVE_STEP / lambda).min(LONGEST_STEP_S).min(slowest);
            dynamics.advance(&mut nu, &mut positions[..servos], &command, step, 1);
            if !nu.iter().all(|x| Float::abs(*x) < 1e6) {
                return None;
            }
            shortest = shortest.min(step);
            for (range, x) in ranges.iter_mut().zip(nu) {
                *range = [range[0].min(x), range[1].max(x)];
            }
            if 4 * k == 3 * next_check {
                before = nu;
            }
            if k == next_check {
                let settled =
                    |i: usize| Float::abs(nu[i] - before[i]) <= SETTLED * (ranges[i][1] - ranges[i][0]);
                if (0..3).all(settled) {
                    break;
                }
                next_check *= 2;
            }
        }
    }
    Some((ranges, shortest))
}

/// A session of a [`CraftModel`]: `u`, `v` and `r` are measured or predicted. The actuators follow the commands; at the
/// start of a run they are at rest under the first one, but a lone linear propeller holds the measured speed. The snapshot is
/// `[u, v, r, positions]`, NaN where unknown.
#[derive(Clone, Debug)]
pub struct CraftSession {
    dynamics: Dynamics,
    inputs: usize,
    h: f64,
    steps: usize,
    nu: [f64; 3],
    positions: Vec<f64>,
    arch: Arch,
}

impl CraftSession {
    /// A session at the start of a run.
    pub fn new(model: &CraftModel) -> Self {
        Self {
            dynamics: Dynamics::clone(&model.dynamics),
            inputs: model.craft.commands.len(),
            h: model.dt / model.steps as f64,
            steps: model.steps,
            nu: [f64::NAN; 3],
            positions: vec![f64::NAN; model.dynamics.servos()],
            arch: Arch::new(),
        }
    }

    /// Whether an output has not been measured yet.
    pub fn is_waiting(&self) -> bool {
        self.nu.iter().any(|x| x.is_nan())
    }

    /// Positions of a run that starts with the command `c`.
    pub(crate) fn start(&self, positions: &mut [f64], c: &[f64]) {
        self.dynamics.settle_unknown(c, positions);
    }

    /// Velocities, and positions of the actuators; NaN where unknown.
    pub fn motion(&self) -> ([f64; 3], &[f64]) {
        (self.nu, &self.positions)
    }

    pub(crate) fn motion_mut(&mut self) -> (&mut [f64; 3], &mut [f64]) {
        (&mut self.nu, &mut self.positions)
    }

    pub(crate) fn set_craft(&mut self, craft: &Craft) {
        self.dynamics.set(craft);
    }

    /// Sets unknown positions to those of the command `c`, held for a long time. Returns whether they were unknown.
    pub(crate) fn settle(&mut self, c: &[f64]) -> bool {
        self.dynamics.settle_unknown(c, &mut self.positions)
    }

    /// Sets the positions of actuators that follow the command at once.
    pub(crate) fn follow(&mut self, c: &[f64]) {
        self.dynamics.follow(c, &mut self.positions);
    }
}

impl Predictor for CraftSession {
    plain!(warm_up over_ground advance_observe rollout_snapshots);

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
        self.dynamics.hold(self.nu[0], &mut self.positions);
    }

    fn advance(&mut self, c: &[f64]) {
        if c.iter().any(|c| !c.is_finite()) {
            return self.reset();
        }
        let mut positions = [f64::NAN; MAX_SERVOS];
        let positions = &mut positions[..self.positions.len()];
        positions.copy_from_slice(&self.positions);
        self.dynamics.settle_unknown(c, positions);
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
            self.dynamics.settle_unknown(c, positions);
            self.dynamics.advance(&mut nu, positions, c, self.h, self.steps);
            y.copy_from_slice(&nu);
        }
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, self.inputs, y, 3);
        if count == 0 || y.is_empty() {
            return;
        }
        if !self.dynamics.is_polynomial() {
            return rollout_each(self, count, commands, work, y);
        }
        assert!(y.len().is_multiple_of(count * 3), "whole sequences");
        let (inputs, outputs) = (commands.len() / count, y.len() / count);
        for (commands, y) in commands.chunks(LANES * inputs).zip(y.chunks_mut(LANES * outputs)) {
            self.arch.dispatch(BatchRollout {
                dynamics: &self.dynamics,
                nu: self.nu,
                positions: &self.positions,
                h: self.h,
                steps: self.steps,
                count: y.len() / outputs,
                inputs: self.inputs,
                commands,
                y,
            });
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
