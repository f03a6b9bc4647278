//! The account of a guarantee: it limits the deviation of answers from a companion, which is the reference model or the
//! unguarded learner.
//!
//! The cost of an answer at test `j` is `c_j = e_answer - factor e_companion`. With the weight `b = exp(-stride / window)`
//! of the past per test, the balance is
//!
//! ```text
//! W_0 = B        W_j = B + b (W_{j-1} - B) - c_j        B = floors floor / (1 - b)
//! ```
//!
//! Then `B - W_j = sum_{i <= j} b^(j-i) c_i`, so that `W_j >= 0` is the guarantee at test `j`.
//!
//! A cost is known `n = horizon / stride` tests after its answer. Until then it is at most the limit `l` of the distance
//! between answer and companion. The limit at test `j` is
//!
//! ```text
//! l_j = max(0, min(A_j / n, A_j - sum of l_i over the answers that are not judged yet))
//! A_j = min(W_j, B + b^n (W_j - B))
//! ```
//!
//! An exempt answer has the cost and the limit 0. **Theorem.** `W_j >= 0` for all `j`; `docs/guard-theory.md` has the proof.

use alloc::vec;
use alloc::vec::Vec;

use super::options::GuardOptions;
use crate::memory::Memory;

/// The balance `W` of one model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Balance {
    opening: f64,
    past: f64,
    pub(super) value: f64,
}

impl Balance {
    /// For a noise floor in the units of the errors.
    pub(super) fn new(options: &GuardOptions, floor: f64) -> Self {
        let past = num_traits::Float::exp(-(options.stride as f64) / options.window as f64);
        let opening = options.floors * floor / (1.0 - past);
        Self { opening, past, value: opening }
    }

    pub(super) fn reset(&mut self) {
        self.value = self.opening;
    }

    pub(super) fn settle(&mut self, cost: f64) {
        self.value = self.opening + self.past * (self.value - self.opening) - cost;
    }

    /// Whether the model has cost more than twice what the guarantee permits.
    pub(super) fn is_overdrawn(&self) -> bool {
        self.value < -self.opening
    }
}

/// The balance of the answers, and the limits of those that are not judged yet.
#[derive(Clone, Debug)]
pub(super) struct Account {
    balance: Balance,
    /// Limits of the last `n` tests, oldest first.
    limits: Vec<f64>,
}

impl Account {
    pub(super) fn new(options: &GuardOptions, balance: Balance) -> Self {
        let mut own = Self { balance, limits: vec![0.0; options.horizon / options.stride] };
        own.open(false);
        own
    }

    /// Limit of the answers from now on.
    pub(super) fn limit(&self) -> f64 {
        self.limits[self.limits.len() - 1]
    }

    pub(super) fn balance(&self) -> f64 {
        self.balance.value
    }

    /// Limit of the answers of a horizon ago.
    pub(super) fn oldest(&self) -> f64 {
        self.limits[0]
    }

    /// Starts a run: answers that are not judged yet never will be.
    pub(super) fn reset(&mut self) {
        self.limits.fill(0.0);
        self.open(false);
    }

    /// Continues from a snapshot with this limit.
    pub(super) fn restore_limit(&mut self, limit: f64) {
        self.limits.fill(limit);
    }

    /// Adds the cost of the oldest answer.
    pub(super) fn settle(&mut self, cost: f64) {
        self.balance.settle(cost.min(self.limits[0]));
    }

    /// Sets the limit of the next answers, and forgets the oldest. Answers that are `exempt` have no cost and the limit 0.
    pub(super) fn open(&mut self, exempt: bool) {
        let n = self.limits.len();
        let Balance { opening, past, value } = self.balance;
        let available = value.min(opening + num_traits::pow(past, n) * (value - opening));
        self.limits.rotate_left(1);
        let pending: f64 = self.limits[..n - 1].iter().sum();
        let limit = (available - pending).min(available / n as f64).max(0.0);
        self.limits[n - 1] = if exempt { 0.0 } else { limit };
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.number(&mut self.balance.value);
        memory.numbers(&mut self.limits);
    }

    /// Whether the numbers can be those of an account.
    pub(super) fn is_sound(&self) -> bool {
        self.balance.value.is_finite() && self.limits.iter().all(|limit| limit.is_finite() && *limit >= 0.0)
    }
}

#[cfg(test)]
mod tests;
