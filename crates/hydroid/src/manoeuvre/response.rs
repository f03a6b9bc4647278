//! The response of a vessel to small changes of propulsion and steering.

use std::f64::consts::PI;

use serde::Serialize;

use super::approach::{Approach, Options};
use super::error::ManoeuvreError;
use super::settling::BLOCK;
use crate::model::Model;
use crate::plant::{InputMap, Simulation};

/// First-order response of a vessel about a straight course at a steady speed.
///
/// ```text
/// T dr/dt + r = K s         Nomoto model of the yaw rate (T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion
///                           Control, 2nd edition, 2021, section 7.2)
/// T_u du/dt + u = K_u p     surge velocity
/// ```
///
/// with the changes of steering `s` (1: hard over) and propulsion `p` (1: full ahead) from the straight course.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Response {
    /// Speed through the water \[m/s\].
    pub speed_m_s: f64,
    /// Propulsion that holds the speed; none for a vessel that no input pushes.
    pub propulsion: Option<f64>,
    /// Steering that holds the course.
    pub steering: f64,
    /// `K`: largest yaw rate after a quarter of the steering, within half a turn, for the whole steering \[rad/s\].
    pub yaw_gain_rad_s: f64,
    /// `T`: time to 63.2 % of this yaw rate \[s\].
    pub yaw_time_s: f64,
    /// Response to the propulsion; none for a vessel that no input pushes.
    #[serde(flatten)]
    pub surge: Option<SurgeResponse>,
    /// Half of the tactical diameter with the steering hard over, the larger one of both sides \[m\].
    pub turning_radius_m: f64,
}

/// First-order response of the surge velocity to the propulsion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SurgeResponse {
    /// `K_u`: change of the steady speed for the whole propulsion \[m/s\].
    #[serde(rename = "surge_gain_m_s")]
    pub gain_m_s: f64,
    /// `T_u`: time to 63.2 % of the change \[s\].
    #[serde(rename = "surge_time_s")]
    pub time_s: f64,
}

/// Longest test \[blocks\].
const MOST_BLOCKS: usize = 200;

/// Change of steering and propulsion in a test.
const STEP: f64 = 0.25;

/// Change over a block, relative to that of the whole test, at which a test ends.
const STEADY: f64 = 0.01;

impl Response {
    /// Measures the response of a model by a test of the steering, one of the propulsion, and turns to both sides.
    ///
    /// # Errors
    /// If the vessel does not reach the speed, holds no straight course, or diverges.
    pub fn of(model: &Model, map: &InputMap, speed_m_s: f64) -> Result<Self, ManoeuvreError> {
        let options = Options { speed_m_s: Some(speed_m_s), ..Options::default() };
        Self::about(&Approach::new(model, map, Simulation::new(model)?, &options)?, map)
    }

    /// Measures the response about an approach.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub fn about(approach: &Approach, map: &InputMap) -> Result<Self, ManoeuvreError> {
        let Approach { propulsion, steering, speed_m_s, .. } = *approach;
        let side = if steering > 0.0 { -STEP } else { STEP };
        let more = if propulsion > 1.0 - STEP { -STEP } else { STEP };
        let (yaw, yaw_time_s) =
            test(approach, map, [propulsion, steering + side], |simulation| simulation.nu()[2])?;
        let is_pushed = map.no_propulsion().is_none();
        let surge = if is_pushed {
            let command = [propulsion + more, steering];
            let (change, time_s) = test(approach, map, command, |simulation| simulation.nu()[0])?;
            Some(SurgeResponse { gain_m_s: change / more, time_s })
        } else {
            None
        };
        let mut turning_radius_m = 0.0_f64;
        for side in [-1.0, 1.0] {
            turning_radius_m = turning_radius_m.max(0.5 * tactical_diameter(approach, map, side)?);
        }
        Ok(Self {
            speed_m_s,
            propulsion: is_pushed.then_some(propulsion),
            steering,
            yaw_gain_rad_s: yaw / side,
            yaw_time_s,
            surge,
            turning_radius_m,
        })
    }
}

/// Distance across the course at a change of heading by 180 degrees, with the steering hard over \[m\].
fn tactical_diameter(approach: &Approach, map: &InputMap, side: f64) -> Result<f64, ManoeuvreError> {
    let (command, mut simulation) = (map.command(approach.propulsion, side), approach.simulation.clone());
    for _ in 0..MOST_BLOCKS * BLOCK {
        simulation.advance(&command);
        simulation.check()?;
        // The approach heads north from the origin.
        if simulation.heading() * side >= PI {
            return Ok(simulation.eta()[1].abs());
        }
    }
    Err(ManoeuvreError::NoTurn {
        t_s: (MOST_BLOCKS * BLOCK) as f64 * simulation.dt(),
        turned_deg: simulation.heading().to_degrees().abs(),
    })
}

/// Largest change of a quantity after a change of propulsion and steering, and the time to 63.2 % of it.
fn test(
    approach: &Approach,
    map: &InputMap,
    [p, s]: [f64; 2],
    read: impl Fn(&Simulation) -> f64,
) -> Result<(f64, f64), ManoeuvreError> {
    let (command, mut simulation) = (map.command(p, s), approach.simulation.clone());
    let (start, dt) = (read(&simulation), simulation.dt());
    let mut changes: Vec<f64> = Vec::new();
    let mut largest = 0.0_f64;
    for block in 0..MOST_BLOCKS {
        let before = largest;
        for _ in 0..BLOCK {
            simulation.advance(&command);
            let change = read(&simulation) - start;
            changes.push(change);
            if change.abs() > largest.abs() {
                largest = change;
            }
        }
        simulation.check()?;
        let turned = simulation.heading().abs() >= PI;
        if turned || block > 0 && (largest - before).abs() <= STEADY * largest.abs() {
            break;
        }
    }
    let risen = changes.iter().position(|change| change / largest >= 0.632).unwrap_or(0);
    Ok((largest, dt * (risen + 1) as f64))
}
