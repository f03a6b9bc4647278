//! Predictions with a limited deviation from the reference model.
//!
//! For the predictions `p` of the adapted model and `f` of the reference model, and half the design range `w`:
//!
//! ```text
//! d      = max over the last stride of steps within the horizon of mean over outputs of |p - f| / w
//! answer = f + a (p - f)      a = min(1, limit / d) for all steps
//! ```
//!
//! The error of the answer exceeds the error of `f` by at most `a d <= limit`, for any measurement (triangle inequality).

use alloc::boxed::Box;

use crate::predict::{Predictor, Workspace, delegate, plain};

/// Error, in half design ranges, at which a prediction counts as diverged: ten times the range.
const DIVERGED: f64 = 20.0;

/// The measure of errors and deviations.
#[derive(Clone, Debug)]
pub(super) struct Metric {
    /// Predictions are compared within `horizon` steps, over the last `stride` of them \[samples\].
    pub(super) horizon: usize,
    pub(super) stride: usize,
    /// `w`: half the design range of each output.
    pub(super) scale: Box<[f64]>,
}

impl Metric {
    /// Rows of the compared steps of a prediction.
    fn compared<'a>(&self, predicted: &'a [f64]) -> core::slice::ChunksExact<'a, f64> {
        let n = self.scale.len();
        let steps = (predicted.len() / n).min(self.horizon);
        predicted[steps.saturating_sub(self.stride) * n..steps * n].chunks_exact(n)
    }

    /// `d`; infinite if a value is not finite.
    fn distance(&self, predicted: &[f64], reference: &[f64]) -> f64 {
        let rows = self.compared(predicted).zip(self.compared(reference));
        let distance = |(p, f): (&[f64], &[f64])| {
            let off = p.iter().zip(f).zip(&self.scale).map(|((p, f), scale)| (p - f).abs() / scale);
            off.sum::<f64>() / self.scale.len() as f64
        };
        rows.map(distance).fold(0.0, |most, d| if d.is_nan() { f64::INFINITY } else { f64::max(most, d) })
    }

    /// Error of an output, at most that of a diverged prediction.
    pub(super) fn error(&self, output: usize, predicted: f64, measured: f64) -> f64 {
        let error = (predicted - measured).abs() / self.scale[output];
        if error < DIVERGED { error } else { DIVERGED }
    }

    /// Replaces a prediction by the answer.
    pub(super) fn limit(&self, predicted: &mut [f64], reference: &[f64], limit: f64) {
        let distance = self.distance(predicted, reference);
        let share = if distance <= limit { 1.0 } else { limit / distance };
        for (p, &f) in predicted.iter_mut().zip(reference) {
            let answer = if share < 1.0 { f + share * (*p - f) } else { *p };
            // A diverged reference model is not a reference.
            if answer.is_finite() {
                *p = answer;
            } else if f.is_finite() {
                *p = f;
            }
        }
    }
}

/// The adapted model, limited by the reference model; without the former the reference model alone.
pub(super) struct Bounded<'a> {
    pub(super) metric: &'a Metric,
    pub(super) limit: f64,
    pub(super) model: Option<&'a dyn Predictor>,
    pub(super) reference: &'a dyn Predictor,
}

impl Bounded<'_> {
    pub(super) fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (beside, [of_model, of_reference]) = work.take_pair(y.len());
        let Some(model) = self.model else { return self.reference.rollout(commands, of_reference, y) };
        self.reference.rollout(commands, of_reference, beside);
        model.rollout(commands, of_model, y);
        self.metric.limit(y, beside, self.limit);
    }

    pub(super) fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        let (beside, [of_model, of_reference]) = work.take_pair(y.len());
        let Some(model) = self.model else {
            return self.reference.rollout_batch(count, commands, of_reference, y);
        };
        self.reference.rollout_batch(count, commands, of_reference, beside);
        model.rollout_batch(count, commands, of_model, y);
        let len = y.len() / count;
        for (y, beside) in y.chunks_exact_mut(len).zip(beside.chunks_exact(len)) {
            self.metric.limit(y, beside, self.limit);
        }
    }
}

/// A fork of a guard without learning.
pub(super) struct GuardFork {
    pub(super) metric: Metric,
    pub(super) limit: f64,
    pub(super) model: Box<dyn Predictor>,
    pub(super) reference: Box<dyn Predictor>,
}

impl GuardFork {
    fn bounded(&self) -> Bounded<'_> {
        let Self { metric, limit, model, reference } = self;
        Bounded { metric, limit: *limit, model: Some(model.as_ref()), reference: reference.as_ref() }
    }
}

impl Predictor for GuardFork {
    plain!(advance_observe rollout_snapshots);
    delegate!(model: outputs inputs warm_up current output output_through_water);

    fn reset(&mut self) {
        self.model.reset();
        self.reference.reset();
    }

    fn observe_heading(&mut self, heading: f64) {
        self.model.observe_heading(heading);
        self.reference.observe_heading(heading);
    }

    fn observe(&mut self, y: &[f64]) {
        self.model.observe(y);
        self.reference.observe(y);
    }

    fn advance(&mut self, c: &[f64]) {
        self.model.advance(c);
        self.reference.advance(c);
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        2 * self.model.snapshot_len() + 1
    }

    fn snapshot(&self, into: &mut [f64]) {
        let len = self.model.snapshot_len();
        self.model.snapshot(&mut into[..len]);
        self.reference.snapshot(&mut into[len..2 * len]);
        into[2 * len] = self.limit;
    }

    fn restore(&mut self, from: &[f64]) {
        let len = self.model.snapshot_len();
        self.model.restore(&from[..len]);
        self.reference.restore(&from[len..2 * len]);
        self.limit = from[2 * len];
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(Self {
            metric: self.metric.clone(),
            limit: self.limit,
            model: self.model.fork(),
            reference: self.reference.fork(),
        })
    }
}
