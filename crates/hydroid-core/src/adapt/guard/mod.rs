//! The guard: an adapter around another one, with a bound on its errors relative to a reference model.
//!
//! Two models follow the run: the learner (*adapted*), and the delivered model with a state filter and constant weights
//! (*reference*). Measurements pass fault detection first (`sensor`). Every [`stride`](GuardOptions::stride) samples a
//! shadow test (`shadow_test`) rolls out the models of a horizon `H` ago under the recorded commands. The errors are
//!
//! ```text
//! e = mean over outputs and the last stride of steps of |predicted - measured| / (half the design range)
//! ```
//!
//! **Theorem.** With the weights `b^age`, `b = exp(-stride / window)`, over all tests until now,
//!
//! ```text
//! sum b^age e_answer <= factor sum b^age e_reference + floors floor / (1 - b)
//! floor = mean over outputs of (standard deviation of the noise) / (half the design range)
//! ```
//!
//! for any measurements, commands and weights of the learner. *Proof*: `account`. The errors are those against the used
//! measurements of the answers at the tests; answers between two tests have the limit of the test before.
//!
//! A second account has the costs of the learner by itself. In deficit the reference model predicts; a learner that is
//! overdrawn by the whole constant starts again from the weights of the reference model.

mod account;
mod adapter;
mod bounded;
mod event;
mod options;
mod sensor;
mod shadow_test;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::{Adapter, Health, Outcome, Rejection};
use account::{Account, Balance};
use bounded::Metric;
use sensor::{Sensor, Verdict};
use shadow_test::ShadowTest;

pub use event::{Action, Event, Expert};
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
    #[error("the guard needs the reference model in the same form as the adapted one")]
    Models,
}

/// A guarded adapter (integrity monitoring of an online learner); see the [module](self).
pub struct Guard {
    learner: Box<dyn Adapter>,
    reference: Box<dyn Adapter>,
    options: GuardOptions,
    sensors: Vec<Sensor>,
    metric: Metric,
    shadow_test: ShadowTest,
    account: Account,
    /// Balance of the learner, as if all answers had been its predictions.
    own: Balance,
    events: Vec<Event>,
    outcome: Outcome,
    /// Samples observed.
    sample: u64,
    measured: Vec<f64>,
    /// Estimate of the active model after the last measurement, and its prediction of the next one.
    estimated: Vec<f64>,
    expected: Vec<f64>,
    buffer: Vec<f64>,
}

impl core::fmt::Debug for Guard {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { options, account, own, sample, .. } = self;
        let mut part = f.debug_struct("Guard");
        part.field("options", options).field("sample", sample);
        part.field("account", account).field("own", own).finish_non_exhaustive()
    }
}

impl Guard {
    /// Guards a learner. `reference` is an adapter of the same model with constant weights, `ranges` the design ranges
    /// `(low, high)` of the outputs, and `noise` the standard deviation of each output's noise.
    ///
    /// # Errors
    /// If options, ranges or models do not fit together.
    pub fn new(
        learner: Box<dyn Adapter>,
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
        if reference.snapshot_len() != len || reference.weights().len() != learner.weights().len() {
            return Err(GuardError::Models);
        }
        let scale: Vec<f64> = ranges.iter().map(|(low, high)| 0.5 * (high - low)).collect();
        let floor = noise.iter().zip(&scale).map(|(noise, scale)| noise / scale).sum::<f64>() / n as f64;
        let balance = Balance::new(&options, floor);
        let metric = Metric { horizon: options.horizon, stride: options.stride, scale: scale.into() };
        Ok(Self {
            shadow_test: ShadowTest::new(learner.as_ref(), metric.clone(), options.factor),
            account: Account::new(&options, balance),
            own: balance,
            metric,
            sensors: noise.iter().map(|&noise| Sensor::new(noise)).collect(),
            events: Vec::with_capacity(2 * n + 3),
            outcome: Outcome::Waiting,
            sample: 0,
            measured: vec![f64::NAN; n],
            estimated: vec![f64::NAN; n],
            expected: vec![f64::NAN; n],
            buffer: vec![0.0; len],
            learner,
            reference,
            options,
        })
    }

    /// Events of the last sample.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The active model, which predicts within the limit: the adapted one while it fulfils the guarantee by itself.
    pub fn active(&self) -> Expert {
        if self.own.value >= 0.0 { Expert::Adapted } else { Expert::Reference }
    }

    /// The weights of the active model, in the layout of [`Learning::weights`](crate::adapt::Learning::weights).
    pub fn active_weights(&self) -> &[f64] {
        self.expert(self.active()).weights()
    }

    /// The largest permitted distance of a prediction from that of the reference model, as a mean over the outputs in half
    /// design ranges.
    pub fn limit(&self) -> f64 {
        self.account.limit()
    }

    /// Balances of the answers, and of the adapted model if all answers had been its predictions; see
    /// [`GuardOptions::floors`].
    pub fn balances(&self) -> [f64; 2] {
        [self.account.balance(), self.own.value]
    }

    /// The measurements that were used at the last sample; NaN for rejected and missing ones.
    pub fn used(&self) -> &[f64] {
        &self.measured
    }

    /// The adapted model.
    pub fn learner(&self) -> &dyn Adapter {
        self.learner.as_ref()
    }

    fn expert(&self, expert: Expert) -> &dyn Adapter {
        match expert {
            Expert::Adapted => self.learner.as_ref(),
            Expert::Reference => self.reference.as_ref(),
        }
    }

    fn record_event(&mut self, action: Action) {
        if self.events.len() < self.events.capacity() {
            self.events.push(Event { sample: self.sample, action });
        }
    }

    /// Stores the estimate of the active model, from which its prediction of the motion begins.
    fn estimate(&mut self) {
        let mut estimated = core::mem::take(&mut self.estimated);
        self.expert(self.active()).output(&mut estimated);
        self.estimated = estimated;
    }

    /// Screens a measurement into `measured`.
    fn screen(&mut self, y: &[f64]) {
        self.measured.copy_from_slice(y);
        if !self.options.sensors {
            return;
        }
        let mut expected = core::mem::take(&mut self.expected);
        self.expert(self.active()).output(&mut expected);
        self.expected = expected;
        for (output, &value) in y.iter().enumerate() {
            let sensor = &mut self.sensors[output];
            let missing = sensor.missing;
            let motion = self.expected[output] - self.estimated[output];
            let verdict = sensor.judge(value, motion, &self.options);
            let corrected = value - sensor.offset;
            let (used, action) = match verdict {
                Verdict::Sound if missing >= self.options.repeats => {
                    (corrected, Some(Action::Back { output, missing }))
                }
                Verdict::Sound => (corrected, None),
                Verdict::Missing => (f64::NAN, None),
                Verdict::Spike { deviations } => (f64::NAN, Some(Action::Spike { output, deviations })),
                Verdict::Stuck { repeats } => {
                    (f64::NAN, (missing == 0).then_some(Action::Stuck { output, repeats }))
                }
                Verdict::Offset { offset } => (corrected, Some(Action::Offset { output, offset })),
            };
            self.measured[output] = used;
            if let Some(action) = action {
                self.record_event(action);
            }
        }
    }

    /// The learner starts again from the weights of the reference model.
    fn start_again(&mut self, action: Action) {
        self.reference.snapshot(&mut self.buffer);
        self.learner.restore(&self.buffer);
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
            self.learner.restart();
            self.record_event(Action::Restarted);
        }
    }

    /// Judges the answers of a horizon ago, and opens the account for the next ones.
    fn judge(&mut self) {
        if let Some(tested) = self.shadow_test.test(self.account.oldest()) {
            self.account.settle(tested.cost);
            let before = self.active();
            let errors @ [adapted, reference] = tested.errors;
            if !adapted.is_nan() {
                self.own.settle(adapted - self.options.factor * reference);
            }
            if self.own.is_overdrawn() {
                self.start_again(Action::RolledBack { errors });
            }
            let to = self.active();
            if to != before {
                self.record_event(Action::Switched { to, errors });
            }
        }
        self.account.open();
    }
}
