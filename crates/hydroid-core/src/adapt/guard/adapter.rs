//! A guard as an [`Adapter`]: three models that walk side by side, and one that answers.

use alloc::boxed::Box;

use super::Guard;
use super::bound::{Allowed, Bounded, BoundedRollout, go_on};
use super::event::Expert;
use super::sensor::Sensor;
use crate::adapt::kalman::Rehearsal;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};
use crate::adapt::{Adapter, Health, Innovation, Outcome};
use crate::predict::{Predictor, Workspace};

impl Guard {
    fn bounded(&self) -> BoundedRollout<'_> {
        BoundedRollout {
            bound: &self.bound,
            allowed: self.choice.allowed,
            motion: &self.motion,
            model: self.expert(self.choice.active),
            reference: self.frozen.as_ref(),
        }
    }
}

impl Predictor for Guard {
    fn outputs(&self) -> usize {
        self.learner.outputs()
    }

    fn inputs(&self) -> usize {
        self.learner.inputs()
    }

    fn warm_up(&self) -> usize {
        self.learner.warm_up()
    }

    fn reset(&mut self) {
        self.learner.reset();
        self.kept.reset();
        self.frozen.reset();
        self.sensors.iter_mut().for_each(Sensor::reset);
        self.trial.reset();
        self.choice.reset();
        self.command.fill(f64::NAN);
        self.motion.fill([f64::NAN; 2]);
        self.events.clear();
        self.outcome = Outcome::Waiting;
    }

    fn observe(&mut self, y: &[f64]) {
        self.events.clear();
        let factor = if self.settings.sensors {
            self.screen(y)
        } else {
            self.measured.copy_from_slice(y);
            self.told.copy_from_slice(y);
            1.0
        };
        self.watch_range();
        self.let_learn();
        if factor > 1.0 {
            self.learner.inflate(factor);
            self.kept.inflate(factor);
            self.frozen.inflate(factor);
        }
        let Self { learner, kept, frozen, measured, told, .. } = self;
        learner.observe(measured);
        kept.observe(measured);
        frozen.observe(told);
        self.outcome = self.learner.outcome();
        self.trial.see(&self.measured);
        self.trial.moves(&mut self.motion);
        if self.trial.is_due() {
            self.check_health();
            self.judge();
            let experts = [self.learner.as_ref(), self.kept.as_ref(), self.frozen.as_ref()];
            self.trial.mark(experts, self.choice.active, self.choice.allowed, &self.motion);
        }
        self.sample += 1;
    }

    fn advance(&mut self, c: &[f64]) {
        self.command.copy_from_slice(c);
        self.trial.hold(c);
        go_on(&mut self.motion);
        self.learner.advance(c);
        self.kept.advance(c);
        self.frozen.advance(c);
    }

    fn output(&self, y: &mut [f64]) {
        self.expert(self.choice.active).output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.learner.snapshot_len() + self.frozen.snapshot_len() + Allowed::LEN + 2 * self.motion.len()
    }

    /// Of the model that predicts, of the one from shore, how far they may be apart, and how the vessel moves.
    fn snapshot(&self, into: &mut [f64]) {
        let len = self.learner.snapshot_len();
        self.expert(self.choice.active).snapshot(&mut into[..len]);
        self.frozen.snapshot(&mut into[len..2 * len]);
        let (allowed, motion) = into[2 * len..].split_at_mut(Allowed::LEN);
        allowed.copy_from_slice(&self.choice.allowed.numbers());
        motion.copy_from_slice(self.motion.as_flattened());
    }

    /// The learner goes on from state and weights of the model that predicted, and predicts unless it was the frozen one; the
    /// snapshot goes on from its state.
    fn restore(&mut self, from: &[f64]) {
        let len = self.learner.snapshot_len();
        let Self { learner, kept, frozen, snapshot: [_, own], .. } = self;
        learner.restore(&from[..len]);
        Self::restore_state(kept.as_mut(), &from[..len], own);
        frozen.restore(&from[len..2 * len]);
        self.trial.reset();
        let allowed = Allowed::of(core::array::from_fn(|i| from[2 * len + i]));
        self.motion.as_flattened_mut().copy_from_slice(&from[2 * len + Allowed::LEN..]);
        self.choice.active = if allowed == Allowed::NONE { Expert::Frozen } else { Expert::Learner };
        self.choice.reset();
        self.choice.allowed = allowed;
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(Bounded {
            bound: self.bound.clone(),
            allowed: self.choice.allowed,
            motion: self.motion.clone().into(),
            model: self.expert(self.choice.active).fork(),
            shore: self.frozen.fork(),
        })
    }
}

impl Adapter for Guard {
    /// That of the learner, or that its weights went back.
    fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn innovations(&self) -> &[Innovation] {
        self.learner.innovations()
    }

    /// What was learned, whichever model predicts.
    fn weights(&self) -> &[f64] {
        self.learner.weights()
    }

    fn freeze(&mut self, frozen: bool) {
        self.stopped = frozen;
        self.learner.freeze(frozen);
    }

    fn inflate(&mut self, factor: f64) {
        self.learner.inflate(factor);
        self.kept.inflate(factor);
        self.frozen.inflate(factor);
    }

    fn restart(&mut self) {
        self.learner.restart();
    }

    fn rehearsal(&self) -> Option<&Rehearsal> {
        self.learner.rehearsal()
    }

    fn keep(&mut self, outputs: &[f64], commands: &[f64]) {
        self.learner.keep(outputs, commands);
    }

    fn health(&self) -> Health {
        self.learner.health()
    }

    fn guard(&self) -> Option<&Guard> {
        Some(self)
    }

    fn memory_len(&self) -> usize {
        let experts = self.learner.memory_len() + self.kept.memory_len() + self.frozen.memory_len();
        let sensors = self.sensors.len() * Sensor::MEMORY_LEN;
        experts
            + sensors
            + self.trial.memory_len()
            + self.choice.memory_len()
            + self.command.len()
            + 2 * self.motion.len()
            + 6
    }

    fn save(&self, into: &mut [f64]) {
        assert_eq!(into.len(), self.memory_len(), "room for the memory");
        let mut into = Writer::new(into);
        for expert in [&self.learner, &self.kept, &self.frozen] {
            expert.save(into.part(expert.memory_len()));
        }
        self.sensors.iter().for_each(|sensor| sensor.save(&mut into));
        self.trial.save(&mut into);
        self.choice.save(&mut into);
        into.numbers(&self.command);
        into.numbers(self.motion.as_flattened());
        // Exact up to 2^53.
        into.numbers(&[self.sample as f64]);
        for count in [self.rest, self.keep, self.next_rest] {
            into.count(count);
        }
        into.flag(self.outside);
        into.flag(self.stopped);
    }

    fn load(&mut self, from: &[f64]) {
        assert_eq!(from.len(), self.memory_len(), "a memory of this adapter");
        let mut from = Reader::new(from);
        for expert in [&mut self.learner, &mut self.kept, &mut self.frozen] {
            expert.load(from.part(expert.memory_len()));
        }
        self.sensors.iter_mut().for_each(|sensor| sensor.load(&mut from));
        self.trial.load(&mut from);
        self.choice.load(&mut from);
        from.numbers(&mut self.command);
        from.numbers(self.motion.as_flattened_mut());
        self.sample = from.count(MOST_COUNTED) as u64;
        for count in [&mut self.rest, &mut self.keep, &mut self.next_rest] {
            *count = from.count(MOST_COUNTED);
        }
        self.outside = from.flag();
        self.stopped = from.flag();
        self.events.clear();
        self.outcome = Outcome::Waiting;
    }

    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let expert = match self.choice.active {
            Expert::Learner => &mut self.learner,
            Expert::Kept => &mut self.kept,
            Expert::Frozen => &mut self.frozen,
        };
        expert.deviations(commands, horizons, work, deviations);
    }
}
