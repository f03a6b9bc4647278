//! Sensor check of one output: spikes, stuck values.
//!
//! Two series are judged. One has the measurements `y`, the other the measurements less the motion that the active
//! model predicts:
//!
//! ```text
//! w_k = y_k - sum_{i <= k} (y_{i|i-1} - y_{i-1|i-1})
//! ```
//!
//! with its predictions `y_{i|i-1}` and estimates `y_{i|i}`. Motion that the model predicts is absent in `w`; motion that
//! it does not predict is smooth in `y`; a fault is a jump in both. A test therefore needs both series.
//!
//! - *Spike* (chi-squared gate): `e` is the deviation from the line through the [`SIDE`] values before, divided by
//!   `sqrt(1 + 1/n + (t - mean t)^2 / S_tt)`. A measurement with `|e| > spike d` in both series is not used, where `d` is
//!   the root mean square of `e` over the [`window`](GuardOptions::window), at least the standard deviation of the noise.
//!   Unused measurements do not belong to the line, which needs two values. White noise exceeds four deviations with a
//!   probability of 6e-5. The change at the measurement after a spike, relative to the change at the spike, decides what the
//!   spike was: near 0, the fault goes on (for at most `SIDE - 1` measurements); near 1, the vessel accelerates, and the
//!   measurement is used; near -1, it is judged by the line again.
//! - *Stuck*: a value is repeated to the last bit.

use super::options::GuardOptions;
use crate::adapt::are_variances;
use crate::memory::{MOST_COUNTED, Memory};

/// Number of values in a line.
pub(super) const SIDE: usize = 8;

/// Values of a series: a line and the last value.
const LEN: usize = SIDE + 1;

/// Deviations before a sensor is judged.
const WARM_UP: usize = 100;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Use the measurement.
    Sound,
    /// There is no measurement.
    Missing,
    /// Do not use the measurement.
    Spike { deviations: f64 },
    /// Do not use a repeated value.
    Stuck { repeats: usize },
}

/// Points `(t, x)`: their number, means, and sums of squares and products about the means.
#[derive(Clone, Copy, Default)]
struct Moments {
    n: f64,
    t: f64,
    x: f64,
    tt: f64,
    tx: f64,
}

impl Moments {
    /// Moments of values, the last one at time `last`; `None` if less than `least` are known.
    fn of(values: &[f64], last: f64, excluded: u32, least: usize) -> Option<Self> {
        let mut m = Self::default();
        for (ago, x) in values.iter().rev().enumerate() {
            if x.is_nan() || excluded >> ago & 1 == 1 {
                continue;
            }
            let (t, n) = (last - ago as f64, m.n + 1.0);
            let (dt, dx) = (t - m.t, x - m.x);
            (m.n, m.t, m.x) = (n, m.t + dt / n, m.x + dx / n);
            m.tt += dt * (t - m.t);
            m.tx += dt * (x - m.x);
        }
        (m.n >= least as f64).then_some(m)
    }
}

/// A mean square with exponential forgetting.
#[derive(Clone, Copy, Debug, Default)]
struct MeanSquare {
    count: usize,
    value: f64,
}

impl MeanSquare {
    /// Adds a deviation, limited to `most` times the root mean square.
    fn add(&mut self, deviation: f64, most: f64, window: usize) {
        self.count = self.count.saturating_add(1).min(window);
        let square = (deviation * deviation).min(most * most * self.value);
        self.value += (square - self.value) / (self.count + 1) as f64;
    }

    fn is_known(&self, window: usize) -> bool {
        self.count >= WARM_UP.min(window)
    }

    fn root(&self) -> f64 {
        num_traits::Float::sqrt(self.value)
    }
}

/// The last values of `y` or `w`, relative to the last one, and their usual deviations.
#[derive(Clone, Copy, Debug)]
struct Series {
    values: [f64; LEN],
    deviations: MeanSquare,
}

impl Series {
    /// Appends a value after a predicted `motion`, by which earlier values are moved.
    fn push(&mut self, value: f64, motion: f64) {
        self.values.rotate_left(1);
        self.values.iter_mut().for_each(|x| *x += motion);
        self.values[LEN - 1] = value;
    }

    /// Deviation of the last value from the line before; NaN if either is unknown.
    fn deviation(&self, excluded: u32) -> f64 {
        let Some(m) = Moments::of(&self.values[..SIDE], -1.0, excluded >> 1, 2) else {
            return f64::NAN;
        };
        let line = m.x - m.t * m.tx / m.tt;
        (self.values[LEN - 1] - line) / num_traits::Float::sqrt(1.0 + 1.0 / m.n + m.t * m.t / m.tt)
    }
}

/// The sensor of one output.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    /// Standard deviation of the noise \[unit of the output\].
    noise: f64,
    /// `y` and `w`.
    series: [Series; 2],
    /// Bit `i`: the measurement `i` samples ago was a spike.
    excluded: u32,
    /// Change at the first of the deviating measurements in a row, in `y`; NaN if the last one did not deviate.
    first: f64,
    /// The last value, the number of its repetitions, and the longest such sequence of the sound sensor.
    last: f64,
    repeats: usize,
    longest: usize,
    pub(super) missing: usize,
}

impl Sensor {
    pub(super) fn new(noise: f64) -> Self {
        let usual = MeanSquare { count: 0, value: noise * noise };
        let series = Series { values: [f64::NAN; LEN], deviations: usual };
        let (first, last) = (f64::NAN, f64::NAN);
        let (excluded, repeats, longest, missing) = (0, 0, 0, 0);
        Self { noise, series: [series; 2], excluded, first, last, repeats, longest, missing }
    }

    /// Starts a run. Usual deviations stay.
    pub(super) fn reset(&mut self) {
        self.series.iter_mut().for_each(|series| series.values.fill(f64::NAN));
        (self.excluded, self.first, self.last) = (0, f64::NAN, f64::NAN);
        (self.repeats, self.missing) = (0, 0);
    }

    /// Judges a measurement after a predicted `motion` since the last one.
    pub(super) fn judge(&mut self, value: f64, motion: f64, options: &GuardOptions) -> Verdict {
        let verdict = self.judged(value, motion, options);
        self.missing = if verdict == Verdict::Sound { 0 } else { self.missing.saturating_add(1) };
        verdict
    }

    fn judged(&mut self, value: f64, motion: f64, options: &GuardOptions) -> Verdict {
        let stuck = value.is_finite() && self.is_stuck(value, options);
        let used = if value.is_finite() && !stuck { value } else { f64::NAN };
        self.series[0].push(used, 0.0);
        self.series[1].push(used, motion);
        self.excluded <<= 1;
        if stuck {
            return Verdict::Stuck { repeats: self.repeats };
        }
        if used.is_nan() {
            return Verdict::Missing;
        }
        let stays = self.stays();
        let (mut least, mut known) = (f64::INFINITY, true);
        for series in &mut self.series {
            let deviation = series.deviation(self.excluded);
            let usual = series.deviations.root().max(self.noise);
            known &= series.deviations.is_known(options.window) && !deviation.is_nan();
            least = least.min(deviation.abs() / usual);
            if !deviation.is_nan() {
                series.deviations.add(deviation, options.spike, options.window);
            }
        }
        if stays {
            self.excluded |= 1;
            // The line may have lost its points.
            return Verdict::Spike { deviations: if known { least } else { options.spike } };
        }
        if !known || least <= options.spike {
            self.excluded |= u32::from(least.is_finite() && least > options.spike);
            self.first = f64::NAN;
            return Verdict::Sound;
        }
        let change = self.change();
        if 2.0 * change * self.first > self.first * self.first {
            return Verdict::Sound;
        }
        self.first = change;
        self.excluded |= 1;
        Verdict::Spike { deviations: least }
    }

    fn change(&self) -> f64 {
        self.series[0].values[LEN - 1] - self.series[0].values[LEN - 2]
    }

    /// Whether a measurement after a spike is nearer to the spike than to the value before it and to the continuation of
    /// the change: it belongs to the same fault, for at most as many measurements as a line has.
    fn stays(&self) -> bool {
        let row = (self.excluded >> 1).trailing_ones() as usize;
        (1..SIDE - 1).contains(&row) && 2.0 * self.change().abs() < self.first.abs()
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
            memory.count(&mut series.deviations.count, MOST_COUNTED);
            memory.number(&mut series.deviations.value);
        }
        for number in [&mut self.first, &mut self.last] {
            memory.number(number);
        }
        let mut excluded = self.excluded as usize;
        memory.count(&mut excluded, u32::MAX as usize);
        self.excluded = u32::try_from(excluded).unwrap_or_default();
        for count in [&mut self.repeats, &mut self.longest, &mut self.missing] {
            memory.count(count, MOST_COUNTED);
        }
    }

    /// Whether the numbers can be those of a sensor.
    pub(super) fn is_sound(&self) -> bool {
        let sound = |series: &Series| {
            are_variances(&[series.deviations.value]) && series.values.iter().all(|x| !x.is_infinite())
        };
        self.series.iter().all(sound)
    }
}

#[cfg(test)]
mod tests;
