//! What a guard is told.

/// Settings of a [`Guard`](super::Guard). Times are in samples, sizes in what stands beside them.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GuardOptions {
    /// `H`: how far ahead predictions are judged \[samples\].
    pub horizon: usize,
    /// Samples between two tests.
    pub stride: usize,
    /// The window of the guarantee \[samples\].
    pub window: usize,
    /// What the guarded prediction may be worse than the frozen one by, beside the noise floor: a factor.
    pub factor: f64,
    /// A model is taken to have errors of at most so many times the largest of late: the more, the oftener predictions are drawn
    /// towards those of the model from shore.
    pub caution: f64,
    /// Memory of the record by which models are chosen \[samples\].
    pub record: usize,
    /// Measurements that jump by so many of the usual deviations of that count as noisier ones ..
    pub inflate: f64,
    /// .. and of so many are no measurements, for as long as `patience` \[samples\].
    pub reject: f64,
    /// See [`reject`](Self::reject). What is off by the same for so long is an offset of the sensor.
    pub patience: usize,
    /// A sensor that has repeated values before is stuck where it does so many times, at the least.
    pub repeats: usize,
    /// Samples between two snapshots of what was learned.
    pub keep: usize,
    /// Whether sensors are judged at all.
    pub sensors: bool,
}

impl GuardOptions {
    /// For samples of `dt` seconds: predictions over 2 s judged five times in that time, a guarantee over 30 s.
    pub fn new(dt: f64) -> Self {
        // Casts saturate, and NaN is 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let samples = |time_s: f64, least: usize| (num_traits::Float::round(time_s / dt) as usize).max(least);
        let horizon = samples(2.0, 4);
        let stride = (horizon / 5).max(1);
        // Models are tested from the samples at which others were tested.
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
            keep: samples(10.0, 2 * horizon),
            sensors: true,
        }
    }

    /// Whether they make sense.
    pub(super) fn is_sound(&self) -> bool {
        let positive = [self.horizon, self.stride, self.window, self.record, self.patience, self.keep];
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
