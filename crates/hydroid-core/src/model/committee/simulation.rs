//! A committee that runs freely, sample by sample.

use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;

use super::{Committee, Limits, MOST_MEMBERS, Member, Past, weighted_median};

/// A rollout of a frozen [`Committee`] of unknown length, whose commands may depend on its predictions.
///
/// Each member keeps the state of its own rollout, and the outputs are the weighted medians. The predictions are those of
/// a rollout from the same start under the same commands.
#[derive(Clone, Debug)]
pub struct CommitteeSimulation {
    committee: Arc<Committee>,
    members: Vec<Running>,
    low: Vec<f64>,
    high: Vec<f64>,
}

#[derive(Clone, Debug)]
struct Running {
    scratch: Vec<f64>,
    elapsed: usize,
    y: Vec<f64>,
}

impl CommitteeSimulation {
    /// A simulation of the members with constant coefficients; [`start`](Self::start) begins it.
    pub fn new(committee: &Committee) -> Self {
        Self::of(committee.frozen())
    }

    /// A simulation for each member, by itself.
    pub fn members_of(committee: &Committee) -> Vec<Self> {
        let single = |member: &Member| {
            let members = vec![member.clone()];
            Committee { members: members.clone(), constant: members, ranges: committee.ranges.clone() }
        };
        committee.constant.iter().map(|member| Self::of(single(member))).collect()
    }

    fn of(committee: Committee) -> Self {
        let outputs = committee.outputs();
        let running = |member: &Member| Running {
            scratch: vec![0.0; member.equations.scratch()],
            elapsed: 0,
            y: vec![f64::NAN; outputs],
        };
        let members = committee.members().iter().map(running).collect();
        Self { committee: Arc::new(committee), members, low: vec![0.0; outputs], high: vec![0.0; outputs] }
    }

    /// The committee.
    pub fn committee(&self) -> &Committee {
        &self.committee
    }

    /// Starts at the present of `past`.
    ///
    /// # Panics
    /// If the past is shorter than [`Committee::span`] and one sample.
    pub fn start(&mut self, past: Past<'_>) {
        let n = self.committee.outputs();
        self.committee.limits(&past.outputs[past.outputs.len() - n..], &mut self.low, &mut self.high);
        for (member, running) in self.committee.members().iter().zip(&mut self.members) {
            running.elapsed = member.equations.begin(past, &mut running.scratch).elapsed;
        }
    }

    /// Predicts the outputs `y` of the next sample under the command `c`.
    ///
    /// # Panics
    /// If `c` or `y` have another length than inputs and outputs.
    pub fn advance(&mut self, c: &[f64], y: &mut [f64]) {
        let members = self.committee.members();
        let limits = Limits { low: &self.low, high: &self.high };
        for (member, running) in members.iter().zip(&mut self.members) {
            let of = &member.equations;
            let mut rolling = of.rolling(running.elapsed, &mut running.scratch);
            of.step(of.coefficients(), &mut rolling, c, limits, &mut running.y);
            running.elapsed = rolling.elapsed;
        }
        let mut votes = [(0.0, 0); MOST_MEMBERS];
        let votes = &mut votes[..members.len()];
        for (i, y) in y.iter_mut().enumerate() {
            for ((vote, member), running) in votes.iter_mut().zip(members).zip(&self.members) {
                *vote = (running.y[i], member.votes);
            }
            *y = weighted_median(votes);
        }
    }

    /// Length of a snapshot; constant over the life of a simulation.
    pub fn snapshot_len(&self) -> usize {
        let members = self.members.iter().map(|running| running.scratch.len() + 1 + running.y.len());
        members.sum::<usize>() + self.low.len() + self.high.len()
    }

    /// Copies all numbers on which predictions depend into `into`.
    ///
    /// # Panics
    /// If `into` has not [`snapshot_len`](Self::snapshot_len) numbers.
    pub fn snapshot(&self, into: &mut [f64]) {
        let mut rest = into;
        let mut put = |numbers: &[f64]| {
            let (own, others) = core::mem::take(&mut rest).split_at_mut(numbers.len());
            own.copy_from_slice(numbers);
            rest = others;
        };
        for running in &self.members {
            put(&running.scratch);
            put(&[running.elapsed as f64]);
            put(&running.y);
        }
        put(&self.low);
        put(&self.high);
        assert!(rest.is_empty(), "a snapshot of another committee");
    }

    /// Restores a snapshot of a simulation of the same committee. A number that no snapshot contains is read as the nearest
    /// one that a snapshot can contain.
    ///
    /// # Panics
    /// If `from` has not [`snapshot_len`](Self::snapshot_len) numbers.
    pub fn restore(&mut self, from: &[f64]) {
        let mut rest = from;
        let mut take = |numbers: &mut [f64]| {
            let (own, others) = rest.split_at(numbers.len());
            numbers.copy_from_slice(own);
            rest = others;
        };
        for (member, running) in self.committee.members().iter().zip(&mut self.members) {
            take(&mut running.scratch);
            let mut elapsed = [0.0];
            take(&mut elapsed);
            let longest = member.equations.shape().clock.saturating_sub(1);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casts saturate")]
            let elapsed = elapsed[0] as usize;
            running.elapsed = elapsed.min(longest);
            take(&mut running.y);
        }
        take(&mut self.low);
        take(&mut self.high);
        assert!(rest.is_empty(), "a snapshot of another committee");
    }

    /// Adds a disturbance to the outputs of all members.
    ///
    /// # Panics
    /// If `by` has not one number for each output.
    pub fn shift(&mut self, by: &[f64]) {
        for (member, running) in self.committee.members().iter().zip(&mut self.members) {
            member.equations.rolling(running.elapsed, &mut running.scratch).shift(by);
        }
    }
}
