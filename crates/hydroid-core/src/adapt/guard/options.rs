//! Options of a guard.

/// Options of a [`Guard`](super::Guard). Times are in samples.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GuardOptions {
    /// Horizon `H` of the tests \[samples\].
    pub horizon: usize,
    /// Interval of the tests \[samples\].
    pub stride: usize,
    /// Window of the guarantee \[samples\].
    pub window: usize,
    /// Factor of the guarantee on the error of the reference model; the noise floor is added.
    pub factor: f64,
    /// Bound on the error of a model, in multiples of its largest recent error. A larger value projects more
    /// predictions onto the reference model.
    pub caution: f64,
    /// Time constant of the records that select the model \[samples\].
    pub record: usize,
    /// Jump of a measurement, relative to the RMS of the jumps, above which its noise variance is inflated.
    pub inflate: f64,
    /// Jump of a measurement, relative to the RMS of the jumps, above which at most `patience` samples are rejected.
    pub reject: f64,
    /// Longest series of rejections \[samples\]; a constant deviation of this length is a sensor offset.
    pub patience: usize,
    /// Minimum number of repetitions of a stuck sensor, for a sensor that has repeated values before.
    pub repeats: usize,
    /// Interval of the snapshots \[samples\].
    pub snapshot_interval: usize,
    /// Whether sensor faults are detected.
    pub sensors: bool,
}

impl GuardOptions {
    /// For samples of `dt` seconds: five tests over a horizon of 2 s, and a guarantee over 30 s.
    pub fn new(dt: f64) -> Self {
        // Casts saturate, and NaN is 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let samples = |time_s: f64, least: usize| (num_traits::Float::round(time_s / dt) as usize).max(least);
        let horizon = samples(2.0, 4);
        let stride = (horizon / 5).max(1);
        // Origins coincide with tests.
        let horizon = horizon - horizon % stride;
        Self {
            horizon,
            stride,
            window: samples(30.0, 4 * horizon),
            factor: 1.2,
            caution: 0.5,
            record: samples(3.0, horizon),
            inflate: 4.5,
            reject: 6.0,
            patience: samples(0.8, 4),
            repeats: 5,
            snapshot_interval: samples(10.0, 2 * horizon),
            sensors: true,
        }
    }

    pub(super) fn is_sound(&self) -> bool {
        let positive =
            [self.horizon, self.stride, self.window, self.record, self.patience, self.snapshot_interval];
        positive.iter().all(|&n| n > 0)
            && self.horizon.is_multiple_of(self.stride)
            && self.window >= self.horizon
            && self.repeats > 1
            && self.factor >= 1.0
            && self.factor.is_finite()
            && self.caution >= 0.0
            && self.caution.is_finite()
            && self.inflate > 0.0
            && self.reject >= self.inflate
    }
}
