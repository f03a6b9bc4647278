//! Whether an output was measured or only said to be.

mod track;

use super::event::Expert;
use super::settings::GuardOptions;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};
use track::{APART, SAME, Track};

/// Who expects a value: the models, and behind them who expects that the vessel goes on as it moved.
pub(super) const EXPECTED: usize = Expert::ALL.len() + 1;

/// Where the expectation stands that nothing changes.
const HELD: usize = EXPECTED;

/// Measurements of a channel before it is judged.
const WARM_UP: usize = 100;

/// The first measurements of a run are not judged and tell nothing of usual jumps: models have just begun to find their states.
const SETTLING: usize = 20;

/// Time constant of the usual size of jumps \[measurements\].
const MEMORY: f64 = 200.0;

/// An offset is what the first measurements with it are off by: so many of them.
const FIRST: usize = 3;

/// A jump is alone where the value before it changed by less than a part of it, or its change did: one in so many.
const ALONE: f64 = 3.0;

/// It is the vessel that is farther off than at first by this factor (and, if it was not far off, by more than noise).
const AWAY: f64 = 1.4;

/// No vessel comes back by itself from a jump of more than so many usual deviations. None jumps by more than so many and stays there, whatever
/// the models that are not told anything meanwhile make of it.
const HUGE: f64 = 13.0;
const SURE: f64 = 20.0;

/// Of those who expect something, so many are most.
const MOST: usize = 3;

/// Jumps of more than this many deviations count as this in what is usual.
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
    /// It is off, and moves, as a vessel does: use it.
    Believed { deviations: f64 },
}

/// One output's sensor.
///
/// What is judged is how far an innovation *jumps* from where they were of late, against what is usual of that, `s`, the root
/// mean square of the jumps: how large innovations are is the filter's affair (a sluggish one has large ones, and all
/// smooth), while a jump is the sensor's noise and little else. Of those who expect something the one with the least jump counts:
/// beside the models that is who expects that the vessel goes on as it moved, and who expects that nothing changes (models that are told nothing
/// may be anywhere at once, a vessel is not). A jump of
/// more than [`reject`](GuardOptions::reject) `s` beside none in what was measured before is a spike (a vessel has inertia, and does not stand still before it
/// jumps), and so are the measurements that follow as long as they are so far off, but for one that jumps back most of the way;
/// after [`patience`](GuardOptions::patience) of them it is an offset of the sensor, if some model finds them off by the same from one to the
/// next, but for noise, and not by half as much more or less than the first. Where the first jump was such as vessels make when they take off
/// (below [`SURE`]), all of them must be the same; where it was not huge, most must find that, and nobody less than half of it left,
/// and in the mean they must be off by [`SAME`] deviations of the noise.
/// Above [`SURE`], it is enough that the second measurement was off as well: models that are told nothing drift, and may be anywhere.
/// Otherwise it is the vessel after all. So is at once what was not huge and is farther off by two fifths and by more than noise.
#[derive(Clone, Debug, Default)]
pub(super) struct Sensor {
    /// Standard deviation of its noise, in its unit.
    noise: f64,
    /// Measurements of this run, and jumps that were found usual.
    begun: usize,
    seen: usize,
    /// `s^2`.
    usual: f64,
    /// The last value as it came, how often it was repeated, and the longest such series of the sound sensor.
    last: f64,
    repeats: usize,
    longest: usize,
    /// How much it changed from one value to the next, and how much before the values in series that were refused: the way back from
    /// a spike is no jump of the vessel, beside which another spike would not be alone.
    step: f64,
    calm: f64,
    /// How much that change changed: a vessel that gathers way jumps by little, and a spike on it is alone all the same.
    swing: f64,
    /// Measurements in series that were refused, and how much the first of them had changed.
    streak: usize,
    jump: f64,
    /// By how many deviations the first of them was off; zero if what was before was not near what was expected.
    first: f64,
    /// The least of these since one was used: where spikes stand side by side the series begins again.
    begun_by: f64,
    /// Whether the second was off by half as much at least: what was a spike is not.
    lasts: bool,
    /// The last value that was used, as it was used.
    held: f64,
    /// What each model makes of them, and who expects the last value that was used.
    tracks: [Track; EXPECTED + 1],
    /// Samples without a measurement that was used.
    pub(super) missing: usize,
    /// What is taken from each measurement.
    pub(super) offset: f64,
}

impl Sensor {
    /// A sensor that was not heard yet.
    pub(super) fn new(noise: f64) -> Self {
        let mut own = Self { noise, ..Self::default() };
        own.reset();
        own
    }

    /// Numbers of [`save`](Self::save).
    pub(super) const MEMORY_LEN: usize = 17 + Track::MEMORY_LEN * (EXPECTED + 1);

    /// The start of a run: what was measured last says nothing.
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

    /// Judges a value of which the models expected so much, NaN where they expected nothing.
    pub(super) fn judge(
        &mut self,
        value: f64,
        expected: [f64; EXPECTED],
        settings: &GuardOptions,
    ) -> Verdict {
        let verdict = self.judged(value, expected, settings);
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

    fn judged(&mut self, value: f64, expected: [f64; EXPECTED], settings: &GuardOptions) -> Verdict {
        if !value.is_finite() {
            self.cut();
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
        let before = [self.step, self.swing];
        self.step = value - self.last;
        self.swing = self.step - before[0];
        self.last = value;
        if warm && self.repeats >= self.limit(settings) {
            self.cut();
            return Verdict::Stuck { repeats: self.repeats };
        }
        let [a, b, c, d] = expected;
        let innovations = [a, b, c, d, self.held].map(|expected| value - self.offset - expected);
        self.weigh(innovations, before, warm, settings)
    }

    /// Nothing is heard any more: a series of refused values ends, and what they were tells nothing of those to come.
    fn cut(&mut self) {
        if self.streak > 0 {
            self.tracks.iter_mut().for_each(Track::forget);
        }
        self.streak = 0;
    }

    fn weigh(
        &mut self,
        innovations: [f64; EXPECTED + 1],
        before: [f64; 2],
        warm: bool,
        settings: &GuardOptions,
    ) -> Verdict {
        let goes_on = self.streak > 0;
        let (mut jump, mut same) = (f64::NAN, false);
        for (track, innovation) in self.tracks.iter_mut().zip(innovations) {
            track.hear(innovation, goes_on);
            let own = track.jump();
            if jump.is_nan() || own.abs() < jump.abs() {
                jump = own;
            }
            // A model that is told nothing meanwhile may be anywhere, and excuses nothing as long as another finds the same.
            same |= goes_on && track.is_same(self.noise);
        }
        self.begun = self.begun.saturating_add(1);
        // Nobody can tell; or, after a time without measurements, models may be far off, and rightly so.
        if jump.is_nan() || self.begun <= SETTLING || (self.missing > 0 && !goes_on) {
            self.streak = 0;
            return Verdict::Sound;
        }
        let usual = num_traits::Float::sqrt(self.usual);
        let deviations = jump.abs() / usual;
        let jumps = self.jumps();
        let back = jumps && 2.0 * deviations < self.first && deviations < HUGE * self.streak as f64;
        let remains = self.first > HUGE && !jumps;
        // (What is neither, and less than a spike after one, is the vessel, which has gone on meanwhile.)
        if goes_on && !back && (same || remains || deviations > settings.reject) {
            return self.go_on(deviations, before[0], settings);
        }
        if goes_on {
            (self.step, self.swing) = (self.calm, f64::NAN);
        }
        if goes_on && deviations > settings.inflate {
            self.tracks.iter_mut().for_each(Track::settle);
        }
        self.streak = 0;
        // (Where only what is expected jumps, it is a model that does.)
        let alone = |before: f64, now: f64| before.abs() * ALONE < now.abs() && 2.0 * now.abs() > jump.abs();
        let alone = alone(before[0], self.step) || alone(before[1], self.swing);
        let off = warm && deviations > settings.inflate;
        if off && alone && deviations > settings.reject {
            (self.streak, self.calm) = (1, before[0]);
            self.jump = self.leap();
            self.begin(usual, settings);
            return Verdict::Spike { deviations };
        }
        self.learn(jump, warm);
        if off && alone {
            Verdict::Inflate { deviations, factor: num_traits::Float::powi(deviations / settings.inflate, 2) }
        } else {
            Verdict::Sound
        }
    }

    /// The first of a series. Those that follow are judged by where the models were off before, and not by the last one before, which may have
    /// been a small spike.
    fn begin(&mut self, usual: f64, settings: &GuardOptions) {
        let mut least = f64::INFINITY;
        let mut from_it = false;
        for (at, track) in self.tracks.iter_mut().enumerate() {
            let own = track.jump();
            // What came before must have been near what a model expected, or this is the way back to it.
            let jumps = own.abs() > settings.reject * usual && 2.0 * track.before.abs() < own.abs();
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

    /// How far the last value jumped beside what it had changed by before the series: a vessel that slows down goes on doing so.
    fn leap(&self) -> f64 {
        self.step.abs().min((self.step - self.calm).abs())
    }

    /// Whether the last value has jumped as far as the first of a series, or not much less.
    fn jumps(&self) -> bool {
        self.leap() * ALONE > self.jump
    }

    /// One more that is far off.
    fn go_on(&mut self, deviations: f64, before: f64, settings: &GuardOptions) -> Verdict {
        self.streak += 1;
        // Three that go farther one after the other, by steps that are alike, are no spikes.
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
        let other = f64::max(0.5 * self.first, settings.reject) * usual;
        for track in &mut self.tracks {
            another &= track.drift.is_nan() || track.drift > other;
            track.go_on(self.noise, self.streak <= FIRST);
        }
        if another {
            // Spikes side by side: what follows is judged by what was before the first of them.
            self.streak = 1;
            self.tracks.iter_mut().for_each(Track::begin);
            (self.jump, self.first) = (self.leap().min(deviations * usual), deviations);
            self.begun_by = self.begun_by.min(deviations);
            return Verdict::Spike { deviations };
        }
        // And a vessel that begins to turn beside a filter that does not expect it jumps by as much as a small spike does, and goes farther.
        let small = self.first <= HUGE;
        if small && deviations > f64::max(AWAY * self.first, self.first + APART) {
            self.streak = 0;
            return Verdict::Believed { deviations };
        }
        if self.streak < settings.patience {
            return Verdict::Spike { deviations };
        }
        // Jumps are the vessel's where nobody finds all of them the same; and small ones where most do not, some model knows nothing of them
        // any more, or they are no more than what those of one offset may differ by.
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

    /// Repetitions from which on the sensor is stuck. One that never repeats itself, because its noise does not, has no need to
    /// do it twice.
    fn limit(&self, settings: &GuardOptions) -> usize {
        if self.longest == 0 { 2 } else { settings.repeats.max(self.longest.saturating_mul(3)) }
    }

    /// Takes a jump into what is usual; one large one does not widen it by much.
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
