//! A value whose rate is a random walk, seen with white noise.

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::log::median;

/// Limits of the ratio of the variances in a step; that of the noise is 1.
const RATIO: [f64; 2] = [1e-12, 1e6];

/// Variance of a first state relative to the square of the largest value.
const UNKNOWN: f64 = 1e4;

/// A value of both axes.
pub(super) type Complex = [f64; 2];

pub(super) fn middle(values: impl Iterator<Item = f64>) -> f64 {
    median(values.collect()).unwrap_or(0.0)
}

/// A random walk of the rate of a value that is seen with white noise: time in samples.
pub(super) struct Walk {
    /// Variance of the change of the rate in a sample, relative to that of the noise.
    ratio: f64,
    /// Standard deviation of the noise.
    pub(super) deviation: f64,
    /// Unit of the values: about the deviation of the noise.
    unit: f64,
    /// Variances of the first value and of its rate, in this unit.
    first: [f64; 2],
}

/// Covariance of a value and its rate.
#[derive(Clone, Copy)]
struct Covariance {
    value: f64,
    both: f64,
    rate: f64,
}

/// Value and rate of both axes before a sample is seen, their covariance, and what is new in the sample.
struct Step {
    state: [Complex; 2],
    covariance: Covariance,
    new: Option<Complex>,
}

impl Walk {
    pub(super) fn most_likely(seen: &[Option<[f64; 2]>]) -> Self {
        let known: Vec<(f64, [f64; 2])> =
            seen.iter().enumerate().filter_map(|(k, value)| Some((k as f64, (*value)?))).collect();
        let both = |of: &dyn Fn(usize) -> f64| of(0).abs().max(of(1).abs());
        let largest = known.iter().map(|(_, value)| both(&|axis| value[axis])).fold(0.0, f64::max);
        let rates = known
            .windows(2)
            .map(|pair| both(&|axis| (pair[1].1[axis] - pair[0].1[axis]) / (pair[1].0 - pair[0].0)));
        let fastest = rates.fold(0.0, f64::max);
        let second = known.windows(3).flat_map(|seen| {
            [0, 1].map(|axis| (seen[2].1[axis] - 2.0 * seen[1].1[axis] + seen[0].1[axis]).abs())
        });
        let noise = 1.4826 * middle(second) / 6.0_f64.sqrt();
        let unit = noise.max(1e-9 * largest).max(f64::MIN_POSITIVE.sqrt());
        let first = [largest, fastest].map(|most| UNKNOWN * (1.0 + (most / unit).powi(2)));
        let likelihood = |log: f64| Self { ratio: log.exp(), deviation: unit, unit, first }.filtered(seen).1;
        let [low, high] = RATIO.map(f64::ln);
        let step = (high - low) / 24.0;
        let grid = (0..=24).map(|k| low + f64::from(k) * step).map(|log| (log, likelihood(log).0));
        let (best, _) =
            grid.fold((low, f64::NEG_INFINITY), |best, next| if next.1 > best.1 { next } else { best });
        let (mut left, mut right) = ((best - step).max(low), (best + step).min(high));
        for _ in 0..12 {
            let third = (right - left) / 3.0;
            if likelihood(left + third).0 >= likelihood(right - third).0 {
                right -= third;
            } else {
                left += third;
            }
        }
        let log = 0.5 * (left + right);
        Self { ratio: log.exp(), deviation: unit * likelihood(log).1, unit, first }
    }

    /// The states by the values before each sample, and the concentrated likelihood with the deviation of the noise in the unit.
    fn filtered(&self, seen: &[Option<[f64; 2]>]) -> (Vec<Step>, (f64, f64)) {
        let mut state = [[0.0; 2]; 2];
        let mut p = Covariance { value: self.first[0], both: 0.0, rate: self.first[1] };
        let (mut squares, mut logs, mut count) = (0.0, 0.0, 0_u32);
        let mut steps = Vec::with_capacity(seen.len());
        for (k, value) in seen.iter().enumerate() {
            if k > 0 {
                state[0] = [0, 1].map(|axis| state[0][axis] + state[1][axis]);
                p = Covariance {
                    value: p.value + 2.0 * p.both + p.rate + self.ratio / 3.0,
                    both: p.both + p.rate + self.ratio / 2.0,
                    rate: p.rate + self.ratio,
                };
            }
            let new = value.map(|value| [0, 1].map(|axis| value[axis] / self.unit - state[0][axis]));
            steps.push(Step { state, covariance: p, new });
            if let Some(new) = new {
                let s = p.value + 1.0;
                let gain = [p.value / s, p.both / s];
                for (state, gain) in state.iter_mut().zip(gain) {
                    *state = [0, 1].map(|axis| state[axis] + gain * new[axis]);
                }
                p = Covariance { value: gain[0], both: gain[1], rate: p.rate - gain[1] * p.both };
                // The first two values decide the first state.
                if count >= 2 {
                    squares += (new[0] * new[0] + new[1] * new[1]) / s;
                    logs += s.ln();
                }
                count += 1;
            }
        }
        let degrees = 2.0 * f64::from(count.saturating_sub(2).max(1));
        let variance = (squares / degrees).max(f64::MIN_POSITIVE);
        (steps, (-0.5 * degrees * variance.ln() - logs, variance.sqrt()))
    }

    /// The states by all values (the smoother of Bryson and Frazier in its modified form: Bierman, Automatica 9 (1973) 503).
    pub(super) fn smoothed(&self, seen: &[Option<[f64; 2]>]) -> Vec<[Complex; 2]> {
        let (steps, _) = self.filtered(seen);
        let mut adjoint = [[0.0; 2]; 2];
        let mut all = vec![[[0.0; 2]; 2]; steps.len()];
        for (Step { state, covariance: p, new }, smoothed) in steps.iter().zip(&mut all).rev() {
            if let Some(new) = new {
                let s = p.value + 1.0;
                adjoint[0] =
                    [0, 1].map(|axis| (new[axis] + adjoint[0][axis] - p.both * adjoint[1][axis]) / s);
            }
            for axis in 0..2 {
                let [value, rate] = [adjoint[0][axis], adjoint[1][axis]];
                smoothed[0][axis] = self.unit * (state[0][axis] + p.value * value + p.both * rate);
                smoothed[1][axis] = self.unit * (state[1][axis] + p.both * value + p.rate * rate);
            }
            adjoint[1] = [0, 1].map(|axis| adjoint[0][axis] + adjoint[1][axis]);
        }
        all
    }

    /// A draw from the distribution of the states given the values, less its mean.
    pub(super) fn draw(&self, seen: &[Option<[f64; 2]>], rng: &mut ChaCha8Rng) -> Vec<[Complex; 2]> {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let (noise, step) = (self.deviation, self.deviation * self.ratio.sqrt());
        let mut state = [[0.0; 2]; 2];
        let (mut states, mut values) = (Vec::with_capacity(seen.len()), Vec::with_capacity(seen.len()));
        for (k, value) in seen.iter().enumerate() {
            if k > 0 {
                for axis in 0..2 {
                    // The covariance of both changes is [[1/3, 1/2], [1/2, 1]].
                    let (a, b) = (normal(), normal());
                    state[0][axis] += state[1][axis] + step * (0.5 * a + b / 12.0_f64.sqrt());
                    state[1][axis] += step * a;
                }
            }
            states.push(state);
            values.push(value.is_some().then(|| [0, 1].map(|axis| state[0][axis] + noise * normal())));
        }
        let means = self.smoothed(&values);
        let apart = states
            .iter()
            .zip(means)
            .map(|(state, mean)| [0, 1].map(|i| [0, 1].map(|axis| state[i][axis] - mean[i][axis])));
        apart.collect()
    }
}
