//! A vessel as a learnable model.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::Learnable;
use super::plant_parameters::PlantParameters;
use crate::math::rows::add_product;
use crate::model::PlantModel;
use crate::vessel::{Command, Dual, Numbers, Plant};

pub(in super::super) const STATE: usize = 4;

/// Longest integration step for derivatives of predictions, relative to the fastest rate of the motion.
const DERIVATIVE_STEP: f64 = 0.5;

/// Derivatives of one [`Dual`] number.
pub(in super::super) const LANES: usize = 8;

/// A vessel whose parameters are its weights, with the Jacobians of its last step.
///
/// The state is `[u, v, r, P_f]` in half-widths of the ranges that the vessel reaches ([`PlantModel::ranges`]); the
/// propeller force `P_f` is hidden. The weights are the relative changes of all nonzero parameters, `ln(p / p_0)` for
/// parameters of fixed sign and `p / p_0 - 1` for the others.
///
/// ```text
/// h_i = (x_i - (low_i + high_i) / 2) / scale_i        scale_i = (high_i - low_i) / 2
/// ```
///
/// A step is one sample under a held command `x = [PP, RD]` in its own units. `A = dh+/dh` and `B = dh+/dw` are the
/// derivatives of the Runge-Kutta steps by forward differentiation ([`Dual`]). Corrected weights outside the set of
/// physical vessels (mass matrix not positive definite, or weights beyond `ln 10`) are projected onto it.
#[derive(Clone, Debug)]
pub struct LearnablePlant {
    map: PlantParameters,
    mean: [f64; STATE],
    scale: [f64; STATE],
    /// Length \[s\] and number of the integration steps in a sample.
    h: f64,
    steps: usize,
    blocks: [Vec<usize>; 1],
    weights: Vec<f64>,
    /// The plant with the derivatives of its parameters with respect to state and weights, `LANES` in each pass.
    passes: Vec<Plant<Dual<LANES>>>,
    by_state: [f64; STATE * STATE],
    by_weights: Vec<f64>,
}

impl LearnablePlant {
    /// From a vessel with its parameters.
    pub fn new(model: &PlantModel) -> Self {
        let map = PlantParameters::new(model.form(), model.numbers());
        let count = map.places().len();
        let half = |[low, high]: [f64; 2]| 0.5 * (high - low);
        let mut own = Self {
            mean: model.ranges().map(|[low, high]| 0.5 * (low + high)),
            scale: model.ranges().map(|range| if half(range) > 0.0 { half(range) } else { 1.0 }),
            h: model.dt() / model.steps() as f64,
            steps: model.steps(),
            blocks: [(0..count).collect()],
            weights: vec![0.0; count],
            passes: Vec::with_capacity((STATE + count).div_ceil(LANES)),
            by_state: [0.0; STATE * STATE],
            by_weights: vec![0.0; STATE * count],
            map,
        };
        own.compile();
        own
    }

    /// Indices of the learned parameters in [`PARAMETER`](crate::vessel::PARAMETER).
    pub fn places(&self) -> &[usize] {
        self.map.places()
    }

    /// All parameters with the current weights.
    pub fn numbers(&self) -> Numbers {
        self.map.numbers(&self.weights)
    }

    /// Unit of each scaled state.
    pub fn scale(&self) -> &[f64; STATE] {
        &self.scale
    }

    /// A state in scaled units.
    pub fn scaled(&self, place: usize, x: f64) -> f64 {
        (x - self.mean[place]) / self.scale[place]
    }

    /// A state in its own unit.
    pub fn unscaled(&self, place: usize, h: f64) -> f64 {
        self.mean[place] + self.scale[place] * h
    }

    pub(in super::super) fn map(&self) -> &PlantParameters {
        &self.map
    }

    pub(in super::super) fn passes(&self) -> usize {
        self.passes.len()
    }

    /// The state at the start of a step, with those of its derivatives that belong to the pass.
    pub(in super::super) fn start(&self, motion: &[f64; STATE], pass: usize) -> [Dual<LANES>; STATE] {
        core::array::from_fn(|i| Dual::along(motion[i], i.wrapping_sub(pass * LANES), self.scale[i]))
    }

    /// One sample of a pass in `steps` integration steps, in physical units; derivatives are with respect to scaled
    /// states and weights.
    pub(in super::super) fn sample(
        &self,
        pass: usize,
        motion: &[Dual<LANES>; STATE],
        c: &[f64],
        steps: usize,
    ) -> [Dual<LANES>; STATE] {
        let plant = &self.passes[pass];
        let actuation = plant.actuation(&Command { pp: c[0], rd: c[1] });
        // Exactly `self.h` for all steps.
        let h = self.h * (self.steps as f64 / steps as f64);
        (0..steps).fold(*motion, |motion, _| plant.advance_motion(&motion, &actuation, h))
    }

    /// Number of integration steps that suffice for the derivatives of a sample: `h |F| <= 0.5`, where `F` is the
    /// Jacobian of the equations of motion in scaled units. The local error of a derivative is then below `0.5^5 / 120`
    /// of its size.
    pub(in super::super) fn derivative_steps(&self, motion: &[f64; STATE], c: &[f64]) -> usize {
        let plant = &self.passes[0];
        let actuation = plant.actuation(&Command { pp: c[0], rd: c[1] });
        let rates = plant.motion_rate(&self.start(motion, 0), &actuation);
        let norm = rates
            .iter()
            .zip(&self.scale)
            .map(|(rate, scale)| rate.partials[..STATE].iter().map(|p| p.abs()).sum::<f64>() / scale)
            .fold(0.0, f64::max);
        let dt = self.h * self.steps as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // casts saturate
        let steps = Float::ceil(dt * norm / DERIVATIVE_STEP) as usize;
        steps.clamp(1, self.steps)
    }

    fn compile(&mut self) {
        self.passes.clear();
        for pass in 0..(STATE + self.weights.len()).div_ceil(LANES) {
            let mut numbers: Numbers<Dual<LANES>> =
                self.map.numbers(&self.weights).map(|number| Dual::along(number, LANES, 0.0));
            for (index, &place) in self.map.places().iter().enumerate() {
                let (value, slope) = self.map.value(index, self.weights[index]);
                numbers[place] = Dual::along(value, (STATE + index).wrapping_sub(pass * LANES), slope);
            }
            self.passes.push(Plant::assemble(self.map.form(), &numbers));
        }
    }
}

impl Learnable for LearnablePlant {
    fn state_len(&self) -> usize {
        STATE
    }

    fn inputs(&self) -> usize {
        PlantModel::INPUTS
    }

    fn outputs(&self) -> usize {
        PlantModel::OUTPUTS
    }

    fn blocks(&self) -> &[Vec<usize>] {
        &self.blocks
    }

    fn rows(&self) -> usize {
        STATE
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn project(&self, weights: &mut [f64]) {
        self.map.project(&self.weights, weights);
    }

    fn set_weights(&mut self, weights: &[f64]) {
        self.weights.copy_from_slice(weights);
        self.compile();
    }

    fn step(&mut self, h: &mut [f64], x: &[f64]) {
        let count = self.weights.len();
        let motion = core::array::from_fn(|i| self.unscaled(i, h[i]));
        for pass in 0..self.passes.len() {
            let moved = self.sample(pass, &self.start(&motion, pass), x, self.steps);
            for (i, moved) in moved.iter().enumerate() {
                let by = 1.0 / self.scale[i];
                for (lane, partial) in moved.partials.iter().enumerate() {
                    match (pass * LANES + lane).checked_sub(STATE) {
                        None => self.by_state[i * STATE + lane] = partial * by,
                        Some(index) if index < count => self.by_weights[i * count + index] = partial * by,
                        Some(_) => {}
                    }
                }
                h[i] = self.scaled(i, moved.value);
            }
        }
    }

    fn output(&self, h: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&h[..PlantModel::OUTPUTS]);
    }

    fn local_jacobian(&self, _: usize, row: usize, into: &mut [f64]) {
        let count = self.weights.len();
        into[..count].copy_from_slice(&self.by_weights[row * count..(row + 1) * count]);
    }

    fn apply_state_jacobian(
        &self,
        state: &[f64],
        local: &[f64],
        columns: usize,
        out: &mut [f64],
        _: &mut [f64],
    ) {
        out.copy_from_slice(local);
        add_product(out, &self.by_state, state, columns);
    }

    fn apply_output_jacobian(&self, state: &[f64], _: &[f64], columns: usize, out: &mut [f64]) {
        out.copy_from_slice(&state[..PlantModel::OUTPUTS * columns]);
    }

    fn scratch(&self, _: usize) -> usize {
        0
    }
}
