//! Whether a vessel can keep a station.

use std::f64::consts::{PI, TAU};

use hydroid_core::actuator::Limits;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::error::PlantError;
use super::simulation::Simulation;
use crate::model::Model;

/// Random commands, and directions that are tested.
const COMMANDS: usize = 300;
const DIRECTIONS: usize = 300;

/// Length of a test \[samples\].
const SAMPLES: usize = 100;

/// Least radius of a ball within the motions that commands cause from rest, relative to the greatest ones along the axes. An
/// octahedron, the hull of three independent forces, has 0.58.
const LEAST: f64 = 0.1;

/// Checks that the commands of a model can move the vessel from rest in every direction of surge, sway and yaw: the convex
/// hull of the motions that random commands within `limits` cause contains a ball around zero.
///
/// # Errors
/// If the model is not a plant, or the vessel cannot keep a station.
pub fn check_station(model: &Model, limits: &[Limits]) -> Result<(), PlantError> {
    let mut simulation = Simulation::new(model)?;
    let mut rest = super::simulation::middle(model);
    simulation.at_rest(&mut rest);
    let idle: Vec<f64> = limits.iter().map(|limits| limits.rest).collect();
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut mean_motion = |command: &[f64]| {
        simulation.start([0.0; 3], &rest, &idle);
        let mut sum = [0.0; 3];
        for _ in 0..SAMPLES {
            simulation.advance(command);
            sum.iter_mut().zip(simulation.nu()).for_each(|(sum, x)| *sum += x / SAMPLES as f64);
        }
        sum
    };
    // A model may drift under commands at rest.
    let drift = mean_motion(&idle);
    let mut motions: Vec<[f64; 3]> = Vec::new();
    for _ in 0..COMMANDS {
        let command: Vec<f64> =
            limits.iter().map(|limits| random.random_range(limits.low..=limits.high)).collect();
        let motion = mean_motion(&command);
        if motion.iter().all(|x| x.is_finite()) {
            motions.push(std::array::from_fn(|i| motion[i] - drift[i]));
        }
    }
    let most: [f64; 3] = std::array::from_fn(|i| {
        motions.iter().map(|motion| motion[i].abs()).fold(f64::MIN_POSITIVE, f64::max)
    });
    // Directions that are evenly spread over the sphere (Fibonacci lattice).
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let weakest = (0..DIRECTIONS)
        .map(|k| {
            let z = 1.0 - (2 * k + 1) as f64 / DIRECTIONS as f64;
            let (sin, cos) = (golden * k as f64 % TAU).sin_cos();
            let direction = [(1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z];
            let along = |motion: &[f64; 3]| (0..3).map(|i| direction[i] * motion[i] / most[i]).sum::<f64>();
            (motions.iter().map(along).fold(f64::NEG_INFINITY, f64::max), direction)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match weakest {
        Some((reach, direction)) if reach < LEAST => {
            let [u, v, r] = direction.map(f64::abs);
            let lacks = if v >= u && v >= r {
                "pushes it sideways"
            } else if u >= r {
                if direction[0] < 0.0 { "pushes it astern" } else { "pushes it ahead" }
            } else {
                "turns it on the spot"
            };
            let inputs = model.description.inputs.iter().map(|port| port.channel.name.as_str());
            Err(PlantError::NoStation { inputs: inputs.collect::<Vec<_>>().join(", "), lacks })
        }
        _ => Ok(()),
    }
}
