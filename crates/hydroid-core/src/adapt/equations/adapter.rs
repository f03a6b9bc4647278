//! Adaptation and saved state of recursive equations.

use super::super::prediction_variance::PredictionVariance;
use super::super::{Health, Innovation, Learning, Outcome, Rehearsing, SaveState};
use super::{Group, RecursiveEquations};
use crate::memory::{MOST_COUNTED, Memory};
use crate::predict::{Predictor, Workspace, plain};

impl Learning for RecursiveEquations {
    plain!(no_guard);

    fn outcome(&self) -> Outcome {
        self.outcome
    }

    fn innovations(&self) -> &[Innovation] {
        &self.innovations
    }

    fn weights(&self) -> &[f64] {
        &self.weights
    }

    fn freeze(&mut self, frozen: bool) {
        self.frozen = frozen;
    }

    fn scale_noise(&mut self, factor: f64) {
        self.inflation = factor;
    }

    fn restart(&mut self) {
        self.groups.iter_mut().for_each(|group| group.kernel.restart());
    }

    /// Unknown: the covariance is positive by construction.
    fn health(&self) -> Health {
        Health::UNKNOWN
    }

    /// From sensor noise, process noise and coefficient uncertainty; NaN during the first rows.
    fn deviations(
        &mut self,
        commands: &[f64],
        horizons: &[usize],
        work: &mut Workspace,
        deviations: &mut [f64],
    ) {
        let n = self.outputs();
        assert_eq!(deviations.len(), horizons.len() * n, "a row for each horizon");
        let (Some(prediction_variance), Some(variances)) =
            (&self.prediction_variance, self.noise.variances())
        else {
            deviations.fill(f64::NAN);
            return;
        };
        // Different outputs are independent. The coefficients of an output have the covariance of their group times the
        // noise variance of its rows.
        let uncertain = |s: &[f64]| -> f64 {
            let of_group = |group: &Group| -> f64 {
                let of_output = |(&output, &first): (&usize, &usize)| {
                    let phi = |t: usize| s[first + t] * self.library.inverse[group.terms[t]];
                    variances[output] * group.kernel.variance(phi)
                };
                group.outputs.iter().zip(&group.firsts).map(of_output).sum()
            };
            self.groups.iter().map(of_group).sum()
        };
        let samples = self.rows.samples();
        let rows = (variances, samples, samples as f64 * self.equations().dt());
        let scratch = work.take(prediction_variance.scratch(horizons.last().copied().unwrap_or(0)));
        prediction_variance.deviations(
            (self.session.state(), commands),
            horizons,
            rows,
            uncertain,
            scratch,
            deviations,
        );
    }
}

impl SaveState for RecursiveEquations {
    fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.session(&mut self.session);
        self.rows.visit_state(memory);
        self.noise.visit_state(memory);
        self.groups.iter_mut().for_each(|group| group.kernel.visit_state(memory));
        memory.numbers(&mut self.library.start);
        memory.flag(&mut self.library.known);
        memory.flag(&mut self.library.held);
        memory.count(&mut self.library.seen, MOST_COUNTED);
        memory.flag(&mut self.frozen);
        memory.number(&mut self.inflation);
        memory.numbers(&mut self.expected);
        if let Some(prediction_variance) = &mut self.prediction_variance {
            prediction_variance.visit_state(memory);
        }
        if memory.is_loading() {
            self.session.weights(&mut self.weights);
            self.update_prediction_variance();
            self.outcome = Outcome::Waiting;
            self.innovations.clear();
        }
    }

    fn is_sound(&self) -> bool {
        self.weights.iter().all(|weight| weight.is_finite())
            && self.groups.iter().all(|group| group.kernel.is_sound())
            && self.noise.is_sound()
            && self.prediction_variance.as_ref().is_none_or(PredictionVariance::is_sound)
    }
}

impl Rehearsing for RecursiveEquations {
    plain!(no_rehearsal);
}
