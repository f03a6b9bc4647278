//! Assignment of samples to the time grid of the model.

use hydroid::log::LogError;

/// Largest number of consecutive grid points without a sample, which bounds the work for a line.
const MAX_SKIPPED: f64 = 1e4;
/// Lines in a row beside the grid, with times that do not decrease, that begin a new run: two wrong stamps in a row are
/// tolerated, and a gap or a clock that was set costs two lines.
const CONFIRMING: u32 = 3;
/// A step between lines may be longer than the longest gap if it is at most this multiple of the step before: the lines of
/// such a stream come more rarely than the gap allows.
const RARE: f64 = 2.0;
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
    /// Not after the last sample, but this much \[s\] earlier: not used.
    Late(f64),
    /// Farther ahead than the longest gap \[s\]: not used unless further lines confirm it.
    Ahead(f64),
    /// The last of the lines that confirm that the clock was set back \[s\]: a new run begins.
    SetBack(f64),
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
    /// Last step between two lines of the present run \[s\].
    step: f64,
    /// Time of the last line beside the grid \[s\], and the number of such lines in a row.
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
        let [place, taken, seen, beside] = [unknown; 4];
        Ok(Self { dt, max_gap, place, taken, seen, interval, step: 0.0, beside, confirming: 0 })
    }

    pub fn is_new(&self) -> bool {
        self.taken.is_nan()
    }

    pub fn taken(&self) -> f64 {
        self.taken
    }

    /// Time of the last line on the grid \[s\].
    pub(super) fn seen(&self) -> f64 {
        self.seen
    }

    /// Mean interval of the lines \[s\], at most a step.
    pub(super) fn interval(&self) -> f64 {
        self.interval
    }

    /// Position of a sample; advances to a used sample.
    pub fn arrive(&mut self, t: f64) -> Arrival {
        if self.is_new() {
            self.begin(t);
            return Arrival::First;
        }
        let after = t - self.taken;
        if after == 0.0 {
            // A stamp of coarse resolution, or a line that came twice, contradicts nothing.
            return Arrival::Late(0.0);
        }
        let longest = self.max_gap * (1.0 + 1e-9);
        if after < 0.0 || after > longest.max(RARE * self.step) {
            return self.confirm(t, after);
        }
        (self.confirming, self.beside) = (0, f64::NAN);
        if t <= self.seen {
            // A sample after the last used one is not late, even if it precedes the last line.
            return Arrival::Between;
        }
        self.step = t - self.seen;
        self.interval += TRACKING_GAIN * 2.0 * (self.step.min(self.dt) - self.interval);
        self.seen = t;
        if after > longest {
            self.begin(t);
            return Arrival::Gap(after);
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

    /// A line beside the grid, before the last sample or farther ahead than the longest gap: its stamp may be wrong, or there
    /// was a gap, or the clock was set. A sequence of such lines decides.
    fn confirm(&mut self, t: f64, after: f64) -> Arrival {
        let step = t - self.beside;
        self.confirming =
            if step >= 0.0 && self.confirming > 0 { self.confirming.saturating_add(1) } else { 1 };
        self.beside = t;
        match (self.confirming >= CONFIRMING, after > 0.0) {
            (false, true) => Arrival::Ahead(after),
            (false, false) => Arrival::Late(-after),
            (true, ahead) => {
                self.begin(t);
                self.step = if step.is_finite() { step } else { 0.0 };
                if ahead { Arrival::Gap(after) } else { Arrival::SetBack(-after) }
            }
        }
    }

    /// Number of lines in a row that were set aside.
    pub fn set_aside(&self) -> u32 {
        self.confirming
    }

    /// Believes the next stamp, as at the start of a session.
    pub fn believe_next(&mut self) {
        (self.confirming, self.beside) = (CONFIRMING, f64::NEG_INFINITY);
    }

    /// Whether a line may repeat one that was answered before the restart: one of the last `resent_s` seconds.
    pub fn repeats(&self, t: f64, resent_s: f64) -> bool {
        t <= self.taken && t > self.taken - resent_s - self.max_gap
    }

    fn begin(&mut self, t: f64) {
        (self.confirming, self.beside) = (0, f64::NAN);
        (self.place, self.taken, self.seen) = (t, t, t);
    }

    pub fn memory(&self) -> [f64; 7] {
        let confirming = f64::from(self.confirming);
        [self.place, self.taken, self.seen, self.interval, self.step, self.beside, confirming]
    }

    /// Restores the values of [`memory`](Self::memory); false for values that no clock has.
    #[must_use]
    pub fn restore(&mut self, memory: [f64; 7]) -> bool {
        let confirming;
        [self.place, self.taken, self.seen, self.interval, self.step, self.beside, confirming] = memory;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a cast saturates
        let confirming = confirming as u32;
        self.confirming = confirming;
        let known = [self.place, self.taken, self.seen, self.step].iter().all(|t| t.is_finite());
        let on_grid = (self.taken - self.place).abs() <= self.dt && self.seen >= self.taken;
        let beside = self.beside.is_nan() == (confirming == 0);
        known
            && on_grid
            && beside
            && self.step >= 0.0
            && self.interval > 0.0
            && self.interval <= 2.0 * self.dt
    }
}
