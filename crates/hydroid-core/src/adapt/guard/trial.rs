//! The shadow test: what the models of some samples ago make of what has happened since.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::bound::{Allowed, Bound, Motion, measure};
use super::event::Expert;
use crate::adapt::Adapter;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};
use crate::predict::{Predictor, Workspace};

const EXPERTS: usize = Expert::ALL.len();

/// What a test found: errors as [`Action`](super::Action) has them, infinite where a rollout blew up, NaN where nothing was
/// measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tested {
    /// Of the predictions that each model made `H` samples ago, over the last stride of them.
    pub(super) far: [f64; EXPERTS],
    /// Of those made one stride ago, over all of it; that of the snapshot is not asked.
    pub(super) near: [f64; EXPERTS],
    /// As `far`, of the learner with the weights that it has now.
    pub(super) now: f64,
    /// How far what each model says of the next horizon has moved within the last stride: the largest distance in it, as if the
    /// last command were held. That of the frozen model is not asked.
    pub(super) revised: [f64; EXPERTS],
    /// What the answers of then cost: their error beyond `factor` times that of the frozen model. An output that was not
    /// measured counts with what the two were apart.
    pub(super) excess: f64,
    /// What of that is beyond what they were allowed: those that stood far from the frozen model's on the strength of a record that
    /// did not hold.
    pub(super) beyond: f64,
    /// Of an answer that was drawn for nothing but its distance, or how the vessel moved: whether it would have cost no more than was allowed.
    pub(super) right: Option<bool>,
    /// Whether all outputs were measured, each in half of the samples at least: a spike here and there hides nothing.
    pub(super) whole: bool,
}

/// The last samples, and the models as they were at some of them.
pub(super) struct Trial {
    horizon: usize,
    stride: usize,
    outputs: usize,
    inputs: usize,
    /// Numbers of a snapshot, and of these, at its end, of weights.
    len: usize,
    weights: usize,
    bound: Bound,
    factor: f64,
    /// The last `H` commands and measurements, twice, so that they always stand in one piece.
    commands: Vec<f64>,
    measured: Vec<f64>,
    /// Samples of this run, and commands.
    seen: usize,
    held: usize,
    /// Of the origins that are still tested: snapshots of each model, the one that was used, how far from the frozen one, and how the vessel
    /// moved.
    snapshots: Vec<f64>,
    used: Vec<Expert>,
    allowed: Vec<Allowed>,
    motions: Vec<[f64; 2]>,
    shadow: Box<dyn Predictor>,
    work: Workspace,
    /// What each model predicted.
    predicted: [Vec<f64>; EXPERTS],
    mixed: Vec<f64>,
    /// The commands of the last stride, and the last one held over a horizon; what is said of it now.
    onward: Vec<f64>,
    said: Vec<f64>,
}

impl Trial {
    pub(super) fn new(learner: &dyn Adapter, bound: Bound, factor: f64) -> Self {
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
            seen: 0,
            held: 0,
            snapshots: vec![0.0; slots * EXPERTS * len],
            used: vec![Expert::default(); slots],
            allowed: vec![Allowed::NONE; slots],
            motions: vec![[f64::NAN; 2]; slots * outputs],
            shadow: learner.fork(),
            work: Workspace::new(),
            predicted: core::array::from_fn(|_| vec![0.0; (horizon + stride) * outputs]),
            mixed: vec![0.0; len],
            onward: vec![0.0; (horizon + stride) * inputs],
            said: vec![0.0; horizon * outputs],
        }
    }

    /// The start of a run: nothing of the one before is tested.
    pub(super) fn reset(&mut self) {
        (self.seen, self.held) = (0, 0);
    }

    /// A command, held from the last sample to the next.
    pub(super) fn hold(&mut self, c: &[f64]) {
        keep(&mut self.commands, self.held % self.horizon, c);
        self.held += 1;
    }

    /// A sample, as it was used; NaN where nothing was.
    pub(super) fn see(&mut self, y: &[f64]) {
        keep(&mut self.measured, self.seen % self.horizon, y);
        self.seen += 1;
    }

    /// How the vessel moves, by the last two strides of samples; without room for two in the horizon nobody knows.
    pub(super) fn moves(&self, motion: &mut Motion) {
        let stride = self.stride;
        if self.seen < 2 * stride || self.horizon < 2 * stride {
            return;
        }
        let rows = &self.measured[last(self.horizon, 2 * stride, self.seen, self.outputs)];
        measure(rows, motion);
    }

    /// Whether the sample that was just seen is one at which models are tested, and tested from later.
    pub(super) fn is_due(&self) -> bool {
        self.origin().is_multiple_of(self.stride) && self.held == self.origin()
    }

    /// Number of the present sample.
    fn origin(&self) -> usize {
        self.seen.saturating_sub(1)
    }

    /// Tests the models that stood at the origins a horizon and a stride ago; none where there are none yet.
    pub(super) fn test(&mut self, [learner, kept]: [&dyn Adapter; 2]) -> Option<Tested> {
        let now = self.origin();
        if now < self.horizon {
            return None;
        }
        let (far, near) = (self.slot(now - self.horizon), self.slot(now - self.stride));
        let mut tested = Tested {
            far: [f64::NAN; EXPERTS],
            near: [f64::NAN; EXPERTS],
            now: f64::NAN,
            revised: [0.0; EXPERTS],
            excess: 0.0,
            beyond: 0.0,
            right: None,
            whole: true,
        };
        for e in 0..EXPERTS {
            self.take(far, e);
            tested.far[e] = self.error(self.horizon, e);
        }
        tested.right = self.right(far);
        tested.excess = self.excess(far);
        tested.beyond = (tested.excess - self.allowed[far].most).max(0.0);
        tested.whole = is_whole(self.judged(), self.outputs);
        // The state of then, the weights of now.
        learner.snapshot(&mut self.mixed);
        let state = self.len - self.weights;
        let own = Expert::Learner.index();
        let at = (far * EXPERTS + own) * self.len;
        self.mixed[..state].copy_from_slice(&self.snapshots[at..at + state]);
        self.shadow.restore(&self.mixed);
        tested.now = self.error(self.horizon, own);
        for e in [own, Expert::Frozen.index()] {
            self.take(near, e);
            tested.near[e] = self.error(self.stride, e);
        }
        for (expert, model) in [(Expert::Learner, learner), (Expert::Kept, kept)] {
            tested.revised[expert.index()] = self.revised(near, expert.index(), model);
        }
        Some(tested)
    }

    /// See [`Tested::revised`]; `slot` is that of a stride ago.
    fn revised(&mut self, slot: usize, expert: usize, model: &dyn Adapter) -> f64 {
        let (begun, held) = self.onward.split_at_mut(self.stride * self.inputs);
        begun.copy_from_slice(&self.commands[last(self.horizon, self.stride, self.held, self.inputs)]);
        let command = &begun[(self.stride - 1) * self.inputs..];
        held.chunks_exact_mut(self.inputs).for_each(|into| into.copy_from_slice(command));
        model.rollout(held, &mut self.work, &mut self.said);
        self.take(slot, expert);
        let before = &mut self.predicted[expert];
        self.shadow.rollout(&self.onward, &mut self.work, before);
        let before = before[self.stride * self.outputs..].chunks_exact(self.outputs);
        let each = self.said.chunks_exact(self.outputs).zip(before);
        let apart = |(now, before): (&[f64], &[f64])| self.bound.apart(now, before);
        // One that blew up may be anywhere.
        each.map(apart).fold(0.0, |most, d| if d.is_nan() { f64::INFINITY } else { f64::max(most, d) })
    }

    /// Keeps the models as they are, to be tested later.
    pub(super) fn mark(
        &mut self,
        experts: [&dyn Adapter; EXPERTS],
        used: Expert,
        allowed: Allowed,
        motion: &Motion,
    ) {
        let slot = self.slot(self.origin());
        let part = &mut self.snapshots[slot * EXPERTS * self.len..][..EXPERTS * self.len];
        for (expert, into) in experts.iter().zip(part.chunks_exact_mut(self.len)) {
            expert.snapshot(into);
        }
        self.used[slot] = used;
        self.allowed[slot] = allowed;
        let moved = self.moved(slot);
        self.motions[moved].copy_from_slice(motion);
    }

    fn slot(&self, origin: usize) -> usize {
        origin / self.stride % self.used.len()
    }

    /// Where the motion of a slot stands.
    fn moved(&self, slot: usize) -> core::ops::Range<usize> {
        slot * self.outputs..(slot + 1) * self.outputs
    }

    fn take(&mut self, slot: usize, expert: usize) {
        let at = (slot * EXPERTS + expert) * self.len;
        self.shadow.restore(&self.snapshots[at..at + self.len]);
    }

    /// Rolls the shadow out over the last `steps` samples, in the place of a model; error in the last stride of that.
    fn error(&mut self, steps: usize, expert: usize) -> f64 {
        let commands = &self.commands[last(self.horizon, steps, self.held, self.inputs)];
        self.shadow.rollout(commands, &mut self.work, &mut self.predicted[expert][..steps * self.outputs]);
        let predicted = &self.predicted[expert][(steps - self.bound.stride) * self.outputs..];
        let measured = self.judged();
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

    /// See [`Tested::right`]; models have been rolled out from the origin of this slot.
    fn right(&self, slot: usize) -> Option<bool> {
        let (used, allowed) = (self.used[slot], self.allowed[slot]);
        let steps = self.horizon * self.outputs;
        let [answer, shore] = [used, Expert::Frozen].map(|e| &self.predicted[e.index()][..steps]);
        let refused = used != Expert::Frozen
            && self.bound.is_refused(answer, shore, allowed, &self.motions[self.moved(slot)]);
        refused.then(|| self.cost(used.index()) <= allowed.most)
    }

    /// See [`Tested::excess`]; models have been rolled out from the origin of this slot.
    fn excess(&mut self, slot: usize) -> f64 {
        let frozen = Expert::Frozen.index();
        if self.used[slot] == Expert::Frozen {
            return self.cost(frozen);
        }
        let motion = &self.motions[self.moved(slot)];
        let [learner, kept, shore] = &mut self.predicted;
        let answer = if self.used[slot] == Expert::Kept { kept } else { learner };
        let steps = self.horizon * self.outputs;
        self.bound.draw(&mut answer[..steps], &shore[..steps], self.allowed[slot], motion);
        let used = self.used[slot].index();
        self.cost(used)
    }

    /// What was measured in the last stride.
    fn judged(&self) -> &[f64] {
        &self.measured[last(self.horizon, self.bound.stride, self.seen, self.outputs)]
    }

    fn cost(&self, used: usize) -> f64 {
        let judged = (self.horizon - self.bound.stride) * self.outputs;
        let measured = self.judged();
        let (answer, shore) =
            (&self.predicted[used][judged..], &self.predicted[Expert::Frozen.index()][judged..]);
        let each = answer.iter().zip(shore).zip(measured).zip(self.bound.scale.iter().cycle());
        let cost = each.map(|(((p, f), y), scale)| {
            let cost = if y.is_nan() { (p - f).abs() } else { (p - y).abs() - self.factor * (f - y).abs() };
            // Nothing is worse than a frozen model that blows up.
            if cost.is_finite() { cost / scale } else { 0.0 }
        });
        cost.sum::<f64>() / measured.len() as f64
    }

    pub(super) fn memory_len(&self) -> usize {
        self.commands.len()
            + self.measured.len()
            + self.snapshots.len()
            + self.used.len()
            + Allowed::LEN * self.allowed.len()
            + self.motions.as_flattened().len()
            + 2
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&self.commands);
        into.numbers(&self.measured);
        into.numbers(&self.snapshots);
        for used in &self.used {
            into.count(used.index());
        }
        for allowed in &self.allowed {
            into.numbers(&allowed.numbers());
        }
        into.numbers(self.motions.as_flattened());
        into.count(self.seen);
        into.count(self.held);
    }

    pub(super) fn load(&mut self, from: &mut Reader<'_>) {
        from.numbers(&mut self.commands);
        from.numbers(&mut self.measured);
        from.numbers(&mut self.snapshots);
        for used in &mut self.used {
            *used = Expert::ALL[from.count(EXPERTS - 1)];
        }
        for allowed in &mut self.allowed {
            let mut numbers = [0.0; Allowed::LEN];
            from.numbers(&mut numbers);
            *allowed = Allowed::of(numbers);
        }
        from.numbers(self.motions.as_flattened_mut());
        self.seen = from.count(MOST_COUNTED);
        self.held = from.count(MOST_COUNTED);
    }
}

/// Where the last `count` rows stand in a ring that keeps each of `len` rows twice, and has seen `end` of them.
fn last(len: usize, count: usize, end: usize, width: usize) -> core::ops::Range<usize> {
    let end = (end + len - 1) % len + len + 1;
    (end - count) * width..end * width
}

/// Puts a row in both copies of a ring.
fn keep(ring: &mut [f64], at: usize, row: &[f64]) {
    let half = ring.len() / 2;
    let place = at * row.len();
    ring[place..place + row.len()].copy_from_slice(row);
    ring[half + place..half + place + row.len()].copy_from_slice(row);
}

/// See [`Tested::whole`]: of rows of so many outputs.
fn is_whole(rows: &[f64], outputs: usize) -> bool {
    let count = rows.len() / outputs;
    let measured = |output: usize| rows.iter().skip(output).step_by(outputs).filter(|y| !y.is_nan()).count();
    (0..outputs).all(|output| 2 * measured(output) >= count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_in_half_of_the_samples_is_whole() {
        let n = f64::NAN;
        assert!(is_whole(&[0.0, 1.0, n, 1.0, 0.0, n, n, n], 2));
        assert!(!is_whole(&[0.0, 1.0, n, 1.0, n, n, n, n], 2));
        assert!(!is_whole(&[0.0, n], 2));
    }
}
