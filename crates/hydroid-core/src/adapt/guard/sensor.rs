//! The gate of one output: a measurement is used, or it is held back.
//!
//! Two series are judged. One has the measurements `y`, the other the measurements less the motion that the learner
//! predicts:
//!
//! ```text
//! w_k = y_k - sum_{i <= k} (y_{i|i-1} - y_{i-1|i-1})
//! ```
//!
//! with its predictions `y_{i|i-1}` and estimates `y_{i|i}`. Motion that the learner predicts is absent in `w`; motion that
//! it does not predict is smooth in `y`; a fault is a jump in both. `e` is the deviation from the line through the used ones
//! of the [`SIDE`] values before, divided by `sqrt(1 + 1/n + (t - mean t)^2 / S_tt)`, and the usual deviation is its root mean
//! square over the [`window`](GuardOptions::window), at least the standard deviation of the noise.
//!
//! - *Sound*: a value with `|e|` above `gate` usual deviations in both series, or one that is repeated to the last bit, is
//!   not used and begins a hold. White noise exceeds four deviations with a probability of 6e-5.
//! - *Held*: a value is used if it agrees with the prediction of the learner (innovation gate),
//!
//!   ```text
//!   |y - y_S| <= gate sqrt(s1^2 + sH^2 t / H)
//!   ```
//!
//!   with the usual deviation `s1` of `w`, the root mean square `sH` of the errors of the learner over the horizon `H` at the
//!   tests, and the samples `t` since the last used value: a random walk of the intensity that the tests measure. As many used
//!   values in a row as there were unused ones, at most [`SIDE`], end the hold. A change at its second value with more than
//!   half of the first change and its sign is motion and ends it too.

use super::options::GuardOptions;
use crate::adapt::are_variances;
use crate::memory::{MOST_COUNTED, Memory};

/// Number of values in a line.
pub(super) const SIDE: usize = 8;

/// Deviations before a sensor is judged.
const WARM_UP: usize = 100;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    Used,
    Missing,
    Unused { deviations: f64 },
    Stuck { repeats: usize },
}

/// A mean square with exponential forgetting.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeanSquare {
    count: usize,
    value: f64,
}

impl MeanSquare {
    /// Adds a deviation, limited to `most` times the root mean square.
    pub(super) fn add(&mut self, deviation: f64, most: f64, window: usize) {
        self.count = self.count.saturating_add(1).min(window);
        let square = (deviation * deviation).min(most * most * self.value);
        self.value += (square - self.value) / (self.count + 1) as f64;
    }

    fn is_known(&self, window: usize) -> bool {
        self.count >= WARM_UP.min(window)
    }

    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.count(&mut self.count, MOST_COUNTED);
        memory.number(&mut self.value);
    }
}

/// The last values of `y` or `w`, relative to the last one and NaN if unused, and their usual deviations.
#[derive(Clone, Copy, Debug)]
struct Series {
    values: [f64; SIDE],
    deviations: MeanSquare,
}

impl Series {
    fn push(&mut self, value: f64) {
        self.values.rotate_left(1);
        self.values[SIDE - 1] = value;
    }

    /// Deviation of the next value from the line; NaN if less than two values are known.
    fn deviation(&self, value: f64) -> f64 {
        let (mut n, mut t_mean, mut x_mean, mut tt, mut tx) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (ago, x) in self.values.iter().rev().enumerate().filter(|(_, x)| !x.is_nan()) {
            let (t, before) = (-1.0 - ago as f64, t_mean);
            n += 1.0;
            t_mean += (t - before) / n;
            x_mean += (x - x_mean) / n;
            tt += (t - before) * (t - t_mean);
            tx += (t - before) * (x - x_mean);
        }
        let line = x_mean - t_mean * tx / tt;
        (value - line) / num_traits::Float::sqrt(1.0 + 1.0 / n + t_mean * t_mean / tt)
    }
}

/// A stretch in which values are compared with the prediction of the learner.
#[derive(Clone, Copy, Debug, Default)]
struct Hold {
    unused: usize,
    /// Used values since the last unused one.
    used: usize,
    /// Change of the measurement at the first value.
    first: f64,
}

/// The sensor of one output.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    /// Standard deviation of the noise \[unit of the output\].
    noise: f64,
    /// `y` and `w`.
    series: [Series; 2],
    hold: Option<Hold>,
    /// Samples since the last used value.
    since: usize,
    /// The last value, the number of its repetitions, and the longest such sequence of the sound sensor.
    last: f64,
    repeats: usize,
    longest: usize,
    /// Errors of the learner over the horizon.
    pub(super) horizon_error: MeanSquare,
}

impl Sensor {
    pub(super) fn new(noise: f64) -> Self {
        let usual = MeanSquare { count: 0, value: noise * noise };
        let series = [Series { values: [f64::NAN; SIDE], deviations: usual }; 2];
        let (since, last, repeats, longest) = (0, f64::NAN, 0, 0);
        Self { noise, series, hold: None, since, last, repeats, longest, horizon_error: usual }
    }

    /// Starts a run. Usual deviations stay.
    pub(super) fn reset(&mut self) {
        self.release();
        (self.last, self.repeats) = (f64::NAN, 0);
    }

    /// Ends a hold: what comes next is judged by what comes next.
    pub(super) fn release(&mut self) {
        self.series.iter_mut().for_each(|series| series.values.fill(f64::NAN));
        (self.hold, self.since) = (None, 0);
    }

    /// Number of values that were not used in the present hold; `None` without one.
    pub(super) fn unused(&self) -> Option<usize> {
        self.hold.map(|hold| hold.unused)
    }

    /// `sqrt(s1^2 + sH^2 share)`: deviation of a measurement from the prediction over this share of the horizon.
    pub(super) fn spread(&self, share: f64) -> f64 {
        let now = self.series[1].deviations.value.max(self.noise * self.noise);
        num_traits::Float::sqrt(now + self.horizon_error.value * share)
    }

    /// Judges a measurement that the learner has `predicted`, with this `motion` since the last one. A hold begins only if it
    /// is permitted.
    pub(super) fn judge(
        &mut self,
        value: f64,
        predicted: f64,
        motion: f64,
        permitted: bool,
        options: &GuardOptions,
    ) -> Verdict {
        self.series[1].values.iter_mut().for_each(|x| *x += motion);
        self.since = self.since.saturating_add(1);
        let (verdict, fits) = self.judged(value, predicted, permitted, options);
        let of_line = if verdict == Verdict::Used && fits { value } else { f64::NAN };
        self.series.iter_mut().for_each(|series| series.push(of_line));
        if verdict == Verdict::Used {
            self.since = 0;
        }
        verdict
    }

    /// The verdict, and whether the value may belong to a line.
    fn judged(
        &mut self,
        value: f64,
        predicted: f64,
        permitted: bool,
        options: &GuardOptions,
    ) -> (Verdict, bool) {
        if !value.is_finite() {
            return (Verdict::Missing, false);
        }
        let change = value - self.last;
        let stuck = self.is_stuck(value, options);
        let begins = self.hold.is_none();
        let (mut deviations, mut known) = (f64::INFINITY, true);
        for series in &mut self.series {
            let deviation = series.deviation(value);
            let usual = num_traits::Float::sqrt(series.deviations.value).max(self.noise);
            known &= series.deviations.is_known(options.window) && !deviation.is_nan();
            deviations = deviations.min(deviation.abs() / usual);
            if begins && !deviation.is_nan() {
                series.deviations.add(deviation, options.gate, options.window);
            }
        }
        let jumps = deviations > options.gate;
        let tolerance = options.gate * self.spread(self.since as f64 / options.horizon as f64);
        let hold = self.hold.get_or_insert(Hold { first: change, ..Hold::default() });
        let moves =
            hold.unused == 1 && self.since == 2 && 2.0 * change * hold.first > hold.first * hold.first;
        let agrees = if begins {
            !(known && jumps && permitted)
        } else {
            moves || (value - predicted).abs() <= tolerance
        };
        if !agrees || (stuck && (permitted || !begins)) {
            (hold.unused, hold.used) = (hold.unused.saturating_add(1), 0);
            let verdict =
                if stuck { Verdict::Stuck { repeats: self.repeats } } else { Verdict::Unused { deviations } };
            return (verdict, false);
        }
        hold.used += 1;
        if moves || hold.used >= hold.unused.min(SIDE) {
            self.hold = None;
        }
        // Values far beyond any range leave no trace in what is usual, before it is known.
        (Verdict::Used, !begins || !jumps || deviations.is_infinite())
    }

    fn is_stuck(&mut self, value: f64, options: &GuardOptions) -> bool {
        let known = self.series[0].deviations.is_known(options.window);
        // Two repetitions of a sensor that has never repeated a value.
        let most = if self.longest == 0 { 2 } else { options.repeats.max(self.longest.saturating_mul(3)) };
        if value == self.last {
            self.repeats = self.repeats.saturating_add(1);
        } else {
            if self.repeats < most || !known {
                self.longest = self.longest.max(self.repeats);
            }
            self.repeats = 0;
        }
        self.last = value;
        known && self.repeats >= most
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        for series in &mut self.series {
            memory.numbers(&mut series.values);
            series.deviations.visit_state(memory);
        }
        self.horizon_error.visit_state(memory);
        let mut is_held = self.hold.is_some();
        let mut hold = self.hold.unwrap_or_default();
        memory.flag(&mut is_held);
        memory.number(&mut hold.first);
        memory.number(&mut self.last);
        let Self { since, repeats, longest, .. } = self;
        for count in [&mut hold.unused, &mut hold.used, since, repeats, longest] {
            memory.count(count, MOST_COUNTED);
        }
        self.hold = is_held.then_some(hold);
    }

    /// Whether the numbers can be those of a sensor.
    pub(super) fn is_sound(&self) -> bool {
        let [y, w] = &self.series;
        are_variances(&[y.deviations.value, w.deviations.value, self.horizon_error.value])
            && y.values.iter().chain(&w.values).all(|x| !x.is_infinite())
    }
}

#[cfg(test)]
mod tests;
