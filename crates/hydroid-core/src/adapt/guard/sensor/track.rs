//! What one expectation makes of an output's measurements.

use crate::adapt::memory::{Reader, Writer};

/// Two measurements in series of a sensor with an offset differ from what is expected by the same, up to so many deviations of its
/// noise: a model that is not told anything meanwhile drifts away, but does not jump. So do all of them, if the model drifts little.
pub(super) const SAME: f64 = 6.0;

/// Share of the last innovation in where innovations have been of late: one alone has the noise of a whole measurement.
const SMOOTH: f64 = 0.3;

/// The innovations of one model.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Track {
    /// The last one, and how far it was from the one before.
    pub(super) last: f64,
    pub(super) drift: f64,
    /// The one before, or where they were of late before a series of measurements that are refused; where they are of late.
    pub(super) base: f64,
    pub(super) mean: f64,
    /// The first jump of the series; NaN where those that followed were others. And the sum of the first ones.
    pub(super) first: f64,
    pub(super) sum: f64,
    /// The least jump of the series, and the largest.
    low: f64,
    high: f64,
}

impl Track {
    /// Numbers of [`save`](Self::save).
    pub(super) const MEMORY_LEN: usize = 8;

    /// One that was not heard yet.
    pub(super) fn new() -> Self {
        Self { last: f64::NAN, ..Self::default() }
    }

    /// How far the last innovation has jumped.
    pub(super) fn jump(&self) -> f64 {
        self.last - self.base
    }

    /// Takes an innovation, of a series of measurements that are refused or not.
    pub(super) fn hear(&mut self, innovation: f64, in_series: bool) {
        if !in_series {
            self.base = self.last;
            let more = SMOOTH * (self.last - self.mean);
            self.mean = if more.is_finite() { self.mean + more } else { self.last };
        }
        self.drift = (innovation - self.last).abs();
        self.last = innovation;
    }

    /// The last one is the first of a series.
    pub(super) fn begin(&mut self) {
        let jump = self.jump();
        (self.first, self.sum, self.low, self.high) = (jump, jump, jump, jump);
    }

    /// The last one is one more of a series, and `early` if it tells by how much all of them are off.
    pub(super) fn go_on(&mut self, noise: f64, early: bool) {
        if !self.is_same(noise) {
            self.first = f64::NAN;
        }
        let jump = self.jump();
        (self.low, self.high) = (self.low.min(jump), self.high.max(jump));
        if early {
            self.sum += jump;
        }
    }

    /// Whether the last one may have the same offset as the first of the series, for a sensor of such a noise.
    pub(super) fn is_same(&self, noise: f64) -> bool {
        self.drift <= SAME * noise && (self.jump() - self.first).abs() <= 0.5 * self.first.abs()
    }

    /// How far the jumps of the series are apart.
    pub(super) fn spread(&self) -> f64 {
        self.high - self.low
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&[self.last, self.drift, self.base, self.mean]);
        into.numbers(&[self.first, self.sum, self.low, self.high]);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        let mut numbers = [0.0; Self::MEMORY_LEN];
        from.numbers(&mut numbers);
        let [last, drift, base, mean, first, sum, low, high] = numbers;
        *self = Self { last, drift, base, mean, first, sum, low, high };
    }
}
