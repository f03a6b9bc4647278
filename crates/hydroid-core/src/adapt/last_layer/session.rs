//! Predictions with the adapted last layer.

use super::DirectLastLayer;
use crate::adapt::{Outcome, Rejection};
use crate::predict::{Predictor, delegate, plain};

impl Predictor for DirectLastLayer {
    plain!(over_ground advance_observe rollout_snapshots);
    delegate!(session: outputs inputs warm_up output rollout rollout_batch snapshot_len snapshot fork);

    fn reset(&mut self) {
        self.session.reset();
        self.windows.restart(self.session.past(), self.session.memory());
        self.inflation = 1.0;
        self.innovations.clear();
        self.outcome = Outcome::Waiting;
    }

    /// Infinite values count as missing.
    fn observe(&mut self, y: &[f64]) {
        let inflation = core::mem::replace(&mut self.inflation, 1.0);
        self.session.observe(y);
        if self.windows.observe(y, self.session.past().0, inflation) {
            self.learn();
        }
        if y.iter().any(|y| y.is_infinite()) {
            self.outcome = Outcome::Rejected(Rejection::NotFinite);
            self.innovations.clear();
        }
    }

    fn advance(&mut self, c: &[f64]) {
        self.session.advance(c);
        let outputs = self.session.past().0;
        let present = &outputs[outputs.len() - self.session.outputs()..];
        self.windows.advance(c, present, self.session.memory());
    }

    /// Restores state and weights. The windows restart, and the covariance stays.
    fn restore(&mut self, from: &[f64]) {
        self.session.restore(from);
        self.windows.restart(self.session.past(), self.session.memory());
        self.sync_learner();
    }
}
