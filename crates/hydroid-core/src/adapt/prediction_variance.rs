//! Variance of the predictions of recursive equations.
//!
//! The error of a rollout over `h` samples against the measurement `y_{k+h}` has the variance
//!
//! ```text
//! sensor noise at the target               a/2
//! sensor noise at the origin               Phi_h (a/2) Phi_h'
//! process noise of each step               sum_{j<h} Phi_j b Phi_j'
//! coefficient uncertainty                  S_h P S_h'
//! ```
//!
//! with the derivatives `Phi_h` and `S_h` of the rollout with respect to the origin and the coefficients
//! ([`Sensitivity`]; the derivatives over `j` steps from the origin stand for those from any step). Errors over one
//! step have the variance `a + b`, increments over the `m` samples of a row `a + b m`; the two equations separate the
//! diagonal matrices `a` and `b`.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::are_variances;
use super::innovation_gate::{FEWEST_ROWS, LARGEST_SHARE, MEMORY_S};
use crate::memory::{MOST_COUNTED, Memory};
use crate::model::sparse::{Equations, EquationsError, Sensitivity};

/// Bound on the normalized error in the variance estimate, which limits the effect of a faulty sample.
const FARTHEST: f64 = 5.0;

#[derive(Clone, Debug)]
pub(super) struct PredictionVariance {
    sensitivity: Sensitivity,
    /// Variance of the one-step errors of each output \[unit^2\].
    one_step: Vec<f64>,
    count: usize,
    /// Samples since the last measurement of each output.
    age: Vec<usize>,
    rate: f64,
}

impl PredictionVariance {
    pub(super) fn new(equations: &Equations, places: &[usize]) -> Result<Self, EquationsError> {
        let n = equations.outputs();
        Ok(Self {
            sensitivity: Sensitivity::new(equations, places)?,
            one_step: vec![0.0; n],
            count: 0,
            age: vec![0; n],
            rate: (equations.dt() / MEMORY_S).min(LARGEST_SHARE),
        })
    }

    /// Starts a run. The variance estimate stays.
    pub(super) fn restart(&mut self) {
        self.age.fill(0);
    }

    pub(super) fn set_coefficients(&mut self, coefficients: &[f64]) {
        self.sensitivity.set_coefficients(coefficients);
    }

    /// Updates the variance with a one-step prediction error, if all outputs were measured one sample before.
    pub(super) fn observe(&mut self, y: &[f64], expected: &[f64]) {
        let fresh = self.age.iter().all(|age| *age == 0);
        let known = self.count >= FEWEST_ROWS;
        let share = self.rate.max(1.0 / (self.count + 1) as f64);
        let errors = y.iter().zip(expected).map(|(y, expected)| y - expected);
        if fresh && errors.clone().all(f64::is_finite) {
            for (variance, error) in self.one_step.iter_mut().zip(errors) {
                let square = error * error;
                let most = if known { FARTHEST * FARTHEST * *variance } else { f64::INFINITY };
                *variance += share * (square.min(most) - *variance);
            }
            self.count = self.count.saturating_add(1);
        }
        for (age, y) in self.age.iter_mut().zip(y) {
            *age = if y.is_nan() { age.saturating_add(1) } else { 0 };
        }
    }

    pub(super) fn scratch(&self, steps: usize) -> usize {
        let n = self.one_step.len();
        (steps + 1) * n * (1 + self.sensitivity.parameters()) + 3 * n + self.sensitivity.scratch()
    }

    /// Standard deviations at the horizons, `horizons x outputs`. `row_noise`: noise variances of the rows
    /// \[unit^2/s^2\], whose windows have `samples` intervals and the length `window_s`. `uncertain` returns the
    /// variance of an output for its derivatives with respect to the coefficients.
    pub(super) fn deviations(
        &self,
        (state, commands): (&[f64], &[f64]),
        horizons: &[usize],
        (row_noise, samples, window_s): (&[f64], usize, f64),
        uncertain: impl Fn(&[f64]) -> f64,
        scratch: &mut [f64],
        into: &mut [f64],
    ) {
        let (n, p) = (self.one_step.len(), self.sensitivity.parameters());
        let steps = horizons.last().copied().unwrap_or(0);
        if self.count < FEWEST_ROWS || commands.iter().any(|c| c.is_nan()) {
            into.fill(f64::NAN);
            return;
        }
        let (y, rest) = scratch.split_at_mut((steps + 1) * n);
        let (s, rest) = rest.split_at_mut((steps + 1) * n * p);
        let (sensor, rest) = rest.split_at_mut(n);
        let (drift, rest) = rest.split_at_mut(n);
        let (drifted, rest) = rest.split_at_mut(n);
        self.sensitivity.rollout(state, commands, rest, y, s);
        for l in 0..n {
            let (one, window) = (self.one_step[l], row_noise[l] * window_s * window_s);
            // One interval does not separate the terms: process noise alone gives the wider band.
            let slope = (window - one) / samples.saturating_sub(1) as f64;
            drift[l] = if samples == 1 { one } else { slope.max(0.0).min(one) };
            sensor[l] = one - drift[l];
        }
        drifted.fill(0.0);
        let mut next = 0;
        for step in 0..steps {
            let phi = |step: usize, i: usize, l: usize| s[(step * n + i) * p + l];
            for i in 0..n {
                drifted[i] += (0..n).map(|l| phi(step, i, l) * phi(step, i, l) * drift[l]).sum::<f64>();
            }
            while horizons.get(next) == Some(&(step + 1)) {
                for i in 0..n {
                    let start: f64 = (0..n)
                        .map(|l| {
                            let variance = 0.5 * sensor[l] + self.age[l] as f64 * drift[l];
                            phi(step + 1, i, l) * phi(step + 1, i, l) * variance
                        })
                        .sum();
                    let row = &s[((step + 1) * n + i) * p..][..p];
                    let variance = 0.5 * sensor[i] + start + drifted[i] + uncertain(&row[n..]);
                    into[next * n + i] = Float::sqrt(variance);
                }
                next += 1;
            }
        }
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.one_step);
        memory.count(&mut self.count, MOST_COUNTED);
        self.age.iter_mut().for_each(|age| memory.count(age, MOST_COUNTED));
    }

    pub(super) fn is_sound(&self) -> bool {
        are_variances(&self.one_step)
    }
}
