//! How far the measurements to come may lie from a rollout of recursive equations.

use alloc::vec;
use alloc::vec::Vec;

use num_traits::Float;

use super::innovation_gate::{FEWEST_ROWS, LARGEST_SHARE, MEMORY_S};
use super::memory::{MOST_COUNTED, Reader, Writer};
use crate::model::sparse::{Equations, EquationsError, Sensitivity};

/// Errors of one step beyond so many standard deviations widen the bands no further: one bad sample must not.
const FARTHEST: f64 = 5.0;

/// What the prediction_variance of predictions is made of, output by output.
///
/// `y_{k+h}` as it will be measured differs from the rollout by
///
/// ```text
/// noise of the sensor at its end                       variance a/2
/// noise of the sensor at its start, carried along      Phi_h a/2 Phi_h'
/// what the equations leave out, step by step           sum_{j<h} Phi_j b Phi_j'
/// coefficients that are uncertain                      S_h P S_h'
/// ```
///
/// `Phi` and `S` are the derivatives of the rollout to its start and to the coefficients ([`Sensitivity`]; `Phi_j`
/// stands for the way from any step to one `j` steps later). Errors of one step have the variance `a + b`, those over
/// the window of a row, of which the regression knows its noise, `a + b m`: that tells sensor from equations.
#[derive(Clone, Debug)]
pub(super) struct PredictionVariance {
    sensitivity: Sensitivity,
    /// Variance of the errors of one step, and how many there were.
    one_step: Vec<f64>,
    count: usize,
    /// Samples since each output was measured.
    age: Vec<usize>,
    /// Share of one error in the variance, once that is settled.
    rate: f64,
}

impl PredictionVariance {
    /// For equations that have a coefficient at each of the places.
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

    /// Forgets the run, not what was learned.
    pub(super) fn restart(&mut self) {
        self.age.fill(0);
    }

    pub(super) fn set_coefficients(&mut self, coefficients: &[f64]) {
        self.sensitivity.set_coefficients(coefficients);
    }

    /// Takes a measurement and what was expected of it one step before; errors count where the outputs were all
    /// measured then.
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

    /// Numbers of scratch for rollouts of so many steps.
    pub(super) fn scratch(&self, steps: usize) -> usize {
        let n = self.one_step.len();
        (steps + 1) * n * (1 + self.sensitivity.parameters()) + 3 * n + self.sensitivity.scratch()
    }

    /// Standard deviations at the horizons. `row_noise` are the variances of the rows' noise \[unit/s squared\],
    /// of windows of `window_s` with `samples` steps, and `uncertain` the variance of an output because of its
    /// coefficients, of which the derivatives to all are given.
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
        self.sensitivity.rollout_in(state, commands, rest, y, s);
        for l in 0..n {
            let (one, window) = (self.one_step[l], row_noise[l] * window_s * window_s);
            // A window of one step cannot tell: all is drift, which is the wider band.
            let slope = (window - one) / samples.saturating_sub(1) as f64;
            drift[l] = if samples == 1 { one } else { slope.clamp(0.0, one) };
            sensor[l] = one - drift[l];
        }
        drifted.fill(0.0);
        let mut next = 0;
        for step in 0..steps {
            let phi = |step: usize, i: usize, l: usize| s[(step * n + i) * p + l];
            for i in 0..n {
                drifted[i] += (0..n).map(|l| phi(step, i, l) * phi(step, i, l) * drift[l]).sum::<f64>();
            }
            // A horizon that is asked for twice is answered twice.
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

    /// How many numbers [`save`](Self::save) writes.
    pub(super) fn memory_len(&self) -> usize {
        self.one_step.len() + self.age.len() + 1
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&self.one_step);
        into.count(self.count);
        self.age.iter().for_each(|age| into.count(*age));
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        from.numbers(&mut self.one_step);
        self.count = from.count(MOST_COUNTED);
        self.age.iter_mut().for_each(|age| *age = from.count(MOST_COUNTED));
    }
}
