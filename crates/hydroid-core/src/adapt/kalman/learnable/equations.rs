//! Sparse equations as a learnable model.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::Learnable;
use crate::adapt::options::RecursiveOptionsError;
use crate::adapt::scale::rms_over_range;
use crate::math::rows::add_product;
use crate::model::sparse::{Equations, Sensitivity};

/// Sparse equations `dy/dt = Xi theta(y, c, s)` with the Jacobians of their last step. The state is the outputs, the
/// weights are the nonzero coefficients.
///
/// Both are scaled, so that one set of options suits all vessels. For the design range `[low, high]` of an output and
/// the root mean square `rms_j` of term `j` over the design ranges ([`rms_over_range`]),
///
/// ```text
/// h_i  = (y_i - (low_i + high_i) / 2) / scale_i        scale_i = (high_i - low_i) / 2
/// w_ij = Xi_ij rms_j / size_i                          size_i  = sqrt(sum_j (Xi_ij rms_j)^2), initial coefficients
/// ```
///
/// so that the initial weights of each equation have the norm one. A step is one sample under a held command; its
/// Jacobians `A = dh+/dh` and `B = dh+/dw` are those of the Runge-Kutta steps ([`Sensitivity`]). The input `x = [c,
/// memory]` is the command, then the memory of the signals in the order of [`Equations::step`]. The memory counts as
/// known, although its past outputs are estimates.
#[derive(Clone, Debug)]
pub struct LearnableEquations {
    equations: Equations,
    sensitivity: Sensitivity,
    mean: Vec<f64>,
    scale: Vec<f64>,
    /// The place of each weight in the table of coefficients, and its unit.
    blocks: [Vec<usize>; 1],
    places: Vec<usize>,
    units: Vec<f64>,
    weights: Vec<f64>,
    coefficients: Vec<f64>,
    by_state: Vec<f64>,
    by_weights: Vec<f64>,
    start: Vec<f64>,
    y: Vec<f64>,
    s: Vec<f64>,
    scratch: Vec<f64>,
}

impl LearnableEquations {
    /// From equations, and the design range `(low, high)` of each output, then each input.
    ///
    /// # Errors
    /// If a range is missing or not finite, all coefficients are zero, or the derivatives do not exist.
    pub fn new(equations: &Equations, ranges: &[(f64, f64)]) -> Result<Self, RecursiveOptionsError> {
        let (n, m, count) = (equations.outputs(), equations.inputs(), equations.terms().len());
        let finite = ranges.iter().all(|(low, high)| low.is_finite() && high.is_finite());
        if ranges.len() != n + m || !finite {
            return Err(RecursiveOptionsError::Ranges);
        }
        let given = equations.coefficients();
        let places: Vec<usize> = (0..given.len()).filter(|&place| given[place] != 0.0).collect();
        if places.is_empty() {
            return Err(RecursiveOptionsError::Nothing);
        }
        let sensitivity = Sensitivity::new(equations, &places).map_err(RecursiveOptionsError::Equations)?;
        let mut all_ranges = ranges.to_vec();
        all_ranges.extend(equations.signals().iter().map(|signal| ranges[usize::from(signal.source())]));
        let rms: Vec<f64> = equations.terms().iter().map(|term| rms_over_range(term, &all_ranges)).collect();
        let square = |place: &usize| Float::powi(given[*place] * rms[place % count], 2);
        let size = |i: usize| places.iter().filter(|p| *p / count == i).map(square).sum();
        let sizes: Vec<f64> = (0..n).map(|i| Float::sqrt(size(i))).collect();
        let units: Vec<f64> = places.iter().map(|place| sizes[place / count] / rms[place % count]).collect();
        if !units.iter().all(|unit| *unit > 0.0 && unit.is_finite()) {
            return Err(RecursiveOptionsError::Extreme("a coefficient"));
        }
        let half = |(low, high): &(f64, f64)| 0.5 * (high - low);
        let scale = ranges[..n].iter().map(half).map(|half| if half > 0.0 { half } else { 1.0 }).collect();
        let mut own = Self {
            mean: ranges[..n].iter().map(|(low, high)| 0.5 * (low + high)).collect(),
            scale,
            blocks: [(0..places.len()).collect()],
            weights: vec![0.0; places.len()],
            coefficients: given.to_vec(),
            by_state: vec![0.0; n * n],
            by_weights: vec![0.0; n * places.len()],
            start: vec![0.0; equations.state_len()],
            y: vec![0.0; 2 * n],
            s: vec![0.0; 2 * n * sensitivity.parameters()],
            scratch: vec![0.0; sensitivity.scratch()],
            equations: equations.clone(),
            sensitivity,
            places,
            units,
        };
        let weights: Vec<f64> = own.places.iter().zip(&own.units).map(|(&p, unit)| given[p] / unit).collect();
        // Through the weights: restored weights then give the same coefficients to the last bit.
        own.set_weights(&weights);
        Ok(own)
    }

    /// The equations with their initial coefficients.
    pub fn equations(&self) -> &Equations {
        &self.equations
    }

    /// Unit of each scaled output.
    pub fn scale(&self) -> &[f64] {
        &self.scale
    }

    /// Places of the weights in the table of coefficients, `outputs x terms`.
    pub fn places(&self) -> &[usize] {
        &self.places
    }

    /// Unit of each weight: the coefficient of a weight of one.
    pub fn units(&self) -> &[f64] {
        &self.units
    }

    /// An output in scaled units.
    pub fn scaled(&self, output: usize, y: f64) -> f64 {
        (y - self.mean[output]) / self.scale[output]
    }

    /// An output in its own unit.
    pub fn unscaled(&self, output: usize, h: f64) -> f64 {
        self.mean[output] + self.scale[output] * h
    }

    pub(in super::super) fn sensitivity(&self) -> &Sensitivity {
        &self.sensitivity
    }
}

impl Learnable for LearnableEquations {
    fn state_len(&self) -> usize {
        self.equations.outputs()
    }

    fn inputs(&self) -> usize {
        self.equations.inputs() + self.equations.state_len() - self.equations.outputs()
    }

    fn outputs(&self) -> usize {
        self.equations.outputs()
    }

    fn blocks(&self) -> &[Vec<usize>] {
        &self.blocks
    }

    fn rows(&self) -> usize {
        self.equations.outputs()
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn set_weights(&mut self, weights: &[f64]) {
        self.weights.copy_from_slice(weights);
        for ((&place, unit), weight) in self.places.iter().zip(&self.units).zip(weights) {
            self.coefficients[place] = weight * unit;
        }
        self.sensitivity.set_coefficients(&self.coefficients);
    }

    fn step(&mut self, h: &mut [f64], x: &[f64]) {
        let (n, m, count) = (self.equations.outputs(), self.equations.inputs(), self.places.len());
        let (c, memory) = x[..self.inputs()].split_at(m);
        for (i, h) in h.iter().enumerate() {
            self.start[i] = self.mean[i] + self.scale[i] * h;
        }
        self.start[n..].copy_from_slice(memory);
        self.sensitivity.rollout(&self.start, c, &mut self.scratch, &mut self.y, &mut self.s);
        let p = self.sensitivity.parameters();
        for (i, row) in self.s[n * p..].chunks_exact(p).enumerate() {
            let (by_outputs, by_coefficients) = row.split_at(n);
            let by = 1.0 / self.scale[i];
            for (j, s) in by_outputs.iter().enumerate() {
                self.by_state[i * n + j] = s * self.scale[j] * by;
            }
            let into = &mut self.by_weights[i * count..(i + 1) * count];
            for ((into, s), unit) in into.iter_mut().zip(by_coefficients).zip(&self.units) {
                *into = s * unit * by;
            }
            h[i] = (self.y[n + i] - self.mean[i]) * by;
        }
    }

    fn output(&self, h: &[f64], y: &mut [f64]) {
        y.copy_from_slice(h);
    }

    fn local_jacobian(&self, _: usize, row: usize, into: &mut [f64]) {
        let count = self.places.len();
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

    fn apply_output_jacobian(&self, state: &[f64], _: &[f64], _: usize, out: &mut [f64]) {
        out.copy_from_slice(state);
    }

    fn scratch(&self, _: usize) -> usize {
        0
    }
}
