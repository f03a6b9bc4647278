//! Random numbers.

use num_traits::Float;

use crate::memory::Memory;

/// White Gaussian numbers from a seed: uniform numbers by `SplitMix64` (G. L. Steele, D. Lea, C. H. Flood, *Fast
/// splittable pseudorandom number generators*, 2014), transformed in pairs (G. E. P. Box and M. E. Muller, 1958). Equal
/// on all machines except for the last digits of logarithm and cosine.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Noise {
    state: u64,
    spare: Option<f64>,
}

impl Noise {
    pub(super) const fn new(seed: u64) -> Self {
        Self { state: seed, spare: None }
    }

    /// Visits the state in four numbers; see [`Controller::visit_state`](super::Controller::visit_state).
    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        let half = u64::from(u32::MAX);
        let mut parts = [
            (self.state >> 32) as f64,
            (self.state & half) as f64,
            f64::from(u8::from(self.spare.is_some())),
            self.spare.unwrap_or(0.0),
        ];
        memory.numbers(&mut parts);
        let [high, low, has_spare, spare] = parts;
        // Casts saturate, and NaN is 0.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let whole = |x: f64| (x as u64).min(half);
        self.state = whole(high) << 32 | whole(low);
        self.spare = (has_spare == 1.0).then_some(spare);
    }

    fn uniform(&mut self) -> f64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let bits = (z ^ (z >> 31)) >> 11;
        1.0 - bits as f64 / 9_007_199_254_740_992.0
    }

    pub(super) fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = Float::sqrt(-2.0 * Float::ln(self.uniform()));
        let (sin, cos) = Float::sin_cos(core::f64::consts::TAU * self.uniform());
        self.spare = Some(radius * sin);
        radius * cos
    }
}
