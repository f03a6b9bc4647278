//! Predictions with the adapted last layer.

use alloc::boxed::Box;

use super::DirectLastLayer;
use crate::adapt::{Outcome, Rejection};
use crate::predict::{Predictor, Workspace};

impl Predictor for DirectLastLayer {
    fn outputs(&self) -> usize {
        self.session.outputs()
    }

    fn inputs(&self) -> usize {
        self.session.inputs()
    }

    fn warm_up(&self) -> usize {
        self.session.warm_up()
    }

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

    fn output(&self, y: &mut [f64]) {
        self.session.output(y);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.session.rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        self.session.snapshot_len()
    }

    fn snapshot(&self, into: &mut [f64]) {
        self.session.snapshot(into);
    }

    /// Restores state and weights. The windows restart, and the covariance stays.
    fn restore(&mut self, from: &[f64]) {
        self.session.restore(from);
        self.windows.restart(self.session.past(), self.session.memory());
        self.sync_learner();
    }

    fn fork(&self) -> Box<dyn Predictor> {
        self.session.fork()
    }
}
