//! A member that learns: recursive least squares on averaged increments.

use alloc::vec;
use alloc::vec::Vec;

use super::super::innovation_gate::{InnovationGate, Noise, NoiseConstants};
use super::super::least_squares::RecursiveLeastSquares;
use super::super::scale::unit_columns;
use super::super::ud_factor::UdFactor;
use super::super::{Innovation, Outcome, Rejection};
use crate::memory::Memory;
use crate::model::committee::{DifferenceEquations, Past, Prior};

/// The constants of a member that learns, for code in other languages.
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct LearnerConstants {
    /// Index of the member.
    pub member: usize,
    /// Place of its coefficients in the weights.
    pub first: usize,
    /// Scale of each term.
    pub scales: Vec<f64>,
    /// Covariance at the start, in scaled coefficients.
    pub factor: UdFactor,
    /// Gate and noise estimate.
    pub noise: NoiseConstants,
    /// Clock steps over which a row is averaged.
    pub averaging: usize,
    /// Samples between two increments.
    pub stride: usize,
    /// Increments in a row.
    pub row_increments: usize,
}

/// Increments of a clock step in an averaged row; more add little information.
const INCREMENTS: usize = 4;

/// Learns the coefficients of one member from rows `(y(t + T) - y(t)) / T = Xi theta(z(t))`, averaged over
/// [`Prior::averaging`] clock steps.
#[derive(Clone, Debug)]
pub(super) struct Learner {
    /// Index of the member.
    pub(super) member: usize,
    /// Place of the coefficients in the weights of the session.
    pub(super) first: usize,
    kernel: RecursiveLeastSquares,
    noise: Noise,
    /// Scale of each term.
    scales: Vec<f64>,
    averaging: usize,
    /// Samples between two increments.
    stride: usize,
    /// Increments in a row, and those in the present one.
    row_increments: usize,
    increments: usize,
    phi: Vec<f64>,
    z: Vec<f64>,
    row: Vec<f64>,
    slots: Vec<f64>,
}

/// Samples between two increments of an averaged row over `samples`.
pub fn increment_stride(samples: usize) -> usize {
    (samples / INCREMENTS).max(1)
}

impl Learner {
    /// `None` if the prior is singular.
    pub(super) fn new(
        member: usize,
        first: usize,
        of: &DifferenceEquations,
        prior: &Prior,
        gate: InnovationGate,
    ) -> Option<Self> {
        let (shape, terms) = (of.shape(), of.terms().len());
        let (scales, r_factor) = unit_columns(&prior.r_factor, terms)?;
        let theta: Vec<f64> = of
            .coefficients()
            .chunks_exact(terms)
            .flat_map(|row| row.iter().zip(&scales).map(|(xi, s)| xi * s))
            .collect();
        let kernel = RecursiveLeastSquares::with_r_factor(&theta, prior.information, &r_factor, false);
        if !kernel.is_sound() {
            return None;
        }
        let samples = prior.averaging * shape.clock;
        let stride = increment_stride(samples);
        // A faulty sample is part of the increments that begin or end with it or have it among their past values.
        let longest = (shape.lags + 1).div_ceil(prior.averaging) + 1;
        Some(Self {
            member,
            first,
            kernel,
            noise: Noise::new(shape.outputs, gate, longest, samples as f64 * shape.dt),
            scales,
            averaging: prior.averaging,
            stride,
            row_increments: samples.div_ceil(stride),
            increments: 0,
            phi: vec![0.0; terms],
            z: vec![0.0; shape.outputs],
            row: vec![0.0; terms],
            slots: vec![0.0; of.program().slots()],
        })
    }

    pub(super) fn constants(&self) -> LearnerConstants {
        LearnerConstants {
            member: self.member,
            first: self.first,
            scales: self.scales.clone(),
            factor: self.kernel.initial_factor(),
            noise: self.noise.constants(),
            averaging: self.averaging,
            stride: self.stride,
            row_increments: self.row_increments,
        }
    }

    /// Forgets an incomplete row.
    pub(super) fn restart_row(&mut self) {
        self.increments = 0;
        self.phi.fill(0.0);
        self.z.fill(0.0);
    }

    /// Resets the covariance.
    pub(super) fn restart(&mut self) {
        self.kernel.restart();
        self.restart_row();
    }

    /// Learns from the newest sample; `measured` is the number of samples up to it without a missing value. Writes the
    /// coefficients to `weights` if they changed. The outcome is waiting while a row is incomplete.
    pub(super) fn learn(
        &mut self,
        of: &DifferenceEquations,
        past: Past<'_>,
        measured: usize,
        inflation: f64,
        innovations: &mut Vec<Innovation>,
        weights: &mut [f64],
    ) -> Outcome {
        let shape = of.shape();
        let n = shape.outputs;
        let needed = shape.span() + shape.clock + 1;
        if measured < needed {
            self.restart_row();
            return Outcome::Waiting;
        }
        if !(measured - needed).is_multiple_of(self.stride) {
            return Outcome::Waiting;
        }
        of.load(past, shape.clock, &mut self.slots);
        let (slots, program) = (&mut self.slots, of.program());
        let now = &past.outputs[past.outputs.len() - n..];
        let clock_s = shape.clock as f64 * shape.dt;
        for ((z, now), before) in self.z.iter_mut().zip(now).zip(&slots[1..=n]) {
            *z += (now - before) / clock_s;
        }
        program.evaluate(slots);
        for (t, phi) in self.phi.iter_mut().enumerate() {
            *phi += slots[program.slot(t)];
        }
        self.increments += 1;
        if self.increments < self.row_increments {
            return Outcome::Waiting;
        }
        let share = 1.0 / self.increments as f64;
        self.z.iter_mut().for_each(|z| *z *= share);
        for ((row, phi), scale) in self.row.iter_mut().zip(&self.phi).zip(&self.scales) {
            *row = phi * share / scale;
        }
        let outcome = self.update(inflation, innovations);
        self.restart_row();
        if matches!(outcome, Outcome::Accepted | Outcome::Inflated { .. }) {
            self.publish(weights);
        }
        outcome
    }

    fn update(&mut self, inflation: f64, innovations: &mut Vec<Innovation>) -> Outcome {
        let all = || self.row.iter().chain(&self.z);
        // Squares of larger numbers overflow.
        if !all().all(|x| x.abs() < 1e150) {
            return Outcome::Rejected(Rejection::NotFinite);
        }
        let leverage = self.kernel.predict(&self.row, &self.z);
        innovations.clear();
        let judged = self.kernel.innovations().iter();
        innovations.extend(judged.map(|&value| Innovation { value, deviation: leverage }));
        let outcome = self.noise.judge(innovations);
        let weight = match outcome {
            Outcome::Accepted => 1.0,
            Outcome::Inflated { weight, .. } => weight,
            _ => return outcome,
        };
        self.kernel.correct(weight * self.averaging as f64 / inflation);
        outcome
    }

    fn publish(&self, weights: &mut [f64]) {
        let terms = self.scales.len();
        let own =
            weights[self.first..].chunks_exact_mut(terms).zip(self.kernel.coefficients().chunks_exact(terms));
        for (weights, theta) in own {
            for ((weight, theta), scale) in weights.iter_mut().zip(theta).zip(&self.scales) {
                *weight = theta / scale;
            }
        }
    }

    /// Takes the coefficients from `weights`.
    pub(super) fn adopt(&mut self, weights: &[f64]) {
        let terms = self.scales.len();
        let own = self
            .kernel
            .coefficients_mut()
            .chunks_exact_mut(terms)
            .zip(weights[self.first..].chunks_exact(terms));
        for (theta, weights) in own {
            for ((theta, weight), scale) in theta.iter_mut().zip(weights).zip(&self.scales) {
                *theta = weight * scale;
            }
        }
        self.restart_row();
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.kernel.visit_state(memory);
        self.noise.visit_state(memory);
        memory.numbers(&mut self.phi);
        memory.numbers(&mut self.z);
        memory.count(&mut self.increments, self.row_increments - 1);
    }

    pub(super) fn is_sound(&self) -> bool {
        self.kernel.is_sound() && self.noise.is_sound()
    }
}
