//! A vessel as a learnable model.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::Learnable;
use super::plant_parameters::PlantParameters;
use crate::craft::{Craft, Dynamics, MAX_SERVOS};
use crate::math::rows::add_product;
use crate::model::CraftModel;
use crate::vessel::{Dual, Number as _};

const OUTPUTS: usize = CraftModel::OUTPUTS;

/// Longest integration step for derivatives of predictions, relative to the fastest rate of the motion.
const DERIVATIVE_STEP: f64 = 0.5;

/// Derivatives of one [`Dual`] number.
pub(in super::super) const LANES: usize = 8;

/// Velocities, and positions of all servos.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Moving<T> {
    pub(in super::super) nu: [T; 3],
    pub(in super::super) positions: [T; MAX_SERVOS],
}

/// The vessel with the derivatives of its numbers that belong to a pass.
#[derive(Clone, Debug)]
struct Pass {
    craft: Craft<Dual<LANES>>,
    dynamics: Dynamics<Dual<LANES>>,
    numbers: Vec<Dual<LANES>>,
}

/// A vessel whose numbers are its weights, with the Jacobians of its last step.
///
/// The state is `[u, v, r]` and the positions of the actuators that do not follow at once, in half-widths of the ranges
/// that the vessel reaches ([`CraftModel::ranges`], [`CraftModel::position_ranges`]); the positions are hidden. The weights
/// are the relative changes of the learned numbers ([`CraftModel::learned`]), `ln(p / p_0)` for numbers of fixed sign and
/// `p / p_0 - 1` for the others.
///
/// ```text
/// h_i = (x_i - (low_i + high_i) / 2) / scale_i        scale_i = (high_i - low_i) / 2
/// ```
///
/// A step is one sample under a held command in its own units. `A = dh+/dh` and `B = dh+/dw` are the derivatives of the
/// integration by forward differentiation ([`Dual`]). Corrected weights outside the set of physical vessels (mass matrix
/// not positive definite, or weights beyond `ln 10`) are projected onto it.
#[derive(Clone, Debug)]
pub struct LearnablePlant {
    map: PlantParameters,
    inputs: usize,
    servos: usize,
    /// Servos whose positions are states.
    moving: Vec<usize>,
    mean: Vec<f64>,
    scale: Vec<f64>,
    /// Length \[s\] and number of the integration steps in a sample.
    h: f64,
    steps: usize,
    blocks: [Vec<usize>; 1],
    weights: Vec<f64>,
    passes: Vec<Pass>,
    by_state: Vec<f64>,
    by_weights: Vec<f64>,
}

impl LearnablePlant {
    /// From a vessel with its numbers.
    pub fn new(model: &CraftModel) -> Self {
        let map = PlantParameters::new(model);
        let count = map.groups().len();
        let moving = model.dynamics().moving();
        let ranges = model.ranges().iter().chain(moving.iter().map(|&servo| &model.position_ranges()[servo]));
        let ranges: Vec<[f64; 2]> = ranges.copied().collect();
        let half = |[low, high]: &[f64; 2]| 0.5 * (high - low);
        let states = ranges.len();
        let constant = |value: f64| Dual::along(value, LANES, 0.0);
        let numbers: Vec<Dual<LANES>> =
            model.craft().parameters().iter().map(|(_, number)| constant(*number)).collect();
        let craft = model.craft().with_numbers(&numbers);
        let pass = Pass { dynamics: Dynamics::new(&craft), craft, numbers };
        let mut own = Self {
            inputs: model.craft().commands.len(),
            servos: model.dynamics().servos(),
            moving,
            mean: ranges.iter().map(|[low, high]| 0.5 * (low + high)).collect(),
            scale: ranges.iter().map(|range| if half(range) > 0.0 { half(range) } else { 1.0 }).collect(),
            h: model.dt() / model.steps() as f64,
            steps: model.steps(),
            blocks: [(0..count).collect()],
            weights: vec![0.0; count],
            passes: vec![pass; (states + count).div_ceil(LANES)],
            by_state: vec![0.0; states * states],
            by_weights: vec![0.0; states * count],
            map,
        };
        own.compile();
        own
    }

    /// Indices in [`Craft::parameters`] of the learned numbers; those of one weight are equal.
    pub fn places(&self) -> &[Vec<usize>] {
        self.map.groups()
    }

    /// All numbers with the current weights, in the order of [`Craft::parameters`].
    pub fn numbers(&self) -> Vec<f64> {
        self.map.numbers(&self.weights).collect()
    }

    /// Unit of each scaled state.
    pub fn scale(&self) -> &[f64] {
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

    /// Servos whose positions are states, in the order of the states.
    pub fn moving(&self) -> &[usize] {
        &self.moving
    }

    pub(in super::super) fn map(&self) -> &PlantParameters {
        &self.map
    }

    pub(in super::super) fn passes(&self) -> usize {
        self.passes.len()
    }

    /// The derivatives of a pass that are with respect to states.
    pub(in super::super) fn state_lanes(&self, pass: usize) -> usize {
        self.scale.len().saturating_sub(pass * LANES).min(LANES)
    }

    /// A state in its own unit.
    fn state<'a, T>(&self, at: &'a mut Moving<T>, place: usize) -> &'a mut T {
        match place.checked_sub(3) {
            None => &mut at.nu[place],
            Some(hidden) => &mut at.positions[self.moving[hidden]],
        }
    }

    /// The state at the start of a step, with those of its derivatives that belong to the pass.
    pub(in super::super) fn start(&self, from: &Moving<f64>, pass: usize) -> Moving<Dual<LANES>> {
        let mut start =
            Moving { nu: from.nu.map(Dual::constant), positions: from.positions.map(Dual::constant) };
        for place in pass * LANES..pass * LANES + self.state_lanes(pass) {
            let state = self.state(&mut start, place);
            *state = Dual::along(state.value, place - pass * LANES, self.scale[place]);
        }
        start
    }

    /// One sample of a pass in `steps` integration steps, in physical units; derivatives are with respect to scaled
    /// states and weights.
    pub(in super::super) fn sample(
        &self,
        pass: usize,
        at: &mut Moving<Dual<LANES>>,
        c: &[f64],
        steps: usize,
    ) {
        // Exactly `self.h` for all steps.
        let h = self.h * (self.steps as f64 / steps as f64);
        self.passes[pass].dynamics.advance(&mut at.nu, &mut at.positions[..self.servos], c, h, steps);
    }

    /// Number of integration steps that suffice for the derivatives of a sample: `h |F| <= 0.5`, where `F` is the
    /// Jacobian of the accelerations in scaled units. The local error of a derivative is then below `0.5^5 / 120` of its
    /// size. Positions are exact.
    pub(in super::super) fn derivative_steps(&self, from: &Moving<f64>) -> usize {
        let mut norms = [0.0; 3];
        for pass in 0..self.scale.len().div_ceil(LANES) {
            let at = self.start(from, pass);
            let rates = self.passes[pass].dynamics.acceleration(at.nu, &at.positions[..self.servos]);
            for ((norm, rate), scale) in norms.iter_mut().zip(&rates).zip(&self.scale) {
                let partials = &rate.partials[..self.state_lanes(pass)];
                *norm += partials.iter().map(|p| p.abs()).sum::<f64>() / scale;
            }
        }
        let norm = norms.into_iter().fold(0.0, f64::max);
        let dt = self.h * self.steps as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // casts saturate
        let steps = Float::ceil(dt * norm / DERIVATIVE_STEP) as usize;
        steps.clamp(1, self.steps)
    }

    fn compile(&mut self) {
        let states = self.scale.len();
        for (index, pass) in self.passes.iter_mut().enumerate() {
            for (place, number) in pass.numbers.iter_mut().enumerate() {
                if let Some(weight) = self.map.weight_of(place) {
                    let (value, slope) = self.map.value(place, self.weights[weight]);
                    *number = Dual::along(value, (states + weight).wrapping_sub(index * LANES), slope);
                }
            }
            pass.craft.set_numbers(&pass.numbers);
            pass.dynamics.set(&pass.craft);
        }
    }
}

impl Learnable for LearnablePlant {
    fn state_len(&self) -> usize {
        self.scale.len()
    }

    fn inputs(&self) -> usize {
        self.inputs
    }

    fn outputs(&self) -> usize {
        OUTPUTS
    }

    fn blocks(&self) -> &[Vec<usize>] {
        &self.blocks
    }

    fn rows(&self) -> usize {
        self.scale.len()
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
        let (count, states) = (self.weights.len(), self.scale.len());
        let mut from = Moving { nu: [0.0; 3], positions: [0.0; MAX_SERVOS] };
        for (place, h) in h.iter().enumerate() {
            *self.state(&mut from, place) = self.unscaled(place, *h);
        }
        for pass in 0..self.passes.len() {
            let mut moved = self.start(&from, pass);
            self.sample(pass, &mut moved, x, self.steps);
            for i in 0..states {
                let (moved, by) = (*self.state(&mut moved, i), 1.0 / self.scale[i]);
                for (lane, partial) in moved.partials.iter().enumerate() {
                    match (pass * LANES + lane).checked_sub(states) {
                        None => self.by_state[i * states + pass * LANES + lane] = partial * by,
                        Some(index) if index < count => self.by_weights[i * count + index] = partial * by,
                        Some(_) => {}
                    }
                }
                h[i] = self.scaled(i, moved.value);
            }
        }
    }

    fn output(&self, h: &[f64], y: &mut [f64]) {
        y.copy_from_slice(&h[..OUTPUTS]);
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
        out.copy_from_slice(&state[..OUTPUTS * columns]);
    }

    fn scratch(&self, _: usize) -> usize {
        0
    }
}
