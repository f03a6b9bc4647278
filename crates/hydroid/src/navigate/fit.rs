//! Maximum likelihood of the statistics.

use super::measurements::{Runs, Statistics};

/// Statistics and their likelihood.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The estimate.
    pub statistics: Statistics,
    /// Logarithm of its likelihood.
    pub log_likelihood: f64,
    /// Sweeps over the numbers.
    pub sweeps: usize,
}

/// Sweeps at most.
const SWEEPS: usize = 12;
/// Gain of the log-likelihood in a sweep below which the search ends.
const ENOUGH: f64 = 1.0;

/// Maximizes the likelihood of the innovations over the logarithms of the statistics, one after the other, by a parabola
/// through three points (coordinate-wise Newton method).
pub fn fit(runs: &Runs, start: &Statistics, mut proceed: impl FnMut() -> bool) -> Fitted {
    let mut numbers = start.numbers(&runs.sensors);
    let value = |numbers: &[f64]| runs.log_likelihood(&start.with_numbers(&runs.sensors, numbers));
    let mut best = value(&numbers);
    let mut steps = vec![0.4; numbers.len()];
    let mut sweeps = 0;
    while sweeps < SWEEPS {
        let before = best;
        for i in 0..numbers.len() {
            if !proceed() {
                break;
            }
            let at = |shift: f64| {
                let mut moved = numbers.clone();
                moved[i] += shift;
                value(&moved)
            };
            let step: f64 = steps[i];
            let (up, down) = rayon::join(|| at(step), || at(-step));
            let curvature = (up - 2.0 * best + down) / (step * step);
            let slope = (up - down) / (2.0 * step);
            let newton = if curvature < 0.0 { -slope / curvature } else { 2.0 * step.copysign(slope) };
            let newton = newton.clamp(-4.0 * step, 4.0 * step);
            let candidates = [(at(newton), newton), (up, step), (down, -step)];
            let mut moved = 0.0;
            for (value, shift) in candidates {
                if value > best {
                    (best, moved) = (value, shift);
                }
            }
            numbers[i] += moved;
            steps[i] = if moved == 0.0 { 0.5 * step } else { moved.abs().clamp(0.05, 0.8) };
        }
        sweeps += 1;
        if best - before < ENOUGH {
            break;
        }
    }
    Fitted { statistics: start.with_numbers(&runs.sensors, &numbers), log_likelihood: best, sweeps }
}
