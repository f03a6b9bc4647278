//! Training of networks.
//!
//! [`train`] learns the weights of a [`Recurrent`] network by backpropagation through time (BPTT), or of a [`Direct`]
//! predictor or a [`ControlAffine`] network by backpropagation. It keeps the weights with the least multi-step error on
//! the validation runs.
//!
//! **Windows.** Runs are cut into windows. In the wash-out at the start of a window the hidden state converges from
//! zero under measured outputs. From the origin on the model receives no outputs, as in a rollout. The loss is
//!
//! ```text
//! L     = sum over outputs i:  (N_i / N) w_i e_i
//! e_i^2 = 1/N_i  sum over windows, k = 1 .. length:   ((y_{o+k,i} - measured_{o+k,i}) / s_i)^2
//! ```
//!
//! with the standard deviation `s_i` of output `i` in the training runs, its weight `w_i`, and `N_i` of `N` compared
//! values. This mean of RMS errors matches the score of [`evaluate`](mod@crate::evaluate); a mean of squares would
//! favour noisy outputs. A step follows the gradient of the squares of each output divided by its `e_i` of the previous
//! epoch (equal `e_i` in the first epoch, and none below a thousandth of the largest). The gradient includes the
//! wash-out and the output feedback. The compared parts tile each run once in an epoch, from a random offset. The
//! windows of a direct predictor start at every sample, with its history in place of a wash-out. Missing outputs are
//! not compared and are replaced by predictions in the feedback; a window with a missing input is skipped.
//!
//! **Scaling** maps design ranges to -2..2. The output of a network is scaled by the outputs, or with a [`BaseKind`] by
//! the RMS residual of the base.
//!
//! **Determinism.** The weights depend only on runs, options and kind of machine. Random numbers have one stream for
//! **Determinism.** The weights depend only on runs, options and kind of machine (rounding of `cos`, `pow` and sums of
//! products), not on the number of threads. Random numbers have one stream for each purpose, restart and epoch. A
//! budget in seconds determines the number of epochs before the first one; [`Trained::epochs`] reports it. **Refit.**
//! With [`TrainOptions::refit`] the selected restart is trained again on training and validation runs **Refit.** With
//! [`TrainOptions::refit`] the selected restart is trained again on training and validation runs. **Optimizer.** Adam
//! with decoupled weight decay, gradient clipping and a [`schedule`](mod@schedule).

#[doc(hidden)]
pub mod adam;
mod affine;
mod base;
mod base_rollout;
mod bptt;
mod budget;
mod chained_rollout;
mod checkpoint;
mod direct;
mod error;
mod fingerprint;
mod init;
mod loss;
mod mini_batch;
mod options;
mod plan;
mod random;
mod refit;
mod restarts;
mod scaling;
#[doc(hidden)]
pub mod schedule;
mod validation;
#[doc(hidden)]
pub mod weight_average;
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
use crate::model::Body;
use crate::progress::Cancelled;

use budget::Clock;
use checkpoint::CheckpointWriter;
use restarts::Restarts;

pub use error::TrainError;
pub use options::{BaseKind, CellKind, Precision, Schedule, TrainOptions};
#[doc(hidden)]
pub use refit::{Outcome, Refit, refit_checkpoint};

/// Data of a training.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// Training runs.
    pub runs: &'a [&'a Trajectory],
    /// Validation runs, whose multi-step error selects the weights.
    pub validation: &'a [&'a Trajectory],
    /// Design range of each output, mapped to -2..2.
    pub outputs: &'a [DesignRange],
    /// Design range of each input.
    pub inputs: &'a [DesignRange],
    /// Longest horizon of the validation rollouts \[samples\].
    pub horizon: usize,
    /// Base equations, for [`BaseKind::Equations`].
    pub equations: Option<Arc<Equations>>,
}

/// An epoch of the training of one restart.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Epoch {
    /// Training loss: weighted mean over outputs of the RMS error in standard deviations; infinite is null in JSON.
    #[serde(deserialize_with = "null_is_infinite")]
    pub train_loss: f64,
    /// Validation error: mean NRMSE over outputs and horizons, as
    /// [`Evaluation::score`](crate::evaluate::Evaluation::score); infinite if a rollout diverged.
    #[serde(deserialize_with = "null_is_infinite")]
    pub validation: f64,
    /// Step size at the end of the epoch.
    pub learning_rate: f64,
}

fn null_is_infinite<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

/// Progress of a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// Completed epochs.
    pub epoch: usize,
    /// Planned epochs.
    pub epochs: usize,
    /// Completed fraction, 0 to 1.
    pub fraction: f64,
    /// Least loss of the last epoch over restarts; NaN before the first is done.
    pub train_loss: f64,
    /// Least validation error so far over restarts; infinite before there is one.
    pub validation: f64,
    /// Estimated remaining time \[s\]; NaN while the epochs of a budget are planned.
    pub seconds_left: f64,
}

/// Progress callback, called several times in an epoch; [`ControlFlow::Break`] cancels.
pub type ProgressCallback<'a> = &'a mut dyn FnMut(&Status) -> ControlFlow<()>;

/// Reason for the end of a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// All epochs are done.
    Done,
    /// Early stopping of all restarts.
    Patience,
    /// The time budget was used up.
    Budget,
}

/// A trained network.
#[derive(Clone, Debug, PartialEq)]
pub enum TrainedNetwork {
    /// Recurrent network.
    Recurrent(Recurrent),
    /// Direct predictor.
    Direct(Direct),
    /// Control-affine network.
    Affine(ControlAffine),
}

impl TrainedNetwork {
    /// The weights.
    pub fn weights(&self) -> &[f64] {
        match self {
            Self::Recurrent(model) => &model.weights,
            Self::Direct(model) => &model.weights,
            Self::Affine(model) => &model.weights,
        }
    }

    /// The recurrent network, if it is one.
    pub fn recurrent(&self) -> Option<&Recurrent> {
        match self {
            Self::Recurrent(model) => Some(model),
            Self::Direct(_) | Self::Affine(_) => None,
        }
    }
}

impl From<TrainedNetwork> for Body {
    fn from(network: TrainedNetwork) -> Self {
        match network {
            TrainedNetwork::Recurrent(recurrent) => Self::Recurrent(Arc::new(recurrent)),
            TrainedNetwork::Direct(direct) => Self::Direct(Arc::new(direct)),
            TrainedNetwork::Affine(affine) => Self::Affine(Arc::new(affine)),
        }
    }
}

/// Result of a training.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// Network with the best weights of the best restart, or of the [`refit`](Self::refit) if that is used.
    pub model: TrainedNetwork,
    /// Epochs of the best restart.
    pub history: Vec<Epoch>,
    /// Index of the best restart, from 0.
    pub restart: usize,
    /// Epoch of the best weights, from 1.
    pub best_epoch: usize,
    /// Least validation error.
    pub validation: f64,
    /// Least validation error of each restart; infinite if all its rollouts diverged.
    pub restarts: Vec<f64>,
    /// Planned epochs. As `epochs` without a budget, they repeat a training that ended with [`Ending::Done`] exactly.
    pub epochs: usize,
    /// Reason for the end.
    pub ending: Ending,
    /// Wash-out of a window \[samples\].
    pub wash_out: usize,
    /// Compared length of a window \[samples\].
    pub window: usize,
    /// Training time \[s\].
    pub seconds: f64,
    /// Best weights of the restarts that did not diverge, with [`TrainOptions::ensemble`]; empty if averaged.
    pub members: Vec<Vec<f64>>,
    /// Result of the refit. All other fields are of the training before it.
    pub refit: Option<Refit>,
}

impl Trained {
    /// Network before the refit, for evaluation on the validation runs.
    pub fn before_refit(&self) -> &TrainedNetwork {
        self.refit.as_ref().map_or(&self.model, |refit| &refit.before)
    }
}

/// Trains a network. With `checkpoint` the state is written to that file, which remains; an existing file is resumed.
///
/// # Errors
/// If options, runs or checkpoint are invalid, all restarts diverged, or the training was cancelled.
pub fn train(
    job: &Job<'_>,
    options: &TrainOptions,
    checkpoint: Option<&Path>,
    watch: ProgressCallback<'_>,
) -> Result<Trained, TrainError> {
    match options.precision {
        Precision::F32 => run::<f32>(job, options, checkpoint, watch),
        Precision::F64 => run::<f64>(job, options, checkpoint, watch),
    }
}

fn run<T: Scalar>(
    job: &Job<'_>,
    options: &TrainOptions,
    checkpoint: Option<&Path>,
    watch: ProgressCallback<'_>,
) -> Result<Trained, TrainError> {
    if options.refit {
        return refit::train::<T>(job, options, checkpoint, watch);
    }
    let (restarts, ending, clock) = advance::<T>(job, options, checkpoint, watch, Phase::Selection)?;
    finish(&restarts, options, ending, &clock)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Selection of the best epoch and restart, within the budget.
    Selection,
    /// Refit from the initial weights of this restart; only the last epoch is validated.
    FinalFit { restart: usize },
}

impl Phase {
    fn first(self) -> usize {
        match self {
            Self::Selection => 0,
            Self::FinalFit { restart } => restart,
        }
    }
}

fn advance<T: Scalar>(
    job: &Job<'_>,
    options: &TrainOptions,
    checkpoint: Option<&Path>,
    watch: ProgressCallback<'_>,
    phase: Phase,
) -> Result<(Restarts<T>, Ending, Clock), TrainError> {
    let mut clock = Clock::start(options.budget_s);
    let mut restarts = Restarts::<T>::new(plan::plan(job, options)?, phase);
    let mut writer = CheckpointWriter::open(checkpoint, job, options);
    let begun = writer.resume(&mut restarts)?;
    if begun.is_none() && phase == Phase::Selection {
        restarts.plan.epochs =
            clock.epochs(&mut restarts, |restarts| match watch(&status(restarts, 0, 0.0, f64::NAN)) {
                ControlFlow::Continue(()) => Ok(()),
                ControlFlow::Break(()) => Err(Cancelled.into()),
            })?;
    }
    let first = begun.unwrap_or(0);
    let mut ending = Ending::Done;
    'epochs: for epoch in first..restarts.plan.epochs {
        if restarts.is_idle() {
            ending = Ending::Patience;
            break;
        }
        let batches = restarts.begin(epoch);
        for batch in 0..batches {
            if clock.is_over() {
                ending = Ending::Budget;
                break 'epochs;
            }
            restarts.step(batch);
            let done = (epoch - first) as f64 + (batch + 1) as f64 / batches as f64;
            if let Some(seconds_left) = clock.tell(done, restarts.plan.epochs - first)
                && watch(&status(&restarts, epoch, done + first as f64, seconds_left)).is_break()
            {
                writer.flush()?;
                return Err(Cancelled.into());
            }
        }
        restarts.end();
        writer.keep(&restarts, epoch + 1)?;
    }
    if ending == Ending::Done && restarts.is_idle() {
        ending = Ending::Patience;
    }
    writer.flush()?;
    Ok((restarts, ending, clock))
}

fn status<T: Scalar>(restarts: &Restarts<T>, epoch: usize, done: f64, seconds_left: f64) -> Status {
    let epochs = restarts.plan.epochs;
    let losses = restarts.members.iter().filter_map(|member| Some(member.history.last()?.train_loss));
    Status {
        epoch,
        epochs,
        fraction: (done / epochs as f64).min(1.0),
        train_loss: losses.fold(f64::NAN, f64::min),
        validation: restarts.members.iter().map(|member| member.best_score).fold(f64::INFINITY, f64::min),
        seconds_left,
    }
}

fn finish<T: Scalar>(
    restarts: &Restarts<T>,
    options: &TrainOptions,
    ending: Ending,
    clock: &Clock,
) -> Result<Trained, TrainError> {
    let plan = &restarts.plan;
    let best = restarts.members.iter().enumerate().filter(|(_, member)| member.best_epoch > 0);
    let Some((restart, member)) = best.min_by(|(_, a), (_, b)| a.best_score.total_cmp(&b.best_score)) else {
        let count = restarts.members.len();
        return Err(match restarts.members.iter().map(|member| member.history.len()).max() {
            Some(1..) => TrainError::Diverged { restarts: count, learning_rate: options.learning_rate },
            _ => clock.no_time(),
        });
    };
    let kept = || restarts.members.iter().filter(|member| options.ensemble && member.best_epoch > 0);
    let of = |member: &restarts::Restart<T>| plan.net.model(&member.best, &plan.scaling, plan.shape);
    // Control-affine networks are averaged; others form an ensemble.
    let averaged = options.cell == CellKind::Affine && options.ensemble;
    let models: Vec<ControlAffine> = kept()
        .filter(|_| averaged)
        .filter_map(|member| match of(member) {
            TrainedNetwork::Affine(model) => Some(model),
            TrainedNetwork::Recurrent(_) | TrainedNetwork::Direct(_) => None,
        })
        .collect();
    Ok(Trained {
        model: weight_average::weight_average(&models).map_or_else(|| of(member), TrainedNetwork::Affine),
        history: member.history.clone(),
        restart,
        best_epoch: member.best_epoch,
        validation: member.best_score,
        restarts: restarts.members.iter().map(|member| member.best_score).collect(),
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
