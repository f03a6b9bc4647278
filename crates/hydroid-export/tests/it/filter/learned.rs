//! A run, and what a network learns along it in hydroid.

use hydroid::adapt::{self, Options};
use hydroid::model::{Body, Model};
use hydroid_core::adapt::{Adapter, Outcome};
use hydroid_core::model::recurrent::BaseModel;
use hydroid_core::predict::Workspace;

use hydroid_export::Precision;

use crate::learning::{AHEAD, Run, program};
use crate::run::steady;

/// Samples at which something happens.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plan {
    /// Another run starts.
    pub(super) anew: usize,
    /// Learning is frozen, and continues.
    pub(super) frozen: usize,
    pub(super) learning: usize,
    /// The memory is copied, and the copy continues.
    pub(super) copied: usize,
    /// Samples between two comparisons of weights and rollouts.
    pub(super) every: usize,
}

pub(super) fn simulated(model: &Model, samples: usize) -> Run {
    Run::simulated(model, samples, samples / 5, |k| if k == samples / 3 { 1.0 } else { 0.0 })
}

/// The numbers that the filter in C writes along a run, and the text of its header.
pub(super) fn in_c(
    model: &Model,
    method: (&Options, Precision),
    (run, plan): (&Run, &Plan),
    flags: &[&str],
) -> (Vec<f64>, String) {
    let sizes = [
        ("ANEW", plan.anew),
        ("FROZEN", plan.frozen),
        ("LEARNING", plan.learning),
        ("COPIED", plan.copied),
        ("EVERY", plan.every),
    ];
    program(model, method, run, (include_str!("run.c"), &sizes), flags)
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
