//! Learning anew from training and validation runs together, once validation runs have chosen.
//!
//! On a short log the validation runs are a large part of what is known of the vessel, and too short to say when to
//! stop: an epoch in the middle of the schedule, where steps are long, looks best by chance. So the training that was
//! chosen is made once more, from its first weights and over as many epochs, on all runs, and its last weights, after
//! the schedule has come down, are the model. Nothing is chosen in it, and nothing is left to judge it by: the
//! network before it stays at hand ([`Refit::before`]) for whoever judges on validation runs.

use std::path::{Path, PathBuf};

use hydroid_core::math::Scalar;
use serde::{Deserialize, Serialize};

use super::{Aim, Ending, Job, Learned, Settings, Status, TrainError, Trained, Watch, advance, finish};
use crate::log::{Table, Trajectory};

/// What came of learning anew.
#[derive(Clone, Debug, PartialEq)]
pub struct Refit {
    /// The network that was chosen, which has not learned from the validation runs.
    pub before: Learned,
    /// Whether the model is the network that has learned from all runs, and if not, why.
    pub outcome: Outcome,
    /// Error of that network on the validation runs, which it has learned from; infinite where a rollout diverged or the
    /// time was over.
    pub validation: f64,
}

/// Whether a network that has learned from all runs is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It is.
    Taken,
    /// It predicts runs that it has learned from worse than the network that has never seen them: its training went wrong.
    Worse,
    /// The time was over before all epochs were done.
    Budget,
}

impl Refit {
    /// Whether the model has learned from the validation runs.
    pub fn is_taken(&self) -> bool {
        self.outcome == Outcome::Taken
    }
}

/// Where the second training is kept beside the first.
pub fn refit_checkpoint(checkpoint: &Path) -> PathBuf {
    checkpoint.with_extension("refit.checkpoint")
}

/// A training, and the same on all runs.
pub(super) fn train<T: Scalar>(
    job: &Job<'_>,
    settings: &Settings,
    checkpoint: Option<&Path>,
    watch: Watch<'_>,
) -> Result<Trained, TrainError> {
    let joined = joined(job.runs.iter().chain(job.validation).copied());
    let all: Vec<&Trajectory> = joined.iter().collect();
    let samples = |runs: &[&Trajectory]| runs.iter().map(|run| run.len()).sum::<usize>() as f64;
    // An epoch takes as long as there are samples: the share of the first training in the whole.
    let share = samples(job.runs) / (samples(job.runs) + samples(&all));
    let first = Settings { budget_s: settings.budget_s.map(|budget| share * budget), ..settings.clone() };
    let mut trained = {
        let watch = &mut |status: &Status| {
            // What is left of the first, and all of the second.
            let whole = status.seconds_left / (1.0 - status.fraction).max(1e-3);
            let seconds_left = status.seconds_left + whole * (1.0 - share) / share;
            watch(&Status { fraction: share * status.fraction, seconds_left, ..*status })
        };
        let (team, ending, clock) = advance::<T>(job, &first, checkpoint, watch, Aim::Choose)?;
        finish(&team, settings, ending, &clock)?
    };
    let dt = job.runs[0].dt;
    let recurrent = trained.model.recurrent().is_some();
    let again = Settings {
        epochs: trained.history.len(),
        patience: None,
        restarts: 1,
        ensemble: false,
        // Windows of the same shape, however long the runs are now.
        wash_out_s: recurrent.then_some(trained.wash_out as f64 * dt),
        history_s: (!recurrent).then_some((trained.wash_out + 1) as f64 * dt),
        window_s: Some(trained.window as f64 * dt),
        budget_s: settings.budget_s.map(|budget| (budget - trained.seconds).max(1e-3 * budget)),
        ..settings.clone()
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
    let aim = Aim::End { restart: trained.restart };
    let (team, ending, clock) = advance::<T>(&job, &again, checkpoint.as_deref(), watch, aim)?;
    let member = &team.members[0];
    let outcome = match ending {
        Ending::Budget => Outcome::Budget,
        // NaN is not less.
        _ if member.best_score <= known => Outcome::Taken,
        _ => Outcome::Worse,
    };
    let before = trained.model.clone();
    if outcome == Outcome::Taken {
        trained.model = team.plan.net.model(&member.best, &team.plan.scaling, team.plan.shape);
        rescale(&mut trained.members, &before, &trained.model);
    }
    trained.seconds += clock.seconds();
    trained.refit = Some(Refit { before, outcome, validation: member.best_score });
    Ok(trained)
}

/// Members are of the scale of the model before; what is added to a base has another one now.
fn rescale(members: &mut [Vec<f64>], before: &Learned, now: &Learned) {
    let (Learned::Direct(before), Learned::Direct(now)) = (before, now) else { return };
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

/// What is kept of the second training of another job gets out of the way: the first of that job has been renamed or
/// removed before.
fn make_room(job: &Job<'_>, settings: &Settings, path: &Path) -> Result<(), TrainError> {
    if !path.exists() || job.is_kept_in(settings, path) == [true; 2] {
        return Ok(());
    }
    std::fs::rename(path, path.with_extension("checkpoint.old")).map_err(|source| TrainError::Checkpoint {
        path: path.to_owned(),
        reason: format!("it is of another training and cannot be renamed ({source}): move it away"),
    })
}

/// Runs, of which those that were cut from one log and follow each other are put together again: a window may then
/// lie across the cut.
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
        Trajectory { name: name.to_owned(), t0: 0.3, dt: 0.1, outputs, inputs, truth: None }
    }

    #[test]
    fn what_was_one_log_is_one_again_and_what_was_not_is_not() {
        let (a, b) = (run("a", 100), run("b", 50));
        let parts = [a.slice(0, 60), b.clone(), a.slice(60, 100)];
        let whole = joined(parts.iter());
        assert_eq!(whole.len(), 2);
        assert_eq!((&whole[0].outputs, &whole[0].inputs), (&a.outputs, &a.inputs));
        assert_eq!(whole[1], b);
        // A part is missing between them; another log that begins where the first one ends.
        assert_eq!(joined([a.slice(0, 60), a.slice(70, 100)].iter()).len(), 2);
        assert_eq!(joined([a.clone(), Trajectory { t0: 0.3 + 10.0, ..b }].iter()).len(), 2);
    }
}
