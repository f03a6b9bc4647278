//! Whether an output was measured or only said to be.

use super::event::Expert;
use super::settings::GuardSettings;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};

const EXPERTS: usize = Expert::ALL.len();

/// Measurements of a channel before it is judged.
const WARM_UP: usize = 100;

/// Time constant of the usual size of innovations \[measurements\].
const MEMORY: f64 = 200.0;

/// Two measurements of a sensor with an offset differ from what is expected by the same, up to so many deviations of its noise.
const SAME: f64 = 5.0;

/// Innovations of less than this many deviations are what a sound sensor gives.
const SOUND: f64 = 4.0;

/// What a sensor said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Use it.
    Sound,
    /// Nothing was measured.
    Missing,
    /// Use it as a noisier one.
    Inflate { deviations: f64, factor: f64 },
    /// Not this one.
    Spike { deviations: f64 },
    /// It repeats itself, since so many measurements.
    Stuck { repeats: usize },
    /// It has an offset from now on, of so much in all: use it without.
    Offset { offset: f64 },
    /// It was refused for as long as patience lasts: use it from now on.
    Believed { deviations: f64 },
}

/// One output's sensor.
///
/// Innovations are those of the model that expected it best, judged against what is usual of them, `s`, their root mean square:
/// the noise that a filter is told is often inflated on purpose. Faults begin between one measurement and the next;
/// innovations that grow are a vessel whom the models do not know. One measurement that is farther off than
/// [`reject`](GuardSettings::reject), after one that was not, is a spike, and so are those that follow it with the same
/// innovation of some model, but for noise: after [`patience`](GuardSettings::patience) of them it is an offset of the
/// sensor (a vessel does not jump and then move as if it had not). One that follows with another innovation is the vessel after
/// all.
#[derive(Clone, Debug, Default)]
pub(super) struct Sensor {
    /// Standard deviation of its noise, in its unit.
    noise: f64,
    /// Innovations that were used.
    seen: usize,
    /// `s^2`.
    usual: f64,
    /// The last value as it came, how often it was repeated, and the longest such series of the sound sensor.
    last: f64,
    repeats: usize,
    longest: usize,
    /// Measurements in series that were refused.
    streak: usize,
    /// What each model makes of them.
    tracks: [Track; EXPERTS],
    /// Samples without a measurement that was used.
    pub(super) missing: usize,
    /// What is taken from each measurement.
    pub(super) offset: f64,
}

/// The innovations of one model.
#[derive(Clone, Copy, Debug, Default)]
struct Track {
    /// The last one.
    last: f64,
    /// Of a series of those that were refused: the first, and the sum; NaN where they are no jump of the sensor.
    first: f64,
    sum: f64,
}

impl Sensor {
    /// A sensor that was not heard yet.
    pub(super) fn new(noise: f64) -> Self {
        Self { noise, last: f64::NAN, ..Self::default() }
    }

    /// Numbers of [`save`](Self::save).
    pub(super) const MEMORY_LEN: usize = 8 + 3 * EXPERTS;

    /// The start of a run: what was measured last says nothing.
    pub(super) fn reset(&mut self) {
        self.last = f64::NAN;
        self.repeats = 0;
        self.streak = 0;
        self.missing = 0;
    }

    /// Judges a value of which the models expected so much, NaN where they expected nothing.
    pub(super) fn judge(
        &mut self,
        value: f64,
        expected: [f64; EXPERTS],
        settings: &GuardSettings,
    ) -> Verdict {
        let verdict = self.judged(value, expected, settings);
        let used = matches!(
            verdict,
            Verdict::Sound | Verdict::Inflate { .. } | Verdict::Offset { .. } | Verdict::Believed { .. }
        );
        self.missing = if used { 0 } else { self.missing.saturating_add(1) };
        verdict
    }

    fn judged(&mut self, value: f64, expected: [f64; EXPERTS], settings: &GuardSettings) -> Verdict {
        if !value.is_finite() {
            self.streak = 0;
            return Verdict::Missing;
        }
        let warm = self.seen >= WARM_UP;
        if value == self.last {
            self.repeats = self.repeats.saturating_add(1);
        } else {
            if self.repeats < self.limit(settings) || !warm {
                self.longest = self.longest.max(self.repeats);
            }
            self.repeats = 0;
        }
        self.last = value;
        if warm && self.repeats >= self.limit(settings) {
            self.streak = 0;
            return Verdict::Stuck { repeats: self.repeats };
        }
        let innovations = expected.map(|expected| value - self.offset - expected);
        let verdict = self.weigh(innovations, warm, settings);
        for (track, innovation) in self.tracks.iter_mut().zip(innovations) {
            track.last = innovation;
        }
        verdict
    }

    fn weigh(&mut self, innovations: [f64; EXPERTS], warm: bool, settings: &GuardSettings) -> Verdict {
        let smaller = |a: f64, b: f64| if a.is_nan() || b.abs() < a.abs() { b } else { a };
        let innovation = innovations.into_iter().fold(f64::NAN, smaller);
        if !innovation.is_finite() {
            return Verdict::Sound;
        }
        let usual = num_traits::Float::sqrt(self.usual);
        let deviations = innovation.abs() / usual;
        // After a time without measurements the models may be far off, and rightly so.
        let known = warm && (self.missing <= settings.patience || self.streak > 0);
        let off = known && deviations > settings.inflate;
        if self.streak > 0 && off {
            return self.go_on(innovations, innovation, deviations, settings);
        }
        self.streak = 0;
        let before = self.tracks.iter().map(|track| track.last).fold(f64::NAN, smaller);
        let abrupt = off && before.abs() < SOUND * usual;
        if abrupt && deviations > settings.reject {
            self.streak = 1;
            for (track, innovation) in self.tracks.iter_mut().zip(innovations) {
                let jumped = (innovation - track.last).abs() > settings.reject * usual;
                track.first = if jumped { innovation } else { f64::NAN };
                track.sum = innovation - track.last;
            }
            return Verdict::Spike { deviations };
        }
        self.learn(innovation, warm);
        if abrupt {
            Verdict::Inflate { deviations, factor: num_traits::Float::powi(deviations / settings.inflate, 2) }
        } else {
            Verdict::Sound
        }
    }

    /// One more that is far off.
    fn go_on(
        &mut self,
        innovations: [f64; EXPERTS],
        innovation: f64,
        deviations: f64,
        settings: &GuardSettings,
    ) -> Verdict {
        self.streak += 1;
        for (track, innovation) in self.tracks.iter_mut().zip(innovations) {
            let moved = innovation - track.first;
            if moved.abs() > SAME * self.noise {
                track.first = f64::NAN;
            }
            track.sum += innovation;
        }
        let Some(track) = self.tracks.iter().find(|track| !track.first.is_nan()) else {
            self.streak = 0;
            self.learn(innovation, true);
            return Verdict::Believed { deviations };
        };
        if self.streak < settings.patience {
            return Verdict::Spike { deviations };
        }
        self.offset += track.sum / self.streak as f64;
        self.streak = 0;
        Verdict::Offset { offset: self.offset }
    }

    /// Repetitions from which on the sensor is stuck.
    fn limit(&self, settings: &GuardSettings) -> usize {
        settings.repeats.max(self.longest.saturating_mul(3))
    }

    /// Takes an innovation that was used into what is usual; one large one does not widen it by much.
    fn learn(&mut self, innovation: f64, warm: bool) {
        let share = (1.0 / MEMORY).max(1.0 / (self.seen + 1) as f64);
        let most = if warm { SOUND * SOUND * self.usual } else { f64::INFINITY };
        self.usual += share * ((innovation * innovation).min(most) - self.usual);
        self.seen = self.seen.saturating_add(1);
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&[self.usual, self.last, self.offset]);
        for track in &self.tracks {
            into.numbers(&[track.last, track.first, track.sum]);
        }
        for count in [self.seen, self.repeats, self.longest, self.streak, self.missing] {
            into.count(count);
        }
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        let mut numbers = [0.0; 3];
        from.numbers(&mut numbers);
        [self.usual, self.last, self.offset] = numbers;
        for track in &mut self.tracks {
            from.numbers(&mut numbers);
            [track.last, track.first, track.sum] = numbers;
        }
        for count in
            [&mut self.seen, &mut self.repeats, &mut self.longest, &mut self.streak, &mut self.missing]
        {
            *count = from.count(MOST_COUNTED);
        }
    }
}
