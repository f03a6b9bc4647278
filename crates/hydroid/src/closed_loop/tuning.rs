//! Tuning of the autopilot by grid search on separate runs.

use hydroid_core::control::{AutopilotOptions, HeadingGains, SpeedGains};
use hydroid_core::guidance::LineOfSightOptions;
use rayon::prelude::*;
use serde::Serialize;

use super::autopilot::AutopilotGains;
use super::disturbance::Conditions;
use super::error::ClosedLoopError;
use super::metrics::Metrics;
use super::options::{ControlMethod, ControllerOptions};
use super::run::{Scenario, run};
use crate::manoeuvre::Response;
use crate::plant::InputMap;
use crate::progress::{Progress, silent};

/// Seeds used for tuning only.
const SEEDS: [u64; 3] = [0x7e57_0001, 0x7e57_0002, 0x7e57_0003];

/// Natural frequency of the heading, relative to that of the response in yaw, `1 / T`.
const OMEGA: [f64; 6] = [0.3, 0.5, 0.8, 1.3, 2.1, 3.4];
/// Look-ahead, relative to the cruising speed over the natural frequency.
const LOOKAHEAD: [f64; 4] = [0.7, 1.4, 2.8, 5.6];
/// Integral gain of the line of sight, relative to the cruising speed.
const SIGMA: [f64; 4] = [0.0, 0.1, 0.2, 0.4];
/// Exponent of the speed in the yaw moment of the steering.
const EXPONENT: [f64; 2] = [1.0, 2.0];
/// Ratio of the time constants of the surge velocity without and with control, less 1.
const PROPORTIONAL: [f64; 6] = [1.0, 2.0, 5.0, 10.0, 20.0, 40.0];
/// Speed gain while the gains of the heading are searched.
const USUAL_PROPORTIONAL: f64 = 5.0;
/// Integral time of the speed, relative to its time constant with control.
const INTEGRAL_TIME: f64 = 8.0;
/// Damping ratio of the heading.
const ZETA: f64 = 1.0;

/// Point of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GridPoint {
    /// Natural frequency of the heading \[rad/s\].
    pub omega: f64,
    /// Look-ahead \[m\].
    pub lookahead: f64,
    /// Integral gain of the line of sight \[m/s\].
    pub sigma: f64,
    /// Proportional gain of the speed \[1/(m/s)\]: full ahead is 1.
    pub proportional: f64,
    /// Exponent of the speed in the gains of the heading.
    pub exponent: f64,
}

/// Result of the grid search.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TunedAutopilot {
    /// Best point of the grid.
    pub best: GridPoint,
    /// Score of the best point: RMS cross-track error relative to the tolerance plus RMS speed error relative to the
    /// cruising speed, mean over the seeds.
    pub score: f64,
    /// Number of points.
    pub tried: usize,
    /// Seeds used for tuning only.
    pub seeds: Vec<u64>,
    /// Response of the vessel at the cruising speed.
    pub response: Response,
    /// Gains of the best point.
    pub gains: AutopilotGains,
}

/// Tunes the autopilot for a scenario at a cruising speed.
///
/// Tests give the [`Response`] of the plant to steering and propulsion. A grid of gains of the heading, and then one of the
/// speed, is simulated in calm water with measurement noise. The gains with the smallest score are chosen.
///
/// # Errors
/// If the scenario is invalid, no point of the grid holds the track, or `progress` cancels.
pub fn tune_autopilot(
    scenario: &Scenario,
    inputs: &InputMap,
    cruise: f64,
    from_s: f64,
    progress: Progress<'_>,
) -> Result<TunedAutopilot, ClosedLoopError> {
    scenario.check_from(from_s)?;
    let response = Response::of(&*scenario.plant.model(scenario.dt_s)?, inputs, cruise)?;
    let Response { yaw_gain_rad_s: gain, yaw_time_s: time, .. } = response;
    let (Some(surge), Some(propulsion)) = (response.surge, response.propulsion) else {
        return Err(ClosedLoopError::NoPropulsion(inputs.no_propulsion().unwrap_or_default()));
    };
    let proportional = |ratio: f64| ratio / surge.gain_m_s;
    let mut grid = Vec::new();
    for omega in OMEGA.map(|omega| omega / time) {
        for lookahead in LOOKAHEAD.map(|share| share * cruise / omega) {
            for sigma in SIGMA.map(|share| share * cruise) {
                for exponent in EXPONENT {
                    let proportional = proportional(USUAL_PROPORTIONAL);
                    grid.push(GridPoint { omega, lookahead, sigma, proportional, exponent });
                }
            }
        }
    }
    let gains = |point: &GridPoint| {
        let heading = HeadingGains::nomoto(gain, time, point.omega, ZETA, cruise);
        let closed_s = surge.time_s / (1.0 + point.proportional * surge.gain_m_s);
        let options = AutopilotOptions {
            line_of_sight: LineOfSightOptions { lookahead: point.lookahead, integral: point.sigma },
            // At low frequencies the vessel's own damping exceeds the required one.
            heading: HeadingGains {
                exponent: point.exponent,
                derivative: heading.derivative.max(0.0),
                ..heading
            },
            speed: SpeedGains {
                proportional: point.proportional,
                integral: point.proportional / (INTEGRAL_TIME * closed_s),
                trim: [propulsion - response.speed_m_s / surge.gain_m_s, 1.0 / surge.gain_m_s],
            },
            steerage: 0.1 * cruise,
            tolerance: scenario.tolerance,
        };
        AutopilotGains { options, inputs: inputs.clone() }
    };
    let score = |point: &GridPoint| -> Result<f64, ClosedLoopError> {
        let mut control = ControllerOptions::new(ControlMethod::Autopilot, &scenario.plant, scenario.dt_s);
        control.limits.clone_from(&scenario.limits);
        control.tolerance = scenario.tolerance;
        control.autopilot = Some(gains(point));
        let mut sum = 0.0;
        for seed in SEEDS {
            let mut controller = control.controller(seed)?;
            let run = run(scenario, &Conditions::calm(seed), controller.as_mut(), &mut silent())?;
            let metrics = Metrics::of(&run, from_s);
            sum += if metrics.held {
                metrics.rms_cross_track / scenario.tolerance + metrics.rms_speed / cruise
            } else {
                f64::INFINITY
            };
        }
        Ok(sum / SEEDS.len() as f64)
    };
    let tried = grid.len() + PROPORTIONAL.len();
    let mut done = 0;
    let mut best_of = |grid: &[GridPoint]| -> Result<(GridPoint, f64), ClosedLoopError> {
        let mut scores = Vec::with_capacity(grid.len());
        for part in grid.chunks(4 * rayon::current_num_threads().max(1)) {
            scores.extend(part.par_iter().map(score).collect::<Result<Vec<f64>, ClosedLoopError>>()?);
            if progress((done + scores.len()) as f64 / tried as f64).is_break() {
                return Err(ClosedLoopError::Cancelled);
            }
        }
        done += grid.len();
        let best = (0..grid.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
        Ok((grid[best], scores[best]))
    };
    let (heading, _) = best_of(&grid)?;
    let speeds = PROPORTIONAL.map(|ratio| GridPoint { proportional: proportional(ratio), ..heading });
    let (best, score) = best_of(&speeds)?;
    if !score.is_finite() {
        return Err(ClosedLoopError::Untunable);
    }
    Ok(TunedAutopilot { gains: gains(&best), best, score, tried, seeds: SEEDS.to_vec(), response })
}
