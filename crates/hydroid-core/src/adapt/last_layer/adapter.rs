//! Adaptation and saved state of the last layer.

use super::DirectLastLayer;
use crate::adapt::are_variances;
use crate::adapt::{Health, Innovation, Learning, Outcome, RecursiveLeastSquares, Rehearsing, SaveState};
use crate::memory::{MOST_COUNTED, Memory};
use crate::predict::{Predictor, Workspace, plain};

impl Learning for DirectLastLayer {
    plain!(no_guard);

    fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Of the last step of the horizon, whose target is the present sample.
    fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }

    fn weights(&self) -> &[f64] {
        self.session.last_layer()
    }

    fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
    }

    fn scale_noise(&mut self, factor: f64) {
        self.inflation = factor;
    }

    fn restart(&mut self) {
        if let Some(learner) = &mut self.learner {
            learner.restart();
        }
    }

    /// The covariance is positive by construction.
    fn health(&self) -> Health {
        Health { min_s_over_r: self.s_over_r, ..Health::UNKNOWN }
    }

    /// From the error variance of each step and the uncertainty of the weights, `sqrt(variance (1 + phi' P phi))`;
    /// NaN beyond the horizon of the network, and for targets with too few errors.
    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        _: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let n = self.session.outputs();
        assert_eq!(deviations.len(), horizons.len() * n, "a row for each horizon");
        let (h, m) = (self.model().horizon, self.session.inputs());
        deviations.fill(f64::NAN);
        // A model without inputs needs no commands.
        let given = &commands[..commands.len().min(h * m)];
        let missing = given.is_empty() && m > 0 || given.iter().any(|c| c.is_nan());
        let unknown = (0..self.seen.len()).all(|i| !self.is_known(i));
        if unknown || self.session.is_waiting() || missing {
            return;
        }
        let features = self.phi.len() - 1;
        self.session.present_features(given, &mut self.phi[..features]);
        let s_over_r = 1.0 + self.learner.as_mut().map_or(0.0, |learner| learner.project(&self.phi));
        let scale = &self.session.model().scaling.correction_scale;
        for (&horizon, into) in horizons.iter().zip(deviations.chunks_exact_mut(n)) {
            if !(1..=h).contains(&horizon) {
                continue;
            }
            for (c, (into, scale)) in into.iter_mut().zip(scale).enumerate() {
                let number = (horizon - 1) * n + c;
                if self.is_known(number) {
                    *into = num_traits::Float::sqrt(self.variance[number] * s_over_r) * scale;
                }
            }
        }
    }
}

impl SaveState for DirectLastLayer {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.session(&mut self.session);
        self.windows.visit_state(memory);
        if let Some(learner) = &mut self.learner {
            learner.visit_state(memory);
        }
        memory.numbers(&mut self.variance);
        memory.number(&mut self.s_over_r);
        memory.number(&mut self.inflation);
        self.seen.iter_mut().for_each(|seen| memory.count(seen, MOST_COUNTED));
        memory.flag(&mut self.frozen);
        if memory.is_loading() {
            self.innovations.clear();
            self.outcome = Outcome::Waiting;
        }
    }

    fn is_sound(&self) -> bool {
        self.session.last_layer().iter().all(|weight| weight.is_finite())
            && self.learner.as_ref().is_none_or(RecursiveLeastSquares::is_sound)
            && are_variances(&self.variance)
    }
}

impl Rehearsing for DirectLastLayer {
    plain!(no_rehearsal);
}
