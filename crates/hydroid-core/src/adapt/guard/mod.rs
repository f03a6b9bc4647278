//! The guard: an adapter around another one, with a bound on its errors relative to a reference model.
//!
//! Three models follow the run: the learner (*adapted*), the last good snapshot of its weights (*snapshot*), and the
//! delivered model with a state filter and constant weights (*reference*). Measurements pass fault detection first
//! (`sensor`). Every [`stride`](GuardOptions::stride) samples a shadow test (`shadow_test`) rolls out the models of a
//! horizon `H` ago, and the learner of that time with its present weights, under the recorded commands. The errors are
//!
//! ```text
//! e_k = mean over outputs and the last stride of steps of |predicted - measured| / (half the design range)
//! ```
//!
//! They select the model that predicts (`model_selector`). A learner that has lost too often takes the weights of a
//! better model.
//!
//! **Guarantee.** Over any window of `N` tests, under the assumptions of the guide to the guard,
//!
//! ```text
//! sum e_guarded <= factor sum e_reference + N floor       floor = mean over outputs of noise / (half the design range)
//! ```
//!
//! A bound (`deviation_bound`) limits the deviation of an answer from the prediction of the reference model, and so its
//! cost for any measurement. Larger deviations require recent tests in which the reference model must be wrong. An
//! account over all open windows limits the cost so far plus the bounds of all pending predictions, so that the
//! reference model, which adds no cost, can end all windows within the guarantee at any time. In deficit, answers
//! within the bound are those of the reference model.

mod adapter;
mod deviation_bound;
mod event;
mod model_selector;
mod options;
mod sensor;
mod shadow_test;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::{Adapter, Health, Outcome, Rejection};
use deviation_bound::DeviationBound;
use model_selector::ModelSelector;
use sensor::{Sensor, Verdict};
use shadow_test::ShadowTest;

pub use event::{Action, Cause, Event, Expert};
pub use options::GuardOptions;

/// Distances from the design range, relative to its width, at which learning stops and resumes.
const OUTSIDE: f64 = 0.5;
const INSIDE: f64 = 0.4;

/// Reasons why a guard cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuardError {
    /// An option is out of range.
    Settings,
    /// A channel lacks a finite range or a positive noise.
    Ranges,
    /// The snapshots differ in length, so that the models are not the same.
    Models,
}

impl core::fmt::Display for GuardError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Settings => write!(
                f,
                "the guard needs positive times, a stride up to its horizon, a horizon up to its window, and a factor of at least 1"
            ),
            Self::Ranges => write!(
                f,
                "the guard needs a finite design range of each channel, and the noise of each output"
            ),
            Self::Models => {
                write!(f, "the guard needs the reference model in the same form as the adapted one")
            }
        }
    }
}

impl core::error::Error for GuardError {}

/// A guarded adapter (integrity monitoring of an online learner); see the [module](self). The guarantee assumes that
/// the measurements that pass fault detection are right, and that supported predictions have the assumed accuracy.
pub struct Guard {
    learner: Box<dyn Adapter>,
    snapshot: Box<dyn Adapter>,
    reference: Box<dyn Adapter>,
    options: GuardOptions,
    ranges: Vec<(f64, f64)>,
    sensors: Vec<Sensor>,
    bound: DeviationBound,
    shadow_test: ShadowTest,
    selector: ModelSelector,
    events: Vec<Event>,
    outcome: Outcome,
    /// Samples observed; samples until learning resumes and until the next snapshot; length of the next pause.
    sample: u64,
    pause: usize,
    until_snapshot: usize,
    next_pause: usize,
    /// Whether learning is stopped outside the design range, and by [`Adapter::freeze`].
    outside: bool,
    stopped: bool,
    measured: Vec<f64>,
    reference_input: Vec<f64>,
    command: Vec<f64>,
    motion: Vec<[f64; 2]>,
    expected: [Vec<f64>; 3],
    buffers: [Vec<f64>; 2],
}

impl core::fmt::Debug for Guard {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { options, selector, sample, .. } = self;
        let part = f.debug_struct("Guard").field("options", options).field("sample", sample).finish();
        part.and_then(|()| write!(f, " {:?}", selector.active))
    }
}

/// The value of a stuck sensor if it is nearer to the expectation of the learner than that of the reference model, else
/// NaN. Without measurements the reference model drifts within seconds in unknown conditions.
fn nearer(value: f64, learner: f64, reference: f64) -> f64 {
    if (value - learner).abs() < (reference - learner).abs() { value } else { f64::NAN }
}

impl Guard {
    /// Guards a learner. `reference` and `snapshot` are adapters of the same model with constant weights, `ranges` the
    /// design ranges `(low, high)` of outputs, then inputs, and `noise` the standard deviation of each output's noise.
    ///
    /// # Errors
    /// If options, ranges or models do not fit together.
    pub fn new(
        learner: Box<dyn Adapter>,
        [reference, snapshot]: [Box<dyn Adapter>; 2],
        ranges: &[(f64, f64)],
        noise: &[f64],
        options: GuardOptions,
    ) -> Result<Self, GuardError> {
        let (n, m) = (learner.outputs(), learner.inputs());
        if !options.is_sound() {
            return Err(GuardError::Settings);
        }
        let sound = |&(low, high): &(f64, f64)| low.is_finite() && high.is_finite() && low < high;
        let positive = |noise: &f64| *noise > 0.0 && noise.is_finite();
        if ranges.len() != n + m
            || noise.len() != n
            || !ranges[..n].iter().all(sound)
            || !noise.iter().all(positive)
        {
            return Err(GuardError::Ranges);
        }
        let len = learner.snapshot_len();
        if [&reference, &snapshot]
            .iter()
            .any(|other| other.snapshot_len() != len || other.weights().len() != learner.weights().len())
        {
            return Err(GuardError::Models);
        }
        let scale: Vec<f64> = ranges[..n].iter().map(|(low, high)| 0.5 * (high - low)).collect();
        let floor = noise.iter().zip(&scale).map(|(noise, scale)| noise / scale).sum::<f64>() / n as f64;
        let bound = DeviationBound { horizon: options.horizon, stride: options.stride, scale: scale.into() };
        Ok(Self {
            shadow_test: ShadowTest::new(learner.as_ref(), bound.clone(), options.factor),
            bound,
            selector: ModelSelector::new(&options, floor),
            ranges: ranges.to_vec(),
            sensors: noise.iter().map(|&noise| Sensor::new(noise)).collect(),
            events: Vec::with_capacity(4 * n + 8),
            outcome: Outcome::Waiting,
            sample: 0,
            pause: 0,
            until_snapshot: options.snapshot_interval,
            next_pause: options.record,
            outside: false,
            stopped: false,
            measured: vec![f64::NAN; n],
            reference_input: vec![f64::NAN; n],
            command: vec![f64::NAN; m],
            motion: vec![[f64::NAN; 2]; n],
            expected: [vec![f64::NAN; n], vec![f64::NAN; n], vec![f64::NAN; n]],
            buffers: [vec![0.0; len], vec![0.0; len]],
            learner,
            snapshot,
            reference,
            options,
        })
    }

    /// Events of the last sample.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The active model, which predicts.
    pub fn active(&self) -> Expert {
        self.selector.active
    }

    /// The weights of the active model, in the layout of [`Learning::weights`](crate::adapt::Learning::weights).
    pub fn active_weights(&self) -> &[f64] {
        self.expert(self.selector.active).weights()
    }

    /// Exponential means of the errors of each model, in the order of [`Expert::ALL`]; NaN before the first test.
    pub fn record(&self) -> [f64; 3] {
        self.selector.record
    }

    /// The adapted model.
    pub fn learner(&self) -> &dyn Adapter {
        self.learner.as_ref()
    }

    fn expert(&self, expert: Expert) -> &dyn Adapter {
        match expert {
            Expert::Adapted => self.learner.as_ref(),
            Expert::Snapshot => self.snapshot.as_ref(),
            Expert::Reference => self.reference.as_ref(),
        }
    }

    fn record_event(&mut self, action: Action) {
        if self.events.len() < self.events.capacity() {
            self.events.push(Event { sample: self.sample, action });
        }
    }

    /// Screens a measurement into `measured`. Returns the factor of its noise variance.
    fn screen(&mut self, y: &[f64]) -> f64 {
        let experts = [&self.learner, &self.snapshot, &self.reference];
        for (into, expert) in self.expected.iter_mut().zip(experts) {
            expert.output(into);
        }
        let mut most = 1.0;
        for (i, &value) in y.iter().enumerate() {
            let sensor = &mut self.sensors[i];
            let missing = sensor.missing;
            let [learner, snapshot, reference] = [0, 1, 2].map(|expert: usize| self.expected[expert][i]);
            let expected = [learner, snapshot, reference, self.motion[i][0]];
            let verdict = sensor.judge(value, expected, &self.options);
            let corrected = value - sensor.offset;
            let output = i;
            let (used, action) = match verdict {
                Verdict::Sound if missing >= self.options.repeats => {
                    (corrected, Some(Action::Back { output, missing }))
                }
                Verdict::Sound => (corrected, None),
                Verdict::Missing => (f64::NAN, None),
                Verdict::Inflate { deviations, factor } => {
                    most = f64::max(most, factor);
                    (corrected, Some(Action::Inflated { output, deviations, factor }))
                }
                Verdict::Spike { deviations } => (f64::NAN, Some(Action::Spike { output, deviations })),
                Verdict::Stuck { repeats } => {
                    let action = (missing == 0).then_some(Action::Stuck { output, repeats });
                    (f64::NAN, action)
                }
                Verdict::Offset { offset } => (corrected, Some(Action::Offset { output, offset })),
                Verdict::Believed { deviations } => {
                    (corrected, Some(Action::Believed { output, deviations }))
                }
            };
            self.measured[i] = used;
            self.reference_input[i] = if let Verdict::Stuck { .. } = verdict {
                nearer(corrected, learner, reference)
            } else {
                used
            };
            if let Some(action) = action {
                self.record_event(action);
            }
        }
        most
    }

    fn check_range(&mut self) {
        let values = self.measured.iter().chain(&self.command);
        let distance = |(x, (low, high)): (&f64, &(f64, f64))| (low - x).max(x - high) / (high - low);
        let (mut channel, mut most) = (0, f64::NEG_INFINITY);
        for (i, distance) in values.zip(&self.ranges).map(distance).enumerate() {
            if distance > most && distance.is_finite() {
                (channel, most) = (i, distance);
            }
        }
        if !self.outside && most > OUTSIDE {
            self.outside = true;
            self.record_event(Action::Outside { channel, distance: most });
        } else if self.outside && most < INSIDE {
            self.outside = false;
            self.record_event(Action::Inside);
        }
    }

    fn update_freeze(&mut self) {
        self.pause = self.pause.saturating_sub(1);
        // Without measurements of an output, the effect of learning on it is unknown.
        let blind = self.sensors.iter().any(|sensor| sensor.missing > self.options.patience);
        self.learner.freeze(self.stopped || self.outside || blind || self.pause > 0);
    }

    fn roll_back(&mut self, to: Expert) {
        let [learner, snapshot, reference] = self.selector.record;
        let better = if to == Expert::Snapshot { snapshot } else { reference };
        let [buffer, _] = &mut self.buffers;
        match to {
            Expert::Snapshot => self.snapshot.snapshot(buffer),
            _ => self.reference.snapshot(buffer),
        }
        self.learner.restore(buffer);
        self.selector.invalidate(Expert::Adapted);
        self.pause = self.next_pause;
        self.next_pause = (2 * self.next_pause).min(4 * self.options.window);
        self.outcome = Outcome::RolledBack;
        self.record_event(Action::RolledBack { to, errors: [learner, better] });
    }

    fn take_snapshot(&mut self) {
        self.until_snapshot = self.options.snapshot_interval;
        self.next_pause = (self.next_pause / 2).max(self.options.record);
        let [buffer, _] = &mut self.buffers;
        self.learner.snapshot(buffer);
        self.snapshot.restore(buffer);
        self.selector.invalidate(Expert::Snapshot);
        let [learner, snapshot, _] = &mut self.selector.record;
        *snapshot = *learner;
        let error = *learner;
        self.record_event(Action::SnapshotTaken { error });
    }

    fn judge(&mut self) {
        let Some(tested) = self.shadow_test.test([self.learner.as_ref(), self.snapshot.as_ref()]) else {
            return;
        };
        let before = self.selector.active;
        if let Some(cause) = self.selector.update(&tested) {
            let errors = [tested.horizon[before.index()], tested.horizon[Expert::Reference.index()]];
            self.record_event(Action::Switched { to: self.selector.active, cause, errors });
        }
        if let Some(to) = self.selector.rollback_target() {
            self.roll_back(to);
        }
        self.until_snapshot = self.until_snapshot.saturating_sub(self.options.stride);
        if self.until_snapshot == 0 && self.selector.should_snapshot() {
            self.take_snapshot();
        }
    }

    fn check_health(&mut self) {
        let lost = self.outcome == Outcome::Rejected(Rejection::NotFinite);
        let Health { least_variance, min_s_over_r } = self.learner.health();
        if lost || least_variance < 0.0 || min_s_over_r < 1.0 - 1e-6 {
            self.learner.restart();
            self.record_event(Action::Restarted);
        }
        if self.learner.weights().iter().any(|w| !w.is_finite()) {
            self.roll_back(Expert::Snapshot);
        }
    }

    /// Sets the state of a model from a snapshot; its weights stay.
    fn restore_state(expert: &mut dyn Adapter, from: &[f64], own: &mut [f64]) {
        expert.snapshot(own);
        let state = own.len() - expert.weights().len();
        own[..state].copy_from_slice(&from[..state]);
        expert.restore(own);
    }
}
