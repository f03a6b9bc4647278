//! The hypothesis that the current has jumped.

use alloc::vec;
use alloc::vec::Vec;

use crate::memory::Memory;
use crate::predict::Current;

/// Another current since the start of a window, with the model of that time, beside the present current and model.
#[derive(Clone, Debug)]
pub(super) struct Jump {
    considered: bool,
    /// The other current.
    pub(super) current: Current,
    /// Logarithm of its odds.
    odds: f64,
    /// Its odds at the beginning.
    prior_odds: f64,
    model: Vec<f64>,
}

impl Jump {
    /// Room for a snapshot of the model.
    pub(super) fn new(size: usize) -> Self {
        let current = Current { velocity: [0.0; 2], covariance: [0.0; 3] };
        Self { considered: false, current, odds: 0.0, prior_odds: 0.0, model: vec![0.0; size] }
    }

    pub(super) const fn is_considered(&self) -> bool {
        self.considered
    }

    pub(super) const fn forget(&mut self) {
        self.considered = false;
    }

    /// Considers another current, with the model before the window and the logarithm of the odds of a jump.
    pub(super) fn consider(&mut self, current: Current, model: &[f64], odds: f64) {
        self.considered = true;
        self.current = current;
        (self.odds, self.prior_odds) = (odds, odds);
        self.model.copy_from_slice(model);
    }

    /// The model before the jump.
    pub(super) fn model(&self, into: &mut [f64]) {
        into.copy_from_slice(&self.model);
    }

    /// Takes a result of a further window: the other current after it, and the logarithm of the ratio of the evidences.
    pub(super) fn update(&mut self, current: Current, evidence: f64) {
        self.current = current;
        self.odds += evidence;
        // Refuted as soon as it is less probable than at the beginning.
        self.considered = self.odds >= self.prior_odds;
    }

    /// Whether the other current is the more probable one.
    pub(super) fn is_confirmed(&self) -> bool {
        self.considered && self.odds > 0.0
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.flag(&mut self.considered);
        memory.numbers(&mut self.current.velocity);
        memory.numbers(&mut self.current.covariance);
        memory.number(&mut self.odds);
        memory.number(&mut self.prior_odds);
        memory.numbers(&mut self.model);
    }
}
