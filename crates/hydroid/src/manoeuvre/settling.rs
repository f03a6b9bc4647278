//! Is a motion steady?

/// Distance of a value from its limit, from the changes over blocks of equal length.
///
/// Changes that shrink by a constant ratio `q` add up to `q / (1 - q)` times the last one (Aitken's method).
#[derive(Clone, Copy, Debug)]
pub(super) struct Settling {
    value: f64,
    change: f64,
}

/// Samples of a block.
pub(super) const BLOCK: usize = 100;

impl Settling {
    /// At a value, before the first block.
    pub(super) const fn from(value: f64) -> Self {
        Self { value, change: f64::NAN }
    }

    /// Change to expect after this block: infinite after the first one, and while the changes grow.
    pub(super) fn update(&mut self, value: f64) -> f64 {
        let change = value - self.value;
        let ratio = change / self.change;
        (self.value, self.change) = (value, change);
        if change == 0.0 {
            0.0
        } else if ratio > 0.0 && ratio < 1.0 {
            change * ratio / (1.0 - ratio)
        } else if ratio > -1.0 && ratio <= 0.0 {
            change
        } else {
            f64::INFINITY
        }
    }
}
