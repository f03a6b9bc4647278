//! The guard: a learner that is watched, and predictions that are never much worse than those of the model from shore.
//!
//! A [`Guard`] is an [`Adapter`] around another one, the learner. It walks two more along: the model from shore as it is,
//! its state filtered (*frozen*), and the learner as it was when it was last found good (*snapshot*). What is measured
//! goes through sensors first (`sensor`): what was not measured at all is not learned from. Every
//! [`stride`](GuardOptions::stride) samples a shadow test (`trial`) rolls out what the three would have predicted a horizon
//! `H` ago, and what the learner would with the weights that it has now, under the commands that came, and compares with
//! what was measured. By these errors
//!
//! ```text
//! e_k = mean over outputs and the last stride of steps of |predicted - measured| / (half the design range)
//! ```
//!
//! one of the three is chosen to predict (`choice`); a learner that is lost gets the weights of a better one back.
//!
//! **Guarantee.** Over any window of `N` tests, whatever the learner does,
//!
//! ```text
//! sum e_guarded <= factor sum e_frozen + N floor         floor = mean over outputs of noise / (half the design range)
//! ```
//!
//! By two means. An answer is not farther from the frozen model's than a bound (`bound`), so that it cannot cost more,
//! whatever will be measured; only where tests of late say that the frozen model must be the one that is off may it be farther. What
//! is within the bound is the frozen model's as long as anything is owed.
//! And an account over all windows that are not over yet says what bounds there may be: what has been used, with the bounds of
//! all predictions that are under way, never exceeds what the guarantee leaves, so that from any moment on the
//! frozen model, which adds nothing to it, ends all windows within the guarantee.

mod adapter;
mod bound;
mod choice;
mod event;
mod sensor;
mod settings;
mod trial;

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::{Adapter, Health, Outcome, Rejection};
use bound::Bound;
use choice::Choice;
use sensor::{Sensor, Verdict};
use trial::Trial;

pub use event::{Action, Cause, Event, Expert};
pub use settings::GuardOptions;

/// Distances from the design range, in its width, at which learning stops and at which it goes on.
const OUTSIDE: f64 = 0.5;
const INSIDE: f64 = 0.4;

/// Why a learner cannot be guarded so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuardError {
    /// The settings make no sense.
    Settings,
    /// There is not one finite range, or one positive noise, for each channel.
    Ranges,
    /// The models are not of one kind: their snapshots differ.
    Models,
}

impl core::fmt::Display for GuardError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Settings => write!(
                f,
                "the guard's times must be positive, its stride not longer than its horizon and that not longer than its window, its factor at least 1"
            ),
            Self::Ranges => write!(
                f,
                "the guard needs a finite design range of each channel, and the noise of each output"
            ),
            Self::Models => {
                write!(f, "the guard needs the frozen model in the same form as the one that learns")
            }
        }
    }
}

impl core::error::Error for GuardError {}

/// A learner under guard; see the [module](self).
pub struct Guard {
    learner: Box<dyn Adapter>,
    kept: Box<dyn Adapter>,
    frozen: Box<dyn Adapter>,
    settings: GuardOptions,
    ranges: Vec<(f64, f64)>,
    sensors: Vec<Sensor>,
    bound: Bound,
    trial: Trial,
    choice: Choice,
    events: Vec<Event>,
    outcome: Outcome,
    /// Samples observed, and those until learning goes on, until the next snapshot, and the time to rest the next time.
    sample: u64,
    rest: usize,
    keep: usize,
    next_rest: usize,
    /// Whether learning has stopped outside the design range, and whether who owns the guard stopped it.
    outside: bool,
    stopped: bool,
    /// What was measured, as it is used, and as the model from shore is told.
    measured: Vec<f64>,
    told: Vec<f64>,
    command: Vec<f64>,
    /// How the vessel moves, by what was measured of it: see [`bound`].
    motion: Vec<[f64; 2]>,
    expected: [Vec<f64>; 3],
    snapshot: [Vec<f64>; 2],
}

impl core::fmt::Debug for Guard {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { settings, choice, sample, .. } = self;
        let part = f.debug_struct("Guard").field("settings", settings).field("sample", sample).finish();
        part.and_then(|()| write!(f, " {:?}", choice.active))
    }
}

/// A value that a sensor is stuck at, where it is nearer to what the learner expects than what the model from shore expects by itself:
/// in water that this model does not know it goes astray within seconds if it is told nothing.
fn nearer(value: f64, learner: f64, frozen: f64) -> f64 {
    if (value - learner).abs() < (frozen - learner).abs() { value } else { f64::NAN }
}

impl Guard {
    /// Guards a learner. `frozen` and `kept` are two of the same model which do not learn (their weights are not to change by
    /// themselves); `ranges` are the design ranges `(low, high)` of outputs, then inputs, and `noise` the standard
    /// deviation of each output's noise.
    ///
    /// # Errors
    /// If these do not fit together.
    pub fn new(
        learner: Box<dyn Adapter>,
        [frozen, kept]: [Box<dyn Adapter>; 2],
        ranges: &[(f64, f64)],
        noise: &[f64],
        settings: GuardOptions,
    ) -> Result<Self, GuardError> {
        let (n, m) = (learner.outputs(), learner.inputs());
        if !settings.is_sound() {
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
        if [&frozen, &kept]
            .iter()
            .any(|other| other.snapshot_len() != len || other.weights().len() != learner.weights().len())
        {
            return Err(GuardError::Models);
        }
        let scale: Vec<f64> = ranges[..n].iter().map(|(low, high)| 0.5 * (high - low)).collect();
        let floor = noise.iter().zip(&scale).map(|(noise, scale)| noise / scale).sum::<f64>() / n as f64;
        let bound = Bound { horizon: settings.horizon, stride: settings.stride, scale: scale.into() };
        Ok(Self {
            trial: Trial::new(learner.as_ref(), bound.clone(), settings.factor),
            bound,
            choice: Choice::new(&settings, floor),
            ranges: ranges.to_vec(),
            sensors: noise.iter().map(|&noise| Sensor::new(noise)).collect(),
            events: Vec::with_capacity(4 * n + 8),
            outcome: Outcome::Waiting,
            sample: 0,
            rest: 0,
            keep: settings.keep,
            next_rest: settings.record,
            outside: false,
            stopped: false,
            measured: vec![f64::NAN; n],
            told: vec![f64::NAN; n],
            command: vec![f64::NAN; m],
            motion: vec![[f64::NAN; 2]; n],
            expected: [vec![f64::NAN; n], vec![f64::NAN; n], vec![f64::NAN; n]],
            snapshot: [vec![0.0; len], vec![0.0; len]],
            learner,
            kept,
            frozen,
            settings,
        })
    }

    /// What was done at the last sample.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The model that predicts.
    pub fn active(&self) -> Expert {
        self.choice.active
    }

    /// The weights of the model that predicts at this moment, in the layout of [`Adapter::weights`]: what a control law that
    /// inverts the model shall go by.
    pub fn active_weights(&self) -> &[f64] {
        self.expert(self.choice.active).weights()
    }

    /// Errors of late of each model, in the order of [`Expert::ALL`]; NaN before the first test.
    pub fn record(&self) -> [f64; 3] {
        self.choice.record
    }

    /// The learner.
    pub fn learner(&self) -> &dyn Adapter {
        self.learner.as_ref()
    }

    fn expert(&self, expert: Expert) -> &dyn Adapter {
        match expert {
            Expert::Learner => self.learner.as_ref(),
            Expert::Kept => self.kept.as_ref(),
            Expert::Frozen => self.frozen.as_ref(),
        }
    }

    fn note(&mut self, action: Action) {
        if self.events.len() < self.events.capacity() {
            self.events.push(Event { sample: self.sample, action });
        }
    }

    /// What is used of a measurement, into `measured`; gives the factor that its noise is to be taken with.
    fn screen(&mut self, y: &[f64]) -> f64 {
        let experts = [&self.learner, &self.kept, &self.frozen];
        for (into, expert) in self.expected.iter_mut().zip(experts) {
            expert.output(into);
        }
        let mut most = 1.0;
        for (i, &value) in y.iter().enumerate() {
            let sensor = &mut self.sensors[i];
            let missing = sensor.missing;
            let [learner, kept, frozen] = [0, 1, 2].map(|expert: usize| self.expected[expert][i]);
            let expected = [learner, kept, frozen, self.motion[i][0]];
            let verdict = sensor.judge(value, expected, &self.settings);
            let corrected = value - sensor.offset;
            let output = i;
            let (used, action) = match verdict {
                Verdict::Sound if missing >= self.settings.repeats => {
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
                    // Said once.
                    let action = (missing == 0).then_some(Action::Stuck { output, repeats });
                    (f64::NAN, action)
                }
                Verdict::Offset { offset } => (corrected, Some(Action::Offset { output, offset })),
                Verdict::Believed { deviations } => {
                    (corrected, Some(Action::Believed { output, deviations }))
                }
            };
            self.measured[i] = used;
            self.told[i] =
                if let Verdict::Stuck { .. } = verdict { nearer(corrected, learner, frozen) } else { used };
            if let Some(action) = action {
                self.note(action);
            }
        }
        most
    }

    /// Whether outputs and command are so far outside of the design range that nothing is to be learned there.
    fn watch_range(&mut self) {
        let values = self.measured.iter().chain(&self.command);
        let distance = |(x, (low, high)): (&f64, &(f64, f64))| (low - x).max(x - high) / (high - low);
        let (mut channel, mut most) = (0, f64::NEG_INFINITY);
        for (i, distance) in values.zip(&self.ranges).map(distance).enumerate() {
            // What is not known, or has no range, is not outside.
            if distance > most && distance.is_finite() {
                (channel, most) = (i, distance);
            }
        }
        if !self.outside && most > OUTSIDE {
            self.outside = true;
            self.note(Action::Outside { channel, distance: most });
        } else if self.outside && most < INSIDE {
            self.outside = false;
            self.note(Action::Inside);
        }
    }

    fn let_learn(&mut self) {
        self.rest = self.rest.saturating_sub(1);
        // What one output makes of the weights, nobody sees while another is not measured.
        let blind = self.sensors.iter().any(|sensor| sensor.missing > self.settings.patience);
        self.learner.freeze(self.stopped || self.outside || blind || self.rest > 0);
    }

    /// The learner's weights, and its state, become those of another model.
    fn roll_back(&mut self, to: Expert) {
        let [learner, kept, frozen] = self.choice.record;
        let better = if to == Expert::Kept { kept } else { frozen };
        let [snapshot, _] = &mut self.snapshot;
        match to {
            Expert::Kept => self.kept.snapshot(snapshot),
            _ => self.frozen.snapshot(snapshot),
        }
        self.learner.restore(snapshot);
        self.choice.forget(Expert::Learner);
        // What led astray once may do so again: each time it waits for longer.
        self.rest = self.next_rest;
        self.next_rest = (2 * self.next_rest).min(4 * self.settings.window);
        self.outcome = Outcome::RolledBack;
        self.note(Action::RolledBack { to, errors: [learner, better] });
    }

    /// Takes a snapshot of the learner's weights.
    fn take_snapshot(&mut self) {
        self.keep = self.settings.keep;
        self.next_rest = (self.next_rest / 2).max(self.settings.record);
        let [snapshot, _] = &mut self.snapshot;
        self.learner.snapshot(snapshot);
        self.kept.restore(snapshot);
        self.choice.forget(Expert::Kept);
        let [learner, kept, _] = &mut self.choice.record;
        *kept = *learner;
        let error = *learner;
        self.note(Action::Kept { error });
    }

    fn judge(&mut self) {
        let Some(tested) = self.trial.test([self.learner.as_ref(), self.kept.as_ref()]) else { return };
        let before = self.choice.active;
        if let Some(cause) = self.choice.take(&tested) {
            let errors = [tested.far[before.index()], tested.far[Expert::Frozen.index()]];
            self.note(Action::Switched { to: self.choice.active, cause, errors });
        }
        if let Some(to) = self.choice.rescue() {
            self.roll_back(to);
        }
        self.keep = self.keep.saturating_sub(self.settings.stride);
        if self.keep == 0 && self.choice.deserves() {
            self.take_snapshot();
        }
    }

    /// Whether the learner is one still; a covariance that is not sound starts again.
    fn check_health(&mut self) {
        let lost = self.outcome == Outcome::Rejected(Rejection::NotFinite);
        let Health { least_variance, sureness } = self.learner.health();
        // Not less than: NaN is what an adapter does not know.
        if lost || least_variance < 0.0 || sureness < 1.0 - 1e-6 {
            self.learner.restart();
            self.note(Action::Restarted);
        }
        if self.learner.weights().iter().any(|w| !w.is_finite()) {
            self.roll_back(Expert::Kept);
        }
    }

    /// Puts the state of a snapshot in a model, whose weights stay as they are.
    fn restore_state(expert: &mut dyn Adapter, from: &[f64], own: &mut [f64]) {
        expert.snapshot(own);
        let kept = own.len() - expert.weights().len();
        own[..kept].copy_from_slice(&from[..kept]);
        expert.restore(own);
    }
}
