//! Random signals from a seed.

use rand::{Rng, RngExt as _};

use super::segment::{Segment, Shape, Signal};

/// Relative frequency of each shape.
const STEPS: f64 = 0.32;
const PRBS: f64 = 0.20;
const TRIANGLE: f64 = 0.14;
const CHIRP: f64 = 0.14;
const RAMP: f64 = 0.12;

/// Generator of random signals for one command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Composer {
    /// Lower limit of the command.
    pub low: f64,
    /// Upper limit of the command.
    pub high: f64,
    /// Probability of a positive level, if the limits contain zero.
    pub forward: f64,
    /// Response time of the vessel \[s\]; holds, periods and segments are multiples of it.
    pub pace_s: f64,
}

impl Composer {
    /// A signal of at least `duration_s` seconds.
    ///
    /// # Panics
    /// If the limits are reversed or not finite, or the pace is not positive.
    pub fn compose(&self, duration_s: f64, rng: &mut impl Rng) -> Signal {
        assert!(self.low <= self.high && self.low.is_finite() && self.high.is_finite(), "no range");
        assert!(self.pace_s > 0.0, "no pace");
        let mut segments = Vec::new();
        let mut reached = 0.0;
        let mut last = 0.0_f64.clamp(self.low, self.high);
        while reached < duration_s {
            let segment = self.segment(&mut last, rng);
            reached += segment.duration_s;
            segments.push(segment);
        }
        Signal { segments }
    }

    /// One segment; a ramp starts at the end of the previous segment.
    fn segment(&self, last: &mut f64, rng: &mut impl Rng) -> Segment {
        let pace = self.pace_s;
        let duration_s = pace * rng.random_range(10.0..30.0);
        let mut choice: f64 = rng.random_range(0.0..1.0);
        let mut drawn = |share: f64| {
            choice -= share;
            choice < 0.0
        };
        let (shape, duration_s) = if drawn(STEPS) {
            let count = rng.random_range(3..=8);
            let levels: Vec<f64> = (0..count).map(|_| self.level(rng)).collect();
            *last = levels[levels.len() - 1];
            // Holds of different lengths excite slow and fast dynamics.
            let hold_s = pace * 1.5 * 5.0_f64.powf(rng.random_range(0.0..1.0));
            (Shape::Steps { levels }, hold_s * f64::from(count))
        } else if drawn(PRBS) {
            let (low, high) = self.pair(rng);
            *last = high;
            (
                Shape::Prbs { low, high, hold_s: pace * rng.random_range(1.0..4.0), start: rng.random() },
                duration_s,
            )
        } else if drawn(TRIANGLE) {
            let (low, high) = self.pair(rng);
            *last = low;
            (Shape::Triangle { low, high, period_s: pace * rng.random_range(4.0..16.0) }, duration_s)
        } else if drawn(CHIRP) {
            let (low, high) = self.pair(rng);
            *last = 0.5 * (low + high);
            let (slow, fast) = (1.0 / (16.0 * pace), 1.0 / (2.5 * pace));
            let (from_hz, to_hz) = if rng.random() { (slow, fast) } else { (fast, slow) };
            let shape =
                Shape::Chirp { centre: 0.5 * (low + high), amplitude: 0.5 * (high - low), from_hz, to_hz };
            (shape, duration_s)
        } else if drawn(RAMP) {
            let (from, to) = (*last, self.level(rng));
            *last = to;
            (Shape::Ramp { from, to }, 0.7 * duration_s)
        } else {
            *last = 0.0_f64.clamp(self.low, self.high);
            let shape = if *last == 0.0 { Shape::Zero } else { Shape::Steps { levels: vec![*last] } };
            (shape, pace * rng.random_range(2.0..8.0))
        };
        Segment { shape, duration_s }
    }

    fn level(&self, rng: &mut impl Rng) -> f64 {
        let (low, high) = if self.low < 0.0 && self.high > 0.0 {
            if rng.random_bool(self.forward.clamp(0.0, 1.0)) { (0.0, self.high) } else { (self.low, 0.0) }
        } else {
            (self.low, self.high)
        };
        rng.random_range(low..=high)
    }

    /// Two ascending levels, at least a fifth of the range apart.
    fn pair(&self, rng: &mut impl Rng) -> (f64, f64) {
        // Bounded number of draws, because one side may be narrower than a fifth of the range.
        for _ in 0..64 {
            let (a, b) = (self.level(rng), self.level(rng));
            if (a - b).abs() >= 0.2 * (self.high - self.low) {
                return (a.min(b), a.max(b));
            }
        }
        (self.low, self.high)
    }
}
