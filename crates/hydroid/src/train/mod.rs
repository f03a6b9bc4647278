//! Training of networks on shore.
//!
//! [`train`] learns the weights of a [`Recurrent`] from runs by backpropagation through time, or those of a [`Direct`]
//! predictor by backpropagation, and keeps those whose multi-step error on validation runs is least.
//!
//! **Windows.** Runs are cut into windows. Over the first samples of one, the wash-out, the hidden state finds itself from
//! zero while outputs are measured; from its origin on the model hears nothing of the outputs, as in a rollout, and
//! is compared:
//!
//! ```text
//! L     = sum over outputs i:  (N_i / N) w_i e_i
//! e_i^2 = 1/N_i  sum over windows, k = 1 .. length:   ((y_{o+k,i} - measured_{o+k,i}) / s_i)^2
//! ```
//!
//! with the standard deviation `s_i` of the output in the training runs, the weight `w_i` of the settings, and `N_i` of
//! `N` values that are compared. So the loss is what [`evaluate`](mod@crate::evaluate) judges by, on the training runs: a
//! mean of root mean squares. A mean of squares would follow the outputs with the most noise, and hardly see how well
//! the precise ones are met. What a step goes along is the gradient of the squares, each output's divided by
//! its `e_i` over the epoch before, which is the gradient of `L` if `e_i` is what it was (in the first epoch all `e_i`
//! count as equal, and none as less than a thousandth of the largest). The gradient goes back through the wash-out too, and through what is fed back. What is compared tiles
//! each run once in an epoch, from an offset drawn anew. (The windows of a direct predictor begin at every sample, and it
//! takes all that it knows from the history in place of a wash-out.) A missing output is not compared, and where it is fed back the
//! model's own prediction stands for it; a window in which an input is missing is left out.
//!
//! **Scaling** is by design ranges: a range is mapped to -2..2. What the network gives is in units of the output where it
//! corrects nothing, and in units of what it corrects where it has a [`BaseKind`]: of a direct predictor on equations the root mean
//! square of what these miss over the horizons of the training runs.
//!
//! **Determinism.** On one kind of machine the weights are a function of runs and settings alone. Random numbers have one stream for each purpose,
//! restart and epoch; gradients are summed over chunks of windows of a fixed size in a fixed order, so that the number
//! of threads changes no bit. Another processor or system may round `cos`, `pow` or a sum of products otherwise, and
//! a training carries such a bit far. Only a budget in seconds depends on the machine: it decides the number of epochs before the
//! first, and [`Trained::epochs`] says what it decided.
//!
//! **All runs.** With [`Settings::refit`] what was chosen is trained once more on training and validation runs together
//! (`refit`).
//!
//! **The optimizer** is Adam with decoupled weight decay, on a gradient that is shortened if long, under a
//! [`schedule`](mod@schedule) that knows its end.

mod adam;
mod affine;
mod ahead;
mod base;
mod below;
mod budget;
mod chain;
mod checkpoint;
mod chunk;
mod error;
mod fingerprint;
mod init;
mod judge;
mod loss;
mod mean;
mod plan;
mod random;
mod refit;
mod scaling;
pub mod schedule;
mod settings;
mod team;
mod unroll;
mod windows;

#[cfg(test)]
mod tests;

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use hydroid_core::math::Scalar;
use hydroid_core::model::affine::ControlAffine;
use hydroid_core::model::direct::Direct;
use hydroid_core::model::recurrent::Recurrent;
use hydroid_core::model::sparse::Equations;
use serde::{Deserialize, Deserializer, Serialize};

use crate::evaluate::DesignRange;
use crate::log::Trajectory;
use crate::progress::Cancelled;

use budget::Clock;
use checkpoint::Keeper;
use team::Team;

pub use error::TrainError;
pub use refit::{Outcome, Refit, refit_checkpoint};
pub use settings::{BaseKind, CellKind, Precision, Schedule, Settings};

/// What to train on.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Runs to learn from.
    pub runs: &'a [&'a Trajectory],
    /// Runs by whose multi-step error the best weights are chosen.
    pub validation: &'a [&'a Trajectory],
    /// Design range of each output: it is mapped to -2..2 for the network.
    pub outputs: &'a [DesignRange],
    /// Design range of each input.
    pub inputs: &'a [DesignRange],
    /// Longest horizon of the validation's rollouts \[samples\].
    pub horizon: usize,
    /// Equations that the network corrects, for [`BaseKind::Equations`].
    pub equations: Option<Arc<Equations>>,
}

/// An epoch of the training of one restart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Epoch {
    /// Loss over the epoch's windows: the root mean square error in standard deviations of the outputs, in the mean over
    /// outputs, each by its weight. Where an error was no number, infinite or NaN; JSON writes both as null, which is
    /// read as infinite.
    #[serde(deserialize_with = "null_is_infinite")]
    pub train_loss: f64,
    /// Validation error after the epoch: the mean over channels and horizons of the NRMSE, as
    /// [`Evaluation::score`](crate::evaluate::Evaluation::score); infinite where a rollout diverged.
    #[serde(deserialize_with = "null_is_infinite")]
    pub validation: f64,
    /// Step size at the end of the epoch.
    pub learning_rate: f64,
}

fn null_is_infinite<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

/// Where a training is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// Epochs that are done.
    pub epoch: usize,
    /// Epochs that are planned.
    pub epochs: usize,
    /// Fraction of the whole that is done, 0 to 1.
    pub fraction: f64,
    /// Least loss of the last epoch over restarts; NaN before the first is done.
    pub train_loss: f64,
    /// Least validation error so far over restarts; infinite before there is one.
    pub validation: f64,
    /// Time that is left as far as one can tell \[s\]; NaN while steps are tried to plan a budget.
    pub seconds_left: f64,
}

/// Hears where the training is, many times in an epoch; [`ControlFlow::Break`] asks it to stop.
pub type Watch<'a> = &'a mut dyn FnMut(&Status) -> ControlFlow<()>;

/// Why a training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// All epochs are done.
    Done,
    /// No restart got better for as many epochs as patience allows.
    Patience,
    /// The time was over before all epochs were done.
    Budget,
}

/// A network with its weights.
#[derive(Clone, Debug, PartialEq)]
pub enum Learned {
    /// A recurrent one.
    Recurrent(Recurrent),
    /// A direct predictor.
    Direct(Direct),
    /// A control-affine network.
    Affine(ControlAffine),
}

impl Learned {
    /// The weights.
    pub fn weights(&self) -> &[f64] {
        match self {
            Self::Recurrent(model) => &model.weights,
            Self::Direct(model) => &model.weights,
            Self::Affine(model) => &model.weights,
        }
    }

    /// The recurrent network; none for others.
    pub fn recurrent(&self) -> Option<&Recurrent> {
        match self {
            Self::Recurrent(model) => Some(model),
            Self::Direct(_) | Self::Affine(_) => None,
        }
    }
}

/// A model that was trained, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The model with the best weights of the best restart, or, if a [`refit`](Self::refit) was taken, with those that
    /// have learned from the validation runs as well.
    pub model: Learned,
    /// The epochs of that restart.
    pub history: Vec<Epoch>,
    /// Which restart it was, from 0.
    pub restart: usize,
    /// Which epoch its weights are of, from 1.
    pub best_epoch: usize,
    /// Its validation error.
    pub validation: f64,
    /// Least validation error of each restart; infinite for one that never had any.
    pub restarts: Vec<f64>,
    /// Epochs that were planned: with a budget as many as fit it. This number as `epochs` without a budget repeats
    /// the training exactly if it ended with [`Ending::Done`].
    pub epochs: usize,
    /// Why it ended.
    pub ending: Ending,
    /// Samples of wash-out of a window.
    pub wash_out: usize,
    /// Samples compared of a window.
    pub window: usize,
    /// Time that it took \[s\].
    pub seconds: f64,
    /// The best weights of each restart, where they were to be kept ([`Settings::ensemble`]); those of restarts that never
    /// had any are missing. None of a control-affine network, which is their mean.
    pub members: Vec<Vec<f64>>,
    /// What came of learning from the validation runs as well, where that was asked for. All other figures are of the
    /// training before.
    pub refit: Option<Refit>,
}

impl Trained {
    /// The network to judge on validation runs: it has not learned from them.
    pub fn unseeing(&self) -> &Learned {
        self.refit.as_ref().map_or(&self.model, |refit| &refit.before)
    }
}

/// Trains a network.
///
/// With `checkpoint` the state is kept in that file as the training goes; if the file is there, the training goes
/// on from it. It stays when the training is done.
///
/// # Errors
/// If settings, runs or checkpoint cannot be used, everything diverged, or the work was interrupted.
pub fn train(
    job: &Job<'_>,
    settings: &Settings,
    checkpoint: Option<&Path>,
    watch: Watch<'_>,
) -> Result<Trained, TrainError> {
    match settings.precision {
        Precision::F32 => run::<f32>(job, settings, checkpoint, watch),
        Precision::F64 => run::<f64>(job, settings, checkpoint, watch),
    }
}

fn run<T: Scalar>(
    job: &Job<'_>,
    settings: &Settings,
    checkpoint: Option<&Path>,
    watch: Watch<'_>,
) -> Result<Trained, TrainError> {
    if settings.refit {
        return refit::train::<T>(job, settings, checkpoint, watch);
    }
    let (team, ending, clock) = advance::<T>(job, settings, checkpoint, watch, Aim::Choose)?;
    finish(&team, settings, ending, &clock)
}

/// What the epochs of a training are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Aim {
    /// To find the best of them; where there is a budget, as many as fit it.
    Choose,
    /// To get to the last of them, from the first weights of this restart: only that one is judged.
    End { restart: usize },
}

impl Aim {
    /// The first of the restarts.
    fn first(self) -> usize {
        match self {
            Self::Choose => 0,
            Self::End { restart } => restart,
        }
    }
}

/// Trains to the end.
fn advance<T: Scalar>(
    job: &Job<'_>,
    settings: &Settings,
    checkpoint: Option<&Path>,
    watch: Watch<'_>,
    aim: Aim,
) -> Result<(Team<T>, Ending, Clock), TrainError> {
    let mut clock = Clock::start(settings.budget_s);
    let mut team = Team::<T>::new(plan::plan(job, settings)?, aim);
    let mut keeper = Keeper::open(checkpoint, job, settings);
    let begun = keeper.resume(&mut team)?;
    if begun.is_none() && aim == Aim::Choose {
        team.plan.epochs = clock.epochs(&mut team, |team| match watch(&status(team, 0, 0.0, f64::NAN)) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Cancelled.into()),
        })?;
    }
    let first = begun.unwrap_or(0);
    let mut ending = Ending::Done;
    'epochs: for epoch in first..team.plan.epochs {
        if team.is_idle() {
            ending = Ending::Patience;
            break;
        }
        let batches = team.begin(epoch);
        for batch in 0..batches {
            if clock.is_over() {
                ending = Ending::Budget;
                break 'epochs;
            }
            team.step(batch);
            let done = (epoch - first) as f64 + (batch + 1) as f64 / batches as f64;
            if let Some(seconds_left) = clock.tell(done, team.plan.epochs - first)
                && watch(&status(&team, epoch, done + first as f64, seconds_left)).is_break()
            {
                keeper.flush()?;
                return Err(Cancelled.into());
            }
        }
        team.end();
        keeper.keep(&team, epoch + 1)?;
    }
    if ending == Ending::Done && team.is_idle() {
        ending = Ending::Patience;
    }
    keeper.flush()?;
    Ok((team, ending, clock))
}

fn status<T: Scalar>(team: &Team<T>, epoch: usize, done: f64, seconds_left: f64) -> Status {
    let epochs = team.plan.epochs;
    let losses = team.members.iter().filter_map(|member| Some(member.history.last()?.train_loss));
    Status {
        epoch,
        epochs,
        fraction: (done / epochs as f64).min(1.0),
        train_loss: losses.fold(f64::NAN, f64::min),
        validation: team.members.iter().map(|member| member.best_score).fold(f64::INFINITY, f64::min),
        seconds_left,
    }
}

fn finish<T: Scalar>(
    team: &Team<T>,
    settings: &Settings,
    ending: Ending,
    clock: &Clock,
) -> Result<Trained, TrainError> {
    let plan = &team.plan;
    let best = team.members.iter().enumerate().filter(|(_, member)| member.best_epoch > 0);
    // The first of equals.
    let Some((restart, member)) = best.min_by(|(_, a), (_, b)| a.best_score.total_cmp(&b.best_score)) else {
        let restarts = team.members.len();
        return Err(match team.members.iter().map(|member| member.history.len()).max() {
            Some(1..) => TrainError::Diverged { restarts, learning_rate: settings.learning_rate },
            _ => clock.no_time(),
        });
    };
    let kept = || team.members.iter().filter(|member| settings.ensemble && member.best_epoch > 0);
    let of = |member: &team::Member<T>| plan.net.model(&member.best, &plan.scaling, plan.shape);
    // Control-affine networks are averaged, others stay beside the best.
    let averaged = settings.cell == CellKind::Affine && settings.ensemble;
    let models: Vec<ControlAffine> = kept()
        .filter(|_| averaged)
        .filter_map(|member| match of(member) {
            Learned::Affine(model) => Some(model),
            Learned::Recurrent(_) | Learned::Direct(_) => None,
        })
        .collect();
    Ok(Trained {
        model: mean::mean(&models).map_or_else(|| of(member), Learned::Affine),
        history: member.history.clone(),
        restart,
        best_epoch: member.best_epoch,
        validation: member.best_score,
        restarts: team.members.iter().map(|member| member.best_score).collect(),
        epochs: plan.epochs,
        ending,
        wash_out: plan.shape.wash_out,
        window: plan.shape.length,
        seconds: clock.seconds(),
        members: kept()
            .filter(|_| !averaged)
            .map(|member| member.best.iter().map(|w| w.wide()).collect())
            .collect(),
        refit: None,
    })
}
