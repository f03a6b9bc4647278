//! Innovations of one expectation of an output.

use crate::adapt::memory::{Reader, Writer};

/// Largest change between two innovations of a constant offset, in deviations of the noise: a model without
/// measurements drifts, but does not jump. The bound also holds for all innovations of a series.
pub(super) const SAME: f64 = 6.0;

const SMOOTH: f64 = 0.3;

/// Largest difference of two measurements of one value, in deviations of the noise (three deviations of the
/// difference).
pub(super) const APART: f64 = 4.5;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Track {
    /// The last innovation, and the size of its last change.
    pub(super) last: f64,
    pub(super) drift: f64,
    /// The innovation and the recent mean before the last innovation, or before a rejected series.
    pub(super) before: f64,
    mean: f64,
    /// The first jump of the series, NaN if later ones differed; sums of the first jumps and of all jumps after the
    /// first.
    pub(super) first: f64,
    pub(super) sum: f64,
    rest: f64,
    low: f64,
    high: f64,
}

impl Track {
    pub(super) const MEMORY_LEN: usize = 9;

    pub(super) fn new() -> Self {
        Self { last: f64::NAN, ..Self::default() }
    }

    /// Jump from the recent mean, which has less noise than the innovation before.
    pub(super) fn jump(&self) -> f64 {
        self.last - self.mean
    }

    pub(super) fn update(&mut self, innovation: f64, in_series: bool) {
        if !in_series {
            self.before = self.last;
            let more = SMOOTH * (self.last - self.mean);
            self.mean = if more.is_finite() { self.mean + more } else { self.last };
        }
        self.drift = (innovation - self.last).abs();
        self.last = innovation;
    }

    /// Restarts the mean after a rejected series that is used from now on.
    pub(super) fn settle(&mut self) {
        self.mean = self.last;
    }

    /// Returns to the mean before a rejected series.
    pub(super) fn forget(&mut self) {
        self.last = self.mean;
    }

    pub(super) fn begin(&mut self) {
        let jump = self.jump();
        (self.first, self.sum, self.low, self.high) = (jump, jump, jump, jump);
        self.rest = 0.0;
    }

    /// Adds the last innovation to the series; `early` for innovations that estimate the offset.
    pub(super) fn continue_series(&mut self, noise: f64, early: bool) {
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

    /// Whether the last innovation can have the offset of the first of the series, given the noise.
    pub(super) fn is_same(&self, noise: f64) -> bool {
        let apart = (self.jump() - self.first).abs();
        self.drift <= SAME * noise && apart <= f64::max(0.5 * self.first.abs(), APART * noise)
    }

    /// The smaller of two estimates of the offset of a series: the mean of its first `early` jumps, and the mean of all
    /// after the first, which was selected for its size.
    pub(super) fn off(&self, length: usize, early: usize) -> f64 {
        let by = |sum: f64, count: usize| sum.abs() / count as f64;
        by(self.sum, length.min(early)).min(by(self.rest, length - 1))
    }

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
