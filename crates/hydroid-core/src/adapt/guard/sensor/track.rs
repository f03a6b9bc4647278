//! What one expectation makes of an output's measurements.

use crate::adapt::memory::{Reader, Writer};

/// Two measurements in series of a sensor with an offset differ from what is expected by the same, up to so many deviations of its
/// noise: a model that is not told anything meanwhile drifts away, but does not jump. So do all of them, if the model drifts little.
pub(super) const SAME: f64 = 6.0;

/// Share of the last innovation in where innovations have been of late.
const SMOOTH: f64 = 0.3;

/// Two measurements of the same are not farther apart than so many deviations of their noise: three of those of the difference.
pub(super) const APART: f64 = 4.5;

/// The innovations of one model.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Track {
    /// The last one, and how far it was from the one before.
    pub(super) last: f64,
    pub(super) drift: f64,
    /// The one before, and where they were of late: before the last one, or before a series of measurements that are refused.
    pub(super) before: f64,
    mean: f64,
    /// The first jump of the series; NaN where those that followed were others. And the sums of the first ones, and of all after the first.
    pub(super) first: f64,
    pub(super) sum: f64,
    rest: f64,
    /// The least jump of the series, and the largest.
    low: f64,
    high: f64,
}

impl Track {
    /// Numbers of [`save`](Self::save).
    pub(super) const MEMORY_LEN: usize = 9;

    /// One that was not heard yet.
    pub(super) fn new() -> Self {
        Self { last: f64::NAN, ..Self::default() }
    }

    /// How far the last innovation has jumped from where they were of late: the one before has the noise of a whole measurement.
    pub(super) fn jump(&self) -> f64 {
        self.last - self.mean
    }

    /// Takes an innovation, of a series of measurements that are refused or not.
    pub(super) fn hear(&mut self, innovation: f64, in_series: bool) {
        if !in_series {
            self.before = self.last;
            let more = SMOOTH * (self.last - self.mean);
            self.mean = if more.is_finite() { self.mean + more } else { self.last };
        }
        self.drift = (innovation - self.last).abs();
        self.last = innovation;
    }

    /// What was refused before is used from now on: what was before it is no measure any more.
    pub(super) fn settle(&mut self) {
        self.mean = self.last;
    }

    /// What was refused is not used: innovations are where they were before it.
    pub(super) fn forget(&mut self) {
        self.last = self.mean;
    }

    /// The last one is the first of a series.
    pub(super) fn begin(&mut self) {
        let jump = self.jump();
        (self.first, self.sum, self.low, self.high) = (jump, jump, jump, jump);
        self.rest = 0.0;
    }

    /// The last one is one more of a series, and `early` if it tells by how much all of them are off.
    pub(super) fn go_on(&mut self, noise: f64, early: bool) {
        if !self.is_same(noise) {
            self.first = f64::NAN;
        }
        let jump = self.jump();
        (self.low, self.high) = (self.low.min(jump), self.high.max(jump));
        self.rest += jump;
        if early {
            self.sum += jump;
        }
    }

    /// Whether the last one may have the same offset as the first of the series, for a sensor of such a noise.
    pub(super) fn is_same(&self, noise: f64) -> bool {
        let apart = (self.jump() - self.first).abs();
        self.drift <= SAME * noise && apart <= f64::max(0.5 * self.first.abs(), APART * noise)
    }

    /// How far the jumps of a series of such a length are off at the least: by the mean of its first `early` ones, or of all after the first,
    /// which was chosen for being large.
    pub(super) fn off(&self, length: usize, early: usize) -> f64 {
        let by = |sum: f64, count: usize| sum.abs() / count as f64;
        by(self.sum, length.min(early)).min(by(self.rest, length - 1))
    }

    /// How far the jumps of the series are apart.
    pub(super) fn spread(&self) -> f64 {
        self.high - self.low
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&[self.last, self.drift, self.before, self.mean, self.first]);
        into.numbers(&[self.sum, self.rest, self.low, self.high]);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        let mut numbers = [0.0; Self::MEMORY_LEN];
        from.numbers(&mut numbers);
        let [last, drift, before, mean, first, sum, rest, low, high] = numbers;
        *self = Self { last, drift, before, mean, first, sum, rest, low, high };
    }
}
