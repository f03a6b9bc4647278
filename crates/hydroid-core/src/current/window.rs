//! The current from the errors of predictions over windows, with the hypothesis that it has jumped.

use num_traits::Float;

use super::symmetric::{determinant, inverse, product, quadratic};
use super::{CurrentOptions, Inner, ThroughWater};
use crate::predict::Current;

/// Norm of three standardized errors with full weight: 95 % of a chi distribution with three degrees of freedom.
const FULL_WEIGHT: f64 = 2.8;

/// Squared median size of third differences of white noise of unit variance: the median size of a normal number is 0.6745,
/// and the squares of 1, 3, 3, 1 add up to 20.
const THIRD_DIFFERENCE: f64 = 0.6745 * 0.6745 * 20.0;

/// Largest number of iterations of an update.
const ITERATIONS: usize = 4;

/// Step of the numerical derivatives, in initial standard deviations.
const STEP: f64 = 0.1;

/// Change at which the iterations end, in initial standard deviations.
const SMALL: f64 = 0.01;

/// Currents under which a window is predicted at once: one, and one with a step in each component.
pub(super) const CURRENTS: usize = 3;

/// Result of a window.
pub(super) struct Estimated {
    current: Current,
    /// Derivatives of the standardized errors by the current.
    slopes: [[f64; 2]; 3],
    /// Whether the error under the prior current is beyond [`FULL_WEIGHT`].
    outlier: bool,
    /// Logarithm of the evidence of the window, without a constant.
    log_evidence: f64,
}

/// Norm of the errors that are not missing.
fn norm(error: [f64; 3], missing: [bool; 3]) -> f64 {
    let present = error.iter().zip(missing).filter(|(_, missing)| !missing);
    Float::sqrt(present.map(|(e, _)| e * e).sum::<f64>())
}

/// Negative logarithm of the density of a norm of standardized errors (P. J. Huber, *Annals of Mathematical Statistics* 35
/// (1964) 73), without its constant.
fn huber(size: f64) -> f64 {
    if size > FULL_WEIGHT { FULL_WEIGHT * (size - 0.5 * FULL_WEIGHT) } else { 0.5 * size * size }
}

impl<P: Inner + ?Sized> ThroughWater<P> {
    /// Updates the current by the last window; no effect where a number is not finite.
    pub(super) fn update_by_window(&mut self) {
        let window = self.options.window;
        self.commands.clear();
        for _ in 0..CURRENTS {
            for back in (1..=window).rev() {
                self.commands.extend_from_slice(self.past.row(back).2);
            }
        }
        // The model as it was before the window predicts the window.
        if self.has_start {
            self.state.copy_from_slice(&self.start);
        } else {
            self.inner.snapshot(&mut self.state);
        }
        self.measure_noise();
        let prior = self.current;
        let Some(found) = self.estimate(prior) else { return };
        let jump = if self.jump.is_considered() {
            self.compare_with_jump(&found, prior)
        } else {
            if found.outlier {
                self.look_for_jump(prior);
            }
            None
        };
        let jumped = jump.is_some();
        let Estimated { current, slopes, .. } = jump.unwrap_or(found);
        self.current = current;
        self.slopes = slopes;
        if jumped {
            // What was learned since then belongs to another current.
            self.jump.model(&mut self.state);
            self.jump.forget();
        } else {
            self.inner.snapshot(&mut self.state);
        }
        let moved = [0, 1].map(|i| current.velocity[i] - self.remembered[i]);
        let within =
            inverse(current.covariance).is_some_and(|information| quadratic(information, moved) < 1.0);
        if jumped || !within {
            self.remembered = current.velocity;
            self.observe_past(current.velocity, 0);
            self.replay.snapshot(&mut self.state);
            self.inner.restore(&self.state);
        }
        self.start.copy_from_slice(&self.state);
        self.has_start = true;
    }

    /// Standard deviations of the errors of a window under the right current, with the noise of the run.
    pub(super) fn error_deviations(&self) -> [f64; 3] {
        let CurrentOptions { deviations, noise, .. } = self.options;
        core::array::from_fn(|i| {
            let excess = (self.noise[i] - noise[i] * noise[i]).max(0.0);
            Float::sqrt(deviations[i] * deviations[i] + 2.0 * excess)
        })
    }

    /// Updates the noise of the run by the past of the last window.
    fn measure_noise(&mut self) {
        self.windows = self.windows.saturating_add(1);
        for (i, output) in self.options.motion.into_iter().enumerate() {
            self.differences.clear();
            for back in 3..self.past.len() {
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| self.past.row(back - k).0[output]);
                self.differences.push((d - a - 3.0 * (c - b)).abs());
            }
            if self.differences.is_empty() {
                continue;
            }
            let middle = self.differences.len() / 2;
            let median = *self.differences.select_nth_unstable_by(middle, f64::total_cmp).1;
            let variance = median * median / THIRD_DIFFERENCE;
            if variance.is_finite() {
                self.noise[i] += (variance - self.noise[i]) / self.windows as f64;
            }
        }
    }

    /// Considers a jump if the last window makes it the more probable explanation.
    fn look_for_jump(&mut self, prior: Current) {
        let CurrentOptions { window, initial, walk, dt, .. } = self.options;
        // As many jumps of the initial deviation as have the variance of the random walk.
        let odds = Float::ln(walk * walk * dt * window as f64 / (initial * initial));
        if let (Some(steady), Some(other)) = (self.estimate(prior), self.estimate(self.free(prior)))
            && other.log_evidence + odds > steady.log_evidence
        {
            self.jump.consider(other.current, &self.state, odds);
        }
    }

    /// A current that may have changed by the initial deviation.
    fn free(&self, Current { velocity, covariance: [p, q, r] }: Current) -> Current {
        let variance = self.options.initial * self.options.initial;
        Current { velocity, covariance: [p + variance, q, r + variance] }
    }

    /// Continues the hypothesis of a jump; the other current if it has become the more probable one.
    fn compare_with_jump(&mut self, found: &Estimated, prior: Current) -> Option<Estimated> {
        let CurrentOptions { window, walk, dt, .. } = self.options;
        self.jump.model(&mut self.state);
        let mut current = self.jump.current;
        let drift = walk * walk * dt * window as f64;
        current.covariance[0] += drift;
        current.covariance[2] += drift;
        let Some(other) = self.estimate(current) else {
            self.jump.forget();
            return None;
        };
        let evidence = other.log_evidence - found.log_evidence;
        self.jump.update(other.current, evidence);
        if !self.jump.is_confirmed() {
            return None;
        }
        // The window that suggested the jump may have begun before it. The last one has not.
        self.estimate(self.free(prior))
    }

    /// Lets the second session observe all samples of the past up to `to` samples before the newest, under a current.
    fn observe_past(&mut self, current: [f64; 2], to: usize) {
        let mut row = core::mem::take(&mut self.row);
        let from = self.past.len() - 1;
        self.replay.restore(&self.state);
        self.replay.reset();
        for back in (to..=from).rev() {
            let (y, heading, _) = self.past.row(back);
            row.copy_from_slice(y);
            self.add_current(current, heading, -1.0, &mut row);
            if back == from {
                self.replay.observe(&row);
            } else {
                self.replay.advance_observe(self.past.row(back + 1).2, &row);
            }
        }
        self.row = row;
    }

    /// Errors of the predictions over the last window under each of some currents, in standard deviations; NaN where
    /// nothing was measured.
    fn errors(&mut self, currents: [[f64; 2]; CURRENTS]) -> [[f64; 3]; CURRENTS] {
        let CurrentOptions { motion, window, .. } = self.options;
        let deviations = self.error_deviations();
        let mut starts = core::mem::take(&mut self.starts);
        for (current, start) in currents.iter().zip(starts.chunks_exact_mut(self.state.len().max(1))) {
            self.observe_past(*current, window);
            self.replay.snapshot(start);
        }
        let mut predicted = core::mem::take(&mut self.predicted);
        self.replay.rollout_snapshots(CURRENTS, &starts, &self.commands, &mut self.work, &mut predicted);
        self.starts = starts;
        let size = predicted.len() / CURRENTS;
        let errors = core::array::from_fn(|i| {
            let end = &mut predicted[(i + 1) * size - self.measured.len()..(i + 1) * size];
            self.add_current(currents[i], self.past.row(0).1, 1.0, end);
            core::array::from_fn(|k| (self.measured[motion[k]] - end[motion[k]]) / deviations[k])
        });
        self.predicted = predicted;
        errors
    }

    /// The current after the last window; `None` where a number is not finite.
    fn estimate(&mut self, before: Current) -> Option<Estimated> {
        let CurrentOptions { initial, motion, .. } = self.options;
        let prior = inverse(before.covariance)?;
        let mut next = before;
        let mut slopes = self.slopes;
        let mut outlier = false;
        let mut log_evidence = 0.0;
        let step = STEP * initial;
        let missing = motion.map(|c| self.measured[c].is_nan());
        for iteration in 0..ITERATIONS {
            let c = next.velocity;
            let [error, moved @ ..] = self.errors([c, [c[0] + step, c[1]], [c[0], c[1] + step]]);
            let size = norm(error, missing);
            if iteration == 0 {
                outlier = size > FULL_WEIGHT;
            }
            let weight = if size > FULL_WEIGHT { FULL_WEIGHT / size } else { 1.0 };
            let mut information = prior;
            let from = [before.velocity[0] - c[0], before.velocity[1] - c[1]];
            let mut right = product(prior, from);
            for (i, e) in error.iter().enumerate().filter(|(i, _)| !missing[*i]) {
                let [north, east] = moved.map(|other| (e - other[i]) / step);
                information[0] += weight * north * north;
                information[1] += weight * north * east;
                information[2] += weight * east * east;
                right[0] += weight * north * e;
                right[1] += weight * east * e;
                slopes[i] = [north, east];
            }
            let covariance = inverse(information)?;
            let change = product(covariance, right);
            if !change.iter().all(|x| x.is_finite()) {
                return None;
            }
            next = Current { velocity: [c[0] + change[0], c[1] + change[1]], covariance };
            // Laplace approximation, with the errors linear from the last iteration on.
            let left =
                core::array::from_fn(|i| error[i] - slopes[i][0] * change[0] - slopes[i][1] * change[1]);
            let from = [change[0] - from[0], change[1] - from[1]];
            let cost = huber(norm(left, missing)) + 0.5 * quadratic(prior, from);
            log_evidence = 0.5 * Float::ln(determinant(prior) * determinant(covariance)) - cost;
            if change.iter().all(|x| x.abs() < SMALL * initial) {
                break;
            }
        }
        Some(Estimated { current: next, slopes, outlier, log_evidence })
    }
}
