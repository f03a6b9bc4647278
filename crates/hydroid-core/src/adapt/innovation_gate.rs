//! Innovation gate (outlier rejection) and online estimate of the row noise.
//!
//! For a row with the innovations `e_i`, the leverage `l = phi' P phi` and the noise variances `s_i^2`, the largest
//! normalized innovation is
//!
//! ```text
//! d = max_i |e_i| / (s_i sqrt(1 + min(l, 1)))
//! w = 1                 d <= inflate
//! w = inflate / d       inflate < d <= reject          Huber weight
//! w = 0                 d > reject
//! ```
//!
//! The noise variance follows the innovations at the rate `a`; the square is bounded by `(inflate s_i)^2` for outliers:
//!
//! ```text
//! s_i^2 <- s_i^2 + a (e_i^2 / (1 + l) - s_i^2)
//! ```

use alloc::vec;
use alloc::vec::Vec;

use super::{Innovation, Outcome, Rejection, are_variances};
use crate::memory::{MOST_COUNTED, Memory};

/// Thresholds on the largest normalized innovation of a row \[standard deviations\].
///
/// A row has the Huber weight `inflate / d` above `inflate` and is rejected above `reject`. A faulty sample is part of
/// a limited number of rows; a longer series of large innovations is accepted as a change of the vessel.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct InnovationGate {
    /// Threshold of down-weighting.
    pub inflate: f64,
    /// Threshold of rejection.
    pub reject: f64,
}

impl Default for InnovationGate {
    fn default() -> Self {
        Self { inflate: 3.0, reject: 10.0 }
    }
}

impl InnovationGate {
    /// No gate: every finite row has full weight.
    pub const OPEN: Self = Self { inflate: f64::INFINITY, reject: f64::INFINITY };
}

/// Rows before the noise estimate is used.
pub(super) const FEWEST_ROWS: usize = 30;

/// Time constant of the noise estimate \[s\], shorter than the forgetting time because the model error changes with
/// the manoeuvre.
pub(super) const MEMORY_S: f64 = 20.0;
/// Maximum rate of the noise estimate.
pub(super) const LARGEST_SHARE: f64 = 0.1;

/// Bound on the leverage in the test. A spike enlarges the regressor and would otherwise pass its own test.
const MOST_LEVERAGE: f64 = 1.0;

/// The constants of gate and noise estimate, for code in other languages.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct NoiseConstants {
    /// The thresholds.
    pub gate: InnovationGate,
    /// Maximum number of consecutive outliers from one faulty sample.
    pub longest: usize,
    /// Rate of the noise estimate.
    pub rate: f64,
    /// Rows before the noise estimate is used.
    pub fewest_rows: usize,
    /// Bound on the leverage in the test.
    pub most_leverage: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Noise {
    gate: InnovationGate,
    /// Noise variance of the rows of each output \[unit^2/s^2\].
    variance: Vec<f64>,
    rows: usize,
    streak: usize,
    /// Maximum number of consecutive outliers from one faulty sample.
    longest: usize,
    rate: f64,
}

impl Noise {
    /// For rows at intervals of `row_s` seconds.
    pub(super) fn new(outputs: usize, gate: InnovationGate, longest: usize, row_s: f64) -> Self {
        let rate = (row_s / MEMORY_S).min(LARGEST_SHARE);
        Self { gate, variance: vec![0.0; outputs], rows: 0, streak: 0, longest, rate }
    }

    pub(super) fn constants(&self) -> NoiseConstants {
        NoiseConstants {
            gate: self.gate,
            longest: self.longest,
            rate: self.rate,
            fewest_rows: FEWEST_ROWS,
            most_leverage: MOST_LEVERAGE,
        }
    }

    /// Noise variance of the rows of each output; `None` during the first rows.
    pub(super) fn variances(&self) -> Option<&[f64]> {
        (self.rows >= FEWEST_ROWS).then_some(&self.variance)
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.variance);
        memory.count(&mut self.rows, MOST_COUNTED);
        memory.count(&mut self.streak, MOST_COUNTED);
    }

    pub(super) fn is_sound(&self) -> bool {
        are_variances(&self.variance)
    }

    /// Outcome of a row. On entry the `deviation` of each innovation is the leverage `phi' P phi`; on return it is the
    /// standard deviation.
    pub(super) fn judge(&mut self, innovations: &mut [Innovation]) -> Outcome {
        let known = self.rows >= FEWEST_ROWS;
        let mut deviations = 0.0f64;
        for (innovation, variance) in innovations.iter().zip(&self.variance) {
            let predicted = variance * (1.0 + innovation.deviation.min(MOST_LEVERAGE));
            // An innovation of zero is not an outlier, even with zero variance.
            if innovation.value != 0.0 {
                deviations = deviations.max(innovation.value.abs() / num_traits::Float::sqrt(predicted));
            }
        }
        let beyond = known && deviations > self.gate.inflate;
        self.streak = if beyond { self.streak + 1 } else { 0 };
        let outlier = beyond && self.streak <= self.longest;
        let share = self.rate.max(1.0 / (self.rows + 1) as f64);
        for (innovation, variance) in innovations.iter_mut().zip(&mut self.variance) {
            let leverage = innovation.deviation;
            innovation.deviation =
                if known { num_traits::Float::sqrt(*variance * (1.0 + leverage)) } else { f64::NAN };
            let mut square = innovation.value * innovation.value / (1.0 + leverage);
            if outlier {
                square = square.min(self.gate.inflate * self.gate.inflate * *variance);
            }
            *variance += share * (square - *variance);
        }
        self.rows = self.rows.saturating_add(1);
        match outlier {
            false => Outcome::Accepted,
            true if deviations > self.gate.reject => Outcome::Rejected(Rejection::Outlier { deviations }),
            true => Outcome::Inflated { deviations, weight: self.gate.inflate / deviations },
        }
    }
}
