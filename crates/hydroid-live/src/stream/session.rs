//! The adapter along a stream: prediction of each sample, update, and prediction of the next ones.

use hydroid_core::adapt::{Adapter, Learning as _, SaveState as _};
use hydroid_core::memory::Memory;
use hydroid_core::predict::{Predictor as _, Workspace};

use super::commands::Commands;
use super::line::Sample;
use crate::black_box::{BlackBoxError, Recorder, RecordingAdapter};
use hydroid::adapt::{BAND_80, BAND_95};
use hydroid::closed_loop::{ActuatorCheck, Elapsed, ModelSession, Pilot, Seen};
use hydroid::log::Note;
use hydroid::model::Model;

/// The adapter along a stream. It does not allocate after the first sample.
pub(super) struct Session {
    adapter: RecordingAdapter<'static>,
    dt: f64,
    horizons: Vec<usize>,
    /// Horizons whose deviations are computed: those of the answers, and one sample.
    computed: Vec<usize>,
    /// Whether anybody wants them.
    has_bands: bool,
    /// Whether `deviations` holds those of the next sample, under the first of `commands`.
    ahead: bool,
    missing: Vec<f64>,
    /// Prediction of the next sample, and its standard deviation.
    expected: Vec<f64>,
    expected_deviations: Vec<f64>,
    estimate: Vec<f64>,
    through_water: Vec<f64>,
    commands: Vec<f64>,
    held: Vec<f64>,
    rollout: Vec<f64>,
    deviations: Vec<f64>,
    work: Workspace,
    /// Measurements with a one-step band, and those inside the 80 % and 95 % bands.
    banded: [usize; 3],
    pilot: Option<Pilot>,
    /// Whether the vessel answers to the commands.
    check: Option<ActuatorCheck>,
    /// Planned commands of a pilot.
    plan: Vec<f64>,
    /// Predicted poses at the horizons, and standard deviations of position \[m\] and heading \[rad\].
    track: Vec<[f64; 3]>,
    track_deviations: Vec<[f64; 2]>,
    /// Places of `u`, `v` and `r` among the outputs, if the track is predicted.
    motion: Option<[usize; 3]>,
    /// Memory of the adapter before its first sample.
    initial: Vec<f64>,
    /// Samples of the present run.
    samples: usize,
}

/// Remarks on the step to a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Transition {
    pub(super) held: bool,
    /// The command of an interval was unknown: a new run began after it.
    pub(super) lost: bool,
    /// The memory of the adapter was not sound: it begins again with the weights of the model.
    pub(super) restarted: bool,
}

impl Session {
    /// Requires ascending, positive horizons.
    pub(super) fn new(mut adapter: Box<dyn Adapter>, horizons: Vec<usize>, dt: f64) -> Self {
        let (n, m) = (adapter.outputs(), adapter.inputs());
        let last = horizons.last().copied().unwrap_or(0);
        let initial = Memory::saved(|memory| adapter.visit_state(memory));
        let mut computed = horizons.clone();
        if last > 0 && horizons[0] > 1 {
            computed.insert(0, 1);
        }
        Self {
            initial,
            samples: 0,
            missing: vec![f64::NAN; n],
            expected: vec![f64::NAN; n],
            expected_deviations: vec![f64::NAN; n],
            estimate: vec![f64::NAN; n],
            through_water: vec![f64::NAN; n],
            commands: vec![f64::NAN; last * m],
            held: vec![f64::NAN; m],
            rollout: vec![f64::NAN; last * n],
            deviations: vec![f64::NAN; computed.len() * n],
            computed,
            has_bands: true,
            ahead: false,
            work: Workspace::new(),
            banded: [0; 3],
            pilot: None,
            check: None,
            plan: Vec::new(),
            track: Vec::new(),
            track_deviations: Vec::new(),
            motion: None,
            adapter: RecordingAdapter::new(adapter, None),
            dt,
            horizons,
        }
    }

    pub(super) fn record(&mut self, recorder: Recorder) {
        self.adapter.record(recorder);
    }

    /// Writes the recording after an answer; returns a note on failure.
    pub(super) fn settle(&mut self, commands: &Commands) -> Option<Note> {
        commands.ahead(&[], &mut self.held);
        self.adapter.settle(&self.held)
    }

    pub(super) fn finish(&mut self) -> Result<(), BlackBoxError> {
        self.adapter.finish()
    }

    pub(super) fn adapter(&self) -> &dyn Adapter {
        &self.adapter
    }

    pub(super) fn adapter_mut(&mut self) -> &mut dyn Adapter {
        self.ahead = false;
        &mut self.adapter
    }

    pub(super) fn horizons(&self) -> &[usize] {
        &self.horizons
    }

    /// Steers from now on, with sessions of this model.
    pub(super) fn steer_by(&mut self, pilot: Pilot, model: &Model) {
        self.check = ActuatorCheck::new(model, pilot.limits(), pilot.patience_s());
        self.plan = vec![f64::NAN; self.commands.len()];
        self.predict_track_of(pilot.motion());
        self.pilot = Some(pilot);
    }

    /// Steers no more.
    pub(super) fn release(&mut self) {
        (self.pilot, self.check) = (None, None);
    }

    /// Whether the vessel answers to the commands; `None` without a controller, and for a model without prediction bands.
    pub(super) fn check(&self) -> Option<&ActuatorCheck> {
        self.check.as_ref()
    }

    /// Predicts the track, with `u`, `v` and `r` in these places among the outputs.
    pub(super) fn predict_track_of(&mut self, motion: [usize; 3]) {
        self.track = vec![[f64::NAN; 3]; self.horizons.len()];
        self.track_deviations = vec![[f64::NAN; 2]; self.horizons.len()];
        self.motion = Some(motion);
    }

    /// Computes no deviations of the predictions from now on: they take most of the time of a network.
    pub(super) fn leave_out_bands(&mut self) {
        self.has_bands = false;
    }

    pub(super) fn pilot(&self) -> Option<&Pilot> {
        self.pilot.as_ref()
    }

    /// Commands that it plans, in rows; none without one.
    pub(super) fn planned(&self) -> &[f64] {
        if self.pilot.is_some() { &self.plan } else { &[] }
    }

    /// Visits the numbers of adapter and pilot.
    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        self.ahead &= !memory.is_loading();
        self.adapter.visit_state(memory);
        if let Some(pilot) = &mut self.pilot {
            pilot.visit_state(memory);
        }
        if let Some(check) = &mut self.check {
            check.visit_state(memory);
        }
    }

    /// Time passes \[s\] without a sample that is used.
    pub(super) fn pass(&mut self, commands: &mut Commands, seconds: f64) {
        if let Some(pilot) = &mut self.pilot {
            pilot.pass(seconds);
            commands.set_last(pilot.command());
        }
    }

    /// Begins a run, after a gap \[s\] unless it is the first.
    pub(super) fn begin(&mut self, commands: &mut Commands, sample: &Sample, gap: Option<f64>) -> Transition {
        self.adapter.to(sample.t, 0, self.dt);
        self.adapter.reset();
        if let Some(check) = &mut self.check {
            check.reset();
        }
        self.samples = 0;
        commands.restart();
        let held = commands.begin(&sample.inputs);
        let restarted = self.observe(commands, sample, gap.map_or(Elapsed::Start, Elapsed::Gap));
        Transition { held: held && self.pilot.is_none(), lost: false, restarted }
    }

    /// Advances to a sample, across grid points without one.
    pub(super) fn advance_to(
        &mut self,
        steps: usize,
        commands: &mut Commands,
        sample: &Sample,
    ) -> Transition {
        self.adapter.to(sample.t, steps.saturating_sub(1), self.dt);
        let ahead = std::mem::take(&mut self.ahead) && steps == 1;
        let Self {
            adapter,
            missing,
            expected,
            expected_deviations,
            work,
            deviations,
            commands: planned,
            check,
            ..
        } = self;
        let mut lost = false;
        let held = commands.advance_to(steps, &sample.inputs, |step, command| {
            if command.iter().any(|c| c.is_nan()) {
                adapter.reset();
                if let Some(check) = check {
                    check.reset();
                }
                expected.fill(f64::NAN);
                lost = true;
                return;
            }
            if let Some(check) = check {
                check.advance(command);
            }
            let last = step + 1 == steps;
            if last && ahead && planned.starts_with(command) {
                // Nothing has changed since the last prediction.
                expected_deviations.copy_from_slice(&deviations[..missing.len()]);
            } else if last {
                adapter.deviations(command, &[1], work, expected_deviations);
            }
            adapter.advance(command);
            if last {
                adapter.output(expected);
            } else {
                adapter.observe(missing);
                if let Some(check) = check {
                    check.observe(f64::NAN, missing);
                }
            }
        });
        self.adapter.to(sample.t, 0, self.dt);
        self.compare(sample);
        let finite = |numbers: &[f64]| numbers.iter().all(|x| x.is_finite());
        // Outputs and command were known: only the memory of the adapter makes a prediction unknown.
        let warm = !lost && self.samples > self.adapter.warm_up() && finite(&self.estimate);
        let broken = warm && !finite(&self.expected);
        if lost {
            self.samples = 0;
        }
        if broken {
            self.start_again();
        }
        let restarted = self.observe(commands, sample, Elapsed::Steps(steps)) || broken;
        Transition { held: held && self.pilot.is_none(), lost, restarted }
    }

    /// Observes a sample and predicts the next ones; true if the adapter began again.
    fn observe(&mut self, commands: &mut Commands, sample: &Sample, elapsed: Elapsed) -> bool {
        self.samples = self.samples.saturating_add(1);
        self.adapter.observe_heading(sample.heading);
        self.adapter.observe(&sample.outputs);
        let unsound = !self.is_sound();
        if unsound {
            self.start_again();
            self.adapter.to(sample.t, 0, self.dt);
            self.adapter.observe_heading(sample.heading);
            self.adapter.observe(&sample.outputs);
        }
        if let Some(check) = &mut self.check {
            check.observe(sample.heading, &sample.outputs);
            if let (Some(_), Some(pilot)) = (check.found(), &mut self.pilot) {
                pilot.stop_unanswered();
            }
        }
        self.predict(commands, sample, elapsed);
        unsound
    }

    /// An adapter whose memory or prediction is not finite would stay so for ever: it begins again as the model.
    fn start_again(&mut self) {
        self.adapter.load(&self.initial);
        self.adapter.reset();
        self.samples = 0;
        self.ahead = false;
    }

    /// Whether the memory of the adapter is sound.
    pub(super) fn is_sound(&self) -> bool {
        self.adapter.is_sound() && self.adapter.weights().iter().all(|weight| weight.is_finite())
    }

    fn compare(&mut self, sample: &Sample) {
        let expected = self.expected.iter().zip(&self.expected_deviations);
        for (y, (expected, deviation)) in sample.outputs.iter().zip(expected) {
            let miss = ((y - expected) / deviation).abs();
            if miss.is_finite() {
                self.banded[0] += 1;
                self.banded[1] += usize::from(miss <= BAND_80);
                self.banded[2] += usize::from(miss <= BAND_95);
            }
        }
    }

    fn predict(&mut self, commands: &mut Commands, sample: &Sample, elapsed: Elapsed) {
        self.adapter.output(&mut self.estimate);
        self.adapter.output_through_water(&mut self.through_water);
        self.steer(commands, sample, elapsed);
        let plan = if self.pilot.is_some() { &self.plan } else { &sample.plan };
        commands.ahead(plan, &mut self.commands);
        self.adapter.rollout(&self.commands, &mut self.work, &mut self.rollout);
        if self.has_bands {
            self.adapter.deviations(&self.commands, &self.computed, &mut self.work, &mut self.deviations);
            self.ahead = !self.computed.is_empty();
        }
        self.predict_track(sample);
    }

    fn steer(&mut self, commands: &mut Commands, sample: &Sample, elapsed: Elapsed) {
        let Self { pilot: Some(pilot), adapter, plan, .. } = self else { return };
        let active = adapter.guard().map_or_else(|| adapter.weights(), |guard| guard.active_weights());
        let weights = pilot.adapts().then_some(active);
        let seen = Seen {
            pose: sample.pose,
            outputs: &sample.outputs,
            estimate: &self.estimate,
            session: ModelSession { predictor: adapter, weights },
        };
        pilot.steer(elapsed, &seen);
        commands.set_last(pilot.command());
        let inputs = pilot.command().len();
        for (later, row) in plan.chunks_exact_mut(inputs.max(1)).enumerate() {
            row.copy_from_slice(pilot.planned(later));
        }
    }

    /// Poses along the rollout. The deviations are upper bounds, of errors of the velocities that do not change their
    /// sign: the standard deviation of a sum is at most the sum of the standard deviations.
    fn predict_track(&mut self, sample: &Sample) {
        let hidden = self.hidden();
        let Self { pilot, motion: Some(motion), horizons, rollout, deviations, .. } = self else { return };
        let deviations = &deviations[hidden..];
        let (n, motion, dt) = (self.missing.len(), *motion, self.dt);
        let [mut x, mut y, mut psi] = pilot.as_ref().map_or(sample.pose, Pilot::eta);
        let mut before = motion.map(|place| self.estimate[place]);
        let (mut from, mut along, mut turned, mut aside) = (0, 0.0, 0.0, 0.0);
        for (h, horizon) in horizons.iter().enumerate() {
            let [su, sv, sr] = motion.map(|place| deviations[h * n + place]);
            for row in rollout[from * n..horizon * n].chunks_exact(n) {
                let nu = motion.map(|place| row[place]);
                let [u, v, r]: [f64; 3] = std::array::from_fn(|i| 0.5 * (before[i] + nu[i]));
                let (sin, cos) = (psi + 0.5 * dt * r).sin_cos();
                (x, y, psi) = (x + dt * (u * cos - v * sin), y + dt * (u * sin + v * cos), psi + dt * r);
                before = nu;
                turned += dt * sr;
                aside += dt * u.hypot(v) * turned;
                along += dt * su.hypot(sv);
            }
            from = *horizon;
            self.track[h] = [x, y, psi];
            self.track_deviations[h] = [along + aside, turned];
        }
    }

    /// Predicted pose at each horizon, and upper bounds of the standard deviations of position \[m\] and heading \[rad\].
    pub(super) fn track(&self) -> (&[[f64; 3]], &[[f64; 2]]) {
        (&self.track, &self.track_deviations)
    }

    pub(super) fn estimate(&self) -> &[f64] {
        &self.estimate
    }

    /// The estimate with the motion through the water.
    pub(super) fn through_water(&self) -> &[f64] {
        &self.through_water
    }

    /// Length of the deviations of one sample, where it is not a horizon of the answers.
    fn hidden(&self) -> usize {
        (self.computed.len() - self.horizons.len()) * self.missing.len()
    }

    /// Prediction of an output at each horizon.
    pub(super) fn prediction(&self, output: usize) -> impl Iterator<Item = f64> {
        let n = self.missing.len();
        self.horizons.iter().map(move |h| self.rollout[(h - 1) * n + output])
    }

    pub(super) fn deviations(&self, output: usize) -> impl Iterator<Item = f64> {
        self.deviations[self.hidden()..].chunks_exact(self.missing.len()).map(move |row| row[output])
    }

    /// Number of horizons at which a prediction is not finite, and at which a band is not.
    pub(super) fn unknown(&self) -> [usize; 2] {
        let n = self.missing.len();
        let finite = |row: &[f64]| row.iter().all(|x| x.is_finite());
        let predicted = |h: &&usize| finite(&self.rollout[(**h - 1) * n..][..n]);
        let banded = self.deviations[self.hidden()..].chunks_exact(n).filter(|row| finite(row)).count();
        let all = self.horizons.len();
        [all - self.horizons.iter().filter(predicted).count(), all - banded]
    }

    /// Measurements with a one-step band, and those inside the 80 % and 95 % bands.
    pub(super) fn banded(&self) -> [usize; 3] {
        self.banded
    }
}
