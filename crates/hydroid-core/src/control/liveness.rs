//! The age of measurements, which limits how long a command may stay in force.

use crate::memory::Memory;

/// Time since each of `N` quantities was last measured, against one limit.
///
/// A command depends on measurements, and is valid while none of them is older than the limit. Two clocks count: a sample
/// that is used states the time since the one before ([`take`](Self::take)); lines that cannot be used, and silence, are time
/// that passes ([`pass`](Self::pass)). Of both, the longer time counts. A quantity that was never measured is infinitely old.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::struct_field_names, reason = "the unit is a suffix")]
pub struct Liveness<const N: usize> {
    limit_s: f64,
    /// Ages at the last sample that was used \[s\].
    ages_s: [f64; N],
    /// Time since that sample \[s\].
    since_s: f64,
}

/// Shortest default of the limit \[s\]. Laws hold a command for this time if they cannot compute one.
pub(super) const SHORTEST_LIMIT_S: f64 = 1.0;

/// Samples of the default of the limit.
const SAMPLES: f64 = 5.0;

impl<const N: usize> Liveness<N> {
    /// Nothing has been measured. A command is valid until the age `limit_s` \[s\].
    pub const fn new(limit_s: f64) -> Self {
        Self { limit_s, ages_s: [f64::INFINITY; N], since_s: 0.0 }
    }

    /// The limit \[s\].
    pub const fn limit_s(&self) -> f64 {
        self.limit_s
    }

    /// Time passes \[s\] without a sample that is used; infinite if it is not known how much.
    pub fn pass(&mut self, seconds: f64) {
        self.since_s += at_least_zero(seconds);
    }

    /// A sample is used, `elapsed_s` seconds after the one before: infinite for the first one. `measured` are the quantities
    /// that it holds.
    pub fn take(&mut self, elapsed_s: f64, measured: [bool; N]) {
        let step = at_least_zero(elapsed_s).max(self.since_s);
        self.since_s = 0.0;
        for (age, measured) in self.ages_s.iter_mut().zip(measured) {
            *age = if measured { 0.0 } else { *age + step };
        }
    }

    /// Age of each quantity \[s\].
    pub fn ages_s(&self) -> [f64; N] {
        self.ages_s.map(|age| age + self.since_s)
    }

    /// Whether an age is beyond the limit. Half a millionth of it covers the rounding of sums.
    pub fn is_beyond(&self, age_s: f64) -> bool {
        age_s > self.limit_s * (1.0 + 5e-7)
    }

    /// Whether no quantity is older than the limit.
    pub fn is_alive(&self) -> bool {
        !self.ages_s().iter().any(|age| self.is_beyond(*age))
    }

    /// Time until a quantity is older than the limit \[s\]; 0 if one is.
    pub fn remaining_s(&self) -> f64 {
        let oldest = self.ages_s().into_iter().fold(0.0, f64::max);
        (self.limit_s - oldest).max(0.0)
    }

    /// Visits all numbers but the limit.
    pub fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.ages_s);
        memory.number(&mut self.since_s);
        for age in self.ages_s.iter_mut().chain([&mut self.since_s]) {
            *age = at_least_zero(*age);
        }
    }
}

/// Default of the limit for samples of `dt_s` seconds \[s\]: a second, and at least five samples.
pub const fn longest_age_s(dt_s: f64) -> f64 {
    SHORTEST_LIMIT_S.max(SAMPLES * dt_s)
}

/// A time; infinite if it is not a number or negative.
fn at_least_zero(seconds: f64) -> f64 {
    if seconds >= 0.0 { seconds } else { f64::INFINITY }
}
