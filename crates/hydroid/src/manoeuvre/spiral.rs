//! The direct spiral trial (Dieudonné).

use serde::Serialize;

use super::approach::Approach;
use super::error::ManoeuvreError;
use super::settling::{BLOCK, Settling};
use crate::plant::InputMap;

/// Results of a spiral trial.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Spiral {
    /// Steady turns, in the order of the trial: from starboard to port and back.
    pub points: Vec<SpiralPoint>,
    /// Whether the vessel is directionally stable: the yaw rate depends on the steering alone. `None` if the motion is not
    /// valid, or the yaw rate does not grow with the steering.
    pub stable: Option<bool>,
    /// Width of the loop: range of the steering within which the yaw rate depends on the side from which it is reached
    /// (1 is half of all steering); 0 for a stable vessel. Its resolution is a step of the trial, less than a hundredth
    /// of the steering about straight ahead.
    pub loop_width: Option<f64>,
    /// Height of the loop: largest difference of the yaw rates at the same steering \[deg/s\].
    pub loop_height_deg_s: Option<f64>,
    /// Why the motion after the last point is not valid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_valid: Option<String>,
}

/// A steady turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpiralPoint {
    /// Steering: 1 is hard to starboard.
    pub steering: f64,
    /// Steady yaw rate \[deg/s\], positive to starboard.
    pub yaw_rate_deg_s: f64,
    /// Speed \[m/s\].
    pub speed_m_s: f64,
}

/// Distance of speed and yaw rate from their limits, relative to them, at which a turn is steady.
const STEADY: f64 = 1e-4;

/// Simulates a direct spiral: the steering goes from `s` to starboard in `steps` steps to port and back, each held until the
/// yaw rate is constant or `longest_s` have passed. The steps grow with the steering, so that a narrow loop about straight ahead is
/// seen.
///
/// # Errors
/// If `steps` is zero.
pub fn spiral(
    approach: &Approach,
    map: &InputMap,
    s: f64,
    steps: u32,
    longest_s: f64,
) -> Result<Spiral, ManoeuvreError> {
    if steps == 0 {
        let needed = "at least one is needed";
        return Err(ManoeuvreError::Option { what: "the number of steps", value: 0.0, needed });
    }
    let mut simulation = approach.simulation.clone();
    let s = s.abs();
    let at = |k: u32| {
        let share = 1.0 - 2.0 * f64::from(k) / f64::from(steps);
        s * share * share.abs()
    };
    let down = (0..=steps).map(at);
    let up = (0..steps).rev().map(at);
    let mut points = Vec::new();
    // A hundredth of the largest yaw rate so far.
    let mut fastest = 0.0_f64;
    let mut command = map.command(approach.propulsion, 0.0);
    for steering in down.chain(up) {
        map.write_command(approach.propulsion, steering, &mut command);
        let mut elapsed = 0.0;
        let [u, v, r] = simulation.nu();
        let (mut speed, mut rate) = (Settling::from(u.hypot(v)), Settling::from(r));
        loop {
            for _ in 0..BLOCK {
                simulation.advance(&command);
            }
            if let Some(reason) = simulation.not_valid() {
                return Ok(Spiral {
                    points,
                    stable: None,
                    loop_width: None,
                    loop_height_deg_s: None,
                    not_valid: Some(reason),
                });
            }
            elapsed += BLOCK as f64 * simulation.dt();
            let [u, v, r] = simulation.nu();
            let now = u.hypot(v);
            let (left, turning) = (speed.update(now).abs(), rate.update(r).abs());
            let steady = left <= STEADY * approach.speed_m_s && turning <= STEADY * r.abs().max(fastest);
            fastest = fastest.max(1e-2 * r.abs());
            if steady || elapsed >= longest_s {
                points.push(SpiralPoint { steering, yaw_rate_deg_s: r.to_degrees(), speed_m_s: now });
                break;
            }
        }
    }
    Ok(Spiral::of(points))
}

/// Difference of the yaw rates at the same steering, relative to their range, from which a loop is one.
const LOOP: f64 = 0.02;

impl Spiral {
    /// The result of a trial whose second half has the steering of the first half in reverse.
    fn of(points: Vec<SpiralPoint>) -> Self {
        let half = points.len() / 2;
        let rates = || points.iter().map(|point| point.yaw_rate_deg_s);
        let range = rates().fold(0.0_f64, |most, rate| most.max(rate.abs()));
        let difference =
            |k: usize| (points[k].yaw_rate_deg_s - points[points.len() - 1 - k].yaw_rate_deg_s).abs();
        let inside: Vec<usize> = (0..half).filter(|&k| difference(k) > LOOP * range).collect();
        // Hysteresis is one contiguous part of the steering; each of its points stands for half of the steps beside it.
        let step = |k: usize| 0.5 * (points[k.saturating_sub(1)].steering - points[k + 1].steering).abs();
        let loop_width = inside.iter().map(|&k| step(k)).sum::<f64>();
        let loop_height_deg_s = inside.iter().map(|&k| difference(k)).fold(0.0, f64::max);
        let grows = points[..=half]
            .windows(2)
            .all(|pair| pair[0].yaw_rate_deg_s >= pair[1].yaw_rate_deg_s - LOOP * range);
        Self {
            stable: (grows || !inside.is_empty()).then_some(inside.is_empty()),
            points,
            loop_width: Some(loop_width),
            loop_height_deg_s: Some(loop_height_deg_s),
            not_valid: None,
        }
    }
}
