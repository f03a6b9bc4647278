//! The shadow test: rollouts of past models under the recorded commands, compared with the measurements.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::deviation_bound::{Budget, DeviationBound, Motion, estimate_motion};
use super::event::Expert;
use crate::adapt::Adapter;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};
use crate::predict::{Predictor, Workspace};

const EXPERTS: usize = Expert::ALL.len();

/// Errors of a shadow test, in the units of [`Action`](super::Action): infinite for a diverged rollout, NaN without
/// measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TestErrors {
    /// Errors of the predictions of `H` samples ago over their last stride.
    pub(super) horizon: [f64; EXPERTS],
    /// Errors of the predictions of one stride ago over the whole stride; NaN for the snapshot.
    pub(super) stride: [f64; EXPERTS],
    /// As `horizon`, for the learner with its present weights.
    pub(super) current_weights: f64,
    /// Revisions: the largest distance, over the next horizon with the last command held, between the predictions of
    /// each model now and a stride ago. Zero for the reference model.
    pub(super) revisions: [f64; EXPERTS],
    /// Cost of the answers: their error beyond `factor` times the error of the reference model. A missing output counts
    /// with the distance between the two predictions.
    pub(super) excess: f64,
    /// Part of the excess beyond the limit of the budget: the cost of wrong supported deviations.
    pub(super) overdraft: f64,
    /// For a rejected prediction: whether its cost would have been within the limit.
    pub(super) rejection_right: Option<bool>,
    /// Whether each output was measured in at least half of the samples.
    pub(super) complete: bool,
}

pub(super) struct ShadowTest {
    horizon: usize,
    stride: usize,
    outputs: usize,
    inputs: usize,
    /// Length of a snapshot, and of the weights at its end.
    len: usize,
    weights: usize,
    bound: DeviationBound,
    factor: f64,
    /// The last `H` commands and measurements, each stored twice, so that they are contiguous.
    commands: Vec<f64>,
    measured: Vec<f64>,
    samples: usize,
    held: usize,
    /// For each origin under test: snapshots of all models, the active model, its budget and the motion.
    snapshots: Vec<f64>,
    active: Vec<Expert>,
    budgets: Vec<Budget>,
    motions: Vec<[f64; 2]>,
    shadow: Box<dyn Predictor>,
    work: Workspace,
    predicted: [Vec<f64>; EXPERTS],
    buffer: Vec<f64>,
    /// The commands of the last stride, then the last command over a horizon; the present prediction under the latter.
    continued: Vec<f64>,
    present: Vec<f64>,
}

impl ShadowTest {
    pub(super) fn new(learner: &dyn Adapter, bound: DeviationBound, factor: f64) -> Self {
        let (horizon, stride) = (bound.horizon, bound.stride);
        let (outputs, inputs, len) = (learner.outputs(), learner.inputs(), learner.snapshot_len());
        let slots = horizon / stride + 1;
        Self {
            horizon,
            stride,
            outputs,
            inputs,
            len,
            weights: learner.weights().len(),
            bound,
            factor,
            commands: vec![0.0; 2 * horizon * inputs],
            measured: vec![f64::NAN; 2 * horizon * outputs],
            samples: 0,
            held: 0,
            snapshots: vec![0.0; slots * EXPERTS * len],
            active: vec![Expert::default(); slots],
            budgets: vec![Budget::NONE; slots],
            motions: vec![[f64::NAN; 2]; slots * outputs],
            shadow: learner.fork(),
            work: Workspace::new(),
            predicted: core::array::from_fn(|_| vec![0.0; (horizon + stride) * outputs]),
            buffer: vec![0.0; len],
            continued: vec![0.0; (horizon + stride) * inputs],
            present: vec![0.0; horizon * outputs],
        }
    }

    pub(super) fn reset(&mut self) {
        (self.samples, self.held) = (0, 0);
    }

    pub(super) fn push_command(&mut self, c: &[f64]) {
        push(&mut self.commands, self.held % self.horizon, c);
        self.held += 1;
    }

    pub(super) fn push_measurement(&mut self, y: &[f64]) {
        push(&mut self.measured, self.samples % self.horizon, y);
        self.samples += 1;
    }

    /// Estimates the motion from the last two strides; no change if the horizon is shorter.
    pub(super) fn estimate_motion(&self, motion: &mut Motion) {
        let stride = self.stride;
        if self.samples < 2 * stride || self.horizon < 2 * stride {
            return;
        }
        let rows = &self.measured[last(self.horizon, 2 * stride, self.samples, self.outputs)];
        estimate_motion(rows, motion);
    }

    pub(super) fn is_due(&self) -> bool {
        self.index().is_multiple_of(self.stride) && self.held == self.index()
    }

    fn index(&self) -> usize {
        self.samples.saturating_sub(1)
    }

    /// Tests the models of a horizon and a stride ago; `None` within the first horizon.
    pub(super) fn test(&mut self, [learner, snapshot]: [&dyn Adapter; 2]) -> Option<TestErrors> {
        let now = self.index();
        if now < self.horizon {
            return None;
        }
        let (horizon_ago, stride_ago) = (self.slot(now - self.horizon), self.slot(now - self.stride));
        let mut tested = TestErrors {
            horizon: [f64::NAN; EXPERTS],
            stride: [f64::NAN; EXPERTS],
            current_weights: f64::NAN,
            revisions: [0.0; EXPERTS],
            excess: 0.0,
            overdraft: 0.0,
            rejection_right: None,
            complete: true,
        };
        for e in 0..EXPERTS {
            self.restore(horizon_ago, e);
            tested.horizon[e] = self.error(self.horizon, e);
        }
        tested.rejection_right = self.rejection_right(horizon_ago);
        tested.excess = self.excess(horizon_ago);
        tested.overdraft = (tested.excess - self.budgets[horizon_ago].limit).max(0.0);
        tested.complete = is_complete(self.last_stride(), self.outputs);
        // The past state with the present weights.
        learner.snapshot(&mut self.buffer);
        let state = self.len - self.weights;
        let own = Expert::Adapted.index();
        let at = (horizon_ago * EXPERTS + own) * self.len;
        self.buffer[..state].copy_from_slice(&self.snapshots[at..at + state]);
        self.shadow.restore(&self.buffer);
        tested.current_weights = self.error(self.horizon, own);
        for e in [own, Expert::Reference.index()] {
            self.restore(stride_ago, e);
            tested.stride[e] = self.error(self.stride, e);
        }
        for (expert, model) in [(Expert::Adapted, learner), (Expert::Snapshot, snapshot)] {
            tested.revisions[expert.index()] = self.revision(stride_ago, expert.index(), model);
        }
        Some(tested)
    }

    /// See [`TestErrors::revisions`]; `slot` is of a stride ago.
    fn revision(&mut self, slot: usize, expert: usize, model: &dyn Adapter) -> f64 {
        let (begun, held) = self.continued.split_at_mut(self.stride * self.inputs);
        begun.copy_from_slice(&self.commands[last(self.horizon, self.stride, self.held, self.inputs)]);
        let command = &begun[(self.stride - 1) * self.inputs..];
        held.chunks_exact_mut(self.inputs).for_each(|into| into.copy_from_slice(command));
        model.rollout(held, &mut self.work, &mut self.present);
        self.restore(slot, expert);
        let before = &mut self.predicted[expert];
        self.shadow.rollout(&self.continued, &mut self.work, before);
        let before = before[self.stride * self.outputs..].chunks_exact(self.outputs);
        let each = self.present.chunks_exact(self.outputs).zip(before);
        let distance = |(now, before): (&[f64], &[f64])| self.bound.distance(now, before);
        each.map(distance).fold(0.0, |most, d| if d.is_nan() { f64::INFINITY } else { f64::max(most, d) })
    }

    pub(super) fn store(
        &mut self,
        experts: [&dyn Adapter; EXPERTS],
        active: Expert,
        budget: Budget,
        motion: &Motion,
    ) {
        let slot = self.slot(self.index());
        let part = &mut self.snapshots[slot * EXPERTS * self.len..][..EXPERTS * self.len];
        for (expert, into) in experts.iter().zip(part.chunks_exact_mut(self.len)) {
            expert.snapshot(into);
        }
        self.active[slot] = active;
        self.budgets[slot] = budget;
        let range = self.motion_range(slot);
        self.motions[range].copy_from_slice(motion);
    }

    fn slot(&self, index: usize) -> usize {
        index / self.stride % self.active.len()
    }

    fn motion_range(&self, slot: usize) -> core::ops::Range<usize> {
        slot * self.outputs..(slot + 1) * self.outputs
    }

    fn restore(&mut self, slot: usize, expert: usize) {
        let at = (slot * EXPERTS + expert) * self.len;
        self.shadow.restore(&self.snapshots[at..at + self.len]);
    }

    /// Rolls the shadow out over the last `steps` samples as a model. Returns the error over the last stride.
    fn error(&mut self, steps: usize, expert: usize) -> f64 {
        let commands = &self.commands[last(self.horizon, steps, self.held, self.inputs)];
        self.shadow.rollout(commands, &mut self.work, &mut self.predicted[expert][..steps * self.outputs]);
        let predicted = &self.predicted[expert][(steps - self.bound.stride) * self.outputs..];
        let measured = self.last_stride();
        let (mut sum, mut count) = (0.0, 0);
        let scales = self.bound.scale.iter().cycle();
        for ((p, y), scale) in predicted.iter().zip(measured).zip(scales) {
            if !y.is_nan() {
                let off = (p - y).abs() / scale;
                sum += if off.is_finite() { off } else { f64::INFINITY };
                count += 1;
            }
        }
        if count > 0 { sum / f64::from(count) } else { f64::NAN }
    }

    /// See [`TestErrors::rejection_right`]; requires the rollouts of all models from the origin of this slot.
    fn rejection_right(&self, slot: usize) -> Option<bool> {
        let (active, budget) = (self.active[slot], self.budgets[slot]);
        let steps = self.horizon * self.outputs;
        let [answer, reference] = [active, Expert::Reference].map(|e| &self.predicted[e.index()][..steps]);
        let motion = &self.motions[self.motion_range(slot)];
        let rejected =
            active != Expert::Reference && self.bound.is_rejected(answer, reference, budget, motion);
        rejected.then(|| self.cost(active.index()) <= budget.limit)
    }

    /// See [`TestErrors::excess`]; requires the rollouts of all models from the origin of this slot.
    fn excess(&mut self, slot: usize) -> f64 {
        if self.active[slot] == Expert::Reference {
            return self.cost(Expert::Reference.index());
        }
        let motion = &self.motions[self.motion_range(slot)];
        let [learner, snapshot, reference] = &mut self.predicted;
        let answer = if self.active[slot] == Expert::Snapshot { snapshot } else { learner };
        let steps = self.horizon * self.outputs;
        self.bound.project(&mut answer[..steps], &reference[..steps], self.budgets[slot], motion);
        self.cost(self.active[slot].index())
    }

    fn last_stride(&self) -> &[f64] {
        &self.measured[last(self.horizon, self.bound.stride, self.samples, self.outputs)]
    }

    fn cost(&self, expert: usize) -> f64 {
        let judged = (self.horizon - self.bound.stride) * self.outputs;
        let measured = self.last_stride();
        let (answer, reference) =
            (&self.predicted[expert][judged..], &self.predicted[Expert::Reference.index()][judged..]);
        let each = answer.iter().zip(reference).zip(measured).zip(self.bound.scale.iter().cycle());
        let cost = each.map(|(((p, f), y), scale)| {
            let cost = if y.is_nan() { (p - f).abs() } else { (p - y).abs() - self.factor * (f - y).abs() };
            // No cost relative to a diverged reference model.
            if cost.is_finite() { cost / scale } else { 0.0 }
        });
        cost.sum::<f64>() / measured.len() as f64
    }

    pub(super) fn memory_len(&self) -> usize {
        self.commands.len()
            + self.measured.len()
            + self.snapshots.len()
            + self.active.len()
            + Budget::LEN * self.budgets.len()
            + self.motions.as_flattened().len()
            + 2
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&self.commands);
        into.numbers(&self.measured);
        into.numbers(&self.snapshots);
        for active in &self.active {
            into.count(active.index());
        }
        for budget in &self.budgets {
            into.numbers(&budget.numbers());
        }
        into.numbers(self.motions.as_flattened());
        into.count(self.samples);
        into.count(self.held);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        from.numbers(&mut self.commands);
        from.numbers(&mut self.measured);
        from.numbers(&mut self.snapshots);
        for active in &mut self.active {
            *active = Expert::ALL[from.count(EXPERTS - 1)];
        }
        for budget in &mut self.budgets {
            let mut numbers = [0.0; Budget::LEN];
            from.numbers(&mut numbers);
            *budget = Budget::of(numbers);
        }
        from.numbers(self.motions.as_flattened_mut());
        self.samples = from.count(MOST_COUNTED);
        self.held = from.count(MOST_COUNTED);
    }
}

/// Range of the last `count` rows in a ring that stores each of `len` rows twice, after `end` rows.
fn last(len: usize, count: usize, end: usize, width: usize) -> core::ops::Range<usize> {
    let end = (end + len - 1) % len + len + 1;
    (end - count) * width..end * width
}

fn push(ring: &mut [f64], at: usize, row: &[f64]) {
    let half = ring.len() / 2;
    let place = at * row.len();
    ring[place..place + row.len()].copy_from_slice(row);
    ring[half + place..half + place + row.len()].copy_from_slice(row);
}

fn is_complete(rows: &[f64], outputs: usize) -> bool {
    let count = rows.len() / outputs;
    let measured = |output: usize| rows.iter().skip(output).step_by(outputs).filter(|y| !y.is_nan()).count();
    (0..outputs).all(|output| 2 * measured(output) >= count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_test_is_complete_with_half_of_the_samples() {
        let n = f64::NAN;
        assert!(is_complete(&[0.0, 1.0, n, 1.0, 0.0, n, n, n], 2));
        assert!(!is_complete(&[0.0, 1.0, n, 1.0, n, n, n, n], 2));
        assert!(!is_complete(&[0.0, n], 2));
    }
}
