//! Restarts that train side by side.

use hydroid_core::math::Scalar;
use hydroid_core::model::recurrent::Scaling;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;

use super::adam::{Adam, PART, clip};
use super::chunk::{Chunk, Net};
use super::judge::Judge;
use super::loss::{Loss, Sums};
use super::random::{Purpose, stream};
use super::windows::{ScaledRun, Shape, Window, shuffled};
use super::{Aim, Epoch, Settings, schedule};

/// Steps of the optimizer that an epoch has at least, if the runs hold as many windows.
const LEAST_STEPS: usize = 8;

/// One training from first weights of its own.
#[derive(Clone, Debug)]
pub(super) struct Member<T> {
    pub(super) weights: Vec<T>,
    pub(super) adam: Adam<T>,
    /// Weights with the least validation error so far.
    pub(super) best: Vec<T>,
    pub(super) best_score: f64,
    /// Epoch that they are of, from 1; 0 before there are any.
    pub(super) best_epoch: usize,
    pub(super) history: Vec<Epoch>,
    /// Whether it gave up.
    pub(super) idle: bool,
    order: Vec<Window>,
    gradient: Vec<T>,
    /// What each output weighs in the loss beside the settings' weight, over an epoch.
    pub(super) balance: Vec<f64>,
    /// Squared errors of the epoch so far, of each output.
    sums: Vec<Sums>,
    work: Vec<Work<T>>,
    /// How many of them the present batch fills.
    chunks: usize,
    judging: Vec<Vec<f64>>,
}

/// What a chunk of windows comes to.
#[derive(Clone, Debug)]
struct Work<T> {
    gradient: Vec<T>,
    sums: Vec<Sums>,
}

/// All that does not change in a training.
#[derive(Clone, Debug)]
pub(super) struct Plan<T> {
    pub(super) settings: Settings,
    pub(super) net: Net,
    pub(super) scaling: Scaling,
    pub(super) shape: Shape,
    pub(super) runs: Vec<ScaledRun<T>>,
    pub(super) validation: Vec<ScaledRun<T>>,
    pub(super) judge: Judge,
    pub(super) loss: Loss,
    pub(super) epochs: usize,
}

impl<T: Scalar> Plan<T> {
    /// The windows of an epoch, the same for all members, who see them in different orders.
    fn windows(&self, epoch: usize) -> Vec<Window> {
        if self.net.everywhere() {
            return self.shape.every(&self.runs, 1);
        }
        self.shape.tiles(&self.runs, &mut stream(self.settings.seed, Purpose::Offsets, 0, epoch))
    }

    /// Steps of an epoch with so many windows.
    fn batches(&self, windows: usize) -> usize {
        windows.div_ceil(self.settings.batch).max(LEAST_STEPS.min(windows))
    }

    fn chunk(&self, shape: Shape, back: bool) -> Chunk<T> {
        self.net.chunk(&self.scaling, shape, self.net.chunk_windows(), back)
    }
}

/// The members, in lock-step: each step's chunks of all members are one bag of work for all threads, so that cores are
/// busy with one restart and with many, and the caller hears of every step.
#[derive(Debug)]
pub(super) struct Team<T> {
    pub(super) plan: Plan<T>,
    pub(super) members: Vec<Member<T>>,
    aim: Aim,
    /// Steps of the present epoch.
    batches: usize,
    epoch: usize,
    /// For learning and for judging.
    learners: Pool<T>,
    judges: Pool<T>,
}

/// Chunks that wait for work: as many as there are threads, however many restarts.
#[derive(Debug)]
struct Pool<T>(Mutex<Vec<Chunk<T>>>);

impl<T> Pool<T> {
    /// Works with a chunk of the pool, or a new one.
    fn with(&self, new: impl FnOnce() -> Chunk<T>, work: impl FnOnce(&mut Chunk<T>)) {
        // What a chunk holds is written over: a lock that was poisoned does no harm.
        let spare = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let free = spare().pop();
        let mut chunk = free.unwrap_or_else(new);
        work(&mut chunk);
        spare().push(chunk);
    }
}

impl<T: Scalar> Team<T> {
    pub(super) fn new(plan: Plan<T>, aim: Aim) -> Self {
        let members = (0..plan.settings.restarts)
            .map(|restart| {
                let restart = aim.first() + restart;
                let mut rng = stream(plan.settings.seed, Purpose::Weights, restart, 0);
                let weights = plan.net.first::<T>(&mut rng);
                let count = weights.len();
                Member {
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
        let [learners, judges] = [0, 1].map(|_| Pool(Mutex::default()));
        Self { plan, members, aim, batches: 0, epoch: 0, learners, judges }
    }

    /// Begins an epoch, counted from 0; gives its number of steps.
    pub(super) fn begin(&mut self, epoch: usize) -> usize {
        let windows = self.plan.windows(epoch);
        self.batches = self.plan.batches(windows.len());
        self.epoch = epoch;
        for (restart, member) in self.members.iter_mut().enumerate().filter(|(_, member)| !member.idle) {
            let restart = self.aim.first() + restart;
            let mut rng = stream(self.plan.settings.seed, Purpose::Order, restart, epoch);
            member.order = shuffled(&windows, &mut rng);
            member.sums.fill([0.0; 2]);
        }
        self.batches
    }

    /// The gradient of each member on a batch of the epoch, and its loss.
    pub(super) fn gradients(&mut self, batch: usize) {
        let plan = &self.plan;
        let mut tasks = Vec::new();
        for member in self.members.iter_mut().filter(|member| !member.idle) {
            let count = member.order.len();
            // Batches as equal as can be.
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
        let learners = &self.learners;
        let new = || plan.chunk(plan.shape, true);
        tasks.into_par_iter().for_each(|(work, weights, windows, channels, factor)| {
            learners.with(new, |chunk| {
                chunk.walk(weights, &plan.runs, windows);
                chunk.squares(&plan.runs, plan.shape.length, &mut work.sums);
                chunk.backward(weights, &plan.runs, &channels, factor, &mut work.gradient);
            });
        });
    }

    /// A step of each member along the gradient of a batch.
    pub(super) fn step(&mut self, batch: usize) {
        self.gradients(batch);
        let rate = self.rate(batch);
        let Settings { clip: most, weight_decay, .. } = self.plan.settings;
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
            // A step along a gradient that is no number would end the training; the loss tells of it.
            if clip(&mut member.gradient, most).is_finite() {
                member.adam.step(&mut member.weights, &member.gradient, rate, weight_decay);
            }
        }
    }

    fn rate(&self, batch: usize) -> f64 {
        let Settings { schedule, learning_rate, .. } = self.plan.settings;
        let (done, steps) = (self.epoch * self.batches + batch, self.plan.epochs * self.batches);
        schedule::rate(schedule, learning_rate, done, steps)
    }

    /// Judges the weights of all members, in scores by member.
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
        let judges = &self.judges;
        let new = || plan.chunk(plan.judge.shape, false);
        tasks.into_par_iter().for_each(|(squares, weights, windows)| {
            judges.with(new, |chunk| plan.judge.squares(chunk, weights, &plan.validation, windows, squares));
        });
        let score = |member: &Member<T>| {
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

    /// Ends an epoch: judges, keeps the best weights, and lets those give up who have not been better for long. Where
    /// the last weights are wanted, the others are not judged.
    pub(super) fn end(&mut self) {
        let wanted = self.aim == Aim::Choose || self.epoch + 1 == self.plan.epochs;
        let scores = if wanted { self.judge() } else { vec![f64::INFINITY; self.members.len()] };
        let learning_rate = self.rate(self.batches);
        let patience = self.plan.settings.patience;
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

    /// Whether nobody goes on.
    pub(super) fn is_idle(&self) -> bool {
        self.members.iter().all(|member| member.idle)
    }
}
