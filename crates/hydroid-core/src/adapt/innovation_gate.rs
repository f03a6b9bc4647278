//! How far a row may be from what is expected, and what happens beyond.

use alloc::vec;
use alloc::vec::Vec;

use super::memory::{MOST_COUNTED, Reader, Writer};
use super::{Innovation, Outcome, Rejection};

/// Limits on the largest innovation of a row \[standard deviations\].
///
/// Beyond `inflate` a row weighs less, as in Huber's estimator: by `inflate / deviations`. Beyond `reject` it
/// is not learned from at all. A single bad sample stands in a limited number of rows; innovations that stay
/// large for longer are no outliers but a vessel that has changed, and are believed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct InnovationGate {
    /// Where weights begin to fall.
    pub inflate: f64,
    /// Where rows are rejected.
    pub reject: f64,
}

impl Default for InnovationGate {
    fn default() -> Self {
        Self { inflate: 3.0, reject: 10.0 }
    }
}

impl InnovationGate {
    /// Learns from everything that is finite.
    pub const OPEN: Self = Self { inflate: f64::INFINITY, reject: f64::INFINITY };
}

/// Rows before the noise is known well enough to judge by.
pub(super) const FEWEST_ROWS: usize = 30;

/// Time \[s\] over which the noise is learned, and the largest share of one row in it: on real vessels the size
/// of what the model leaves out changes with what the vessel does. (With the forgetting time of the coefficients, a
/// minute, 64 and 83 % of the tug's innovations were inside the 80 and 95 % band; so, 74 and 90 %.)
pub(super) const MEMORY_S: f64 = 20.0;
pub(super) const LARGEST_SHARE: f64 = 0.1;

/// The part of an innovation that uncertain coefficients can excuse is bounded by that of the noise. A spike
/// in an output makes large regressors, whose innovation would otherwise excuse itself.
const MOST_LEVERAGE: f64 = 1.0;

/// The noise of the rows, learned from the innovations, and the gate that follows from it.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    gate: InnovationGate,
    /// Variance of each output's row noise.
    variance: Vec<f64>,
    rows: usize,
    /// Rows in sequence that were beyond the gate, and how many of them one bad sample can explain.
    streak: usize,
    longest: usize,
    /// Share of a row in the noise estimate, once that is settled.
    rate: f64,
}

impl Noise {
    /// For rows that come every `row_s` seconds.
    pub(super) fn new(outputs: usize, gate: InnovationGate, longest: usize, row_s: f64) -> Self {
        let rate = (row_s / MEMORY_S).min(LARGEST_SHARE);
        Self { gate, variance: vec![0.0; outputs], rows: 0, streak: 0, longest, rate }
    }

    /// Variance of the noise of each output's rows, once it is known.
    pub(super) fn variances(&self) -> Option<&[f64]> {
        (self.rows >= FEWEST_ROWS).then_some(&self.variance)
    }

    /// How many numbers [`save`](Self::save) writes.
    pub(super) fn memory_len(&self) -> usize {
        self.variance.len() + 2
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&self.variance);
        into.count(self.rows);
        into.count(self.streak);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        from.numbers(&mut self.variance);
        self.rows = from.count(MOST_COUNTED);
        self.streak = from.count(MOST_COUNTED);
    }

    /// Completes the innovations of a row (their values are given, and in `deviation` their `phi' P phi`) and
    /// decides what happens to it.
    pub(super) fn judge(&mut self, innovations: &mut [Innovation]) -> Outcome {
        let known = self.rows >= FEWEST_ROWS;
        let mut deviations = 0.0f64;
        for (innovation, variance) in innovations.iter().zip(&self.variance) {
            let predicted = variance * (1.0 + innovation.deviation.min(MOST_LEVERAGE));
            // A row without an innovation is no outlier, even where there is no noise at all.
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
                // What is not believed does not widen the gate either, by more than the gate itself.
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
