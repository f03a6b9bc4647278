//! The session of a committee: its past, the rollouts of its members, and the members that learn.

mod learner;

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::innovation_gate::InnovationGate;
use super::{Health, Innovation, Learning, Outcome, Rehearsing, SaveState};
use crate::memory::{MOST_COUNTED, Memory};
use crate::model::committee::{Committee, CommitteeError, Limits, MOST_MEMBERS, Past, weighted_median};
use crate::predict::{Predictor, Workspace, delegate, plain, rollout_steps};
use learner::Learner;

pub use learner::{LearnerConstants, increment_stride};

/// A session of a [`Committee`], and an [`Adapter`](super::Adapter) of the members that learn.
///
/// A member with a [`Prior`](crate::model::committee::Prior) continues the regression of the training rows along the run:
/// its coefficients are those of ridge regression on all rows so far, where the training rows have the weight of the
/// prior ([`RecursiveLeastSquares`](super::RecursiveLeastSquares) without forgetting). Rows are increments over the clock
/// step of the member, averaged over several clock steps. An [`InnovationGate`] reduces the weight of outliers. Which
/// members learn, and how fast, was decided with the votes, by the errors of rollouts on runs that were left out.
///
/// A missing value is replaced by the prediction of the committee. Increments with a missing value are not part of a row.
#[derive(Clone, Debug)]
pub struct CommitteeSession {
    committee: Arc<Committee>,
    learners: Vec<Learner>,
    /// Coefficients of the members that learn.
    weights: Vec<f64>,
    /// Outputs of the last samples, row by row, the present one last.
    outputs: Vec<f64>,
    /// Commands before the present, row by row.
    inputs: Vec<f64>,
    started: bool,
    /// Consecutive samples without a missing value, up to the present one.
    measured: usize,
    observed: bool,
    frozen: bool,
    inflation: f64,
    outcome: Outcome,
    innovations: Vec<Innovation>,
    /// Prediction of the next sample.
    next: Vec<f64>,
    /// Standard deviations of the prediction errors, a row for each horizon from 1 on; may be empty.
    deviations: Arc<[f64]>,
    work: Workspace,
}

impl CommitteeSession {
    /// A session at the start of a run.
    ///
    /// # Errors
    /// If the prior of a member is singular.
    pub fn new(committee: Arc<Committee>) -> Result<Self, CommitteeError> {
        let mut learners = Vec::new();
        let mut weights = Vec::new();
        let mut rows = committee.span() + 1;
        for (index, member) in committee.members().iter().enumerate() {
            let Some(prior) = &member.prior else { continue };
            let of = &member.equations;
            let gate = InnovationGate::default();
            let learner = Learner::new(index, weights.len(), of, prior, gate);
            learners.push(learner.ok_or(CommitteeError::Prior { member: index })?);
            weights.extend_from_slice(of.coefficients());
            rows = rows.max(of.shape().span() + of.shape().clock + 1);
        }
        let outputs = committee.outputs();
        Ok(Self {
            outputs: vec![f64::NAN; rows * outputs],
            inputs: vec![0.0; (rows - 1) * committee.inputs()],
            innovations: Vec::with_capacity(outputs),
            committee,
            learners,
            weights,
            started: false,
            measured: 0,
            observed: false,
            frozen: false,
            inflation: 1.0,
            outcome: Outcome::Waiting,
            next: vec![0.0; outputs],
            deviations: Arc::from([]),
            work: Workspace::new(),
        })
    }

    /// The session with standard deviations of its prediction errors, `horizons x outputs`, from the horizon 1 on: errors
    /// on runs that were left out.
    ///
    /// # Panics
    /// If the deviations are not whole rows.
    #[must_use]
    pub fn with_deviations(self, deviations: Vec<f64>) -> Self {
        assert!(deviations.len().is_multiple_of(self.committee.outputs()), "a number for each output");
        Self { deviations: deviations.into(), ..self }
    }

    /// The constants of the members that learn.
    #[doc(hidden)]
    pub fn learners(&self) -> Vec<LearnerConstants> {
        self.learners.iter().map(Learner::constants).collect()
    }

    /// The committee.
    pub fn committee(&self) -> &Arc<Committee> {
        &self.committee
    }

    fn present(&self) -> &[f64] {
        &self.outputs[self.outputs.len() - self.committee.outputs()..]
    }

    fn begin_step(&mut self, c: &[f64]) {
        if !self.observed {
            self.measured = 0;
        }
        self.observed = false;
        if !self.started {
            // The unknown commands before a run are its first one.
            self.inputs.chunks_exact_mut(c.len().max(1)).for_each(|row| row.copy_from_slice(c));
            self.started = true;
        }
    }

    /// Moves the past by a sample; the newest outputs are those of the sample before.
    fn shift(&mut self, c: &[f64]) {
        let (n, m) = (self.committee.outputs(), self.committee.inputs());
        self.outputs.copy_within(n.., 0);
        if self.inputs.len() > m {
            self.inputs.copy_within(m.., 0);
        }
        let end = self.inputs.len();
        if end > 0 {
            self.inputs[end - m..].copy_from_slice(c);
        }
    }

    fn roll(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let members = self.committee.members();
        let scratch = members.iter().map(|member| member.equations.scratch()).max().unwrap_or(0);
        let past = Past { outputs: &self.outputs, inputs: &self.inputs };
        let outputs = self.committee.outputs();
        let numbers = work.take(2 * outputs + scratch + members.len() * y.len());
        let (limits, numbers) = numbers.split_at_mut(2 * outputs);
        let (low, high) = limits.split_at_mut(outputs);
        self.committee.limits(self.present(), low, high);
        let limits = Limits { low, high };
        let (scratch, predicted) = numbers.split_at_mut(scratch);
        let mut rest = &self.weights[..];
        for (member, own) in members.iter().zip(predicted.chunks_exact_mut(y.len().max(1))) {
            let of = &member.equations;
            let coefficients = if member.prior.is_some() {
                let (learned, others) = rest.split_at(of.coefficients().len());
                rest = others;
                learned
            } else {
                of.coefficients()
            };
            of.rollout(coefficients, past, commands, limits, scratch, own);
        }
        let mut votes = [(0.0, 0); MOST_MEMBERS];
        let votes = &mut votes[..members.len()];
        for (i, y) in y.iter_mut().enumerate() {
            for ((vote, member), own) in
                votes.iter_mut().zip(members).zip(predicted.chunks_exact(predicted.len() / members.len()))
            {
                *vote = (own[i], member.votes);
            }
            *y = weighted_median(votes);
        }
    }
}

impl Predictor for CommitteeSession {
    plain!(over_ground rollout_batch rollout_snapshots);
    delegate!(committee: outputs inputs);

    fn warm_up(&self) -> usize {
        self.committee.span() + 1
    }

    /// The learned coefficients stay.
    fn reset(&mut self) {
        self.outputs.fill(f64::NAN);
        self.inputs.fill(0.0);
        self.started = false;
        self.measured = 0;
        self.observed = false;
        self.outcome = Outcome::Waiting;
        self.innovations.clear();
        self.learners.iter_mut().for_each(Learner::restart_row);
    }

    fn observe(&mut self, y: &[f64]) {
        let n = self.committee.outputs();
        let newest = self.outputs.len() - n;
        let mut complete = true;
        for (c, &y) in y.iter().enumerate() {
            if y.is_nan() {
                complete = false;
                continue;
            }
            if self.outputs[newest + c].is_nan() {
                // The unknown past of an output is its first value.
                self.outputs[c..]
                    .iter_mut()
                    .step_by(n)
                    .filter(|past| past.is_nan())
                    .for_each(|past| *past = y);
            }
            self.outputs[newest + c] = y;
        }
        self.measured = if complete { self.measured.saturating_add(1) } else { 0 };
        self.observed = true;
        self.outcome = Outcome::Waiting;
        self.innovations.clear();
        if !self.frozen {
            let past = Past { outputs: &self.outputs, inputs: &self.inputs };
            for learner in &mut self.learners {
                let of = &self.committee.members()[learner.member].equations;
                let outcome = learner.learn(
                    of,
                    past,
                    self.measured,
                    self.inflation,
                    &mut self.innovations,
                    &mut self.weights,
                );
                if outcome != Outcome::Waiting {
                    self.outcome = outcome;
                }
            }
        }
        self.inflation = 1.0;
    }

    fn advance(&mut self, c: &[f64]) {
        self.begin_step(c);
        let mut work = core::mem::take(&mut self.work);
        let mut next = core::mem::take(&mut self.next);
        self.roll(c, &mut work, &mut next);
        self.work = work;
        let known = self.present().iter().all(|y| !y.is_nan());
        self.shift(c);
        if known {
            let newest = self.outputs.len() - next.len();
            self.outputs[newest..].copy_from_slice(&next);
        }
        self.next = next;
    }

    fn advance_observe(&mut self, c: &[f64], y: &[f64]) {
        if y.iter().all(|y| !y.is_nan()) {
            self.begin_step(c);
            self.shift(c);
        } else {
            self.advance(c);
        }
        self.observe(y);
    }

    fn output(&self, y: &mut [f64]) {
        y.copy_from_slice(self.present());
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        rollout_steps(commands, self.inputs(), y, self.outputs());
        if !y.is_empty() {
            self.roll(commands, work, y);
        }
    }

    fn snapshot_len(&self) -> usize {
        self.outputs.len() + self.inputs.len() + 1 + self.weights.len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        assert_eq!(into.len(), self.snapshot_len(), "room for the snapshot");
        let started = f64::from(u8::from(self.started));
        let numbers = self.outputs.iter().chain(&self.inputs).chain([&started]).chain(&self.weights);
        into.iter_mut().zip(numbers).for_each(|(into, number)| *into = *number);
    }

    /// Restores past and coefficients. The covariances stay, and rows restart.
    fn restore(&mut self, from: &[f64]) {
        assert_eq!(from.len(), self.snapshot_len(), "a snapshot of this model");
        let mut memory = Memory::Loading(from);
        memory.numbers(&mut self.outputs);
        memory.numbers(&mut self.inputs);
        memory.flag(&mut self.started);
        memory.numbers(&mut self.weights);
        self.measured = 0;
        self.observed = false;
        for learner in &mut self.learners {
            learner.adopt(&self.weights);
        }
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(Self { frozen: true, ..self.clone() })
    }
}

impl Learning for CommitteeSession {
    plain!(no_guard);

    /// Outcome of the last member that completed a row at this sample; the gates of the others can differ.
    fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
    }

    fn scale_noise(&mut self, factor: f64) {
        self.inflation = factor;
    }

    fn restart(&mut self) {
        self.learners.iter_mut().for_each(Learner::restart);
    }

    /// Unknown: the covariances are positive by construction.
    fn health(&self) -> Health {
        Health::UNKNOWN
    }

    /// Those of [`with_deviations`](CommitteeSession::with_deviations); NaN beyond their last horizon.
    fn deviations(&mut self, _: &[f64], horizons: &[usize], _: &mut Workspace, deviations: &mut [f64]) {
        let outputs = self.committee.outputs();
        assert_eq!(deviations.len(), horizons.len() * outputs, "a row for each horizon");
        for (row, &horizon) in deviations.chunks_exact_mut(outputs).zip(horizons) {
            match self.deviations.chunks_exact(outputs).nth(horizon.wrapping_sub(1)) {
                Some(known) => row.copy_from_slice(known),
                None => row.fill(f64::NAN),
            }
        }
    }
}

impl SaveState for CommitteeSession {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.session(self);
        memory.count(&mut self.measured, MOST_COUNTED);
        memory.flag(&mut self.observed);
        memory.flag(&mut self.frozen);
        memory.number(&mut self.inflation);
        self.learners.iter_mut().for_each(|learner| learner.visit_state(memory));
        if memory.is_loading() {
            self.outcome = Outcome::Waiting;
            self.innovations.clear();
        }
    }

    fn is_sound(&self) -> bool {
        self.weights.iter().all(|weight| weight.is_finite()) && self.learners.iter().all(Learner::is_sound)
    }
}

impl Rehearsing for CommitteeSession {
    plain!(no_rehearsal);
}
