//! A guard as an adapter: three models follow the run, and the active one predicts.

use alloc::boxed::Box;

use super::Guard;
use super::deviation_bound::{BoundedRollout, Budget, GuardFork, extrapolate};
use super::event::Expert;
use super::sensor::Sensor;
use crate::adapt::kalman::RehearsalOptions;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};
use crate::adapt::{Health, Innovation, Learning, Outcome, Rehearsing, SaveState};
use crate::predict::{Current, Predictor, Workspace};

impl Guard {
    fn bounded(&self) -> BoundedRollout<'_> {
        BoundedRollout {
            bound: &self.bound,
            budget: self.selector.budget,
            motion: &self.motion,
            model: self.expert(self.selector.active),
            reference: self.reference.as_ref(),
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
        self.snapshot.reset();
        self.reference.reset();
        self.sensors.iter_mut().for_each(Sensor::reset);
        self.shadow_test.reset();
        self.selector.reset();
        self.command.fill(f64::NAN);
        self.motion.fill([f64::NAN; 2]);
        self.events.clear();
        self.outcome = Outcome::Waiting;
    }

    fn observe_heading(&mut self, heading: f64) {
        for expert in [&mut self.learner, &mut self.snapshot, &mut self.reference] {
            expert.observe_heading(heading);
        }
    }

    fn current(&self) -> Option<&Current> {
        self.expert(self.selector.active).current()
    }

    fn output_through_water(&self, y: &mut [f64]) {
        self.expert(self.selector.active).output_through_water(y);
    }

    fn observe(&mut self, y: &[f64]) {
        self.events.clear();
        let factor = if self.options.sensors {
            self.screen(y)
        } else {
            self.measured.copy_from_slice(y);
            self.reference_input.copy_from_slice(y);
            1.0
        };
        self.check_range();
        self.update_freeze();
        if factor > 1.0 {
            self.learner.scale_noise(factor);
            self.snapshot.scale_noise(factor);
            self.reference.scale_noise(factor);
        }
        let Self { learner, snapshot, reference, measured, reference_input, .. } = self;
        learner.observe(measured);
        snapshot.observe(measured);
        reference.observe(reference_input);
        self.outcome = self.learner.outcome();
        self.shadow_test.push_measurement(&self.measured);
        self.shadow_test.estimate_motion(&mut self.motion);
        if self.shadow_test.is_due() {
            self.check_health();
            self.judge();
            let experts = [self.learner.as_ref(), self.snapshot.as_ref(), self.reference.as_ref()];
            self.shadow_test.store(experts, self.selector.active, self.selector.budget, &self.motion);
        }
        self.sample += 1;
    }

    fn advance(&mut self, c: &[f64]) {
        self.command.copy_from_slice(c);
        self.shadow_test.push_command(c);
        extrapolate(&mut self.motion);
        self.learner.advance(c);
        self.snapshot.advance(c);
        self.reference.advance(c);
    }

    fn output(&self, y: &mut [f64]) {
        self.expert(self.selector.active).output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.learner.snapshot_len() + self.reference.snapshot_len() + Budget::LEN + 2 * self.motion.len()
    }

    /// Snapshots of the active and the reference model, the budget, and the motion of the vessel.
    fn snapshot(&self, into: &mut [f64]) {
        let len = self.learner.snapshot_len();
        self.expert(self.selector.active).snapshot(&mut into[..len]);
        self.reference.snapshot(&mut into[len..2 * len]);
        let (budget, motion) = into[2 * len..].split_at_mut(Budget::LEN);
        budget.copy_from_slice(&self.selector.budget.numbers());
        motion.copy_from_slice(self.motion.as_flattened());
    }

    /// The learner takes state and weights of the active model, the snapshot its state. The learner becomes active,
    /// unless the reference model was.
    fn restore(&mut self, from: &[f64]) {
        let len = self.learner.snapshot_len();
        let Self { learner, snapshot, reference, buffers: [_, own], .. } = self;
        learner.restore(&from[..len]);
        Self::restore_state(snapshot.as_mut(), &from[..len], own);
        reference.restore(&from[len..2 * len]);
        self.shadow_test.reset();
        let budget = Budget::of(core::array::from_fn(|i| from[2 * len + i]));
        self.motion.as_flattened_mut().copy_from_slice(&from[2 * len + Budget::LEN..]);
        self.selector.active = if budget == Budget::NONE { Expert::Reference } else { Expert::Adapted };
        self.selector.reset();
        self.selector.budget = budget;
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(GuardFork {
            bound: self.bound.clone(),
            budget: self.selector.budget,
            motion: self.motion.clone().into(),
            model: self.expert(self.selector.active).fork(),
            reference: self.reference.fork(),
        })
    }
}

impl Learning for Guard {
    /// The outcome of the learner, or a rollback of its weights.
    fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn innovations(&self) -> &[Innovation] {
        self.learner.innovations()
    }

    /// The weights of the learner, even if another model is active.
    fn weights(&self) -> &[f64] {
        self.learner.weights()
    }

    fn freeze(&mut self, frozen: bool) {
        self.stopped = frozen;
        self.learner.freeze(frozen);
    }

    fn scale_noise(&mut self, factor: f64) {
        self.learner.scale_noise(factor);
        self.snapshot.scale_noise(factor);
        self.reference.scale_noise(factor);
    }

    fn restart(&mut self) {
        self.learner.restart();
    }

    fn health(&self) -> Health {
        self.learner.health()
    }

    fn guard(&self) -> Option<&Guard> {
        Some(self)
    }

    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let expert = match self.selector.active {
            Expert::Adapted => &mut self.learner,
            Expert::Snapshot => &mut self.snapshot,
            Expert::Reference => &mut self.reference,
        };
        expert.deviations(commands, horizons, work, deviations);
    }
}

impl SaveState for Guard {
    fn memory_len(&self) -> usize {
        let experts = self.learner.memory_len() + self.snapshot.memory_len() + self.reference.memory_len();
        let sensors = self.sensors.len() * Sensor::MEMORY_LEN;
        experts
            + sensors
            + self.shadow_test.memory_len()
            + self.selector.memory_len()
            + self.command.len()
            + 2 * self.motion.len()
            + 6
    }

    fn save(&self, into: &mut [f64]) {
        assert_eq!(into.len(), self.memory_len(), "room for the memory");
        let mut into = Writer::new(into);
        for expert in [&self.learner, &self.snapshot, &self.reference] {
            expert.save(into.part(expert.memory_len()));
        }
        self.sensors.iter().for_each(|sensor| sensor.save(&mut into));
        self.shadow_test.save(&mut into);
        self.selector.save(&mut into);
        into.numbers(&self.command);
        into.numbers(self.motion.as_flattened());
        into.numbers(&[self.sample as f64]);
        for count in [self.pause, self.until_snapshot, self.next_pause] {
            into.count(count);
        }
        into.flag(self.outside);
        into.flag(self.stopped);
    }

    fn load(&mut self, from: &[f64]) {
        assert_eq!(from.len(), self.memory_len(), "a memory of this adapter");
        let mut from = Reader::new(from);
        for expert in [&mut self.learner, &mut self.snapshot, &mut self.reference] {
            expert.load(from.part(expert.memory_len()));
        }
        self.sensors.iter_mut().for_each(|sensor| sensor.load(&mut from));
        self.shadow_test.load(&mut from);
        self.selector.load(&mut from);
        from.numbers(&mut self.command);
        from.numbers(self.motion.as_flattened_mut());
        self.sample = from.count(MOST_COUNTED) as u64;
        for count in [&mut self.pause, &mut self.until_snapshot, &mut self.next_pause] {
            *count = from.count(MOST_COUNTED);
        }
        self.outside = from.flag();
        self.stopped = from.flag();
        self.events.clear();
        self.outcome = Outcome::Waiting;
    }
}

impl Rehearsing for Guard {
    fn rehearsal(&self) -> Option<&RehearsalOptions> {
        self.learner.rehearsal()
    }

    fn store_window(&mut self, outputs: &[f64], commands: &[f64]) {
        self.learner.store_window(outputs, commands);
    }
}
