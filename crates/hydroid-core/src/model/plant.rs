//! The equations of motion of a vessel with given parameters as a model.

use alloc::boxed::Box;

use num_traits::Float;
use pulp::{Arch, Simd, WithSimd};

use crate::predict::{Predictor, Workspace, plain, rollout_steps};
use crate::vessel::{Actuation, Command, Form, Lanes, Number as _, Numbers, Plant, VesselParams};

/// The longest integration step \[s\], as in simulation (see [`Plant::advance`]).
const STEP_S: f64 = 0.01;

const MOST_STEPS: f64 = 100_000.0;

/// Command sequences of a batch that are integrated side by side.
const LANES: usize = 16;

/// Reasons why a vessel cannot be a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum PlantModelError {
    #[error(transparent)]
    Vessel(crate::vessel::InvalidParams),
    #[error(transparent)]
    Craft(crate::craft::InvalidCraft),
    #[error("a sample time of {0} s is out of range: give a positive number of seconds")]
    Step(f64),
    #[error(
        "the speeds of the vessel diverge within the limits of its commands: check drag, thrust, and the limits of the commands"
    )]
    Unbounded,
}

/// The plant of a [`VesselParams`] over samples with held commands: outputs `u, v, r`, inputs the commands of propeller
/// and rudder, hidden state the propeller force. A sample is a whole number of RK4 steps of at most 10 ms.
#[derive(Clone, Debug, PartialEq)]
pub struct PlantModel {
    params: VesselParams,
    numbers: Numbers,
    dt: f64,
    steps: usize,
    ranges: [[f64; 2]; 4],
}

impl PlantModel {
    /// Outputs: `u`, `v`, `r`.
    pub const OUTPUTS: usize = 3;

    /// Inputs: propeller and rudder command.
    pub const INPUTS: usize = 2;

    /// A model with samples of `dt` seconds.
    ///
    /// # Errors
    /// See [`PlantModelError`].
    pub fn new(params: &VesselParams, dt: f64) -> Result<Self, PlantModelError> {
        let plant = Plant::new(params).map_err(PlantModelError::Vessel)?;
        let steps = Float::ceil(dt / STEP_S - 1e-6).max(1.0);
        if !(dt > 0.0 && steps <= MOST_STEPS) {
            return Err(PlantModelError::Step(dt));
        }
        let ranges = reached(params, &plant);
        if !ranges.as_flattened().iter().all(|value| value.is_finite()) {
            return Err(PlantModelError::Unbounded);
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 1 and 100,000
        let steps = steps as usize;
        Ok(Self { params: params.clone(), numbers: params.numbers(), dt, steps, ranges })
    }

    /// The vessel.
    pub fn params(&self) -> &VesselParams {
        &self.params
    }

    /// The parameters as a flat array.
    pub fn numbers(&self) -> &Numbers {
        &self.numbers
    }

    /// The form of its equations.
    pub fn form(&self) -> Form {
        self.params.form()
    }

    /// Sample time \[s\].
    pub fn dt(&self) -> f64 {
        self.dt
    }

    /// Number of integration steps in a sample.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Lowest and highest `u`, `v`, `r` and `P_f` from rest under the corners of the command limits.
    pub fn ranges(&self) -> &[[f64; 2]; 4] {
        &self.ranges
    }
}

fn reached(params: &VesselParams, plant: &Plant) -> [[f64; 2]; 4] {
    const LONG_S: f64 = 120.0;
    let mut ranges = [[0.0, 0.0]; 4];
    let (propeller, rudder) = (&params.commands.propeller, &params.commands.rudder);
    for pp in propeller.limits {
        for rd in [rudder.limits[0], rudder.limits[1], rudder.clamp(0.0)] {
            let actuation = plant.actuation(&Command { pp, rd });
            let mut motion = [0.0; 4];
            let mut t = 0.0;
            while t < LONG_S {
                motion = plant.advance_motion(&motion, &actuation, STEP_S);
                for ([low, high], x) in ranges.iter_mut().zip(motion) {
                    // A NaN is kept.
                    *low = if x < *low || x.is_nan() { x } else { *low };
                    *high = if x > *high || x.is_nan() { x } else { *high };
                }
                t += STEP_S;
            }
        }
    }
    ranges
}

/// A session of a [`PlantModel`]: `u`, `v` and `r` are measured or predicted. The propeller force starts at the force
/// that holds the speed. A run starts once all three outputs have been measured. The snapshot is `[u, v, r, P_f]`.
#[derive(Clone, Debug)]
pub struct PlantSession {
    plant: Plant,
    /// The plant for the sequences of a batch.
    lanes: Plant<Lanes<LANES>>,
    arch: Arch,
    h: f64,
    steps: usize,
    motion: [f64; 4],
}

fn side_by_side(form: Form, numbers: &Numbers) -> Plant<Lanes<LANES>> {
    Plant::assemble(form, &numbers.map(Lanes::constant))
}

impl PlantSession {
    /// A session at the start of a run.
    pub fn new(model: &PlantModel) -> Self {
        Self {
            plant: Plant::assemble(model.form(), model.numbers()),
            lanes: side_by_side(model.form(), model.numbers()),
            arch: Arch::new(),
            h: model.dt / model.steps as f64,
            steps: model.steps,
            motion: [f64::NAN; 4],
        }
    }

    /// The present `[u, v, r, P_f]`; NaN where unknown.
    pub fn motion(&self) -> &[f64; 4] {
        &self.motion
    }

    /// Whether an output has not been measured yet.
    pub fn is_waiting(&self) -> bool {
        self.motion.iter().any(|x| x.is_nan())
    }

    fn stepped(&self, motion: &[f64; 4], c: &[f64]) -> [f64; 4] {
        let actuation = self.plant.actuation(&Command { pp: c[0], rd: c[1] });
        (0..self.steps).fold(*motion, |motion, _| self.plant.advance_motion(&motion, &actuation, self.h))
    }
}

/// Rollouts of at most [`LANES`] command sequences from one state, sequence by sequence in `commands` and `y`.
struct BatchRollout<'a> {
    session: &'a PlantSession,
    count: usize,
    commands: &'a [f64],
    y: &'a mut [f64],
}

impl WithSimd for BatchRollout<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        const INPUTS: usize = PlantModel::INPUTS;
        const OUTPUTS: usize = PlantModel::OUTPUTS;
        let Self {
            session: &PlantSession { ref plant, ref lanes, h, steps, motion, .. },
            count,
            commands,
            y,
        } = self;
        let samples = y.len() / (count * OUTPUTS);
        let mut motion = motion.map(Lanes::constant);
        let mut actuation = Actuation { pp: Lanes([0.0; LANES]), moment_per_speed: Lanes([0.0; LANES]) };
        for sample in 0..samples {
            for sequence in 0..count {
                let c = &commands[(sequence * samples + sample) * INPUTS..][..INPUTS];
                let of_sequence = plant.actuation(&Command { pp: c[0], rd: c[1] });
                actuation.pp.0[sequence] = of_sequence.pp;
                actuation.moment_per_speed.0[sequence] = of_sequence.moment_per_speed;
            }
            for _ in 0..steps {
                motion = lanes.advance_motion(&motion, &actuation, h);
            }
            for sequence in 0..count {
                let y = &mut y[(sequence * samples + sample) * OUTPUTS..][..OUTPUTS];
                y.iter_mut().zip(&motion).for_each(|(y, x)| *y = x.0[sequence]);
            }
        }
    }
}

impl Predictor for PlantSession {
    plain!(warm_up over_ground advance_observe rollout_snapshots);

    fn outputs(&self) -> usize {
        PlantModel::OUTPUTS
    }

    fn inputs(&self) -> usize {
        PlantModel::INPUTS
    }

    fn reset(&mut self) {
        self.motion = [f64::NAN; 4];
    }

    fn observe(&mut self, y: &[f64]) {
        for (own, y) in self.motion.iter_mut().zip(y) {
            *own = if y.is_finite() { *y } else { *own };
        }
        if self.motion[3].is_nan() {
            self.motion[3] = self.plant.holding_force(self.motion[0]);
        }
    }

    fn advance(&mut self, c: &[f64]) {
        // Before the start of a run, measured values are held.
        if !self.is_waiting() {
            self.motion = self.stepped(&self.motion, c);
            if !self.motion.iter().all(|x| x.is_finite()) {
                self.reset();
            }
        }
    }

    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(&self.motion[..PlantModel::OUTPUTS]);
    }

    fn rollout(&self, commands: &[f64], _: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, PlantModel::INPUTS, y, PlantModel::OUTPUTS);
        let mut motion = self.motion;
        for (c, y) in commands.chunks_exact(PlantModel::INPUTS).zip(y.chunks_exact_mut(PlantModel::OUTPUTS)) {
            motion = self.stepped(&motion, c);
            y.copy_from_slice(&motion[..PlantModel::OUTPUTS]);
        }
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], _: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, PlantModel::INPUTS, y, PlantModel::OUTPUTS);
        if count == 0 || y.is_empty() {
            return;
        }
        assert!(y.len().is_multiple_of(count * PlantModel::OUTPUTS), "whole sequences");
        let (inputs, outputs) = (commands.len() / count, y.len() / count);
        for (commands, y) in commands.chunks(LANES * inputs).zip(y.chunks_mut(LANES * outputs)) {
            let count = y.len() / outputs;
            self.arch.dispatch(BatchRollout { session: self, count, commands, y });
        }
    }

    fn snapshot_len(&self) -> usize {
        self.motion.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        into.copy_from_slice(&self.motion);
    }

    fn restore(&mut self, from: &[f64]) {
        self.motion.copy_from_slice(from);
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(self.clone())
    }
}
