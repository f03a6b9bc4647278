//! Tuning of the autopilot by grid search on separate runs.

use hydroid_core::control::{AutopilotOptions, HeadingGains, SpeedGains};
use hydroid_core::guidance::LineOfSightOptions;
use hydroid_core::vessel::{Command, Plant};
use rayon::prelude::*;
use serde::Serialize;

use super::disturbance::Conditions;
use super::error::ClosedLoopError;
use super::metrics::Metrics;
use super::options::{ControlMethod, ControllerOptions};
use super::run::{Scenario, run};
use crate::progress::{Progress, silent};

/// Seeds used for tuning only.
const SEEDS: [u64; 3] = [0x7e57_0001, 0x7e57_0002, 0x7e57_0003];

/// Natural frequency of the heading \[rad/s\].
const OMEGA: [f64; 6] = [0.4, 0.7, 1.0, 1.5, 2.2, 3.2];
/// Look-ahead \[s\] at the cruising speed.
const LOOKAHEAD_S: [f64; 6] = [0.4, 0.7, 1.0, 1.5, 2.5, 4.0];
/// Integral gain of the line of sight, relative to the cruising speed.
const SIGMA: [f64; 4] = [0.0, 0.1, 0.2, 0.4];
/// Proportional gain of the speed, relative to mass over propeller lag.
const PROPORTIONAL: [f64; 5] = [0.8, 1.5, 3.0, 6.0, 12.0];
/// Exponent of the speed in the yaw moment of the rudder.
const EXPONENT: [f64; 2] = [1.0, 2.0];
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
    /// Proportional gain of the speed \[N per m/s\].
    pub proportional: f64,
    /// Exponent of the speed in the gains of the heading.
    pub exponent: f64,
}

/// Result of the grid search.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TunedAutopilot {
    /// Best point of the grid.
    pub best: GridPoint,
    /// Score of the best point: RMS cross-track error \[m\] plus RMS speed error \[m/s\], mean over the seeds.
    pub score: f64,
    /// Number of points.
    pub tried: usize,
    /// Seeds used for tuning only.
    pub seeds: Vec<u64>,
    /// Nomoto gain \[rad/s per unit of the rudder\] and time constant \[s\] at the cruising speed, from a turning test.
    pub nomoto: [f64; 2],
    /// Gains of the best point.
    #[serde(skip)]
    pub settings: AutopilotOptions,
}

/// Tunes the autopilot for a scenario at a cruising speed.
///
/// Speed trials give the drag and a turning test gives the Nomoto model. A grid of gains is then simulated on the
/// nominal vessel in calm water with measurement noise. The gains with the smallest sum of RMS cross-track error \[m\]
/// and RMS speed error \[m/s\] are chosen.
///
/// # Errors
/// If the scenario is invalid, no point of the grid holds the track, or `progress` cancels.
pub fn tune_autopilot(
    scenario: &Scenario,
    cruise: f64,
    from_s: f64,
    progress: Progress<'_>,
) -> Result<TunedAutopilot, ClosedLoopError> {
    scenario.check_from(from_s)?;
    let plant = Plant::new(&scenario.vessel)?;
    let lag = scenario.vessel.propeller.lag;
    let [mass, ..] = plant.mass_matrix();
    let nomoto = turning_test(scenario, &plant, cruise);
    let drag = speed_trials(&plant, cruise);
    let mut grid = Vec::new();
    for omega in OMEGA {
        for seconds in LOOKAHEAD_S {
            for sigma in SIGMA {
                for gain in PROPORTIONAL {
                    for exponent in EXPONENT {
                        grid.push(GridPoint {
                            omega,
                            lookahead: seconds * cruise,
                            sigma: sigma * cruise,
                            proportional: gain * mass / lag,
                            exponent,
                        });
                    }
                }
            }
        }
    }
    let settings = |tuning: &GridPoint| {
        let [gain, time] = nomoto;
        let heading = HeadingGains::nomoto(gain, time, tuning.omega, ZETA, cruise);
        AutopilotOptions {
            line_of_sight: LineOfSightOptions { lookahead: tuning.lookahead, integral: tuning.sigma },
            // At low frequencies the vessel's own damping exceeds the required one.
            heading: HeadingGains {
                exponent: tuning.exponent,
                derivative: heading.derivative.max(0.0),
                ..heading
            },
            speed: SpeedGains {
                proportional: tuning.proportional,
                integral: tuning.proportional / (8.0 * lag),
                drag,
            },
            steerage: 0.1 * cruise,
            tolerance: scenario.tolerance,
        }
    };
    let score = |tuning: &GridPoint| -> Result<f64, ClosedLoopError> {
        let mut control = ControllerOptions::new(ControlMethod::Autopilot, &scenario.vessel, scenario.dt_s);
        control.limits = scenario.limits;
        control.tolerance = scenario.tolerance;
        control.autopilot = Some(settings(tuning));
        let mut sum = 0.0;
        for seed in SEEDS {
            let mut controller = control.controller(seed)?;
            let run = run(scenario, &Conditions::calm(seed), controller.as_mut(), &mut silent())?;
            let metrics = Metrics::of(&run, from_s);
            sum += if metrics.held { metrics.rms_cross_track + metrics.rms_speed } else { f64::INFINITY };
        }
        Ok(sum / SEEDS.len() as f64)
    };
    let mut scores = Vec::with_capacity(grid.len());
    for part in grid.chunks(4 * rayon::current_num_threads().max(1)) {
        scores.extend(part.par_iter().map(score).collect::<Result<Vec<f64>, ClosedLoopError>>()?);
        if progress(scores.len() as f64 / grid.len() as f64).is_break() {
            return Err(ClosedLoopError::Cancelled);
        }
    }
    let best = (0..grid.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
    if !scores[best].is_finite() {
        return Err(ClosedLoopError::Untunable);
    }
    Ok(TunedAutopilot {
        settings: settings(&grid[best]),
        best: grid[best],
        score: scores[best],
        tried: grid.len(),
        seeds: SEEDS.to_vec(),
        nomoto,
    })
}

/// Non-negative coefficients of the drag `d_1 U + d_2 U^2` from the holding forces at half and full cruising speed.
fn speed_trials(plant: &Plant, cruise: f64) -> [f64; 2] {
    let force = |share: f64| plant.holding_force(share * cruise) / (share * cruise);
    let (half, full) = (force(0.5), force(1.0));
    let quadratic = ((full - half) / (0.5 * cruise)).max(0.0);
    [(full - quadratic * cruise).max(0.0), quadratic]
}

/// Steady yaw rate per rudder and time to 63.2 % of it, with a quarter of the rudder limit at the cruising speed.
fn turning_test(scenario: &Scenario, plant: &Plant, cruise: f64) -> [f64; 2] {
    const STEP_S: f64 = 0.01;
    const STEPS: u32 = 3_000;
    let rudder = 0.25 * scenario.vessel.commands.rudder.limits[1];
    let actuation = plant.actuation(&Command { pp: plant.holding_force(cruise), rd: rudder });
    let mut motion = [cruise, 0.0, 0.0, plant.holding_force(cruise)];
    let mut rates = Vec::new();
    for _ in 0..STEPS {
        motion = plant.advance_motion(&motion, &actuation, STEP_S);
        (motion[0], motion[3]) = (cruise, plant.holding_force(cruise));
        rates.push(motion[2]);
    }
    let settled = rates.last().copied().unwrap_or(0.0);
    let risen = rates.iter().position(|r| r.abs() >= 0.632 * settled.abs()).unwrap_or(0);
    [settled / rudder, STEP_S * (risen + 1) as f64]
}
