//! Parallel training of several restarts.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::adam::{Adam, PART, clip};
use super::loss::{Loss, Sums};
use super::mini_batch::{Architecture, MiniBatch};
use super::random::{Purpose, stream};
use super::validation::Validation;
use super::windows::{ScaledRun, Shape, Window, shuffled};
use super::{Epoch, Phase, TrainOptions, schedule};

/// Least number of optimizer steps in an epoch, if the runs hold as many windows.
const LEAST_STEPS: usize = 8;

/// One training from its own initial weights.
#[derive(Clone, Debug)]
pub(super) struct Restart<T> {
    pub(super) weights: Vec<T>,
    pub(super) adam: Adam<T>,
    /// Weights with the least validation error so far.
    pub(super) best: Vec<T>,
    pub(super) best_score: f64,
    /// Epoch of the best weights, from 1; 0 before the first.
    pub(super) best_epoch: usize,
    pub(super) history: Vec<Epoch>,
    /// Whether early stopping has ended this restart.
    pub(super) idle: bool,
    order: Vec<Window>,
    gradient: Vec<T>,
    /// Adaptive weight of each output in the loss over an epoch.
    pub(super) balance: Vec<f64>,
    /// Sum of squared errors in this epoch and their number, for each output.
    sums: Vec<Sums>,
    work: Vec<Work<T>>,
    /// Number of entries of `work` that the present batch uses.
    chunks: usize,
    judging: Vec<Vec<f64>>,
}

#[derive(Clone, Debug)]
struct Work<T> {
    gradient: Vec<T>,
    sums: Vec<Sums>,
}

/// Data that stay constant during a training.
#[derive(Clone, Debug)]
pub(super) struct Plan<T> {
    pub(super) options: TrainOptions,
    pub(super) net: Architecture,
    pub(super) scaling: Scaling,
    pub(super) shape: Shape,
    pub(super) runs: Vec<ScaledRun<T>>,
    pub(super) validation: Vec<ScaledRun<T>>,
    pub(super) judge: Validation,
    pub(super) loss: Loss,
    pub(super) epochs: usize,
}

impl<T: Scalar> Plan<T> {
    /// Windows of an epoch; each restart visits them in its own order.
    fn windows(&self, epoch: usize) -> Vec<Window> {
        if self.net.has_overlapping_windows() {
            return self.shape.every(&self.runs, 1);
        }
        self.shape.tiles(&self.runs, &mut stream(self.options.seed, Purpose::Offsets, 0, epoch))
    }

    fn batches(&self, windows: usize) -> usize {
        windows.div_ceil(self.options.batch).max(LEAST_STEPS.min(windows))
    }

    fn chunk(&self, shape: Shape, back: bool) -> MiniBatch<T> {
        self.net.chunk(&self.scaling, shape, self.net.chunk_windows(), back)
    }
}

/// All restarts, trained in lock-step: the mini-batches of all restarts are distributed over all threads in each step.
#[derive(Debug)]
pub(super) struct Restarts<T> {
    pub(super) plan: Plan<T>,
    pub(super) members: Vec<Restart<T>>,
    phase: Phase,
    /// Steps of the present epoch.
    batches: usize,
    epoch: usize,
    training_pool: Pool<T>,
    validation_pool: Pool<T>,
}

#[derive(Debug)]
struct Pool<T>(Mutex<Vec<MiniBatch<T>>>);

impl<T> Pool<T> {
    fn with(&self, new: impl FnOnce() -> MiniBatch<T>, work: impl FnOnce(&mut MiniBatch<T>)) {
        // Buffers are overwritten, so that a poisoned lock is harmless.
        let spare = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let free = spare().pop();
        let mut chunk = free.unwrap_or_else(new);
        work(&mut chunk);
        spare().push(chunk);
    }
}

impl<T: Scalar> Restarts<T> {
    pub(super) fn new(plan: Plan<T>, phase: Phase) -> Self {
        let members = (0..plan.options.restarts)
            .map(|restart| {
                let restart = phase.first() + restart;
                let mut rng = stream(plan.options.seed, Purpose::Weights, restart, 0);
                let weights = plan.net.first::<T>(&mut rng);
                let count = weights.len();
                Restart {
                    best: weights.clone(),
                    weights,
                    adam: Adam::new(count),
                    best_score: f64::INFINITY,
                    best_epoch: 0,
                    history: Vec::new(),
                    idle: false,
                    order: Vec::new(),
                    gradient: vec![T::zero(); count],
                    balance: plan.loss.even(),
                    sums: vec![[0.0; 2]; plan.shape.outputs],
                    work: Vec::new(),
                    chunks: 0,
                    judging: Vec::new(),
                }
            })
            .collect();
        let [training_pool, validation_pool] = [0, 1].map(|_| Pool(Mutex::default()));
        Self { plan, members, phase, batches: 0, epoch: 0, training_pool, validation_pool }
    }

    /// Begins epoch `epoch`, counted from 0; returns its number of steps.
    pub(super) fn begin(&mut self, epoch: usize) -> usize {
        let windows = self.plan.windows(epoch);
        self.batches = self.plan.batches(windows.len());
        self.epoch = epoch;
        for (restart, member) in self.members.iter_mut().enumerate().filter(|(_, member)| !member.idle) {
            let restart = self.phase.first() + restart;
            let mut rng = stream(self.plan.options.seed, Purpose::Order, restart, epoch);
            member.order = shuffled(&windows, &mut rng);
            member.sums.fill([0.0; 2]);
        }
        self.batches
    }

    /// Computes the gradient and the loss of each restart on a batch.
    pub(super) fn gradients(&mut self, batch: usize) {
        let plan = &self.plan;
        let mut tasks = Vec::new();
        for member in self.members.iter_mut().filter(|member| !member.idle) {
            let count = member.order.len();
            let windows = &member.order[count * batch / self.batches..count * (batch + 1) / self.batches];
            let targets: usize = windows.iter().map(|window| window.targets).sum();
            let factor = 1.0 / targets.max(1) as f64;
            let size = plan.net.chunk_windows();
            let chunks = windows.len().div_ceil(size);
            let count = member.weights.len();
            while member.work.len() < chunks {
                let sums = vec![[0.0; 2]; plan.shape.outputs];
                member.work.push(Work { gradient: vec![T::zero(); count], sums });
            }
            member.chunks = chunks;
            let channels = Arc::new(plan.loss.weights(&member.balance));
            for (work, windows) in member.work.iter_mut().zip(windows.chunks(size)) {
                tasks.push((work, member.weights.as_slice(), windows, Arc::clone(&channels), factor));
            }
        }
        let training_pool = &self.training_pool;
        let new = || plan.chunk(plan.shape, true);
        tasks.into_par_iter().for_each(|(work, weights, windows, channels, factor)| {
            training_pool.with(new, |chunk| {
                chunk.forward(weights, &plan.runs, windows);
                chunk.squares(&plan.runs, plan.shape.length, &mut work.sums);
                chunk.backward(weights, &plan.runs, &channels, factor, &mut work.gradient);
            });
        });
    }

    pub(super) fn step(&mut self, batch: usize) {
        self.gradients(batch);
        let rate = self.rate(batch);
        let TrainOptions { clip: most, weight_decay, .. } = self.plan.options;
        for member in self.members.iter_mut().filter(|member| !member.idle) {
            let work = &member.work[..member.chunks];
            for work in work {
                for (sum, part) in member.sums.iter_mut().zip(&work.sums) {
                    *sum = [sum[0] + part[0], sum[1] + part[1]];
                }
            }
            let add = |(part, gradient): (usize, &mut [T])| {
                gradient.fill(T::zero());
                for work in work {
                    for (sum, &g) in gradient.iter_mut().zip(&work.gradient[part * PART..]) {
                        *sum += g;
                    }
                }
            };
            member.gradient.par_chunks_mut(PART).enumerate().for_each(add);
            // A non-finite gradient is skipped; the loss reports it.
            if clip(&mut member.gradient, most).is_finite() {
                member.adam.step(&mut member.weights, &member.gradient, rate, weight_decay);
            }
        }
    }

    fn rate(&self, batch: usize) -> f64 {
        let TrainOptions { schedule, learning_rate, .. } = self.plan.options;
        let (done, steps) = (self.epoch * self.batches + batch, self.plan.epochs * self.batches);
        schedule::rate(schedule, learning_rate, done, steps)
    }

    pub(super) fn judge(&mut self) -> Vec<f64> {
        let plan = &self.plan;
        let cells = plan.judge.shape.length * plan.judge.shape.outputs;
        let mut tasks = Vec::new();
        for member in self.members.iter_mut().filter(|member| !member.idle) {
            let chunks = plan.judge.windows.chunks(plan.net.chunk_windows());
            member.judging.resize_with(chunks.len(), || vec![0.0; cells]);
            for (squares, windows) in member.judging.iter_mut().zip(chunks) {
                tasks.push((squares, member.weights.as_slice(), windows));
            }
        }
        let validation_pool = &self.validation_pool;
        let new = || plan.chunk(plan.judge.shape, false);
        tasks.into_par_iter().for_each(|(squares, weights, windows)| {
            validation_pool
                .with(new, |chunk| plan.judge.squares(chunk, weights, &plan.validation, windows, squares));
        });
        let score = |member: &Restart<T>| {
            let mut sums = vec![0.0; cells];
            for squares in &member.judging {
                for (sum, square) in sums.iter_mut().zip(squares) {
                    *sum += square;
                }
            }
            plan.judge.score(&sums)
        };
        self.members.iter().map(|member| if member.idle { f64::INFINITY } else { score(member) }).collect()
    }

    /// Ends an epoch: validation, best weights, early stopping. In the final fit only the last epoch is validated.
    pub(super) fn end(&mut self) {
        let wanted = self.phase == Phase::Selection || self.epoch + 1 == self.plan.epochs;
        let scores = if wanted { self.judge() } else { vec![f64::INFINITY; self.members.len()] };
        let learning_rate = self.rate(self.batches);
        let patience = self.plan.options.patience;
        for (member, validation) in self.members.iter_mut().zip(scores).filter(|(member, _)| !member.idle) {
            let train_loss = self.plan.loss.value(&member.sums);
            self.plan.loss.rebalance(&member.sums, &mut member.balance);
            member.history.push(Epoch { train_loss, validation, learning_rate });
            if validation < member.best_score {
                member.best.clone_from(&member.weights);
                member.best_score = validation;
                member.best_epoch = member.history.len();
            }
            member.idle = patience.is_some_and(|most| member.history.len() - member.best_epoch >= most);
        }
    }

    pub(super) fn is_idle(&self) -> bool {
        self.members.iter().all(|member| member.idle)
    }
}
