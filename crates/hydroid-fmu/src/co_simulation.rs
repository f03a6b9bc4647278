//! Co-simulation: communication steps of any length over a model with samples.

use hydroid::model::{Body, Model};
use hydroid::plant::{FreeRun, Motion, arc};

use crate::resource::Resource;

/// A communication point this share of a sample from the end of a sample counts as its end.
const NEAR: f64 = 1e-6;

/// Relative rounding error of times.
const ROUNDING: f64 = 1e-12;

/// Most numbers of the past before the start.
const MOST_PAST: usize = 20_000_000;

/// Most samples in a communication step.
const MOST_SAMPLES: f64 = 1e9;

/// A model that runs freely, between any two instants.
///
/// Samples end at `t_0 + k dt`. The command of a sample is the mean of the inputs over it: with the input `c_i` held for
/// `d_i` seconds,
///
/// ```text
/// c = sum(d_i c_i) / dt
/// ```
///
/// At the end of a sample the outputs are those of the model. Within a sample, `s` seconds after its start, they are
/// interpolated between its ends, where the later end is that of the sample with the present input held up to it:
///
/// ```text
/// y(t_k + s) = y_k + s / dt (y_{k+1} - y_k)
/// ```
///
/// Results at the ends of samples therefore do not depend on the communication steps, if the inputs change there only.
#[derive(Debug)]
pub(crate) struct CoSimulation {
    run: FreeRun,
    motion: Option<Motion>,
    current: [f64; 2],
    start_s: f64,
    samples: u64,
    /// Time since the last sample \[s\].
    filled_s: f64,
    /// Mean of the inputs since the last sample.
    mean: Vec<f64>,
    /// Pose at the last sample.
    eta: [f64; 3],
    /// Snapshot at the last sample, and one sample ahead.
    ends: [Vec<f64>; 2],
}

/// Conditions at the start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start<'a> {
    pub(crate) time_s: f64,
    pub(crate) outputs: &'a [f64],
    /// Commands before the start.
    pub(crate) inputs: &'a [f64],
    pub(crate) eta: [f64; 3],
    pub(crate) current: [f64; 2],
}

impl CoSimulation {
    pub(crate) fn new(resource: &Resource) -> Self {
        let run = FreeRun::new(&resource.model);
        let ends = [(); 2].map(|()| vec![f64::NAN; run.snapshot_len()]);
        Self {
            run,
            motion: resource.variables.motion().copied(),
            current: [0.0; 2],
            start_s: 0.0,
            samples: 0,
            filled_s: 0.0,
            mean: vec![0.0; resource.variables.counts()[1]],
            eta: [0.0; 3],
            ends,
        }
    }

    /// Starts in a steady motion.
    pub(crate) fn start(&mut self, model: &Model, start: Start<'_>) -> Result<(), String> {
        let rows = self.run.warm_up();
        let width = start.outputs.len() + start.inputs.len();
        if rows.saturating_mul(width) > MOST_PAST {
            return Err(format!("the model depends on {rows} past samples, which are too many"));
        }
        // The actuators of a vessel would else start from the first command.
        if matches!(model.body, Body::Craft(_)) && rows == 1 {
            self.run.start_after(&start.outputs.repeat(2), start.inputs);
        } else {
            self.run.start(start.outputs, start.inputs);
        }
        (self.start_s, self.samples, self.filled_s) = (start.time_s, 0, 0.0);
        (self.eta, self.current) = (start.eta, start.current);
        self.run.snapshot(&mut self.ends[0]);
        Ok(())
    }

    fn dt(&self) -> f64 {
        self.run.dt()
    }

    /// Present time \[s\].
    pub(crate) fn time(&self) -> f64 {
        self.sample_time(self.samples) + self.filled_s
    }

    fn sample_time(&self, k: u64) -> f64 {
        self.start_s + k as f64 * self.dt()
    }

    /// Adds an input that is held for `duration_s` to the mean.
    fn absorb(&mut self, inputs: &[f64], duration_s: f64) {
        let all = self.filled_s + duration_s;
        for (mean, input) in self.mean.iter_mut().zip(inputs) {
            *mean = if self.filled_s == 0.0 { *input } else { *mean + (input - *mean) * (duration_s / all) };
        }
    }

    /// Steps from the time `t` by `h` seconds with the inputs held.
    pub(crate) fn step(&mut self, t: f64, h: f64, inputs: &[f64]) -> Result<(), String> {
        if !(t.is_finite() && h.is_finite() && h > 0.0 && h / self.dt() < MOST_SAMPLES) {
            return Err(format!(
                "a step of {h} s from {t} s is not possible: it must be positive and shorter than {MOST_SAMPLES} samples"
            ));
        }
        let near = NEAR * self.dt() + ROUNDING * t.abs().max(h);
        // Samples that rounding hides would never end.
        if near > 0.1 * self.dt() {
            return Err(format!("a time of {t} s is too large for samples of {} s: start at 0 s", self.dt()));
        }
        if (t - self.time()).abs() > near {
            let now = self.time();
            return Err(format!("a step from {t} s is not possible, because the time of the FMU is {now} s"));
        }
        let end = t + h;
        while self.sample_time(self.samples + 1) <= end + near {
            self.absorb(inputs, self.dt() - self.filled_s);
            self.advance();
        }
        let rest = end - self.time();
        if rest > near {
            self.absorb(inputs, rest);
            self.filled_s += rest;
        }
        Ok(())
    }

    fn nu(&self) -> [f64; 3] {
        self.motion.as_ref().map_or([0.0; 3], |motion| motion.nu(self.run.outputs()))
    }

    /// Completes a sample under the mean of the inputs.
    fn advance(&mut self) {
        let before = self.nu();
        self.run.advance(&self.mean);
        self.eta = arc(self.eta, [before, self.nu()], self.current, self.dt());
        self.samples += 1;
        self.filled_s = 0.0;
        self.run.snapshot(&mut self.ends[0]);
    }

    /// Writes the present outputs and pose, and the snapshot of the session into `snapshot`.
    pub(crate) fn present(&mut self, inputs: &[f64], outputs: &mut [f64], pose: &mut [f64]) -> &[f64] {
        outputs.copy_from_slice(self.run.outputs());
        pose.iter_mut().zip(self.eta).for_each(|(pose, eta)| *pose = eta);
        if self.filled_s == 0.0 {
            return &self.ends[0];
        }
        let share = self.filled_s / self.dt();
        let held: Vec<f64> =
            self.mean.iter().zip(inputs).map(|(mean, c)| mean + (c - mean) * (1.0 - share)).collect();
        let before = self.nu();
        self.run.advance(&held);
        let eta = arc(self.eta, [before, self.nu()], self.current, self.dt());
        let between = |from: f64, to: f64| from + (to - from) * share;
        outputs.iter_mut().zip(self.run.outputs()).for_each(|(y, ahead)| *y = between(*y, *ahead));
        pose.iter_mut().zip(eta).for_each(|(pose, ahead)| *pose = between(*pose, ahead));
        let [now, ahead] = &mut self.ends;
        self.run.snapshot(ahead);
        self.run.restore(now);
        ahead.iter_mut().zip(now.iter()).for_each(|(ahead, now)| *ahead = between(*now, *ahead));
        ahead
    }

    /// Number of numbers of [`save`](Self::save).
    pub(crate) fn saved_len(&self) -> usize {
        8 + self.mean.len() + self.run.snapshot_len()
    }

    /// Appends all numbers on which the future depends.
    pub(crate) fn save(&self, into: &mut Vec<f64>) {
        let [x, y, psi] = self.eta;
        let [north, east] = self.current;
        into.extend([self.start_s, self.samples as f64, self.filled_s, x, y, psi, north, east]);
        into.extend(&self.mean);
        into.extend(&self.ends[0]);
    }

    /// Takes numbers of [`save`](Self::save).
    pub(crate) fn restore(&mut self, from: &[f64]) -> Result<(), String> {
        let [start_s, samples, filled_s, x, y, psi, north, east, rest @ ..] = from else {
            return Err(String::from("the state is too short"));
        };
        if rest.len() != self.mean.len() + self.run.snapshot_len() {
            return Err(String::from("the state is that of another model"));
        }
        let whole = *samples >= 0.0 && *samples < 9e15 && samples.fract() == 0.0;
        if !(whole && start_s.is_finite() && *filled_s >= 0.0 && *filled_s < self.dt()) {
            return Err(String::from("the state contains an impossible time"));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        let samples = *samples as u64;
        (self.start_s, self.samples, self.filled_s) = (*start_s, samples, *filled_s);
        (self.eta, self.current) = ([*x, *y, *psi], [*north, *east]);
        let (mean, snapshot) = rest.split_at(self.mean.len());
        self.mean.copy_from_slice(mean);
        self.ends[0].copy_from_slice(snapshot);
        self.run.restore(snapshot);
        Ok(())
    }
}
