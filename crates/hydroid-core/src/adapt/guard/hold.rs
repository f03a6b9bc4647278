//! The end of a hold against the gate: the measurement is trusted.
//!
//! - *Evidence*: the unguarded learner predicts the measurements that are held back, over [`Evidence::tests`] tests within the
//!   hold, with a mean error of at most two deviations (the 95 % limit of a normal deviate), in two consecutive tests. They do
//!   what a model that believes them predicts.
//! - *Budget*: every sample with a held output takes 1 from the budget, every other one gives back `share`, up to `hold`.
//!   Without budget all holds end. In any `L` samples, at most `(hold + share L) / (1 + share)` have a held output.

use super::options::GuardOptions;
use crate::memory::Memory;

/// Deviations within which measurements are consistent with a prediction.
pub(super) const CONSISTENT: f64 = 2.0;

/// Consecutive consistent tests that end a hold.
const CONSISTENT_TESTS: usize = 2;

/// Consistency of the measurements that are held back with the unguarded learner.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Evidence {
    consistent: usize,
}

impl Evidence {
    /// Length of the predictions \[tests\]: half a horizon.
    pub(super) fn tests(options: &GuardOptions) -> usize {
        (options.horizon / options.stride).div_ceil(2)
    }

    pub(super) fn reset(&mut self) {
        self.consistent = 0;
    }

    /// Adds a test; whether the evidence suffices.
    pub(super) fn add(&mut self, consistent: bool) -> bool {
        self.consistent = if consistent { self.consistent + 1 } else { 0 };
        self.consistent >= CONSISTENT_TESTS
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.count(&mut self.consistent, CONSISTENT_TESTS);
    }
}

/// Samples that may still be held.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    left: f64,
}

impl Budget {
    pub(super) fn new(options: &GuardOptions) -> Self {
        Self { left: options.hold as f64 }
    }

    /// Whether a hold may begin: there is budget for a horizon.
    pub(super) fn permits(self, options: &GuardOptions) -> bool {
        self.left >= options.horizon as f64
    }

    /// Whether there is budget for a held sample.
    pub(super) fn is_empty(self) -> bool {
        self.left < 1.0
    }

    /// Counts a sample.
    pub(super) fn add(&mut self, held: bool, options: &GuardOptions) {
        self.left = if held { self.left - 1.0 } else { (self.left + options.share).min(options.hold as f64) };
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.number(&mut self.left);
    }

    pub(super) fn is_sound(self, options: &GuardOptions) -> bool {
        (0.0..=options.hold as f64).contains(&self.left)
    }
}
