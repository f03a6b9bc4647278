//! Fault detection for the sensor of one output: innovation gate, repeat test, and test for offsets.
//!
//! Two predictors expect each measurement: the model, corrected by the recent mean of its residual, and the
//! extrapolation of the recent motion. Both are fading-memory polynomial filters (Brookner, *Tracking and Kalman
//! Filtering Made Easy*, 1998, section 7.2), of degree 0 on the residual and of degree 1 on the measurement. With the
//! innovation `z` and its root mean square `s` over the last 200 samples:
//!
//! | fault | condition |
//! | --- | --- |
//! | outlier | `z^2 / s^2 > gate^2` for both predictors: a chi-squared test with one degree of freedom |
//! | stuck | the value repeats bit for bit, longer than this sensor ever did |
//! | offset | likelihood ratio of a series of outliers, below |
//!
//! A series of outliers `z_j`, `j = 0, 1, ..`, from the predictions before it, ends when
//!
//! - a measurement is inside the gate and has lost half of the first deviation: the outliers were spikes;
//! - the generalised likelihood ratio shows motion of the vessel, or the series is `patience` long: it is an offset if the
//!   ratio shows that, else motion.
//!
//! An offset is the line `z_j = c + a j`; motion starts at zero, `z_j = a (j + 1) + q (j + 1)^2`. Both have two parameters,
//! fitted by least squares. With the sums of squared residuals `R_o` and `R_m`, the ratio shows an offset if
//! `R_m - R_o > gate^2 s^2` for both predictors, and motion if `R_o - R_m > gate^2 s^2` and `R_m < gate^2 s^2` for one of
//! them: the likelihoods then differ by the factor `exp(gate^2 / 2)`.

use super::options::GuardOptions;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};

/// Weight of the past in a predictor, per sample: a memory of about three samples.
const FADING: f64 = 0.7;

/// Samples in the mean square of the innovations. Half of them precede the first judgement.
const MEMORY: usize = 200;

/// Samples after a start of the predictors without judgement.
const SETTLING: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Use the measurement.
    Sound,
    /// There is no measurement.
    Missing,
    /// Reject an outlier.
    Spike { deviations: f64 },
    /// Reject a repeated value.
    Stuck { repeats: usize },
    /// Use the measurement without an offset of this total size.
    Offset { offset: f64 },
    /// Use the measurement: the suspected fault was motion of the vessel.
    Believed { deviations: f64 },
}

/// The sensor of one output.
#[derive(Clone, Debug, Default)]
pub(super) struct Sensor {
    /// Predictors of the residual of the model, and of the measurement.
    trackers: [Tracker; 2],
    /// Samples in the mean squares, and samples until the predictors have settled.
    seen: usize,
    settling: usize,
    /// The last raw value, the number of its repetitions, and the longest such series of the sound sensor.
    last: f64,
    repeats: usize,
    longest: usize,
    /// Length of the series of outliers.
    series: usize,
    /// Samples since the last used measurement.
    pub(super) missing: usize,
    pub(super) offset: f64,
}

impl Sensor {
    pub(super) const MEMORY_LEN: usize = 8 + 2 * Tracker::MEMORY_LEN;

    pub(super) fn new() -> Self {
        let mut own = Self { trackers: [0, 1].map(Tracker::new), ..Self::default() };
        own.reset();
        own
    }

    /// Starts a run. Offset and mean squares stay.
    pub(super) fn reset(&mut self) {
        (self.last, self.repeats, self.missing) = (f64::NAN, 0, 0);
        self.settle();
    }

    fn settle(&mut self) {
        self.series = 0;
        self.settling = SETTLING;
        self.trackers.iter_mut().for_each(Tracker::restart);
    }

    /// A sample without a measurement: the predictors extrapolate, and start again after a long silence.
    fn skip(&mut self, options: &GuardOptions) {
        if self.missing >= options.patience {
            self.settle();
        } else {
            self.trackers.iter_mut().for_each(|tracker| tracker.level += tracker.slope);
        }
    }

    /// Judges a measurement that the model expects at `expected`.
    pub(super) fn judge(&mut self, value: f64, expected: f64, options: &GuardOptions) -> Verdict {
        let verdict = self.judged(value, expected, options);
        let used = matches!(verdict, Verdict::Sound | Verdict::Offset { .. } | Verdict::Believed { .. });
        self.missing = if used { 0 } else { self.missing.saturating_add(1) };
        verdict
    }

    fn judged(&mut self, value: f64, expected: f64, options: &GuardOptions) -> Verdict {
        if !value.is_finite() {
            self.skip(options);
            return Verdict::Missing;
        }
        if self.repeats(value, options) {
            self.skip(options);
            return Verdict::Stuck { repeats: self.repeats };
        }
        let corrected = value - self.offset;
        let signals = [corrected - expected, corrected];
        let deviations = self
            .trackers
            .iter_mut()
            .zip(signals)
            .map(|(tracker, signal)| tracker.innovate(signal))
            .fold(f64::INFINITY, f64::min);
        let judges = self.settling == 0 && 2 * self.seen >= MEMORY && deviations.is_finite();
        self.settling = self.settling.saturating_sub(1);
        let within = deviations <= options.gate;
        if !judges || (within && (self.series == 0 || self.trackers.iter().any(Tracker::is_back))) {
            self.series = 0;
            let seen = self.seen.min(MEMORY - 1);
            self.trackers.iter_mut().for_each(|tracker| tracker.update(seen, options.gate));
            self.seen = self.seen.saturating_add(1);
            return Verdict::Sound;
        }
        self.trackers.iter_mut().for_each(|tracker| tracker.extend_series(self.series));
        self.series += 1;
        let fits = self.trackers.map(|tracker| tracker.fit(self.series));
        let known = || fits.iter().flatten();
        let most = options.gate * options.gate;
        let ends = self.series >= options.patience;
        let best = known().min_by(|a, b| a.offset_misfit.total_cmp(&b.offset_misfit));
        if let (true, Some(best)) = (ends, best)
            && known().all(|fit| fit.motion_misfit - fit.offset_misfit > most)
        {
            self.offset += best.offset;
            self.settle();
            return Verdict::Offset { offset: self.offset };
        }
        let moves = |fit: &Fit| fit.motion_misfit < most && fit.offset_misfit - fit.motion_misfit > most;
        if ends || known().any(moves) {
            self.settle();
            return Verdict::Believed { deviations };
        }
        Verdict::Spike { deviations }
    }

    /// Whether the sensor is stuck: the value repeats more often than ever, at least `repeats` times, or twice if this
    /// sensor never repeated a value.
    fn repeats(&mut self, value: f64, options: &GuardOptions) -> bool {
        let limit = if self.longest == 0 { 2 } else { options.repeats.max(self.longest.saturating_mul(3)) };
        let warm = 2 * self.seen >= MEMORY;
        if value == self.last {
            self.repeats = self.repeats.saturating_add(1);
        } else {
            if self.repeats < limit || !warm {
                self.longest = self.longest.max(self.repeats);
            }
            self.repeats = 0;
        }
        self.last = value;
        warm && self.repeats >= limit
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&[self.last, self.offset]);
        for count in [self.seen, self.settling, self.repeats, self.longest, self.series, self.missing] {
            into.count(count);
        }
        self.trackers.iter().for_each(|tracker| tracker.save(into));
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        let mut numbers = [0.0; 2];
        from.numbers(&mut numbers);
        [self.last, self.offset] = numbers;
        let counts = [&mut self.seen, &mut self.settling, &mut self.repeats, &mut self.longest];
        for count in counts.into_iter().chain([&mut self.series, &mut self.missing]) {
            *count = from.count(MOST_COUNTED);
        }
        self.trackers.iter_mut().for_each(|tracker| tracker.load(from));
    }
}

/// A fading-memory polynomial filter of degree 0 or 1, with the mean square of its innovations.
#[derive(Clone, Copy, Debug, Default)]
struct Tracker {
    degree: usize,
    /// State; NaN before the first value.
    level: f64,
    slope: f64,
    /// Values since the last start.
    count: usize,
    /// `s^2`.
    mean_square: f64,
    /// The last innovation; the first one of a series, and sums over the series with `x = j + 1`: `z`, `x z`, `x^2 z`,
    /// `z^2`.
    innovation: f64,
    first: f64,
    sums: [f64; 4],
}

impl Tracker {
    const MEMORY_LEN: usize = 10;

    fn new(degree: usize) -> Self {
        Self { degree, level: f64::NAN, ..Self::default() }
    }

    fn restart(&mut self) {
        (self.level, self.slope, self.count) = (f64::NAN, 0.0, 0);
    }

    fn scale(&self) -> f64 {
        num_traits::Float::sqrt(self.mean_square)
    }

    /// Compares a value with the prediction. Returns the normalized innovation, NaN without a prediction.
    fn innovate(&mut self, value: f64) -> f64 {
        let predicted = self.level + self.slope;
        self.innovation = value - predicted;
        self.level = if predicted.is_nan() { value } else { predicted };
        self.innovation.abs() / self.scale()
    }

    /// Adds the last value to the filter, and its innovation to the mean square, limited to the gate.
    fn update(&mut self, seen: usize, gate: f64) {
        let z = self.innovation;
        self.count += 1;
        if z.is_nan() {
            return;
        }
        // Gains of the growing memory until they fall to those of the fading memory.
        let n = self.count as f64;
        let (alpha, beta) = if self.degree == 0 {
            ((1.0 / n).max(1.0 - FADING), 0.0)
        } else {
            let growing = 2.0 * (2.0 * n - 1.0) / (n * (n + 1.0));
            let fading = 1.0 - FADING * FADING;
            if growing > fading {
                (growing, 6.0 / (n * (n + 1.0)))
            } else {
                (fading, (1.0 - FADING) * (1.0 - FADING))
            }
        };
        self.level += alpha * z;
        self.slope += beta * z;
        let most = if 2 * seen >= MEMORY { gate * gate * self.mean_square } else { f64::INFINITY };
        self.mean_square += ((z * z).min(most) - self.mean_square) / (seen + 1) as f64;
    }

    /// Whether the last value is inside the gate's half of the first deviation of the series.
    fn is_back(&self) -> bool {
        2.0 * self.innovation.abs() <= self.first.abs()
    }

    fn extend_series(&mut self, place: usize) {
        if place == 0 {
            (self.first, self.sums) = (self.innovation, [0.0; 4]);
        }
        let (x, z) = ((place + 1) as f64, self.innovation);
        for (sum, more) in self.sums.iter_mut().zip([z, x * z, x * x * z, z * z]) {
            *sum += more;
        }
    }

    /// Least-squares fits of an offset and of motion; `None` for fewer than three innovations, or without a prediction.
    fn fit(&self, len: usize) -> Option<Fit> {
        let n = len as f64;
        let [z, xz, xxz, zz] = self.sums;
        let (mean, spread) = (0.5 * (n + 1.0), n * (n * n - 1.0) / 12.0);
        let slope = (xz - mean * z) / spread;
        // Sums of the powers 2, 3 and 4 of 1..n, and the normal equations of a x + q x^2.
        let (square, cube) = (n * (n + 1.0) * (2.0 * n + 1.0) / 6.0, n * n * (n + 1.0) * (n + 1.0) / 4.0);
        let fourth = square * (3.0 * n * n + 3.0 * n - 1.0) / 5.0;
        let determinant = square * fourth - cube * cube;
        let a = (fourth * xz - cube * xxz) / determinant;
        let q = (square * xxz - cube * xz) / determinant;
        let fit = Fit {
            offset: z / n - (mean - 1.0) * slope,
            offset_misfit: (zz - z * z / n - slope * slope * spread) / self.mean_square,
            motion_misfit: (zz - a * xz - q * xxz) / self.mean_square,
        };
        (len >= 3 && fit.offset_misfit.is_finite()).then_some(fit)
    }

    fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&[self.level, self.slope, self.mean_square, self.innovation, self.first]);
        into.numbers(&self.sums);
        into.count(self.count);
    }

    fn load(&mut self, from: &mut Reader<'_>) {
        let mut numbers = [0.0; 5];
        from.numbers(&mut numbers);
        [self.level, self.slope, self.mean_square, self.innovation, self.first] = numbers;
        from.numbers(&mut self.sums);
        self.count = from.count(MOST_COUNTED);
    }
}

/// Fits of a series of outliers: the offset `c`, and the misfits `R_o / s^2` and `R_m / s^2`.
#[derive(Clone, Copy, Debug)]
struct Fit {
    offset: f64,
    offset_misfit: f64,
    motion_misfit: f64,
}

#[cfg(test)]
mod tests;
