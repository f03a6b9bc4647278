//! The hypothesis that the current has jumped.

use alloc::vec;
use alloc::vec::Vec;

use crate::adapt::memory::{Reader, Writer};
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

    pub(super) const fn memory_len(&self) -> usize {
        self.model.len() + 8
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        let Current { velocity: [north, east], covariance: [p, q, r] } = self.current;
        into.flag(self.considered);
        into.numbers(&[north, east, p, q, r, self.odds, self.prior_odds]);
        into.numbers(&self.model);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        self.considered = from.flag();
        let mut numbers = [0.0; 7];
        from.numbers(&mut numbers);
        let [north, east, p, q, r, odds, prior_odds] = numbers;
        self.current = Current { velocity: [north, east], covariance: [p, q, r] };
        (self.odds, self.prior_odds) = (odds, prior_odds);
        from.numbers(&mut self.model);
    }
}
