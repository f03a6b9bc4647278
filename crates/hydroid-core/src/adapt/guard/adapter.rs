//! A guard as an adapter: both models follow the run, and the active one predicts.

use alloc::boxed::Box;

use super::Guard;
use super::bounded::{Bounded, GuardFork};
use super::event::Expert;
use super::sensor::Sensor;
use crate::adapt::{Learning, Outcome, Rehearsing, SaveState};
use crate::memory::{MOST_COUNTED, Memory};
use crate::predict::{Current, Predictor, Workspace, delegate, plain};

impl Guard {
    fn bounded(&self) -> Bounded<'_> {
        Bounded {
            metric: &self.metric,
            limit: self.account.limit(),
            model: (self.active() == Expert::Adapted).then_some(self.learner.as_ref() as &dyn Predictor),
            reference: self.reference.as_ref(),
        }
    }
}

impl Predictor for Guard {
    plain!(advance_observe rollout_snapshots);
    delegate!(learner: outputs inputs warm_up);

    fn reset(&mut self) {
        self.learner.reset();
        self.reference.reset();
        self.sensors.iter_mut().for_each(Sensor::reset);
        self.shadow_test.reset();
        self.account.reset();
        self.estimated.fill(f64::NAN);
        self.events.clear();
        self.outcome = Outcome::Waiting;
    }

    fn observe_heading(&mut self, heading: f64) {
        self.learner.observe_heading(heading);
        self.reference.observe_heading(heading);
    }

    fn current(&self) -> Option<&Current> {
        self.expert(self.active()).current()
    }

    fn output_through_water(&self, y: &mut [f64]) {
        self.expert(self.active()).output_through_water(y);
    }

    fn observe(&mut self, y: &[f64]) {
        self.events.clear();
        self.screen(y);
        self.learner.observe(&self.measured);
        self.reference.observe(&self.measured);
        self.outcome = self.learner.outcome();
        self.shadow_test.push_measurement(&self.measured);
        if self.shadow_test.is_due() {
            self.check_health();
            self.judge();
            let adapted = self.active() == Expert::Adapted;
            self.shadow_test.store([self.learner.as_ref(), self.reference.as_ref()], adapted);
        }
        self.estimate();
        self.sample += 1;
    }

    fn advance(&mut self, c: &[f64]) {
        self.shadow_test.push_command(c);
        self.learner.advance(c);
        self.reference.advance(c);
    }

    fn output(&self, y: &mut [f64]) {
        self.expert(self.active()).output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        2 * self.learner.snapshot_len() + 1
    }

    /// Snapshots of the active and the reference model, and the limit.
    fn snapshot(&self, into: &mut [f64]) {
        let len = self.learner.snapshot_len();
        self.expert(self.active()).snapshot(&mut into[..len]);
        self.reference.snapshot(&mut into[len..2 * len]);
        into[2 * len] = self.account.limit();
    }

    /// The learner takes state and weights of the snapshot's active model and is selected.
    fn restore(&mut self, from: &[f64]) {
        let len = self.learner.snapshot_len();
        self.learner.restore(&from[..len]);
        self.reference.restore(&from[len..2 * len]);
        self.shadow_test.reset();
        self.account.restore_limit(from[2 * len]);
        self.own.reset();
        self.estimate();
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(GuardFork {
            metric: self.metric.clone(),
            limit: self.account.limit(),
            model: self.expert(self.active()).fork(),
            reference: self.reference.fork(),
        })
    }
}

impl Learning for Guard {
    /// The outcome of the learner, or a rollback of its weights.
    fn outcome(&self) -> Outcome {
        self.outcome
    }

    // Also the weights are those of the learner, even if the reference model is active.
    delegate!(learner: innovations weights freeze restart health);

    fn scale_noise(&mut self, factor: f64) {
        self.learner.scale_noise(factor);
        self.reference.scale_noise(factor);
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
        let expert = match self.active() {
            Expert::Adapted => &mut self.learner,
            Expert::Reference => &mut self.reference,
        };
        expert.deviations(commands, horizons, work, deviations);
    }
}

impl SaveState for Guard {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.learner.visit_state(memory);
        self.reference.visit_state(memory);
        self.sensors.iter_mut().for_each(|sensor| sensor.visit_state(memory));
        self.shadow_test.visit_state(memory);
        self.account.visit_state(memory);
        memory.numbers(&mut self.estimated);
        memory.number(&mut self.own.value);
        let mut sample = usize::try_from(self.sample).unwrap_or(MOST_COUNTED);
        memory.count(&mut sample, MOST_COUNTED);
        self.sample = sample as u64;
        if memory.is_loading() {
            self.events.clear();
            self.outcome = Outcome::Waiting;
        }
    }

    fn is_sound(&self) -> bool {
        self.learner.is_sound()
            && self.reference.is_sound()
            && self.sensors.iter().all(Sensor::is_sound)
            && self.account.is_sound()
            && self.own.value.is_finite()
    }
}

impl Rehearsing for Guard {
    delegate!(learner: rehearsal store_window);
}
