//! Options of a guard.

/// Longest horizon of the tests \[samples\], which bounds their memory.
const LONGEST_HORIZON: usize = 10_000;

/// Options of a [`Guard`](super::Guard). Times are in samples.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GuardOptions {
    /// Horizon `H` of the tests \[samples\], at most 10,000.
    pub horizon: usize,
    /// Interval of the tests \[samples\].
    pub stride: usize,
    /// Time constant of the guarantees \[samples\]: errors are weighted by `exp(-age / window)`.
    pub window: usize,
    /// Factor of the guarantees on the errors of the reference model and of the unguarded learner.
    pub factor: f64,
    /// Constant of the guarantees, relative to the noise of the sensors.
    pub floors: f64,
    /// Deviation of a measurement, relative to the usual one, above which it is held back.
    pub gate: f64,
    /// Minimum number of repetitions of a stuck sensor, for a sensor that has repeated values before.
    pub repeats: usize,
    /// Longest stretch of dead reckoning against a measurement \[samples\]; see [`share`](Self::share).
    pub hold: usize,
    /// Part of this stretch that every sample without a hold gives back: at most `share / (1 + share)` of the samples are
    /// held in the long run.
    pub share: f64,
    /// Whether measurements are held back at all.
    pub sensors: bool,
}

impl GuardOptions {
    /// For samples of `dt` seconds: five tests over a horizon of 2 s or 10,000 samples, and a guarantee over a minute.
    pub fn new(dt: f64) -> Self {
        // Casts saturate, and NaN is 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let samples = |time_s: f64, least: usize| (num_traits::Float::round(time_s / dt) as usize).max(least);
        let horizon = samples(2.0, 4).min(LONGEST_HORIZON);
        let stride = (horizon / 5).max(1);
        // Origins coincide with tests.
        let horizon = horizon - horizon % stride;
        let window = samples(60.0, horizon.saturating_mul(4));
        Self {
            horizon,
            stride,
            window,
            factor: 1.2,
            floors: 0.5,
            gate: 4.0,
            repeats: 5,
            hold: window.saturating_mul(2),
            share: 0.1,
            sensors: true,
        }
    }

    pub(super) fn is_sound(&self) -> bool {
        [self.horizon, self.stride, self.window].iter().all(|&n| n > 0)
            && self.horizon <= LONGEST_HORIZON
            && self.horizon.is_multiple_of(self.stride)
            && self.window >= self.horizon
            && self.repeats > 1
            && self.factor >= 1.0
            && self.factor.is_finite()
            && self.floors > 0.0
            && self.floors.is_finite()
            && self.gate > 0.0
            && self.hold >= self.horizon
            && self.share > 0.0
            && self.share.is_finite()
    }
}
