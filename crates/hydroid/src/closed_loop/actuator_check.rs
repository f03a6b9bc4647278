//! Faults of actuators, found from how a vessel answers to its commands.

use hydroid_core::actuator::Limits;
use hydroid_core::memory::Memory;
use hydroid_core::predict::{Predictor, Workspace};

use crate::evaluate::{BAND_80, DesignRange, PredictionBands};
use crate::model::Model;
use crate::plant::believed;

/// Time without a false alarm, in the mean \[s\].
const FALSE_ALARM_S: f64 = 36_000.0;

/// Largest current, relative to the speed of the vessel over ground.
const MOST_CURRENT: f64 = 0.4;

/// What may be wrong with the actuators. Inputs are places among those of the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActuatorFault {
    /// An input has no effect: its actuator is lost.
    Lost(usize),
    /// An input acts the other way about its neutral value.
    Reversed(usize),
    /// No input has an effect.
    AllLost,
}

impl ActuatorFault {
    /// Changes a command to the one that acts.
    pub fn apply(self, command: &mut [f64], limits: &[Limits]) {
        match self {
            Self::Lost(input) => command[input] = limits[input].rest,
            Self::Reversed(input) => {
                let Limits { low, high, rest, .. } = limits[input];
                command[input] = (2.0 * rest - command[input]).clamp(low, high);
            }
            Self::AllLost => command.iter_mut().zip(limits).for_each(|(c, limits)| *c = limits.rest),
        }
    }

    /// All faults of inputs that are commanded: those whose limits differ.
    pub fn all(limits: &[Limits]) -> Vec<Self> {
        let inputs = limits.iter().enumerate();
        let lost =
            inputs.clone().filter(|(_, limits)| limits.low < limits.high).map(|(input, _)| Self::Lost(input));
        let both = |limits: &Limits| limits.low < limits.rest && limits.rest < limits.high;
        let reversed = inputs.filter(|(_, limits)| both(limits)).map(|(input, _)| Self::Reversed(input));
        let several = lost.clone().count() > 1;
        lost.chain(reversed).chain(several.then_some(Self::AllLost)).collect()
    }
}

/// Degrees of freedom of the errors: their tails are heavier than those of a normal distribution.
const FREEDOM: f64 = 5.0;

/// Square of the distribution of Student that one of a hundred errors exceeds.
const LARGEST: f64 = 16.26;

/// Largest logarithm of a likelihood ratio of a window: one of a hundred windows may be of something else.
const MOST: f64 = 4.605;

/// Windows over which the scale of the errors is a mean.
const MEMORY: f64 = 20.0;

/// Mean error of a window as a random walk, by a Kalman filter, and the scale of what is left.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Walk {
    mean: f64,
    /// Relative to the square of the scale.
    variance: f64,
    /// Mean square of the innovations, relative to the variance that the bands state, and at least this one.
    scale: f64,
}

impl Walk {
    const START: Self = Self { mean: 0.0, variance: 3.0, scale: 1.0 };

    /// Takes the error of a window, in deviations. Returns the logarithm of its likelihood, but for a constant, and the square of
    /// the error relative to the scale.
    fn take(&mut self, error: f64) -> [f64; 2] {
        let variance = self.variance + 1.0;
        let total = variance + 1.0;
        let innovation = error - self.mean;
        let square = innovation * innovation / total;
        let relative = square / self.scale;
        // Of a normal distribution with a random scale: what is far outside says little of the mean.
        let weight = (FREEDOM + 1.0) / (FREEDOM + relative);
        let likelihood = -0.5 * self.scale.ln() - 0.5 * (FREEDOM + 1.0) * (relative / FREEDOM).ln_1p();
        *self = Self {
            mean: self.mean + weight * variance / total * innovation,
            variance: variance / total,
            scale: (self.scale + (square - self.scale) / MEMORY).max(1.0),
        };
        [likelihood, relative]
    }
}

/// A fault that is suspected, with its evidence.
#[derive(Clone, Copy, Debug)]
struct Suspect {
    fault: ActuatorFault,
    /// Sum of the logarithms of the likelihood ratios since it was zero, when the fault may have begun.
    sum: f64,
    /// The same without clipping: which of several faults it is.
    whole: f64,
    walks: [Walk; 2],
}

/// Watches whether a vessel answers to its commands as its model, or as the model with a fault of an actuator.
///
/// The errors `e` of a prediction over a window, of surge velocity and yaw rate, are those of the model under the commands that have
/// acted, and under these commands as each fault changes them. Each has a mean `b` that walks at random, for wind, a current and what
/// the model leaves out, and what is left has a distribution of Student with a scale `s` that is estimated, with that of the prediction
/// bands as its least value:
///
/// ```text
/// e_w = b_w + n_w,   b_w = b_{w-1} + m_w,   n_w, m_w ~ t(5) s_w
/// S_w = max(0, S_{w-1} + clip(log p(e_w with the fault) - log p(e_w)))
/// ```
///
/// The ratios are clipped: one window in a hundred may be of something else than the hypotheses (P. J. Huber, *Annals of Mathematical
/// Statistics* 36 (1965) 1753). Where `S` is zero, mean and scale of a fault are those of the sound vessel: it may begin there.
///
/// A fault is found when its `S` exceeds the logarithm of the number of windows in ten hours times the number of faults: the mean time
/// between false alarms is at least as long if the errors are as described (E. S. Page, *Biometrika* 41 (1954) 100; G. Lorden, *Annals of
/// Mathematical Statistics* 42 (1971) 1897). Its own errors in the window must not be among the largest of a hundred, so that nothing is
/// found where no hypothesis explains the motion. Of several faults it is the one with the largest sum of ratios that are not clipped.
///
/// The bands of `u` are widened by the change of a velocity over ground that the turn makes in a current of 0.4 of the speed. Windows
/// with a motion outside the range in which a model is believed are not judged. A command beyond the range of the training has the
/// effect of its end: more of it would have at least as much.
pub struct ActuatorCheck {
    session: Box<dyn Predictor>,
    scratch: Box<dyn Predictor>,
    /// Limits of the commands within the range of the training.
    limits: Vec<Limits>,
    /// Ranges of the outputs in which a window is judged.
    motion: Vec<[f64; 2]>,
    /// Places of `u` and `r`.
    places: [usize; 2],
    dt: f64,
    /// Samples of a window, and of the present one.
    length: usize,
    samples: usize,
    /// State at the beginning of the window, the commands in it, and the turn \[rad\].
    snapshot: Vec<f64>,
    commands: Vec<f64>,
    turn: f64,
    /// Samples of the window with outputs outside their range.
    outside: usize,
    /// Samples of this run.
    seen: usize,
    /// Deviations of `u` and `r`.
    deviations: [f64; 2],
    walks: [Walk; 2],
    suspects: Vec<Suspect>,
    threshold: f64,
    /// Place of the fault that was found.
    found: Option<usize>,
    work: Workspace,
    sequences: Vec<f64>,
    outputs: Vec<f64>,
}

impl ActuatorCheck {
    /// For a model with prediction bands, and windows of a time \[s\]; shorter if the bands are. `None` without bands, and for a model
    /// without `u` and `r`.
    pub fn new(model: &Model, limits: &[Limits], window_s: f64) -> Option<Self> {
        let description = &model.description;
        let bands: &PredictionBands = description.bands.as_ref()?;
        let place = |name: &str| description.outputs.iter().position(|port| port.channel.name == name);
        let places = [place("u")?, place("r")?];
        let longest = *bands.horizons.last()?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number")]
        let length = ((window_s / description.dt).round() as usize).clamp(1, longest.max(1));
        let level = bands.levels.iter().position(|level| (level - 0.8).abs() < 1e-9)?;
        let deviations = places.map(|place| bands.half_width(level, length, place) / BAND_80);
        if !deviations.iter().all(|deviation| deviation.is_finite() && *deviation > 0.0) {
            return None;
        }
        let session = model.frozen().session();
        let limits: Vec<Limits> = limits
            .iter()
            .zip(&description.inputs)
            .map(|(limits, port)| {
                let DesignRange { low, high } = port.training_range.unwrap_or(port.range);
                let rest = limits.rest;
                Limits {
                    low: limits.low.max(low).min(rest),
                    high: limits.high.min(high).max(rest),
                    ..*limits
                }
            })
            .collect();
        let all = ActuatorFault::all(&limits);
        let (count, n, m) = (all.len(), session.outputs(), session.inputs());
        let windows = FALSE_ALARM_S / (length as f64 * description.dt);
        let suspects =
            all.into_iter().map(|fault| Suspect { fault, sum: 0.0, whole: 0.0, walks: [Walk::START; 2] });
        Some(Self {
            scratch: session.fork(),
            snapshot: vec![0.0; session.snapshot_len()],
            session,
            limits,
            motion: description.outputs.iter().map(believed).collect(),
            places,
            dt: description.dt,
            length,
            samples: 0,
            commands: vec![0.0; length * m],
            turn: 0.0,
            outside: 0,
            seen: 0,
            deviations,
            walks: [Walk::START; 2],
            suspects: suspects.collect(),
            threshold: (windows * count as f64).ln().max(1.0),
            found: None,
            work: Workspace::new(),
            sequences: vec![0.0; (count + 1) * length * m],
            outputs: vec![0.0; (count + 1) * length * n],
        })
    }

    /// A run begins.
    pub fn reset(&mut self) {
        self.session.reset();
        (self.seen, self.samples, self.turn, self.outside) = (0, 0, 0.0, 0);
        self.forget();
    }

    fn forget(&mut self) {
        self.walks = [Walk::START; 2];
        for suspect in &mut self.suspects {
            (suspect.sum, suspect.whole, suspect.walks) = (0.0, 0.0, [Walk::START; 2]);
        }
    }

    /// The fault that was found; it stays so.
    pub fn found(&self) -> Option<ActuatorFault> {
        self.found.map(|place| self.suspects[place].fault)
    }

    /// A command acts for a sample.
    pub fn advance(&mut self, command: &[f64]) {
        let m = command.len();
        let row = self.commands[self.samples * m..][..m].iter_mut();
        for ((to, command), limits) in row.zip(command).zip(&self.limits) {
            *to = command.clamp(limits.low, limits.high);
        }
        self.samples += 1;
        self.session.advance(command);
    }

    /// Observes a measurement \[heading in rad\]; NaN is missing.
    pub fn observe(&mut self, heading: f64, outputs: &[f64]) {
        self.session.observe_heading(heading);
        self.session.observe(outputs);
        self.seen = self.seen.saturating_add(1);
        let [u, r] = self.places.map(|place| outputs[place]);
        if r.is_finite() {
            self.turn += r * self.dt;
        }
        let ranges = outputs.iter().zip(&self.motion);
        let is_outside =
            !ranges.clone().all(|(value, [low, high])| value.is_nan() || (low..=high).contains(&value));
        self.outside += usize::from(is_outside);
        if self.samples == self.length {
            if self.outside == 0
                && u.is_finite()
                && r.is_finite()
                && self.seen > self.length + self.session.warm_up()
            {
                self.judge([u, r]);
            }
            (self.samples, self.outside) = (0, usize::from(is_outside));
        }
        if self.samples == 0 {
            self.session.snapshot(&mut self.snapshot);
            self.turn = 0.0;
        }
    }

    fn judge(&mut self, measured: [f64; 2]) {
        let (n, m) = (self.session.outputs(), self.session.inputs());
        let window = self.length * m;
        let (own, others) = self.sequences.split_at_mut(window);
        own.copy_from_slice(&self.commands);
        for (rows, suspect) in others.chunks_exact_mut(window).zip(&self.suspects) {
            rows.copy_from_slice(&self.commands);
            rows.chunks_exact_mut(m).for_each(|row| suspect.fault.apply(row, &self.limits));
        }
        self.scratch.restore(&self.snapshot);
        let count = self.suspects.len() + 1;
        self.scratch.rollout_batch(count, &self.sequences, &mut self.work, &mut self.outputs);
        let current = MOST_CURRENT * measured[0].abs() * self.turn.abs().min(2.0);
        let [u, r] = self.deviations;
        let deviations = [u.hypot(current), r];
        let last = |k: usize| &self.outputs[((k + 1) * self.length - 1) * n..][..n];
        let errors = |k: usize| -> [f64; 2] {
            std::array::from_fn(|i| (measured[i] - last(k)[self.places[i]]) / deviations[i])
        };
        let own = errors(0);
        if !own.iter().all(|error| error.is_finite()) {
            return self.forget();
        }
        let before = self.walks;
        let take = |walks: &mut [Walk; 2], errors: [f64; 2]| -> [f64; 2] {
            let [u, r]: [[f64; 2]; 2] = std::array::from_fn(|i| walks[i].take(errors[i]));
            [u[0] + r[0], u[1].max(r[1])]
        };
        let [usual, _] = take(&mut self.walks, own);
        let (sound, mut most) = (self.found.is_none(), f64::NEG_INFINITY);
        for (k, suspect) in self.suspects.iter_mut().enumerate() {
            if suspect.sum == 0.0 {
                (suspect.walks, suspect.whole) = (before, 0.0);
            }
            let errors = errors(k + 1);
            let [likelihood, square] = take(&mut suspect.walks, errors);
            let gain = likelihood - usual;
            // A prediction that is not finite is no evidence.
            (suspect.sum, suspect.whole) = if gain.is_finite() {
                ((suspect.sum + gain.clamp(-MOST, MOST)).max(0.0), suspect.whole + gain)
            } else {
                (0.0, 0.0)
            };
            if sound && suspect.sum > self.threshold && suspect.whole > most && square < LARGEST {
                most = suspect.whole;
                self.found = Some(k);
            }
        }
    }

    /// Visits all numbers of the state.
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.session(&mut *self.session);
        memory.numbers(&mut self.snapshot);
        memory.numbers(&mut self.commands);
        memory.number(&mut self.turn);
        memory.count(&mut self.samples, self.length - 1);
        memory.count(&mut self.outside, self.length);
        memory.count(&mut self.seen, usize::MAX / 4);
        let mut walk = |walk: &mut Walk| {
            memory.number(&mut walk.mean);
            memory.number(&mut walk.variance);
            memory.number(&mut walk.scale);
        };
        self.walks.iter_mut().for_each(&mut walk);
        for suspect in &mut self.suspects {
            suspect.walks.iter_mut().for_each(&mut walk);
        }
        for suspect in &mut self.suspects {
            memory.number(&mut suspect.sum);
            memory.number(&mut suspect.whole);
        }
        let mut found = self.found.map_or(0, |place| place + 1);
        memory.count(&mut found, self.suspects.len());
        self.found = found.checked_sub(1);
    }
}
