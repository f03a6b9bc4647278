//! Stability check: rollouts of equations from random states under random commands inside the training range.

use std::sync::Arc;

use hydroid_core::model::sparse::{Equations, EquationsSession};
use hydroid_core::predict::{Predictor, Workspace};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::evaluate::DesignRange;

/// Options of the stability check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StabilityOptions {
    /// Number of rollouts.
    pub rollouts: usize,
    /// Length of a rollout \[samples\].
    pub steps: usize,
    /// Seed of states and commands.
    pub seed: u64,
}

/// Result of the stability check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StabilityCheck {
    /// Rollouts made.
    pub rollouts: usize,
    /// Rollouts that were not finite or left ten times the design range.
    pub unbounded: usize,
}

impl StabilityCheck {
    /// Whether every rollout stayed bounded.
    pub fn is_bounded(self) -> bool {
        self.unbounded == 0
    }
}

/// Rolls equations out from initial outputs drawn uniformly from their design ranges, under commands drawn
/// uniformly from their ranges and held for random times. The commands before a rollout equal its first
/// command.
pub fn stability_check(
    equations: &Equations,
    outputs: &[DesignRange],
    inputs: &[DesignRange],
    options: StabilityOptions,
) -> StabilityCheck {
    let equations = Arc::new(equations.clone());
    let unbounded = (0..options.rollouts)
        .into_par_iter()
        .map_init(
            || (EquationsSession::new(Arc::clone(&equations)), Workspace::new()),
            |(session, work), index| {
                let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
                rng.set_stream(index as u64);
                let mut within =
                    |range: &DesignRange| range.low + (range.high - range.low) * rng.random::<f64>();
                let state: Vec<f64> = outputs.iter().map(&mut within).collect();
                let mut commands = Vec::with_capacity(options.steps * inputs.len());
                let mut held: Vec<f64> = inputs.iter().map(&mut within).collect();
                for _ in 0..options.steps {
                    let change = within(&DesignRange { low: 0.0, high: 1.0 });
                    if change * (options.steps as f64) < 20.0 {
                        held = inputs.iter().map(&mut within).collect();
                    }
                    commands.extend_from_slice(&held);
                }
                session.reset();
                for _ in 0..session.warm_up() {
                    session.observe(&state);
                    session.advance(&commands[..inputs.len()]);
                }
                session.observe(&state);
                let mut y = vec![0.0; options.steps * outputs.len()];
                session.rollout(&commands, work, &mut y);
                let diverged = y
                    .chunks_exact(outputs.len())
                    .any(|row| row.iter().zip(outputs).any(|(value, range)| range.diverged(*value)));
                usize::from(diverged)
            },
        )
        .sum();
    StabilityCheck { rollouts: options.rollouts, unbounded }
}
