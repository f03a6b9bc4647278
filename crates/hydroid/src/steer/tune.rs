//! Gains of the autopilot, by a grid on voyages of its own.

use hydroid_core::control::{AutopilotSettings, HeadingGains, SpeedGains};
use hydroid_core::guidance::LineOfSightSettings;
use hydroid_core::vessel::{Command, Plant};
use rayon::prelude::*;
use serde::Serialize;

use super::error::SteerError;
use super::metrics::Metrics;
use super::sail::{Scene, sail};
use super::sea::Conditions;
use super::steering::{Kind, Steering};
use crate::progress::{Progress, silent};

/// Seeds that nothing else is sailed with.
const SEEDS: [u64; 3] = [0x7e57_0001, 0x7e57_0002, 0x7e57_0003];

/// Natural frequency of the heading \[rad/s\].
const OMEGA: [f64; 6] = [0.4, 0.7, 1.0, 1.5, 2.2, 3.2];
/// Look-ahead \[s\] at the cruising speed.
const LOOKAHEAD_S: [f64; 6] = [0.4, 0.7, 1.0, 1.5, 2.5, 4.0];
/// Integral of the line of sight, in shares of the cruising speed.
const SIGMA: [f64; 4] = [0.0, 0.1, 0.2, 0.4];
/// Gain of the speed, in masses over lags.
const PROPORTIONAL: [f64; 5] = [0.8, 1.5, 3.0, 6.0, 12.0];
/// How the moment of the rudder grows with the speed.
const EXPONENT: [f64; 2] = [1.0, 2.0];
/// Damping of the heading.
const ZETA: f64 = 1.0;

/// A point of the grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tuning {
    /// Natural frequency of the heading \[rad/s\].
    pub omega: f64,
    /// Look-ahead \[m\].
    pub lookahead: f64,
    /// Integral of the line of sight \[m/s\].
    pub sigma: f64,
    /// Gain of the speed \[N per m/s\].
    pub proportional: f64,
    /// Exponent of the speed in the gains of the heading.
    pub exponent: f64,
}

/// The best point, and what it was worth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tuned {
    /// The best of the grid.
    pub best: Tuning,
    /// Its score: the mean over the seeds of cross-track error \[m\] and speed error \[m/s\] together.
    pub score: f64,
    /// Points that were tried.
    pub tried: usize,
    /// Seeds that they were tried on, and nothing else is.
    pub seeds: Vec<u64>,
    /// Gain \[rad/s per unit of the rudder\] and time constant \[s\] of the vessel at the cruising speed, from a turning test.
    pub nomoto: [f64; 2],
    /// The settings.
    #[serde(skip)]
    pub settings: AutopilotSettings,
}

/// Tunes the autopilot for a scene at a cruising speed, as a yard would: speed trials and a turning test for the drag and the
/// Nomoto model, then a grid of gains on the vessel as built, in still water with its own noise; the least sum of cross-track
/// and speed error (1 m counts as 1 m/s) wins.
///
/// # Errors
/// If the scene is not possible, no point of the grid holds its course, or `progress` breaks off.
pub fn tune(scene: &Scene, cruise: f64, from_s: f64, progress: Progress<'_>) -> Result<Tuned, SteerError> {
    scene.check_from(from_s)?;
    let plant = Plant::new(&scene.vessel)?;
    let lag = scene.vessel.propeller.lag;
    let [mass, ..] = plant.mass_matrix();
    let nomoto = turning_test(scene, &plant, cruise);
    let drag = speed_trials(&plant, cruise);
    let mut grid = Vec::new();
    for omega in OMEGA {
        for seconds in LOOKAHEAD_S {
            for sigma in SIGMA {
                for gain in PROPORTIONAL {
                    for exponent in EXPONENT {
                        grid.push(Tuning {
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
    let settings = |tuning: &Tuning| {
        let [gain, time] = nomoto;
        let heading = HeadingGains::nomoto(gain, time, tuning.omega, ZETA, cruise);
        AutopilotSettings {
            line_of_sight: LineOfSightSettings { lookahead: tuning.lookahead, integral: tuning.sigma },
            // A slow frequency asks for less damping than the vessel has by itself.
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
            tolerance: scene.tolerance,
        }
    };
    let score = |tuning: &Tuning| -> Result<f64, SteerError> {
        let mut steering = Steering::new(Kind::Autopilot, &scene.vessel, scene.dt_s);
        steering.limits = scene.limits;
        steering.tolerance = scene.tolerance;
        steering.autopilot = Some(settings(tuning));
        let mut sum = 0.0;
        for seed in SEEDS {
            let mut helm = steering.helm(seed)?;
            let voyage = sail(scene, &Conditions::calm(seed), helm.as_mut(), &mut silent())?;
            let metrics = Metrics::of(&voyage, from_s);
            sum += if metrics.held { metrics.rms_cross_track + metrics.rms_speed } else { f64::INFINITY };
        }
        Ok(sum / SEEDS.len() as f64)
    };
    let mut scores = Vec::with_capacity(grid.len());
    for part in grid.chunks(4 * rayon::current_num_threads().max(1)) {
        scores.extend(part.par_iter().map(score).collect::<Result<Vec<f64>, SteerError>>()?);
        if progress(scores.len() as f64 / grid.len() as f64).is_break() {
            return Err(SteerError::Cancelled);
        }
    }
    // The first of equals.
    let best = (0..grid.len()).min_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
    if !scores[best].is_finite() {
        return Err(SteerError::Untunable);
    }
    Ok(Tuned {
        settings: settings(&grid[best]),
        best: grid[best],
        score: scores[best],
        tried: grid.len(),
        seeds: SEEDS.to_vec(),
        nomoto,
    })
}

/// `drag_1 U + drag_2 U^2` through the forces that hold half of the cruising speed and all of it; what would be negative is
/// left out.
fn speed_trials(plant: &Plant, cruise: f64) -> [f64; 2] {
    let force = |share: f64| plant.holding_force(share * cruise) / (share * cruise);
    let (half, full) = (force(0.5), force(1.0));
    let quadratic = ((full - half) / (0.5 * cruise)).max(0.0);
    [(full - quadratic * cruise).max(0.0), quadratic]
}

/// Yaw rate per rudder in the long run, and the time to 63 % of it, with a quarter of the rudder at the cruising speed.
fn turning_test(scene: &Scene, plant: &Plant, cruise: f64) -> [f64; 2] {
    const STEP_S: f64 = 0.01;
    const STEPS: u32 = 3_000;
    let rudder = 0.25 * scene.vessel.commands.rudder.limits[1];
    let actuation = plant.actuation(&Command { pp: plant.holding_force(cruise), rd: rudder });
    let mut motion = [cruise, 0.0, 0.0, plant.holding_force(cruise)];
    let mut rates = Vec::new();
    for _ in 0..STEPS {
        motion = plant.advance_motion(&motion, &actuation, STEP_S);
        // The engine holds the speed.
        (motion[0], motion[3]) = (cruise, plant.holding_force(cruise));
        rates.push(motion[2]);
    }
    let settled = rates.last().copied().unwrap_or(0.0);
    let risen = rates.iter().position(|r| r.abs() >= 0.632 * settled.abs()).unwrap_or(0);
    [settled / rudder, STEP_S * (risen + 1) as f64]
}
