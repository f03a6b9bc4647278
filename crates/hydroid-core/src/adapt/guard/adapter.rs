//! A guard as an adapter: the models follow the run, and the active one predicts.

use alloc::boxed::Box;

use super::Guard;
use super::account::Account;
use super::bounded::{Bounded, GuardFork, read_limits, snapshot_len, write_snapshot};
use super::event::Expert;
use super::sensor::Sensor;
use crate::adapt::{Adapter, Learning, Outcome, Rehearsing, SaveState};
use crate::memory::{MOST_COUNTED, Memory};
use crate::predict::{Current, Predictor, Workspace, delegate, plain};

impl Guard {
    fn bounded(&self) -> Bounded<'_> {
        let model = (self.guarded() == Expert::Adapted).then_some(self.learner.as_ref() as &dyn Predictor);
        let unguarded: &dyn Predictor = self.expert(Expert::Unguarded);
        Bounded {
            metric: &self.metric,
            limits: self.limits(),
            held: self.is_held(),
            model,
            reference: self.reference.as_ref(),
            unguarded: (self.apart || model.is_none()).then_some(unguarded),
        }
    }

    /// The models that run.
    fn each(&mut self, call: impl Fn(&mut dyn Adapter)) {
        call(self.learner.as_mut());
        call(self.reference.as_mut());
        if self.apart {
            call(self.unguarded.as_mut());
        }
    }
}

impl Predictor for Guard {
    plain!(advance_observe rollout_snapshots);
    delegate!(learner: outputs inputs warm_up);

    fn reset(&mut self) {
        self.each(|model| model.reset());
        self.sensors.iter_mut().for_each(Sensor::reset);
        self.shadow_test.reset();
        self.accounts.iter_mut().for_each(Account::reset);
        self.held = 0;
        self.evidence.reset();
        self.estimated.fill(f64::NAN);
        self.events.clear();
        self.outcome = Outcome::Waiting;
    }

    fn observe_heading(&mut self, heading: f64) {
        self.each(|model| model.observe_heading(heading));
    }

    fn current(&self) -> Option<&Current> {
        self.present().current()
    }

    fn output_through_water(&self, y: &mut [f64]) {
        self.present().output_through_water(y);
    }

    fn observe(&mut self, y: &[f64]) {
        self.events.clear();
        self.shadow_test.begin();
        let trusted = self.screen(y);
        if self.apart {
            self.unguarded.observe(y);
        }
        self.learner.freeze(self.frozen || self.is_held());
        if trusted && self.apart && self.unguarded.is_sound() {
            self.join();
        } else {
            self.learner.observe(&self.measured);
        }
        self.reference.observe(&self.measured);
        self.outcome = self.learner.outcome();
        self.shadow_test.push_measurement(y, &self.measured);
        if self.shadow_test.is_due() {
            self.test();
        }
        self.estimate();
        self.sample += 1;
    }

    fn advance(&mut self, c: &[f64]) {
        self.shadow_test.push_command(c);
        self.each(|model| model.advance(c));
    }

    fn output(&self, y: &mut [f64]) {
        self.present().output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        snapshot_len(self.learner.as_ref())
    }

    fn snapshot(&self, into: &mut [f64]) {
        let models = [self.active(), Expert::Reference, Expert::Unguarded];
        let models = models.map(|expert| self.expert(expert) as &dyn Predictor);
        write_snapshot(models, self.limits(), self.is_held(), into);
    }

    /// The learner takes state and weights of the snapshot's active model and is selected.
    fn restore(&mut self, from: &[f64]) {
        self.separate();
        let len = self.learner.snapshot_len();
        let models = [&mut self.learner, &mut self.reference, &mut self.unguarded];
        for (model, from) in models.into_iter().zip(from.chunks_exact(len)) {
            model.restore(from);
        }
        let (limits, held) = read_limits(from, len);
        self.held = usize::from(held);
        self.shadow_test.reset();
        for (account, limit) in self.accounts.iter_mut().zip(limits) {
            account.restore_limit(limit);
        }
        self.own.reset();
        self.estimate();
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(GuardFork {
            metric: self.metric.clone(),
            limits: self.limits(),
            held: self.is_held(),
            model: self.expert(self.active()).fork(),
            reference: self.reference.fork(),
            unguarded: self.expert(Expert::Unguarded).fork(),
            apart: self.apart || self.active() == Expert::Reference,
        })
    }
}

impl Learning for Guard {
    /// The outcome of the learner, or a rollback of its weights.
    fn outcome(&self) -> Outcome {
        self.outcome
    }

    // Also the weights are those of the learner, even if the reference model is active.
    delegate!(learner: innovations weights health);

    fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
        self.learner.freeze(frozen || self.is_held());
        self.unguarded.freeze(frozen);
    }

    fn restart(&mut self) {
        self.learner.restart();
        if self.apart {
            self.unguarded.restart();
        }
    }

    fn scale_noise(&mut self, factor: f64) {
        self.each(|model| model.scale_noise(factor));
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
            Expert::Reference => &mut self.reference,
            Expert::Unguarded if self.apart => &mut self.unguarded,
            Expert::Adapted | Expert::Unguarded => &mut self.learner,
        };
        expert.deviations(commands, horizons, work, deviations);
    }
}

impl SaveState for Guard {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.learner.visit_state(memory);
        // The length is constant: a copy of the learner takes the place of an unguarded one that is not run.
        let unguarded =
            if self.apart || memory.is_loading() { &mut self.unguarded } else { &mut self.learner };
        unguarded.visit_state(memory);
        self.reference.visit_state(memory);
        memory.flag(&mut self.apart);
        memory.count(&mut self.agreeing, MOST_COUNTED);
        memory.count(&mut self.held, MOST_COUNTED);
        memory.flag(&mut self.frozen);
        let mut announced = self.announced.index();
        memory.count(&mut announced, Expert::ALL.len() - 1);
        self.announced = Expert::ALL[announced];
        self.budget.visit_state(memory);
        self.evidence.visit_state(memory);
        self.sensors.iter_mut().for_each(|sensor| sensor.visit_state(memory));
        self.shadow_test.visit_state(memory);
        self.accounts.iter_mut().for_each(|account| account.visit_state(memory));
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

    /// The unguarded learner does not count: one that is not sound is replaced at the next test.
    fn is_sound(&self) -> bool {
        self.learner.is_sound()
            && self.reference.is_sound()
            && self.sensors.iter().all(Sensor::is_sound)
            && self.accounts.iter().all(Account::is_sound)
            && self.own.value.is_finite()
            && self.budget.is_sound(&self.options)
    }
}

impl Rehearsing for Guard {
    delegate!(learner: rehearsal);

    fn store_window(&mut self, outputs: &[f64], commands: &[f64]) {
        self.learner.store_window(outputs, commands);
        self.unguarded.store_window(outputs, commands);
    }
}
