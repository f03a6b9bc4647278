//! Predictions with a limited deviation from the reference model, and from the unguarded learner.
//!
//! For a prediction `p`, that of a companion `f`, and half the design range `w`:
//!
//! ```text
//! d          = max over the last stride of steps within the horizon of mean over outputs of |p - f| / w
//! near(p, f) = f + a (p - f)      a = min(1, limit / d) for all steps
//! ```
//!
//! Its error exceeds the error of `f` by at most `a d <= limit`, for any measurement (triangle inequality). Errors are limited
//! to 20, so that a limit of 20 permits any prediction, also beside a companion that has diverged. With the
//! predictions `s` of the learner, `f` of the reference model and `p` of the unguarded learner, the answer is `near(s, f)`
//! while a measurement is held back, and `near(near(s, f), p)` otherwise.

use alloc::boxed::Box;

use crate::predict::{Current, Predictor, Workspace, delegate, plain};

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
    pub(super) fn distance(&self, predicted: &[f64], companion: &[f64]) -> f64 {
        let rows = self.compared(predicted).zip(self.compared(companion));
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

    /// Replaces a prediction by one within the limit of its companion.
    pub(super) fn limit(&self, predicted: &mut [f64], companion: &[f64], limit: f64) {
        let distance = self.distance(predicted, companion);
        // Errors are at most those of a diverged prediction.
        let share = if distance.min(DIVERGED) <= limit { 1.0 } else { limit / distance };
        for (p, &f) in predicted.iter_mut().zip(companion) {
            let near = if share < 1.0 { f + share * (*p - f) } else { *p };
            // A companion that has diverged limits nothing.
            if near.is_finite() {
                *p = near;
            } else if f.is_finite() {
                *p = f;
            }
        }
    }
}

/// The models behind an answer.
pub(super) struct Bounded<'a> {
    pub(super) metric: &'a Metric,
    /// Limits of the distance to the reference model and to the unguarded learner.
    pub(super) limits: [f64; 2],
    /// Whether a measurement is held back: the second limit does not apply.
    pub(super) held: bool,
    /// `None`: the reference model.
    pub(super) model: Option<&'a dyn Predictor>,
    pub(super) reference: &'a dyn Predictor,
    /// `None`: its predictions are those of `model`.
    pub(super) unguarded: Option<&'a dyn Predictor>,
}

impl Bounded<'_> {
    pub(super) fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.answer(1, work, y, |model, work, y| model.rollout(commands, work, y));
    }

    pub(super) fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.answer(count, work, y, |model, work, y| model.rollout_batch(count, commands, work, y));
    }

    fn answer(
        &self,
        count: usize,
        work: &mut Workspace,
        y: &mut [f64],
        roll_out: impl Fn(&dyn Predictor, &mut Workspace, &mut [f64]),
    ) {
        let [to_reference, to_unguarded] = self.limits;
        let (beside, [of_model, of_reference]) = work.take_pair(2 * y.len());
        let (reference, unguarded) = beside.split_at_mut(y.len());
        if let (false, 0.0, Some(alone)) = (self.held, to_unguarded, self.unguarded.or(self.model)) {
            return roll_out(alone, of_model, y);
        }
        roll_out(self.reference, of_reference, reference);
        match self.model {
            Some(model) => roll_out(model, of_model, y),
            None => y.copy_from_slice(reference),
        }
        match self.unguarded {
            Some(model) if !self.held => roll_out(model, of_model, unguarded),
            _ => unguarded.copy_from_slice(y),
        }
        let len = y.len() / count.max(1);
        let besides = reference.chunks_exact(len.max(1)).zip(unguarded.chunks_exact(len.max(1)));
        for (y, (reference, unguarded)) in y.chunks_exact_mut(len.max(1)).zip(besides) {
            self.metric.limit(y, reference, to_reference);
            if !self.held {
                self.metric.limit(y, unguarded, to_unguarded);
            }
        }
    }
}

/// A fork of a guard without learning.
pub(super) struct GuardFork {
    pub(super) metric: Metric,
    pub(super) limits: [f64; 2],
    pub(super) held: bool,
    /// The active model.
    pub(super) model: Box<dyn Predictor>,
    pub(super) reference: Box<dyn Predictor>,
    pub(super) unguarded: Box<dyn Predictor>,
    /// Whether the unguarded learner differs from the active model.
    pub(super) apart: bool,
}

impl GuardFork {
    fn bounded(&self) -> Bounded<'_> {
        Bounded {
            metric: &self.metric,
            limits: self.limits,
            held: self.held,
            model: Some(self.model.as_ref()),
            reference: self.reference.as_ref(),
            unguarded: self.apart.then_some(self.unguarded.as_ref()),
        }
    }

    fn models(&mut self) -> [&mut Box<dyn Predictor>; 3] {
        [&mut self.model, &mut self.reference, &mut self.unguarded]
    }

    fn present(&self) -> &dyn Predictor {
        if self.held { self.model.as_ref() } else { self.unguarded.as_ref() }
    }
}

impl Predictor for GuardFork {
    plain!(advance_observe rollout_snapshots);
    delegate!(model: outputs inputs warm_up);

    fn current(&self) -> Option<&Current> {
        self.present().current()
    }

    fn output(&self, y: &mut [f64]) {
        self.present().output(y);
    }

    fn output_through_water(&self, y: &mut [f64]) {
        self.present().output_through_water(y);
    }

    fn reset(&mut self) {
        self.models().into_iter().for_each(|model| model.reset());
    }

    fn observe_heading(&mut self, heading: f64) {
        self.models().into_iter().for_each(|model| model.observe_heading(heading));
    }

    fn observe(&mut self, y: &[f64]) {
        self.models().into_iter().for_each(|model| model.observe(y));
    }

    fn advance(&mut self, c: &[f64]) {
        self.models().into_iter().for_each(|model| model.advance(c));
    }

    fn rollout(&self, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout(commands, work, y);
    }

    fn rollout_batch(&self, count: usize, commands: &[f64], work: &mut Workspace, y: &mut [f64]) {
        self.bounded().rollout_batch(count, commands, work, y);
    }

    fn snapshot_len(&self) -> usize {
        snapshot_len(self.model.as_ref())
    }

    fn snapshot(&self, into: &mut [f64]) {
        let models = [self.model.as_ref(), self.reference.as_ref(), self.unguarded.as_ref()];
        write_snapshot(models, self.limits, self.held, into);
    }

    fn restore(&mut self, from: &[f64]) {
        let len = self.model.snapshot_len();
        for (model, from) in self.models().into_iter().zip(from.chunks_exact(len)) {
            model.restore(from);
        }
        (self.limits, self.held) = read_limits(from, len);
        self.apart = from[..len] != from[2 * len..3 * len];
    }

    fn fork(&self) -> Box<dyn Predictor> {
        Box::new(Self {
            metric: self.metric.clone(),
            limits: self.limits,
            held: self.held,
            model: self.model.fork(),
            reference: self.reference.fork(),
            unguarded: self.unguarded.fork(),
            apart: self.apart,
        })
    }
}

pub(super) fn snapshot_len(model: &dyn Predictor) -> usize {
    3 * model.snapshot_len() + 3
}

/// Snapshots of the active model, the reference model and the unguarded learner, the limits, and 1 if a measurement is held
/// back.
pub(super) fn write_snapshot(
    models: [&dyn Predictor; 3],
    [to_reference, to_unguarded]: [f64; 2],
    held: bool,
    into: &mut [f64],
) {
    let (snapshots, rest) = into.split_at_mut(into.len() - 3);
    for (model, into) in models.iter().zip(snapshots.chunks_exact_mut(snapshots.len() / 3)) {
        model.snapshot(into);
    }
    rest.copy_from_slice(&[to_reference, to_unguarded, f64::from(u8::from(held))]);
}

/// Limits of a snapshot, and whether a measurement is held back.
pub(super) fn read_limits(from: &[f64], len: usize) -> ([f64; 2], bool) {
    ([from[3 * len], from[3 * len + 1]], from[3 * len + 2] != 0.0)
}
