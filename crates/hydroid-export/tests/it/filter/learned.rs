//! A run, and what a network learns along it in hydroid.

use hydroid::adapt::{self, Options};
use hydroid::model::{Body, Model};
use hydroid_core::adapt::{Adapter, Outcome};
use hydroid_core::model::recurrent::BaseModel;
use hydroid_core::predict::Workspace;

use super::program::{AHEAD, Plan};
use crate::models::{commands, drawn, first_outputs};
use crate::run::steady;

/// A run: commands and measurements, row by row.
#[derive(Clone)]
pub(super) struct Run {
    pub(super) first: Vec<f64>,
    pub(super) held: Vec<f64>,
    pub(super) commands: Vec<f64>,
    pub(super) measured: Vec<f64>,
}

/// Measurements of a vessel that is not the model: each output follows a mixture of the commands, whose effect changes along
/// the run, behind a lag. There are missing values, and an outlier.
pub(super) fn simulated(model: &Model, samples: usize) -> Run {
    let (first, held) = (first_outputs(model), commands(model, 1, 0.4));
    let (n, m) = (first.len(), held.len());
    let given = commands(model, samples, 2.0);
    let mut y = first.clone();
    let mut measured = Vec::new();
    for (k, c) in given.chunks_exact(m).enumerate() {
        let effect = 0.8 - 0.5 * k as f64 / samples as f64;
        for (i, y) in y.iter_mut().enumerate() {
            let target: f64 = c.iter().enumerate().map(|(j, c)| effect * c / (1 + i + j) as f64).sum();
            *y += (0.1 + 0.05 * i as f64) * (target - *y);
        }
        let noise = drawn(n, k as f64);
        let mut row: Vec<f64> = y.iter().zip(noise).map(|(y, noise)| y + 0.01 * noise).collect();
        if k % 97 == 13 {
            row[k % n] = f64::NAN;
        }
        if k == samples / 3 {
            row[k % n] += 1.0;
        }
        if (samples / 5..samples / 5 + 60).contains(&k) {
            row.fill(f64::NAN);
        }
        measured.extend(row);
    }
    Run { first, held, commands: given, measured }
}

/// What happens along a run.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Learned {
    /// Outputs after each step, and after each measurement.
    pub(super) outputs: Vec<f64>,
    /// Whether each measurement was used: 0, 1, or 2 for a divergence.
    pub(super) results: Vec<f64>,
    pub(super) weights: Vec<f64>,
    pub(super) predicted: Vec<f64>,
}

/// Starts a run. The memory of a base and the positions of actuators are those of a steady motion.
fn start(adapter: &mut dyn Adapter, model: &Model, run: &Run) {
    adapter.reset();
    let Body::Recurrent(network) = &model.body else { return };
    let limited = model.description.inputs.iter().any(|port| port.rate_limit.is_some());
    if !limited && !matches!(network.base, BaseModel::Equations(_)) {
        return adapter.observe(&run.first);
    }
    let session = steady(model, &run.first, &run.held);
    let mut snapshot = vec![0.0; session.snapshot_len()];
    session.snapshot(&mut snapshot);
    let front = snapshot.len() - network.network.state_len();
    snapshot[front..].fill(0.0);
    snapshot.extend(adapter.weights());
    adapter.restore(&snapshot);
}

impl Learned {
    pub(super) fn of(model: &Model, options: &Options, run: &Run, plan: &Plan) -> Self {
        let (mut adapter, _) = adapt::adapter(model, options, &[]).unwrap();
        let (n, m) = (run.first.len(), run.held.len());
        let mut own = Self::default();
        let mut work = Workspace::new();
        let (mut y, mut ahead) = (vec![0.0; n], vec![0.0; AHEAD * n]);
        for (k, (c, row)) in run.commands.chunks_exact(m).zip(run.measured.chunks_exact(n)).enumerate() {
            if k == 0 || k == plan.anew {
                start(adapter.as_mut(), model, run);
            }
            adapter.freeze((plan.frozen..plan.learning).contains(&k));
            adapter.advance(c);
            adapter.output(&mut y);
            own.outputs.extend(&y);
            adapter.observe(row);
            adapter.output(&mut y);
            own.outputs.extend(&y);
            own.results.push(match adapter.outcome() {
                Outcome::Rejected(_) => 2.0,
                Outcome::Waiting => 0.0,
                _ if (plan.frozen..plan.learning).contains(&k) => 0.0,
                _ => 1.0,
            });
            if k % plan.every == 0 {
                own.weights.extend(adapter.weights());
                adapter.rollout(&run.commands[..AHEAD * m], &mut work, &mut ahead);
                own.predicted.extend(&ahead);
            }
        }
        own
    }

    /// From the numbers of the program.
    pub(super) fn read(numbers: &[f64], samples: usize, n: usize, weights: usize, plan: &Plan) -> Self {
        let mut own = Self::default();
        let mut rest = numbers;
        let mut take = |count: usize| {
            let (taken, after) = rest.split_at(count);
            rest = after;
            taken
        };
        for k in 0..samples {
            own.outputs.extend(take(2 * n));
            own.results.extend(take(1));
            if k % plan.every == 0 {
                own.weights.extend(take(weights));
                own.predicted.extend(take(AHEAD * n));
            }
        }
        assert!(rest.is_empty());
        own
    }
}
