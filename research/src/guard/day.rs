//! Bad days: logs with faults that are drawn at random.
//!
//! A day draws one fault, or with a probability of 0.3 two, each uniformly from the kinds of [`Kind::ALL`]. Its output or
//! input, its sign and its start (the middle two thirds of the log) are uniform, its size and duration are log-uniform.
//! Sizes of sensor faults are multiples of the standard deviation of the noise.
//!
//! | kind | size |
//! | --- | --- |
//! | spikes | 0.3 to 2 % of the samples of all outputs, of 8 to 200 deviations |
//! | dropout, stuck | an output is missing, or repeats its value, for 1 to 30 s |
//! | jump, creep | an output has an offset of 5 to 100 deviations from then on, or reaches one of 2 to 20 within 10 to 120 s |
//! | delay | all outputs come 1 to 5 samples late, for 10 to 60 s |
//! | swap | 1 % of the samples change places with the next |
//! | units | an output is in degrees per second or knots, for 60 s |
//! | command | the log repeats a command that the vessel does not receive, for 5 to 60 s |
//! | clock | the clock is set: the session starts a new run |
//! | gain | an actuator has 0.6 to 1.6 times its effect from then on (the log has the commands) |
//! | current | a current of 2 to 10 % of the range of `u` from then on |
//!
//! With a probability of 0.3, a fault that ends is added, from a stream of random numbers of its own: for 0.5 to 60 s
//! (log-uniform), two outputs are exchanged, an output has the wrong sign, is doubled, is rounded to a tenth of its largest
//! value, or has an offset of 5 to 100 deviations.
//!
//! A gain is exact for a log, because the response to a command that was multiplied is recorded; a current is exact for a
//! vessel whose forces depend on the motion through the water, with the heading from the integral of the true `r`.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::ops::Range;

use hydroid::log::{Table, Trajectory};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    None,
    Spikes,
    Dropout,
    Stuck,
    Jump,
    Creep,
    Delay,
    Swap,
    Units,
    Command,
    Clock,
    Gain,
    Current,
    Exchange,
    Sign,
    Double,
    Rounding,
}

impl Kind {
    /// Faults that end.
    const TRANSIENT: [Self; 5] = [Self::Exchange, Self::Sign, Self::Double, Self::Rounding, Self::Jump];

    const ALL: [Self; 13] = [
        Self::None,
        Self::Spikes,
        Self::Dropout,
        Self::Stuck,
        Self::Jump,
        Self::Creep,
        Self::Delay,
        Self::Swap,
        Self::Units,
        Self::Command,
        Self::Clock,
        Self::Gain,
        Self::Current,
    ];
}

/// A fault of a sensor: output, and the samples `from..to`.
#[derive(Clone, Debug)]
pub(super) struct SensorFault {
    pub(super) kind: Kind,
    pub(super) output: usize,
    pub(super) from: usize,
    pub(super) to: usize,
}

/// A log with faults.
#[derive(Clone, Debug)]
pub(super) struct Day {
    pub(super) run: Trajectory,
    /// True outputs, row by row.
    pub(super) truth: Vec<f64>,
    pub(super) faults: Vec<SensorFault>,
    /// Samples at which a new run begins.
    pub(super) resets: Vec<usize>,
    pub(super) text: String,
}

/// The tables of a day in work.
struct Draft<'a> {
    n: usize,
    m: usize,
    len: usize,
    dt: f64,
    names: Vec<&'a str>,
    noise: &'a [f64],
    outputs: Vec<f64>,
    inputs: Vec<f64>,
    truth: Vec<f64>,
    faults: Vec<SensorFault>,
    resets: Vec<usize>,
    text: String,
}

impl Day {
    /// A day without faults.
    pub(super) fn clean(run: &Trajectory) -> Self {
        let truth = run.truth.as_ref().unwrap_or(&run.outputs);
        Self {
            truth: truth.rows(0, run.len()).to_vec(),
            run: run.clone(),
            faults: Vec::new(),
            resets: Vec::new(),
            text: "clean".to_owned(),
        }
    }

    /// Draws the faults of a day on a log. `noise` are standard deviations of the outputs, `range_u` the width of the range
    /// of the first output.
    pub(super) fn draw(run: &Trajectory, noise: &[f64], range_u: f64, rng: &mut ChaCha8Rng) -> Self {
        let mut draft = Draft::new(run, noise);
        let count = if rng.random::<f64>() < 0.3 { 2 } else { 1 };
        // The vessel changes before its sensors fail.
        let mut kinds: Vec<Kind> =
            (0..count).map(|_| Kind::ALL[rng.random_range(0..Kind::ALL.len())]).collect();
        kinds.sort_by_key(|kind| !matches!(kind, Kind::Gain | Kind::Current));
        for kind in kinds {
            draft.add(kind, range_u, rng);
        }
        let mut second = rng.clone();
        second.set_stream(1);
        if second.random::<f64>() < 0.3 {
            draft.add_transient(&mut second);
        }
        draft.day(run)
    }

    /// A day with given faults of sensors.
    pub(super) fn with(run: &Trajectory, noise: &[f64], genes: &[Gene]) -> Self {
        let mut draft = Draft::new(run, noise);
        for &Gene { kind, output, from, samples, size } in genes {
            let to = (from + samples).min(draft.len);
            if !draft.text.is_empty() {
                draft.text.push_str(", ");
            }
            // Writing to a string cannot fail.
            let _ = write!(draft.text, "{kind:?}={}:{size:.1}@{from}..{to}", draft.names[output]);
            draft.fail(kind, output, from..to, size);
            draft.faults.push(SensorFault { kind, output, from, to });
        }
        draft.day(run)
    }
}

/// A fault of a sensor, as a search for the worst ones varies it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gene {
    kind: Kind,
    output: usize,
    from: usize,
    samples: usize,
    size: f64,
}

impl Gene {
    const KINDS: [Kind; 11] = [
        Kind::Spikes,
        Kind::Dropout,
        Kind::Stuck,
        Kind::Jump,
        Kind::Creep,
        Kind::Delay,
        Kind::Units,
        Kind::Exchange,
        Kind::Sign,
        Kind::Double,
        Kind::Rounding,
    ];

    /// A fault of 0.5 to 60 s that begins within the samples. A delay has at most 7 samples.
    pub(super) fn draw(run: &Trajectory, begins: &Range<usize>, rng: &mut ChaCha8Rng) -> Self {
        let kind = Self::KINDS[rng.random_range(0..Self::KINDS.len())];
        let size = match kind {
            Kind::Delay => log_uniform(rng, 1.0, 8.0),
            _ => sign(rng) * log_uniform(rng, 2.0, 200.0),
        };
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // durations are positive and short
        let samples = (log_uniform(rng, 0.5, 60.0) / run.dt).ceil() as usize;
        let output = rng.random_range(0..run.outputs.width());
        Self { kind, output, from: rng.random_range(begins.clone()), samples, size }
    }

    /// With one property of another fault.
    pub(super) fn with_part_of(self, other: Self, rng: &mut ChaCha8Rng) -> Self {
        match rng.random_range(0..4) {
            0 => Self { kind: other.kind, size: other.size, ..self },
            1 => Self { output: other.output, ..self },
            2 => Self { from: other.from, ..self },
            _ => Self { samples: other.samples, ..self },
        }
    }
}

fn log_uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low * (high / low).powf(rng.random())
}

/// Factor between the unit of an output and one that it may have by mistake: degrees per second, knots.
fn other_unit(name: &str) -> f64 {
    if name == "r" { 360.0 / TAU } else { 3600.0 / 1852.0 }
}

fn sign(rng: &mut ChaCha8Rng) -> f64 {
    if rng.random() { 1.0 } else { -1.0 }
}

impl<'a> Draft<'a> {
    fn new(run: &'a Trajectory, noise: &'a [f64]) -> Self {
        let truth = run.truth.as_ref().unwrap_or(&run.outputs);
        Self {
            n: run.outputs.width(),
            m: run.inputs.width(),
            len: run.len(),
            dt: run.dt,
            names: run.outputs.channels().iter().map(|channel| channel.name.as_str()).collect(),
            noise,
            outputs: run.outputs.rows(0, run.len()).to_vec(),
            inputs: run.inputs.rows(0, run.len()).to_vec(),
            truth: truth.rows(0, run.len()).to_vec(),
            faults: Vec::new(),
            resets: Vec::new(),
            text: String::new(),
        }
    }

    /// The day of the log.
    fn day(self, run: &Trajectory) -> Day {
        let Draft { outputs, inputs, truth, faults, resets, text, .. } = self;
        let table = |like: &Table, values| Table::new(like.channels().to_vec(), values);
        Day {
            run: Trajectory {
                outputs: table(&run.outputs, outputs),
                inputs: table(&run.inputs, inputs),
                truth: None,
                ..run.clone()
            },
            truth,
            faults,
            resets,
            text,
        }
    }

    fn samples(&self, time_s: f64) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // durations are positive and short
        let count = (time_s / self.dt).round() as usize;
        count.max(1)
    }

    /// Range of samples of a duration that is log-uniform between the limits \[s\].
    fn span(&self, rng: &mut ChaCha8Rng, low_s: f64, high_s: f64) -> (usize, usize) {
        let from = self.len / 6 + rng.random_range(0..(2 * self.len / 3).max(1));
        (from, (from + self.samples(log_uniform(rng, low_s, high_s))).min(self.len))
    }

    // A list of the kinds reads best in one place.
    #[allow(clippy::too_many_lines)]
    fn add(&mut self, kind: Kind, range_u: f64, rng: &mut ChaCha8Rng) {
        let (n, m) = (self.n, self.m);
        let output = rng.random_range(0..n);
        let input = rng.random_range(0..m);
        let name = self.names[output];
        let (mut from, mut to) = self.span(rng, 1.0, 30.0);
        let mut on = Some(output);
        let text = &mut self.text;
        if !text.is_empty() {
            text.push_str(", ");
        }
        // Writing to a string cannot fail.
        match kind {
            Kind::None => {
                text.push_str("none");
                on = None;
            }
            Kind::Spikes => {
                let share = log_uniform(rng, 0.003, 0.02);
                let _ = write!(text, "spikes={share:.4}");
                for k in 0..self.len {
                    for i in 0..n {
                        if rng.random::<f64>() < share {
                            let size = sign(rng) * log_uniform(rng, 8.0, 200.0);
                            self.outputs[k * n + i] += size * self.noise[i];
                            self.faults.push(SensorFault { kind, output: i, from: k, to: k + 1 });
                        }
                    }
                }
                on = None;
            }
            Kind::Dropout => {
                let _ = write!(text, "dropout={name}:{from}..{to}");
                self.fail(kind, output, from..to, 0.0);
            }
            Kind::Stuck => {
                let _ = write!(text, "stuck={name}:{from}..{to}");
                self.fail(kind, output, from..to, 0.0);
            }
            Kind::Jump => {
                let size = sign(rng) * log_uniform(rng, 5.0, 100.0);
                to = self.len;
                let _ = write!(text, "jump={name}:{size:.1}@{from}");
                self.fail(kind, output, from..to, size);
            }
            Kind::Creep => {
                let size = sign(rng) * log_uniform(rng, 2.0, 20.0);
                let full;
                (from, full) = self.span(rng, 10.0, 120.0);
                to = self.len;
                let _ = write!(self.text, "creep={name}:{size:.1}@{from}..{full}");
                for k in from..to {
                    let share = ((k - from) as f64 / (full - from) as f64).min(1.0);
                    self.outputs[k * n + output] += share * size * self.noise[output];
                }
            }
            Kind::Delay => {
                (from, to) = self.span(rng, 10.0, 60.0);
                let late: u32 = rng.random_range(1..=5);
                let _ = write!(self.text, "delay={late}:{from}..{to}");
                self.fail(kind, output, from..to, f64::from(late));
                for output in 0..n {
                    self.faults.push(SensorFault { kind, output, from, to });
                }
                on = None;
            }
            Kind::Swap => {
                text.push_str("swap=0.01");
                for k in 1..self.len {
                    if rng.random::<f64>() < 0.01 {
                        for output in 0..n {
                            self.outputs.swap((k - 1) * n + output, k * n + output);
                            self.faults.push(SensorFault { kind, output, from: k - 1, to: k + 1 });
                        }
                    }
                }
                on = None;
            }
            Kind::Units => {
                to = (from + self.samples(60.0)).min(self.len);
                let _ = write!(self.text, "units={name}:{:.2}@{from}..{to}", other_unit(name));
                self.fail(kind, output, from..to, 0.0);
            }
            Kind::Command => {
                (from, to) = self.span(rng, 5.0, 60.0);
                let _ = write!(self.text, "command={input}:{from}..{to}");
                let held = self.inputs[from * m + input];
                (from..to).for_each(|k| self.inputs[k * m + input] = held);
                on = None;
            }
            Kind::Clock => {
                let _ = write!(text, "clock@{from}");
                self.resets.push(from);
                on = None;
            }
            Kind::Gain => {
                let gain = log_uniform(rng, 0.6, 1.6);
                let _ = write!(text, "gain={input}:{gain:.2}@{from}");
                (from..self.len).for_each(|k| self.inputs[k * m + input] /= gain);
                on = None;
            }
            Kind::Exchange | Kind::Sign | Kind::Double | Kind::Rounding => on = None,
            Kind::Current => {
                let speed = range_u * log_uniform(rng, 0.02, 0.1);
                let direction = TAU * rng.random::<f64>();
                let _ = write!(text, "current={speed:.2}@{from}");
                self.set_current(from, speed, direction);
                on = None;
            }
        }
        if let Some(output) = on {
            self.faults.push(SensorFault { kind, output, from, to });
        }
    }

    /// Adds a fault that ends.
    fn add_transient(&mut self, rng: &mut ChaCha8Rng) {
        let n = self.n;
        let kind = Kind::TRANSIENT[rng.random_range(0..Kind::TRANSIENT.len())];
        let output = rng.random_range(0..n);
        let other = (output + 1) % n;
        let (from, to) = self.span(rng, 0.5, 60.0);
        let size = sign(rng) * log_uniform(rng, 5.0, 100.0);
        self.fail(kind, output, from..to, size);
        // Writing to a string cannot fail.
        let _ = write!(self.text, ", {kind:?}={}:{from}..{to}", self.names[output]);
        self.faults.push(SensorFault { kind, output, from, to });
        if kind == Kind::Exchange && other != output {
            self.faults.push(SensorFault { kind, output: other, from, to });
        }
    }

    /// A sensor fails in some samples; `size` is that of an offset in deviations of the noise, or of a delay in samples.
    fn fail(&mut self, kind: Kind, output: usize, samples: Range<usize>, size: f64) {
        let Self { n, noise, .. } = *self;
        let offset = size * noise[output];
        let factor = other_unit(self.names[output]);
        let values = self.outputs.iter().skip(output).step_by(n).filter(|y| y.is_finite());
        let step = 0.1 * values.fold(0.0, |most, y| f64::max(most, y.abs())).max(f64::MIN_POSITIVE);
        let held = self.outputs[samples.start * n + output];
        let len = samples.len();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few samples
        let late = (size.abs() as usize).min(samples.start);
        let rows = samples.start * n..samples.end * n;
        if kind == Kind::Delay {
            let before = self.outputs[rows.start - late * n..rows.end - late * n].to_vec();
            self.outputs[rows].copy_from_slice(&before);
            return;
        }
        for (k, row) in self.outputs[rows].chunks_exact_mut(n).enumerate() {
            match kind {
                Kind::Dropout => row[output] = f64::NAN,
                Kind::Stuck => row[output] = held,
                Kind::Units => row[output] *= factor,
                Kind::Exchange => row.swap(output, (output + 1) % n),
                Kind::Sign => row[output] = -row[output],
                Kind::Double => row[output] *= 2.0,
                Kind::Rounding => row[output] = (row[output] / step).round() * step,
                Kind::Creep => row[output] += offset * k as f64 / len as f64,
                Kind::Spikes if !k.is_multiple_of(9) => {}
                _ => row[output] += offset,
            }
        }
    }

    /// Adds a current to the velocities over ground, where outputs are named `u`, `v` and `r`.
    fn set_current(&mut self, from: usize, speed: f64, direction: f64) {
        let place = |name: &str| self.names.iter().position(|given| *given == name);
        let (Some(u), Some(v), Some(r)) = (place("u"), place("v"), place("r")) else { return };
        let mut heading = 0.0;
        for k in 0..self.len {
            if k >= from {
                let (sin, cos) = (direction - heading).sin_cos();
                for table in [&mut self.outputs, &mut self.truth] {
                    table[k * self.n + u] += speed * cos;
                    table[k * self.n + v] += speed * sin;
                }
            }
            heading += self.dt * self.truth[k * self.n + r];
        }
    }
}
