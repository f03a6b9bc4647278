//! The guard: an adapter around another one, with bounds on its errors relative to two companions.
//!
//! Three models follow the run: the learner (*adapted*), the delivered model with a state filter and constant weights
//! (*reference*), and the learner as it would be without a guard (*unguarded*), which receives all measurements. The other two
//! receive those that pass fault detection (`sensor`). Learner and unguarded learner are one session until they receive
//! something different. Every [`stride`](GuardOptions::stride) samples a shadow test (`shadow_test`) rolls out the models of
//! a horizon `H` ago under the recorded commands. The errors are
//!
//! ```text
//! e = mean over outputs and the last stride of steps of |predicted - measured| / (half the design range)
//! ```
//!
//! **Theorem.** With the weights `b^age`, `b = exp(-stride / window)`, over all tests until now,
//!
//! ```text
//! sum b^age (1 - q) e_answer <= factor sum b^age (1 - q) e_unguarded + floors floor / (1 - b)
//! floor = mean over outputs of (standard deviation of the noise) / (half the design range)
//! ```
//!
//! for any measurements, commands and weights; `q` is 1 for an answer that was given while a measurement was held back, and 0
//! otherwise. Against the used measurements, the prediction that is limited by the reference model alone has the same bound
//! relative to the reference model, without `q`. *Proof*: `docs/guard-theory.md`. The errors are those of the answers at the tests;
//! answers between two tests have the limits of the test before.
//!
//! A balance has the costs of the learner by itself. In deficit the reference model predicts; a learner that is overdrawn by
//! the whole constant starts again from the weights of the reference model.

mod account;
mod adapter;
mod bounded;
mod event;
mod hold;
mod options;
mod screen;
mod sensor;
mod shadow_test;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::{Adapter, Health, Outcome, Rejection};
use account::{Account, Balance};
use bounded::Metric;
use hold::{Budget, Evidence};
use sensor::Sensor;
use shadow_test::{Origin, ShadowTest};

pub use event::{Action, Cause, Event, Expert};
pub use options::GuardOptions;

/// Reasons why a guard cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum GuardError {
    #[error(
        "the guard needs positive times, a stride that divides its horizon, a horizon up to its window and up to 10000 samples, and a factor of at least 1"
    )]
    Settings,
    #[error("the guard needs a finite design range of each output, and the noise of each output")]
    Ranges,
    /// The snapshots differ in length, so that the models are not the same.
    #[error(
        "the guard needs the reference model and the unguarded learner in the same form as the adapted model"
    )]
    Models,
}

/// A guarded adapter (integrity monitoring of an online learner); see the [module](self).
pub struct Guard {
    learner: Box<dyn Adapter>,
    /// The learner without a guard; not run while it would equal the learner.
    unguarded: Box<dyn Adapter>,
    reference: Box<dyn Adapter>,
    /// Whether the unguarded learner differs from the learner.
    apart: bool,
    /// Consecutive tests in which both had the same predictions up to the noise floor.
    agreeing: usize,
    /// Samples since a hold began; 0 without one.
    held: usize,
    budget: Budget,
    evidence: Evidence,
    /// Whether the user has frozen the learner.
    frozen: bool,
    options: GuardOptions,
    sensors: Vec<Sensor>,
    floor: f64,
    metric: Metric,
    shadow_test: ShadowTest,
    /// Accounts of the answers against the reference model and the unguarded learner.
    accounts: [Account; 2],
    /// Balance of the learner, as if all answers had been its predictions.
    own: Balance,
    /// The active model at the last test.
    announced: Expert,
    events: Vec<Event>,
    outcome: Outcome,
    /// Samples observed.
    sample: u64,
    measured: Vec<f64>,
    /// Estimate of the learner after the last measurement, and its prediction of the next one.
    estimated: Vec<f64>,
    expected: Vec<f64>,
    buffer: Vec<f64>,
}

impl core::fmt::Debug for Guard {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { options, accounts, own, sample, .. } = self;
        let mut part = f.debug_struct("Guard");
        part.field("options", options).field("sample", sample);
        part.field("accounts", accounts).field("own", own).finish_non_exhaustive()
    }
}

impl Guard {
    /// Guards a learner. `unguarded` is an adapter of the same model, options and state, `reference` one of the same model
    /// with constant weights, `ranges` the design ranges `(low, high)` of the outputs, and `noise` the standard deviation of
    /// each output's noise.
    ///
    /// # Errors
    /// If options, ranges or models do not fit together.
    pub fn new(
        mut learner: Box<dyn Adapter>,
        mut unguarded: Box<dyn Adapter>,
        reference: Box<dyn Adapter>,
        ranges: &[(f64, f64)],
        noise: &[f64],
        options: GuardOptions,
    ) -> Result<Self, GuardError> {
        let n = learner.outputs();
        if !options.is_sound() {
            return Err(GuardError::Settings);
        }
        let sound = |&(low, high): &(f64, f64)| low.is_finite() && high.is_finite() && low < high;
        let positive = |noise: &f64| *noise > 0.0 && noise.is_finite();
        if ranges.len() != n || noise.len() != n || !ranges.iter().all(sound) || !noise.iter().all(positive) {
            return Err(GuardError::Ranges);
        }
        let len = learner.snapshot_len();
        let memory = learner.memory_len();
        let fits = |model: &dyn Adapter| {
            model.snapshot_len() == len && model.weights().len() == learner.weights().len()
        };
        if !fits(reference.as_ref()) || !fits(unguarded.as_ref()) || unguarded.memory_len() != memory {
            return Err(GuardError::Models);
        }
        let scale: Vec<f64> = ranges.iter().map(|(low, high)| 0.5 * (high - low)).collect();
        let floor = noise.iter().zip(&scale).map(|(noise, scale)| noise / scale).sum::<f64>() / n as f64;
        let balance = Balance::new(&options, floor);
        let metric = Metric { horizon: options.horizon, stride: options.stride, scale: scale.into() };
        Ok(Self {
            shadow_test: ShadowTest::new(learner.as_ref(), metric.clone(), options.factor),
            accounts: [Account::new(&options, balance), Account::new(&options, balance)],
            own: balance,
            floor,
            metric,
            sensors: noise.iter().map(|&noise| Sensor::new(noise)).collect(),
            announced: Expert::Adapted,
            events: Vec::with_capacity(2 * n + 3),
            outcome: Outcome::Waiting,
            sample: 0,
            measured: vec![f64::NAN; n],
            estimated: vec![f64::NAN; n],
            expected: vec![f64::NAN; n],
            buffer: vec![0.0; len.max(memory)],
            apart: false,
            agreeing: 0,
            held: 0,
            budget: Budget::new(&options),
            evidence: Evidence::default(),
            frozen: false,
            learner,
            unguarded,
            reference,
            options,
        })
    }

    /// Events of the last sample.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The active model, which predicts within the limits. While a measurement is held back, or the second limit is not 0,
    /// it is the adapted model if that fulfils the guarantee by itself, and the reference model otherwise.
    pub fn active(&self) -> Expert {
        if self.held == 0 && self.accounts[1].limit() == 0.0 { Expert::Unguarded } else { self.guarded() }
    }

    /// The better one of the adapted model and the reference model.
    fn guarded(&self) -> Expert {
        if self.own.value >= 0.0 { Expert::Adapted } else { Expert::Reference }
    }

    /// The weights of the active model, in the layout of [`Learning::weights`](crate::adapt::Learning::weights).
    pub fn active_weights(&self) -> &[f64] {
        self.expert(self.active()).weights()
    }

    /// The largest permitted distances of a prediction from that of the reference model, and of the result from that of the
    /// unguarded learner, as means over the outputs in half design ranges. The second limit does not apply while a
    /// measurement is held back.
    pub fn limits(&self) -> [f64; 2] {
        self.accounts.each_ref().map(Account::limit)
    }

    /// Balances of the answers against the reference model, of the adapted model as if all answers had been its predictions,
    /// and of the answers against the unguarded learner; see [`GuardOptions::floors`].
    pub fn balances(&self) -> [f64; 3] {
        let [reference, unguarded] = self.accounts.each_ref().map(Account::balance);
        [reference, self.own.value, unguarded]
    }

    /// Whether a measurement is held back, or was until it has agreed with the learner often enough.
    pub fn is_held(&self) -> bool {
        self.held > 0
    }

    /// The measurements that were used at the last sample; NaN for rejected and missing ones.
    pub fn used(&self) -> &[f64] {
        &self.measured
    }

    /// The adapted model.
    pub fn learner(&self) -> &dyn Adapter {
        self.learner.as_ref()
    }

    /// The adapted model as it would be without a guard; the same session as the [learner](Self::learner) while both are
    /// equal. If its memory is not sound, the learner takes its place at the next test.
    pub fn unguarded(&self) -> &dyn Adapter {
        self.expert(Expert::Unguarded)
    }

    fn expert(&self, expert: Expert) -> &dyn Adapter {
        match expert {
            Expert::Reference => self.reference.as_ref(),
            Expert::Unguarded if self.apart => self.unguarded.as_ref(),
            Expert::Adapted | Expert::Unguarded => self.learner.as_ref(),
        }
    }

    /// The model of the estimate: the unguarded learner unless a measurement is held back.
    fn present(&self) -> &dyn Adapter {
        self.expert(if self.is_held() { self.active() } else { Expert::Unguarded })
    }

    fn record_event(&mut self, action: Action) {
        if self.events.len() < self.events.capacity() {
            self.events.push(Event { sample: self.sample, action });
        }
    }

    /// Stores the estimate from which the prediction of the motion begins.
    fn estimate(&mut self) {
        self.learner.output(&mut self.estimated);
    }

    /// Begins to run the unguarded learner, before the learner receives something else.
    fn separate(&mut self) {
        if !self.apart {
            let len = self.learner.memory_len();
            self.learner.save(&mut self.buffer[..len]);
            self.unguarded.load(&self.buffer[..len]);
            self.unguarded.freeze(self.frozen);
            (self.apart, self.agreeing) = (true, 0);
        }
    }

    /// The unguarded learner becomes the learner.
    fn join(&mut self) {
        core::mem::swap(&mut self.learner, &mut self.unguarded);
        self.apart = false;
    }

    /// The learner starts again from the weights of the reference model.
    fn start_again(&mut self, action: Action) {
        self.separate();
        let len = self.reference.snapshot_len();
        self.reference.snapshot(&mut self.buffer[..len]);
        self.learner.restore(&self.buffer[..len]);
        self.learner.restart();
        self.own.reset();
        self.outcome = Outcome::RolledBack;
        self.record_event(action);
    }

    /// Resets a memory that is not sound.
    fn check_health(&mut self) {
        let Health { least_variance, min_s_over_r } = self.learner.health();
        let lost = self.outcome == Outcome::Rejected(Rejection::NotFinite);
        if self.learner.weights().iter().any(|w| !w.is_finite()) {
            self.start_again(Action::Restarted);
        } else if lost || least_variance < 0.0 || min_s_over_r < 1.0 - 1e-6 {
            self.separate();
            self.learner.restart();
            self.record_event(Action::Restarted);
        }
        // It would stay so for ever; the learner takes its place.
        self.apart &= self.unguarded.is_sound();
    }

    /// Judges the answers of a horizon ago, and opens the accounts for the next ones.
    fn judge(&mut self) {
        let tested = self.shadow_test.test(self.accounts.each_ref().map(Account::oldest));
        let tests = self.options.window / self.options.stride;
        if let Some(tested) = tested {
            for (account, cost) in self.accounts.iter_mut().zip(tested.costs) {
                account.settle(cost);
            }
            let errors @ [adapted, reference, _] = tested.errors;
            if !adapted.is_nan() {
                self.own.settle(adapted - self.options.factor * reference);
            }
            if self.own.is_overdrawn() {
                self.start_again(Action::RolledBack { errors });
            }
            let agrees = self.apart && !self.is_held() && tested.apart <= self.floor;
            self.agreeing = if agrees { self.agreeing + 1 } else { 0 };
            if self.agreeing >= tests {
                self.join();
            }
            if !self.is_held() {
                for (sensor, square) in self.sensors.iter_mut().zip(&self.shadow_test.squares) {
                    if !square.is_nan() {
                        let error = num_traits::Float::sqrt(*square);
                        sensor.horizon_error.add(error, self.options.gate, tests);
                    }
                }
            }
        }
        let [to_reference, to_unguarded] = &mut self.accounts;
        to_reference.open(false);
        to_unguarded.open(self.held > 0);
        let to = self.active();
        if let Some(tested) = tested.filter(|_| to != self.announced) {
            self.announced = to;
            self.record_event(Action::Switched { to, errors: tested.errors });
        }
    }

    /// Judges earlier answers and stores the present origin, at a test.
    fn test(&mut self) {
        self.check_health();
        self.judge();
        let adapted = self.guarded() == Expert::Adapted;
        let origin = Origin { adapted, apart: self.apart, held: self.is_held() };
        let Self { learner, unguarded, reference, .. } = self;
        let unguarded = if self.apart { unguarded } else { &*learner };
        self.shadow_test.store([learner.as_ref(), reference.as_ref(), unguarded.as_ref()], origin);
    }
}
