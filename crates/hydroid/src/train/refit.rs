//! Refit on training and validation runs.
//!
//! On a short log the validation runs are a large part of the data, and too short for reliable early stopping: an epoch
//! in the middle of the schedule may be best by chance. The refit therefore trains the selected restart again on all
//! runs, from its initial weights and over the same number of epochs, and uses the last weights. The network before the
//! refit ([`Refit::before`]) remains available for evaluation on the validation runs.

use std::path::{Path, PathBuf};

use hydroid_core::math::Scalar;
use serde::{Deserialize, Serialize};

use super::{
    Ending, Job, Phase, ProgressCallback, Status, TrainError, TrainOptions, Trained, TrainedNetwork, advance,
    finish,
};
use crate::log::{Table, Trajectory};

/// Result of a refit.
#[derive(Clone, Debug, PartialEq)]
pub struct Refit {
    /// Network before the refit, which was not trained on the validation runs.
    pub before: TrainedNetwork,
    /// Whether the refitted network is used.
    pub outcome: Outcome,
    /// Error of the refitted network on the validation runs (of its training); infinite if diverged or out of time.
    pub validation: f64,
}

/// Decision about the refitted network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Used.
    Taken,
    /// Not used: its error on the validation runs is larger than that of the network before the refit.
    Worse,
    /// Not used: the time was over before all epochs were done.
    Budget,
}

impl Refit {
    /// Whether the refitted network is used.
    pub fn is_taken(&self) -> bool {
        self.outcome == Outcome::Taken
    }
}

/// Checkpoint file of the refit.
pub fn refit_checkpoint(checkpoint: &Path) -> PathBuf {
    checkpoint.with_extension("refit.checkpoint")
}

pub(super) fn train<T: Scalar>(
    job: &Job<'_>,
    options: &TrainOptions,
    checkpoint: Option<&Path>,
    watch: ProgressCallback<'_>,
) -> Result<Trained, TrainError> {
    let joined = joined(job.runs.iter().chain(job.validation).copied());
    let all: Vec<&Trajectory> = joined.iter().collect();
    let samples = |runs: &[&Trajectory]| runs.iter().map(|run| run.len()).sum::<usize>() as f64;
    // The time of an epoch is proportional to the number of samples.
    let share = samples(job.runs) / (samples(job.runs) + samples(&all));
    let first = TrainOptions { budget_s: options.budget_s.map(|budget| share * budget), ..options.clone() };
    let mut trained = {
        let watch = &mut |status: &Status| {
            let whole = status.seconds_left / (1.0 - status.fraction).max(1e-3);
            let seconds_left = status.seconds_left + whole * (1.0 - share) / share;
            watch(&Status { fraction: share * status.fraction, seconds_left, ..*status })
        };
        let (restarts, ending, clock) = advance::<T>(job, &first, checkpoint, watch, Phase::Selection)?;
        finish(&restarts, options, ending, &clock)?
    };
    let dt = job.runs[0].dt;
    let recurrent = trained.model.recurrent().is_some();
    let again = TrainOptions {
        epochs: trained.history.len(),
        patience: None,
        restarts: 1,
        ensemble: false,
        // Windows keep their shape although the runs are longer.
        wash_out_s: recurrent.then_some(trained.wash_out as f64 * dt),
        history_s: (!recurrent).then_some((trained.wash_out + 1) as f64 * dt),
        window_s: Some(trained.window as f64 * dt),
        budget_s: options.budget_s.map(|budget| (budget - trained.seconds).max(1e-3 * budget)),
        ..options.clone()
    };
    let job = Job { runs: &all, ..job.clone() };
    let checkpoint = checkpoint.map(refit_checkpoint);
    if let Some(path) = &checkpoint {
        make_room(&job, &again, path)?;
    }
    let known = trained.validation;
    let watch = &mut |status: &Status| {
        let fraction = share + (1.0 - share) * status.fraction;
        watch(&Status { fraction, validation: known, ..*status })
    };
    let phase = Phase::FinalFit { restart: trained.restart };
    let (restarts, ending, clock) = advance::<T>(&job, &again, checkpoint.as_deref(), watch, phase)?;
    let member = &restarts.members[0];
    let outcome = match ending {
        Ending::Budget => Outcome::Budget,
        // False for NaN.
        _ if member.best_score <= known => Outcome::Taken,
        _ => Outcome::Worse,
    };
    let before = trained.model.clone();
    if outcome == Outcome::Taken {
        trained.model = restarts.plan.net.model(&member.best, &restarts.plan.scaling, restarts.plan.shape);
        rescale(&mut trained.members, &before, &trained.model);
    }
    trained.seconds += clock.seconds();
    trained.refit = Some(Refit { before, outcome, validation: member.best_score });
    Ok(trained)
}

/// Ensemble members have the correction scale of the network before the refit.
fn rescale(members: &mut [Vec<f64>], before: &TrainedNetwork, now: &TrainedNetwork) {
    let (TrainedNetwork::Direct(before), TrainedNetwork::Direct(now)) = (before, now) else { return };
    let (old, new) = (&before.scaling.correction_scale, &now.scaling.correction_scale);
    for member in members {
        for tensor in now.network.tensors().iter().rev().take(2) {
            for (row, weights) in member[tensor.range()].chunks_exact_mut(tensor.columns).enumerate() {
                let channel = row % old.len();
                for w in weights {
                    *w *= old[channel] / new[channel];
                }
            }
        }
    }
}

/// Removes the refit checkpoint of another job; the first checkpoint of that job was renamed or removed before.
fn make_room(job: &Job<'_>, options: &TrainOptions, path: &Path) -> Result<(), TrainError> {
    if !path.exists() || job.is_kept_in(options, path) == [true; 2] {
        return Ok(());
    }
    std::fs::rename(path, path.with_extension("checkpoint.old")).map_err(|source| TrainError::Checkpoint {
        path: path.to_owned(),
        reason: format!("it is of another training and cannot be renamed ({source}): move it away"),
    })
}

/// Joins consecutive parts of one log, so that windows may span the cut.
fn joined<'a>(runs: impl Iterator<Item = &'a Trajectory>) -> Vec<Trajectory> {
    let log = |name: &str| name.split('[').next().map(str::to_owned);
    let mut whole: Vec<Trajectory> = Vec::new();
    for run in runs {
        let follows = |before: &&mut Trajectory| {
            let end = before.t0 + before.len() as f64 * before.dt;
            log(&before.name) == log(&run.name)
                && before.name != run.name
                && (run.t0 - end).abs() < 1e-3 * run.dt
        };
        if let Some(before) = whole.iter_mut().find(follows) {
            let both = |a: &Table, b: &Table| {
                Table::new(a.channels(), [a.rows(0, a.len()), b.rows(0, b.len())].concat())
            };
            before.outputs = both(&before.outputs, &run.outputs);
            before.inputs = both(&before.inputs, &run.inputs);
        } else {
            whole.push(Trajectory { truth: None, ..run.clone() });
        }
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Channel;

    fn run(name: &str, samples: usize) -> Trajectory {
        let table =
            |c: &str| Table::new([Channel::new(c, "")], (0..samples).map(|k| k as f64).collect::<Vec<_>>());
        let (outputs, inputs) = (table("y"), table("c"));
        Trajectory {
            name: name.to_owned(),
            t0: 0.3,
            dt: 0.1,
            outputs,
            inputs,
            truth: None,
            heading: None,
            position: None,
        }
    }

    #[test]
    fn what_was_one_log_is_one_again_and_what_was_not_is_not() {
        let (a, b) = (run("a", 100), run("b", 50));
        let parts = [a.slice(0, 60), b.clone(), a.slice(60, 100)];
        let whole = joined(parts.iter());
        assert_eq!(whole.len(), 2);
        assert_eq!((&whole[0].outputs, &whole[0].inputs), (&a.outputs, &a.inputs));
        assert_eq!(whole[1], b);
        // Gap between parts, or a different log.
        assert_eq!(joined([a.slice(0, 60), a.slice(70, 100)].iter()).len(), 2);
        assert_eq!(joined([a.clone(), Trajectory { t0: 0.3 + 10.0, ..b }].iter()).len(), 2);
    }
}
