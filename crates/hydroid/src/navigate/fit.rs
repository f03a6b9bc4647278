//! Maximum likelihood of the statistics.

use hydroid_core::navigation::{Prior, State};

use super::measurements::{Runs, Statistics};

/// Statistics, constants of the vessel and the GNSS, and their likelihood.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The statistics.
    pub statistics: Statistics,
    /// Means and standard deviations of the constants, for the states of [`CONSTANTS`].
    pub constants: [(f64, f64); CONSTANTS.len()],
    /// Logarithm of the likelihood and the prior.
    pub log_likelihood: f64,
    /// Sweeps over the numbers.
    pub sweeps: usize,
}

/// States that are constant and multiply others. An extended Kalman filter with wide priors of them can converge to wrong
/// values; the likelihood of a filter with fixed values has no such error.
pub const CONSTANTS: [State; 4] = [State::Delay, State::Misalignment, State::Pivot, State::Heel];
/// First steps of the search for the constants.
const STEPS: [f64; CONSTANTS.len()] = [0.1, 0.01, 1.0, 0.5];

/// Sweeps at most.
const SWEEPS: usize = 12;
/// Gain of the log-likelihood in a sweep below which the search ends.
const ENOUGH: f64 = 1.0;

impl Fitted {
    /// A prior with the constants.
    #[must_use]
    pub fn prior(&self, prior: &Prior) -> Prior {
        let states = CONSTANTS.iter().zip(&self.constants);
        states.fold(prior.clone(), |prior, (state, (mean, deviation))| prior.with(*state, *mean, *deviation))
    }
}

/// Maximizes the likelihood of the innovations over the logarithms of the statistics, and its product with the prior over
/// the constants, one after the other, by a parabola through three points (coordinate-wise Newton method). The standard
/// deviation of a constant is that of the curvature.
pub fn fit(runs: &Runs, start: &Statistics, mut proceed: impl FnMut() -> bool) -> Fitted {
    let prior = Prior::default();
    let usual = CONSTANTS.map(|state| prior.mean[state as usize]);
    let widest = CONSTANTS.map(|state| prior.deviation[state as usize]);
    let mut numbers = start.numbers(&runs.sensors);
    let statistics = numbers.len();
    numbers.extend(usual);
    let value = |numbers: &[f64]| {
        let constants: [f64; CONSTANTS.len()] = std::array::from_fn(|i| numbers[statistics + i]);
        let away = constants.iter().zip(&usual).zip(&widest).map(|((x, mean), width)| (x - mean) / width);
        let prior: f64 = away.map(|x| -0.5 * x * x).sum();
        prior + runs.log_likelihood(&start.with_numbers(&runs.sensors, numbers), &constants)
    };
    let mut best = value(&numbers);
    let mut steps = vec![0.4; statistics];
    steps.extend(STEPS);
    let mut deviations = widest;
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
            steps[i] = if moved == 0.0 { 0.5 * step } else { moved.abs() };
            if i < statistics {
                steps[i] = steps[i].clamp(0.05, 0.8);
            } else {
                let widest = widest[i - statistics];
                let deviation = if curvature < 0.0 { (-1.0 / curvature).sqrt().min(widest) } else { widest };
                // A step of one standard deviation shows the curvature.
                if curvature < 0.0 {
                    steps[i] = steps[i].max(deviation);
                }
                deviations[i - statistics] = deviation;
            }
        }
        sweeps += 1;
        if best - before < ENOUGH {
            break;
        }
    }
    Fitted {
        statistics: start.with_numbers(&runs.sensors, &numbers),
        constants: std::array::from_fn(|i| (numbers[statistics + i], deviations[i])),
        log_likelihood: best,
        sweeps,
    }
}
