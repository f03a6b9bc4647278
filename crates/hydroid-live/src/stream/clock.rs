//! Assignment of samples to the time grid of the model.

use hydroid::log::LogError;

/// Largest number of consecutive grid points without a sample, which bounds the work for a line.
const MAX_SKIPPED: f64 = 1e4;
/// A silence beyond this time \[s\] is a jump of the clock until further lines confirm it.
const LONGEST_SILENCE_S: f64 = 3_600.0;
/// Consecutive lines, each at most the longest gap after the one before, that confirm a jump of the clock.
const CONFIRMING: u32 = 10;
/// Gain of the grid on deviations of the samples, and weight of an interval in the mean.
const TRACKING_GAIN: f64 = 1.0 / 16.0;
/// Below this share of the sample time, the mean interval marks a stream faster than the model.
const FASTER_SHARE: f64 = 0.75;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arrival {
    /// First of a session.
    First,
    /// Number of steps after the previous one.
    Next(usize),
    /// After a gap \[s\] longer than the limit: a new run begins.
    Gap(f64),
    /// Not after the last sample, but this much \[s\] earlier.
    Late(f64),
    /// A jump of the clock \[s\] that no further lines confirm yet.
    Jump(f64),
    /// The last of the lines that confirm a jump of the clock \[s\], backward or forward: a new run begins.
    Stepped(f64),
    /// Between two grid points, or a second sample at the last one.
    Between,
}

/// A time grid with spacing `dt`, whose origin is the first sample. A later sample is assigned to the grid point within
/// half a step, and the grid slowly follows the samples, so that clocks of different rates do not drift apart.
///
/// Of several samples in a step the nearest to the grid point is used: for a stream faster than the model, half of the
/// mean interval is the limit before a grid point.
#[derive(Clone, Debug)]
pub struct Clock {
    dt: f64,
    max_gap: f64,
    /// Times of the last grid point, of its sample, and of the last line \[s\].
    place: f64,
    taken: f64,
    seen: f64,
    /// Mean interval of the lines, each at most one step \[s\].
    interval: f64,
    /// Time of the first sample \[s\].
    begun: f64,
    /// Time of the last line beside the grid \[s\], and the number of consistent ones.
    beside: f64,
    confirming: u32,
}

impl Clock {
    pub fn new(dt: f64, max_gap: f64) -> Result<Self, LogError> {
        let bad =
            |reason: String| LogError::BadOption { what: "a gap limit", value: max_gap.to_string(), reason };
        if !(max_gap > 0.0 && max_gap.is_finite()) {
            return Err(bad("it must be a positive number of seconds".to_owned()));
        }
        if max_gap / dt > MAX_SKIPPED {
            return Err(bad(format!(
                "it must be at most {MAX_SKIPPED} steps of the model, which are {dt} s long"
            )));
        }
        let (unknown, interval) = (f64::NAN, dt);
        let [place, taken, seen, begun, beside] = [unknown; 5];
        Ok(Self { dt, max_gap, place, taken, seen, interval, begun, beside, confirming: 0 })
    }

    pub fn is_new(&self) -> bool {
        self.taken.is_nan()
    }

    pub fn taken(&self) -> f64 {
        self.taken
    }

    /// Position of a sample; advances to a used sample.
    pub fn arrive(&mut self, t: f64) -> Arrival {
        if self.is_new() {
            self.begin(t);
            self.begun = t;
            return Arrival::First;
        }
        let after = t - self.taken;
        if after <= 0.0 || after > LONGEST_SILENCE_S {
            return self.confirm(t, after);
        }
        self.confirming = 0;
        if t <= self.seen {
            // A sample after the last used one is not late, even if it precedes the last line.
            return Arrival::Between;
        }
        self.interval += TRACKING_GAIN * 2.0 * ((t - self.seen).min(self.dt) - self.interval);
        self.seen = t;
        let gap = t - self.taken;
        if gap > self.max_gap * (1.0 + 1e-9) {
            self.begin(t);
            return Arrival::Gap(gap);
        }
        let steps = ((t - self.place) / self.dt).round();
        let late = t - self.place - steps * self.dt;
        let fast = self.interval < FASTER_SHARE * self.dt;
        // More steps than a gap allows result from an invalid state.
        if !(1.0..=MAX_SKIPPED + 1.0).contains(&steps) || fast && late < -0.5 * self.interval {
            return Arrival::Between;
        }
        self.place += steps * self.dt;
        self.place += TRACKING_GAIN * late;
        self.taken = t;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // a whole number of steps; a cast saturates
        Arrival::Next(steps as usize)
    }

    /// A line that is late or follows an absurd silence: a single stamp may be wrong, and a clock may be set.
    fn confirm(&mut self, t: f64, after: f64) -> Arrival {
        let step = t - self.beside;
        let consistent = step > 0.0 && step <= self.max_gap;
        self.confirming = if consistent { self.confirming.saturating_add(1) } else { 1 };
        self.beside = t;
        if self.confirming >= CONFIRMING {
            self.begin(t);
            return Arrival::Stepped(after);
        }
        if after > 0.0 { Arrival::Jump(after) } else { Arrival::Late(-after) }
    }

    /// Whether a line that is not after the sample of a resumed state repeats one that was answered before: the first of the
    /// stream, or one of the last `resent_s` seconds.
    pub fn repeats(&self, t: f64, resent_s: f64) -> bool {
        t == self.begun || t > self.taken - resent_s - self.max_gap
    }

    fn begin(&mut self, t: f64) {
        self.confirming = 0;
        (self.place, self.taken, self.seen) = (t, t, t);
    }

    pub fn memory(&self) -> [f64; 5] {
        [self.place, self.taken, self.seen, self.interval, self.begun]
    }

    /// Restores the values of [`memory`](Self::memory). Invalid values do not panic.
    pub fn restore(&mut self, memory: [f64; 5]) {
        [self.place, self.taken, self.seen, self.interval, self.begun] = memory;
    }
}
