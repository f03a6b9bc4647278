//! Fault detection for the sensor of one output: outliers, stuck values, offsets.

mod track;

use super::options::GuardOptions;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};
use track::{APART, SAME, Track};

/// Number of expected values: of the adapted and the reference model, then of the extrapolated motion.
pub(super) const EXPECTED: usize = 3;

/// Index of the track of persistence, which expects the last used value.
const HELD: usize = EXPECTED;

/// Measurements before a channel is screened.
const WARM_UP: usize = 100;

/// First measurements of a run without screening and learning: the states of the models settle.
const SETTLING: usize = 20;

/// Time constant of the mean square of the jumps \[measurements\].
const MEMORY: f64 = 200.0;

/// Number of first measurements of a series whose mean deviation is the offset.
const FIRST: usize = 3;

/// A jump is isolated where the previous change, or the previous change of the change, was smaller by this factor.
const ALONE: f64 = 3.0;

/// Growth of a deviation, relative to the first, that only motion explains (beyond noise, for a small deviation).
const AWAY: f64 = 1.4;

/// A vessel does not return by itself from a jump of more than `HUGE` times the RMS. Above `SURE` a lasting jump is an
/// offset even if models drift without measurements.
const HUGE: f64 = 13.0;
const SURE: f64 = 20.0;

/// Number of tracks that form a majority.
const MOST: usize = 3;

/// Bound on the jumps in the mean square, relative to the RMS.
const SOUND: f64 = 4.0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Use the measurement.
    Sound,
    /// There is no measurement.
    Missing,
    /// Use the measurement with inflated noise variance.
    Inflate { deviations: f64, factor: f64 },
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
///
/// The test variable is the *jump* of the innovation from its recent mean, relative to the root mean square `s` of the
/// jumps: a slow filter has large, smooth innovations, while a jump is sensor noise. Innovations are computed for each
/// expectation: both models, the extrapolated motion, and persistence. The smallest jump counts, because models
/// without measurements drift, and a vessel does not jump.
///
/// - A jump of more than [`reject`](GuardOptions::reject) `s` without a similar change of the measurement before is an
///   outlier. So are the following measurements at a similar distance, except one that jumps back most of the way.
/// - After [`patience`](GuardOptions::patience) such measurements the sensor has an offset, if some expectation finds
///   them at a constant distance (up to noise and drift, and within half of the first jump).
/// - For a first jump below [`SURE`], all of them must agree. Below [`HUGE`], a majority of expectations must agree,
///   none may find less than half of the jump left, and their mean must exceed [`SAME`] deviations of the noise. Above
///   [`SURE`], a deviation of the second measurement suffices.
/// - Otherwise the deviation is motion of the vessel. A deviation below [`HUGE`] is motion at once if it grows by two
///   fifths and beyond noise.
#[derive(Clone, Debug, Default)]
pub(super) struct Sensor {
    /// Standard deviation of the noise \[unit of the output\].
    noise: f64,
    /// Measurements of this run, and jumps in the mean square.
    begun: usize,
    seen: usize,
    /// `s^2`.
    usual: f64,
    /// The last raw value, the number of its repetitions, and the longest such series of the sound sensor.
    last: f64,
    repeats: usize,
    longest: usize,
    /// The last change of the measurement, and the last change before a rejected series: the return from
    /// an outlier does not hide the next outlier.
    step: f64,
    calm: f64,
    /// The last change of the change: an outlier on a smooth acceleration is isolated as well.
    swing: f64,
    /// Length of the rejected series, and the change at its first measurement.
    streak: usize,
    jump: f64,
    /// Deviation of the first measurement of the series; zero if the measurement before it was not near the
    /// expectation.
    first: f64,
    /// Its minimum since the last used measurement: adjacent outliers restart the series.
    begun_by: f64,
    /// Whether the second measurement deviated by at least half of the first deviation.
    lasts: bool,
    held: f64,
    /// Innovations of each expectation, with persistence last.
    tracks: [Track; EXPECTED + 1],
    pub(super) missing: usize,
    pub(super) offset: f64,
}

impl Sensor {
    pub(super) fn new(noise: f64) -> Self {
        let mut own = Self { noise, ..Self::default() };
        own.reset();
        own
    }

    pub(super) const MEMORY_LEN: usize = 17 + Track::MEMORY_LEN * (EXPECTED + 1);

    pub(super) fn reset(&mut self) {
        self.begun = 0;
        self.last = f64::NAN;
        self.step = f64::NAN;
        self.calm = f64::NAN;
        self.swing = f64::NAN;
        self.repeats = 0;
        self.streak = 0;
        self.missing = 0;
        self.held = f64::NAN;
        self.tracks = [Track::new(); EXPECTED + 1];
    }

    pub(super) fn judge(&mut self, value: f64, expected: [f64; EXPECTED], options: &GuardOptions) -> Verdict {
        let verdict = self.judged(value, expected, options);
        let used = matches!(
            verdict,
            Verdict::Sound | Verdict::Inflate { .. } | Verdict::Offset { .. } | Verdict::Believed { .. }
        );
        self.missing = if used { 0 } else { self.missing.saturating_add(1) };
        if used {
            (self.held, self.tracks[HELD].last) = (value - self.offset, 0.0);
        }
        verdict
    }

    fn judged(&mut self, value: f64, expected: [f64; EXPECTED], options: &GuardOptions) -> Verdict {
        if !value.is_finite() {
            self.end_series();
            return Verdict::Missing;
        }
        let warm = self.seen >= WARM_UP;
        if value == self.last {
            self.repeats = self.repeats.saturating_add(1);
        } else {
            if self.repeats < self.limit(options) || !warm {
                self.longest = self.longest.max(self.repeats);
            }
            self.repeats = 0;
        }
        let before = [self.step, self.swing];
        self.step = value - self.last;
        self.swing = self.step - before[0];
        self.last = value;
        if warm && self.repeats >= self.limit(options) {
            self.end_series();
            return Verdict::Stuck { repeats: self.repeats };
        }
        let [a, b, c] = expected;
        let innovations = [a, b, c, self.held].map(|expected| value - self.offset - expected);
        self.classify(innovations, before, warm, options)
    }

    fn end_series(&mut self) {
        if self.streak > 0 {
            self.tracks.iter_mut().for_each(Track::forget);
        }
        self.streak = 0;
    }

    fn classify(
        &mut self,
        innovations: [f64; EXPECTED + 1],
        before: [f64; 2],
        warm: bool,
        options: &GuardOptions,
    ) -> Verdict {
        let in_series = self.streak > 0;
        let (mut jump, mut same) = (f64::NAN, false);
        for (track, innovation) in self.tracks.iter_mut().zip(innovations) {
            track.update(innovation, in_series);
            let own = track.jump();
            if jump.is_nan() || own.abs() < jump.abs() {
                jump = own;
            }
            // One constant deviation suffices, because other models may drift.
            same |= in_series && track.is_same(self.noise);
        }
        self.begun = self.begun.saturating_add(1);
        // There is no expectation, or the models have drifted during an outage.
        if jump.is_nan() || self.begun <= SETTLING || (self.missing > 0 && !in_series) {
            self.streak = 0;
            return Verdict::Sound;
        }
        let usual = num_traits::Float::sqrt(self.usual);
        let deviations = jump.abs() / usual;
        let jumps = self.jumps();
        let back = jumps && 2.0 * deviations < self.first && deviations < HUGE * self.streak as f64;
        let remains = self.first > HUGE && !jumps;
        // A smaller deviation after an outlier is motion of the vessel during the series.
        if in_series && !back && (same || remains || deviations > options.reject) {
            return self.continue_series(deviations, before[0], options);
        }
        if in_series {
            (self.step, self.swing) = (self.calm, f64::NAN);
        }
        if in_series && deviations > options.inflate {
            self.tracks.iter_mut().for_each(Track::settle);
        }
        self.streak = 0;
        // A jump of the expectation alone is a jump of the model.
        let alone = |before: f64, now: f64| before.abs() * ALONE < now.abs() && 2.0 * now.abs() > jump.abs();
        let alone = alone(before[0], self.step) || alone(before[1], self.swing);
        let off = warm && deviations > options.inflate;
        if off && alone && deviations > options.reject {
            (self.streak, self.calm) = (1, before[0]);
            self.jump = self.leap();
            self.begin_series(usual, options);
            return Verdict::Spike { deviations };
        }
        self.learn(jump, warm);
        if off && alone {
            Verdict::Inflate { deviations, factor: num_traits::Float::powi(deviations / options.inflate, 2) }
        } else {
            Verdict::Sound
        }
    }

    /// Starts a series. Its measurements are compared with the mean innovations before it: the last one may contain a
    /// small outlier.
    fn begin_series(&mut self, usual: f64, options: &GuardOptions) {
        let mut least = f64::INFINITY;
        let mut from_it = false;
        for (at, track) in self.tracks.iter_mut().enumerate() {
            let own = track.jump();
            // If the measurement before was not near the expectation, this jump is the return to it.
            let jumps = own.abs() > options.reject * usual && 2.0 * track.before.abs() < own.abs();
            from_it |= jumps && at != HELD;
            track.begin();
            least = least.min(track.sum.abs());
            if !jumps || (at == HELD && !from_it) {
                track.first = f64::NAN;
            }
        }
        self.first = if from_it { least / usual } else { 0.0 };
        self.begun_by = self.first;
    }

    /// Size of the last jump, less the change before the series: a decelerating vessel keeps decelerating.
    fn leap(&self) -> f64 {
        self.step.abs().min((self.step - self.calm).abs())
    }

    /// Whether the last jump is comparable with the first of the series.
    fn jumps(&self) -> bool {
        self.leap() * ALONE > self.jump
    }

    fn continue_series(&mut self, deviations: f64, before: f64, options: &GuardOptions) -> Verdict {
        self.streak += 1;
        // Three growing deviations with similar steps are motion.
        let alike = before * self.step > 0.0 && self.step.abs() <= ALONE * before.abs();
        let away = self.step * self.tracks[HELD].last > 0.0 && deviations > AWAY * self.begun_by;
        let farther = alike && away;
        if farther && self.missing + 1 >= FIRST {
            self.streak = 0;
            return Verdict::Believed { deviations };
        }
        if self.streak == 2 {
            self.lasts = 2.0 * deviations >= self.first;
        }
        let mut another = self.jumps();
        let usual = num_traits::Float::sqrt(self.usual);
        let other = f64::max(0.5 * self.first, options.reject) * usual;
        for track in &mut self.tracks {
            another &= track.drift.is_nan() || track.drift > other;
            track.continue_series(self.noise, self.streak <= FIRST);
        }
        if another {
            // Adjacent outliers are compared with the innovations before the first.
            self.streak = 1;
            self.tracks.iter_mut().for_each(Track::begin);
            (self.jump, self.first) = (self.leap().min(deviations * usual), deviations);
            self.begun_by = self.begun_by.min(deviations);
            return Verdict::Spike { deviations };
        }
        // The start of a turn resembles a small outlier, and grows.
        let small = self.first <= HUGE;
        if small && deviations > f64::max(AWAY * self.first, self.first + APART) {
            self.streak = 0;
            return Verdict::Believed { deviations };
        }
        if self.streak < options.patience {
            return Verdict::Spike { deviations };
        }
        // It is motion if no expectation finds a constant deviation, or, for small deviations, no majority does.
        let sure = self.first > SURE;
        let known = || self.tracks.iter().filter(|track| track.sum.is_finite());
        let same = |track: &&Track| !track.first.is_nan() && (sure || track.spread() <= SAME * self.noise);
        let agreed = || 2.0 * deviations >= self.first && known().filter(same).count() >= MOST;
        let far = |track: &Track| track.off(self.streak, FIRST) >= SAME * self.noise;
        let steadiest = || known().min_by(|a, b| a.spread().total_cmp(&b.spread()));
        let found = known().find(same).filter(|track| !small || (agreed() && far(track)));
        let Some(track) = found.or_else(|| steadiest().filter(|_| sure && self.lasts)) else {
            self.streak = 0;
            return Verdict::Believed { deviations };
        };
        let more = track.sum / self.streak.min(FIRST) as f64;
        self.streak = 0;
        self.offset += more;
        self.tracks.iter_mut().for_each(|track| track.last -= more);
        Verdict::Offset { offset: self.offset }
    }

    /// Number of repetitions of a stuck sensor; 2 for a sensor that has never repeated a value.
    fn limit(&self, options: &GuardOptions) -> usize {
        if self.longest == 0 { 2 } else { options.repeats.max(self.longest.saturating_mul(3)) }
    }

    fn learn(&mut self, jump: f64, warm: bool) {
        self.seen = self.seen.saturating_add(1);
        let share = (1.0 / MEMORY).max(1.0 / self.seen as f64);
        let most = if warm { SOUND * SOUND * self.usual } else { f64::INFINITY };
        self.usual += share * ((jump * jump).min(most) - self.usual);
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&[self.usual, self.last, self.offset, self.step, self.calm]);
        into.numbers(&[self.jump, self.first, self.held, self.swing, self.begun_by]);
        into.flag(self.lasts);
        self.tracks.iter().for_each(|track| track.save(into));
        for count in [self.begun, self.seen, self.repeats, self.longest, self.streak, self.missing] {
            into.count(count);
        }
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        let mut numbers = [0.0; 10];
        from.numbers(&mut numbers);
        let [usual, last, offset, step, calm, jump, first, held, swing, begun_by] = numbers;
        (self.usual, self.last, self.offset) = (usual, last, offset);
        (self.step, self.calm, self.jump, self.first) = (step, calm, jump, first);
        (self.held, self.swing, self.begun_by) = (held, swing, begun_by);
        self.lasts = from.flag();
        self.tracks.iter_mut().for_each(|track| track.load(from));
        let counts = [&mut self.begun, &mut self.seen, &mut self.repeats, &mut self.longest];
        for count in counts.into_iter().chain([&mut self.streak, &mut self.missing]) {
            *count = from.count(MOST_COUNTED);
        }
    }
}

#[cfg(test)]
mod tests;
