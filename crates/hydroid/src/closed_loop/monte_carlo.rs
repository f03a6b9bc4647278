//! Monte Carlo simulation of the closed loop over seed, current, wind and mass.

use std::f64::consts::TAU;

use rand::RngExt as _;
use rayon::prelude::*;
use serde::Serialize;

use super::disturbance::Conditions;
use super::error::{ClosedLoopError, at_least};
use super::metrics::Metrics;
use super::options::ControllerOptions;
use super::random::{Purpose, stream};
use super::run::{Scenario, run};
use crate::progress::{Progress, silent};

/// Dispersion of the conditions about their nominal values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Dispersion {
    /// Relative deviation of the mass, uniform in `[-mass, mass]`.
    pub mass: f64,
    /// Largest additional current \[m/s\], uniform in speed and direction.
    pub current: f64,
    /// Largest additional steady wind force \[N\], uniform in size and direction. Half of it adds to the gusts.
    pub wind: f64,
}

impl Default for Dispersion {
    /// 20 % of the mass, 0.3 m/s current, 15 N wind.
    fn default() -> Self {
        Self { mass: 0.2, current: 0.3, wind: 15.0 }
    }
}

impl Dispersion {
    fn check(&self) -> Result<(), ClosedLoopError> {
        at_least("the dispersion of the current", self.current, 0.0)?;
        at_least("the dispersion of the wind", self.wind, 0.0)?;
        if (0.0..1.0).contains(&self.mass) {
            return Ok(());
        }
        let needed = "a share of 0 or more and less than 1 is needed";
        Err(ClosedLoopError::Option { what: "the dispersion of the mass", value: self.mass, needed })
    }

    fn draw(&self, nominal: &Conditions, index: u64) -> Conditions {
        // Consecutive seeds give independent streams: the seed is the key of ChaCha8.
        let seed = nominal.seed.wrapping_add(index);
        let mut random = stream(seed, Purpose::Conditions);
        let mut unit = || random.random::<f64>();
        let mass = nominal.mass * (1.0 + self.mass * (2.0 * unit() - 1.0));
        let mut vector = |most: f64, nominal: [f64; 2]| {
            let (size, (sin, cos)) = (most * unit(), (TAU * unit()).sin_cos());
            ([nominal[0] + size * cos, nominal[1] + size * sin], size)
        };
        let (current, _) = vector(self.current, nominal.current);
        let (force, size) = vector(self.wind, nominal.wind.force);
        let mut wind = nominal.wind;
        (wind.force, wind.gust) = (force, nominal.wind.gust.hypot(0.5 * size));
        Conditions { seed, current, wind, mass, ..*nominal }
    }
}

/// One run of a Monte Carlo simulation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// Conditions of the run.
    pub conditions: Conditions,
    /// Metrics of the run.
    pub metrics: Metrics,
}

/// Distribution of a metric over all trials.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Median.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub max: f64,
}

/// Result of a Monte Carlo simulation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MonteCarlo {
    /// Number of trials.
    pub runs: usize,
    /// Trials that held the track ([`Metrics::held`]).
    pub held: usize,
    /// Trials that diverged.
    pub diverged: usize,
    /// Sum of [`Metrics::violations`].
    pub violations: usize,
    /// Sum of [`Metrics::undetected_losses`].
    pub undetected_losses: usize,
    /// RMS distance from the reference \[m\].
    pub rms_position: Summary,
    /// RMS cross-track error \[m\].
    pub rms_cross_track: Summary,
    /// RMS speed error \[m/s\].
    pub rms_speed: Summary,
    /// Largest cross-track error \[m\].
    pub max_cross_track: Summary,
    /// Dispersion of the conditions.
    pub dispersion: Dispersion,
    /// Trials in the order of their seeds.
    pub trials: Vec<Trial>,
}

/// Simulates `runs` trials in parallel, each with conditions drawn about `nominal`. Trial `k` has the seed of `nominal`
/// plus `k`; the result does not depend on the number of threads.
///
/// # Errors
/// As [`run()`](super::run()) and [`ControllerOptions::controller`].
pub fn monte_carlo(
    control: &ControllerOptions,
    scenario: &Scenario,
    nominal: &Conditions,
    dispersion: &Dispersion,
    runs: usize,
    from_s: f64,
    progress: Progress<'_>,
) -> Result<MonteCarlo, ClosedLoopError> {
    dispersion.check()?;
    scenario.check_from(from_s)?;
    if runs == 0 {
        let needed = "at least one is needed";
        return Err(ClosedLoopError::Option { what: "the number of runs", value: 0.0, needed });
    }
    let mut trials = Vec::with_capacity(runs);
    // Progress and cancellation are handled between chunks.
    let chunk = rayon::current_num_threads().max(1);
    for first in (0..runs).step_by(chunk) {
        let part = first..(first + chunk).min(runs);
        let chunk_trials: Vec<Trial> = part
            .into_par_iter()
            .map(|index| {
                let conditions = dispersion.draw(nominal, index as u64);
                let mut controller = control.controller(conditions.seed)?;
                let run = run(scenario, &conditions, controller.as_mut(), &mut silent())?;
                Ok(Trial { conditions, metrics: Metrics::of(&run, from_s) })
            })
            .collect::<Result<_, ClosedLoopError>>()?;
        trials.extend(chunk_trials);
        if progress(trials.len() as f64 / runs as f64).is_break() {
            return Err(ClosedLoopError::Cancelled);
        }
    }
    let of = |figure: fn(&Metrics) -> f64| summary(trials.iter().map(|o| figure(&o.metrics)).collect());
    let sum = |figure: fn(&Metrics) -> usize| trials.iter().map(|o| figure(&o.metrics)).sum();
    Ok(MonteCarlo {
        runs,
        held: sum(|m| usize::from(m.held)),
        diverged: sum(|m| usize::from(m.diverged)),
        violations: sum(|m| m.violations),
        undetected_losses: sum(|m| m.undetected_losses),
        rms_position: of(|m| m.rms_position),
        rms_cross_track: of(|m| m.rms_cross_track),
        rms_speed: of(|m| m.rms_speed),
        max_cross_track: of(|m| m.max_cross_track),
        dispersion: *dispersion,
        trials,
    })
}

/// Percentiles by nearest rank; NaN ranks last.
fn summary(mut figures: Vec<f64>) -> Summary {
    for figure in &mut figures {
        *figure = if figure.is_nan() { f64::INFINITY } else { *figure };
    }
    figures.sort_unstable_by(f64::total_cmp);
    let rank = |share: f64| {
        // The rank is between 0 and the length.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let rank = (share * figures.len() as f64).ceil() as usize;
        figures.get(rank.saturating_sub(1)).copied().unwrap_or(f64::NAN)
    };
    Summary { median: rank(0.5), p95: rank(0.95), max: rank(1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_ranks_last() {
        let of = |figures: &[f64]| summary(figures.to_vec());
        let [plain, signed] = [f64::NAN, -f64::NAN].map(|nan| of(&[1.0, nan, 3.0, 2.0]));
        assert_eq!((plain.median, plain.p95, plain.max), (2.0, f64::INFINITY, f64::INFINITY));
        assert_eq!(plain, signed);
    }
}
