//! Limits of the rates of the actuators behind the inputs, found by cross-validation.
//!
//! A limit is not a coefficient of a regression, but for given limits the positions of the actuators are known
//! ([`RateLimiter`]), and difference equations in the positions are linear in their coefficients. The limits that minimize
//! the cross-validated errors of their rollouts are suggested (variable projection, as for the currents of runs). An input
//! has no limit unless the limit reduces the errors by more than one standard error over the folds (one-standard-error rule:
//! L. Breiman et al., *Classification and Regression Trees*, 1984, section 3.4.3).

use hydroid_core::rate_limit::RateLimiter;
use rayon::prelude::*;

use super::candidates::Grid;
use super::folds::folds;
use super::library::Library;
use crate::log::{Table, Trajectory};
use crate::progress::{self, Cancelled, Progress};
use crate::sindy::{BlockLosses, subsample};

/// Libraries and numbers of past values of the regressions, and their ridge penalty.
const LIBRARIES: [Library; 2] = [Library::Plain, Library::Marine];
const LAGS: [usize; 2] = [1, 2];
const RIDGE: f64 = 1e-4;

/// Most samples of all runs, and the shortest segment of a longer run.
const SAMPLES: usize = 100_000;
const SEGMENT: usize = 3_000;

/// Halvings of the time in which an actuator passes its range, from the horizon on.
const HALVINGS: i32 = 4;

/// Halvings of the step around the best of these times.
const REFINEMENTS: i32 = 3;

/// A run with the positions of its actuators in place of its commands. `rates` has a rate for each input \[unit/s\].
pub fn positions(run: &Trajectory, rates: &[Option<f64>]) -> Trajectory {
    let Some(mut limiter) = RateLimiter::new(rates.iter().copied(), run.dt) else { return run.clone() };
    let mut values = run.inputs.rows(0, run.len()).to_vec();
    values.chunks_exact_mut(run.inputs.width()).for_each(|row| limiter.advance(row));
    Trajectory { inputs: Table::new(run.inputs.channels().to_vec(), values), ..run.clone() }
}

/// A limit for each input \[unit/s\]; `None` where none is found. Only the first `actuators` inputs belong to actuators.
///
/// # Errors
/// If `progress` cancels.
pub fn suggest(
    runs: &[&Trajectory],
    actuators: usize,
    horizon: usize,
    progress: Progress<'_>,
) -> Result<Vec<Option<f64>>, Cancelled> {
    let Some(run) = runs.first() else { return Ok(Vec::new()) };
    let mut rates = vec![None; run.inputs.width()];
    let runs = subsample(runs, SAMPLES, SEGMENT.max(10 * horizon));
    let horizon_s = horizon as f64 * run.dt;
    let Some(mut least) = losses(&runs, &rates, horizon) else { return Ok(rates) };
    for c in 0..actuators.min(rates.len()) {
        progress::report(progress, c as f64 / actuators as f64)?;
        let values = || runs.iter().flat_map(|run| run.inputs.column(c));
        let (low, high) =
            values().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        if high <= low {
            continue;
        }
        // The actuator passes its range in the horizon, halved `exponent` times.
        let rate = |exponent: f64| (high - low) * 2.0_f64.powf(exponent) / horizon_s;
        let limited = |exponent: f64| {
            let mut rates = rates.clone();
            rates[c] = Some(rate(exponent));
            Some((exponent, losses(&runs, &rates, horizon)?))
        };
        let better = |a: &(f64, BlockLosses), b: &(f64, BlockLosses)| a.1.mean().total_cmp(&b.1.mean());
        let coarse = (0..=HALVINGS).map(f64::from).filter_map(limited);
        let Some(mut found) = coarse.min_by(better) else { continue };
        for refinement in 1..=REFINEMENTS {
            let step = 0.5_f64.powi(refinement);
            let sides = [found.0 - step, found.0 + step].map(limited);
            for next in sides.into_iter().flatten() {
                if better(&next, &found).is_lt() {
                    found = next;
                }
            }
        }
        if found.1.is_significantly_better(&least) {
            rates[c] = Some(rate(found.0));
            least = found.1;
        }
    }
    Ok(rates)
}

/// Losses on the folds of the best regression in the positions of the actuators.
fn losses(runs: &[Trajectory], rates: &[Option<f64>], horizon: usize) -> Option<BlockLosses> {
    let runs: Vec<Trajectory> = runs.iter().map(|run| positions(run, rates)).collect();
    let runs: Vec<&Trajectory> = runs.iter().collect();
    let grid = Grid::part(&runs, folds(&runs, 0), horizon, &LIBRARIES, &LAGS).ok()?;
    let all: Vec<BlockLosses> = grid
        .with_ridge(RIDGE)
        .par_iter()
        .filter_map(|candidate| {
            let validation = grid.losses(&grid.predictions(candidate)?);
            Some(BlockLosses { validation, training: Vec::new() })
        })
        .collect();
    all.into_iter().min_by(|a, b| a.mean().total_cmp(&b.mean()))
}
