//! A model that runs freely.

use hydroid_core::current::in_body;

use super::error::PlantError;
use super::free_run::FreeRun;
use super::outside::Belief;
use crate::log::Trajectory;
use crate::model::{MOTION, Model};

/// Units of the outputs of the motion.
const UNITS: [&str; 3] = ["m/s", "m/s", "rad/s"];

/// A plant in motion: the model predicts its next outputs from its own, without measurements.
///
/// The pose follows the motion by [`arc`]. A vessel without the output `v` does not drift through the water.
///
/// A committee runs as in a rollout: each member by itself, and the outputs are the medians.
#[derive(Clone, Debug)]
pub struct Simulation {
    run: FreeRun,
    motion: Motion,
    current: [f64; 2],
    eta: [f64; 3],
    samples: usize,
    belief: Belief,
}

/// Pose after a sample of `dt` seconds: the vessel moves on an arc with the means of the body velocities `nu` at its ends.
///
/// ```text
/// psi' = psi + r dt
/// [x', y'] = [x, y] + R(psi + r dt / 2) [u, v] sinc(r dt / 2) dt + [V_n, V_e] dt,    sinc(a) = sin(a) / a
/// ```
///
/// This is exact in a steady turn, and of second order in `dt` otherwise. Position north, east \[m\], heading \[rad\]
/// clockwise from north; `u` forward, `v` to starboard, relative to the water \[m/s\], `r` to starboard \[rad/s\]; current
/// `V_n` north, `V_e` east \[m/s\].
pub fn arc([x, y, psi]: [f64; 3], [before, after]: [[f64; 3]; 2], current: [f64; 2], dt: f64) -> [f64; 3] {
    let [u, v, r] = std::array::from_fn(|i| 0.5 * (before[i] + after[i]));
    let half = 0.5 * r * dt;
    let length = dt * if half.abs() < 1e-6 { 1.0 } else { half.sin() / half };
    let (sin, cos) = (psi + half).sin_cos();
    let [north, east] = current.map(|velocity| velocity * dt);
    [x + length * (u * cos - v * sin) + north, y + length * (u * sin + v * cos) + east, psi + 2.0 * half]
}

/// Indices of surge, sway and yaw rate in the outputs of a model.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    u: usize,
    v: Option<usize>,
    r: usize,
}

impl Motion {
    /// The indices in the outputs of a model.
    ///
    /// # Errors
    /// If the model has no output `u` or `r`, or one with another unit.
    pub fn of(model: &Model) -> Result<Self, PlantError> {
        let outputs = &model.description.outputs;
        let find = |i: usize| -> Result<Option<usize>, PlantError> {
            let place = outputs.iter().position(|port| port.channel.name == MOTION[i]);
            if let Some(place) = place {
                let unit = &outputs[place].channel.unit;
                if !unit.is_empty() && unit != UNITS[i] {
                    return Err(PlantError::Unit { name: MOTION[i], unit: unit.clone(), needed: UNITS[i] });
                }
            }
            Ok(place)
        };
        let known = || outputs.iter().map(|port| port.channel.name.as_str()).collect::<Vec<_>>().join(", ");
        let needed =
            |i: usize| find(i)?.ok_or_else(|| PlantError::NoMotion { missing: MOTION[i], known: known() });
        Ok(Self { u: needed(0)?, v: find(1)?, r: needed(2)? })
    }

    /// The places of surge, sway and yaw rate in the outputs.
    pub const fn places(&self) -> [Option<usize>; 3] {
        [Some(self.u), self.v, Some(self.r)]
    }

    /// Surge, sway and yaw rate in a row of outputs; no sway where it is not an output.
    pub fn nu(&self, y: &[f64]) -> [f64; 3] {
        [y[self.u], self.v.map_or(0.0, |v| y[v]), y[self.r]]
    }
}

impl Simulation {
    /// A simulation of a model with constant weights, at the origin, in still water. [`start`](Self::start) or
    /// [`start_after`](Self::start_after) begins it.
    ///
    /// # Errors
    /// If the model has no output `u` or `r`, or one with another unit.
    pub fn new(model: &Model) -> Result<Self, PlantError> {
        Ok(Self::with(FreeRun::new(model), Motion::of(model)?, Belief::of(model)))
    }

    /// A simulation for each member of the model's ensemble or committee. Their spread reflects the uncertainty of the model.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_members(model: &Model) -> Result<Vec<Self>, PlantError> {
        let (motion, belief) = (Motion::of(model)?, Belief::of(model));
        Ok(FreeRun::of_members(model).into_iter().map(|run| Self::with(run, motion, belief)).collect())
    }

    fn with(run: FreeRun, motion: Motion, belief: Belief) -> Self {
        Self { run, motion, current: [0.0; 2], eta: [0.0; 3], samples: 0, belief }
    }

    /// The simulation of a trial that begins with the present motion: no order of it pushes the vessel more.
    #[must_use]
    pub(crate) fn after_approach(self) -> Self {
        let [u, v, _] = self.nu();
        Self { belief: self.belief.below_speed(u.hypot(v)), ..self }
    }

    /// The simulation in water that moves with a constant velocity, north and east \[m/s\].
    #[must_use]
    pub fn with_current(self, current: [f64; 2]) -> Self {
        Self { current, ..self }
    }

    /// Velocity of the water, north and east \[m/s\].
    pub const fn current(&self) -> [f64; 2] {
        self.current
    }

    /// Starts at a pose in a steady motion with the outputs `y` (through the water): the command `c` has been held for a long time.
    ///
    /// # Panics
    /// If `y` or `c` have another length than outputs and inputs.
    pub fn start(&mut self, eta: [f64; 3], y: &[f64], c: &[f64]) {
        self.run.start(y, c);
        (self.eta, self.samples) = (eta, 0);
    }

    /// Number of samples on which predictions depend at least, the present one included.
    pub const fn warm_up(&self) -> usize {
        self.run.warm_up()
    }

    /// Starts at a pose after a past: rows of outputs (through the water), the last of which is the present, and the
    /// commands between them.
    ///
    /// # Panics
    /// If there are fewer rows than [`warm_up`](Self::warm_up), or one command too many or too few.
    pub fn start_after(&mut self, eta: [f64; 3], outputs: &[f64], commands: &[f64]) {
        self.run.start_after(outputs, commands);
        (self.eta, self.samples) = (eta, 0);
    }

    /// Starts at the sample `k` of a run at a pose, after up to `past` samples. Measured velocities over ground become those
    /// through the water of the current; missing values are the last ones.
    pub(crate) fn start_in(&mut self, run: &Trajectory, k: usize, past: usize, eta: [f64; 3]) {
        let from = k.saturating_sub(past.max(self.warm_up()));
        let missing = (self.warm_up() + from).saturating_sub(k + 1);
        let Motion { u, v, .. } = self.motion;
        let n = self.outputs().len();
        let mut outputs: Vec<f64> = Vec::new();
        let mut commands: Vec<f64> = Vec::new();
        for sample in std::iter::repeat_n(from, missing).chain(from..=k) {
            let mut row = run.outputs.row(sample).to_vec();
            let heading = run.heading_at(sample);
            let [surge, sway] = in_body(self.current, if heading.is_finite() { heading } else { eta[2] });
            row[u] -= surge;
            if let Some(v) = v {
                row[v] -= sway;
            }
            for (c, value) in row.iter_mut().enumerate().filter(|(_, value)| !value.is_finite()) {
                *value = outputs.len().checked_sub(n).map_or(0.0, |last| outputs[last + c]);
            }
            outputs.extend(row);
            if sample < k {
                commands.extend_from_slice(run.inputs.row(sample));
            }
        }
        // A start within the first samples of a run repeats its first command.
        let rows = outputs.len() / n;
        let inputs = run.inputs.width();
        while commands.len() < (rows - 1) * inputs {
            commands.splice(..0, run.inputs.row(from).iter().copied());
        }
        self.start_after(eta, &outputs, &commands);
    }

    /// The next sample, with the command `c` held up to it.
    ///
    /// # Panics
    /// If `c` has another length than the inputs.
    pub fn advance(&mut self, c: &[f64]) {
        let before = self.motion.nu(self.run.outputs());
        self.run.advance(c);
        let after = self.motion.nu(self.run.outputs());
        self.eta = arc(self.eta, [before, after], self.current, self.run.dt());
        self.samples += 1;
    }

    /// Moves the vessel to a pose.
    pub fn place(&mut self, eta: [f64; 3]) {
        (self.eta, self.samples) = (eta, 0);
    }

    /// Sets the motion in a row of outputs to zero.
    pub(crate) fn at_rest(&self, outputs: &mut [f64]) {
        self.motion.places().into_iter().flatten().for_each(|place| outputs[place] = 0.0);
    }

    /// Sets the surge velocity in a row of outputs, and the yaw rate to zero.
    pub(crate) fn on_course(&self, outputs: &mut [f64], surge: f64) {
        outputs[self.motion.u] = surge;
        outputs[self.motion.r] = 0.0;
    }

    /// Surge velocity in a row of outputs.
    pub(crate) fn surge_of(&self, outputs: &[f64]) -> f64 {
        outputs[self.motion.u]
    }

    /// Pose `[x, y, psi]`: north, east \[m\], heading \[rad\], clockwise from north and not wrapped.
    pub const fn eta(&self) -> [f64; 3] {
        self.eta
    }

    /// Heading \[rad\], clockwise from north, not wrapped.
    pub const fn heading(&self) -> f64 {
        self.eta[2]
    }

    /// Body velocities `[u, v, r]` through the water.
    pub fn nu(&self) -> [f64; 3] {
        self.motion.nu(self.outputs())
    }

    /// Body velocities `[u, v, r]` over ground.
    pub fn nu_over_ground(&self) -> [f64; 3] {
        let [u, v, r] = self.nu();
        let [surge, sway] = in_body(self.current, self.eta[2]);
        [u + surge, v + sway, r]
    }

    /// Outputs of the model; the motion is through the water.
    pub fn outputs(&self) -> &[f64] {
        self.run.outputs()
    }

    /// Outputs of the model, with the motion over ground.
    pub fn outputs_over_ground(&self) -> Vec<f64> {
        let mut row = self.outputs().to_vec();
        let [u, v, _] = self.nu_over_ground();
        row[self.motion.u] = u;
        if let Some(place) = self.motion.v {
            row[place] = v;
        }
        row
    }

    /// The water moves with another velocity from now on; the velocity over ground stays.
    pub(crate) fn change_current(&mut self, current: [f64; 2]) {
        let change = [0, 1].map(|axis| current[axis] - self.current[axis]);
        let [surge, sway] = in_body(change, self.eta[2]);
        let mut shift = vec![0.0; self.outputs().len()];
        shift[self.motion.u] = -surge;
        if let Some(v) = self.motion.v {
            shift[v] = -sway;
        }
        self.shift(&shift);
        self.current = current;
    }

    /// Adds a disturbance to the outputs.
    pub(crate) fn shift(&mut self, by: &[f64]) {
        self.run.shift(by);
    }

    /// Sample time \[s\].
    pub const fn dt(&self) -> f64 {
        self.run.dt()
    }

    /// An error if the motion is not finite.
    ///
    /// # Errors
    /// [`PlantError::Diverged`].
    pub fn check(&self) -> Result<(), PlantError> {
        if self.nu().iter().chain(&self.eta).all(|x| x.is_finite()) {
            return Ok(());
        }
        Err(PlantError::Diverged { t_s: self.samples as f64 * self.dt() })
    }

    /// Why the present motion is not to be believed; `None` if it is.
    pub fn not_valid(&self) -> Option<String> {
        self.belief.breach(self.nu())
    }
}

/// The current that a model estimates from the samples of a run before one of them, north and east \[m/s\]; zero for a
/// model of the motion over ground.
pub fn current_before(model: &Model, run: &Trajectory, sample: usize) -> [f64; 2] {
    if model.description.current.is_none() {
        return [0.0; 2];
    }
    let mut session = model.frozen().session();
    for k in 0..sample.min(run.len()) {
        session.observe_heading(run.heading_at(k));
        session.observe(run.outputs.row(k));
        session.advance(run.inputs.row(k));
    }
    session.current().map_or([0.0; 2], |current| current.velocity)
}

/// Outputs at which a search starts: the middle of the ranges, without sway and yaw rate.
pub(crate) fn middle(model: &Model) -> Vec<f64> {
    let middle = |port: &crate::model::Port| match port.channel.name.as_str() {
        "v" | "r" => 0.0_f64.clamp(port.range.low, port.range.high),
        _ => 0.5 * (port.range.low + port.range.high),
    };
    model.description.outputs.iter().map(middle).collect()
}
