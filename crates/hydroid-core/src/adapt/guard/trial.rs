//! The shadow test: what the models of some samples ago make of what has happened since.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::event::Expert;
use super::settings::GuardSettings;
use crate::adapt::Adapter;
use crate::adapt::memory::{MOST_COUNTED, Reader, Writer};
use crate::predict::{Predictor, Workspace};

const EXPERTS: usize = Expert::ALL.len();

/// What a test found: errors as [`Action`](super::Action) has them, infinite where a rollout blew up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tested {
    /// Of the predictions that each model made `H` samples ago, over the last stride of them.
    pub(super) far: [f64; EXPERTS],
    /// Of those made one stride ago, over all of it; that of the snapshot is not asked.
    pub(super) near: [f64; EXPERTS],
    /// As `far`, of the learner with the weights that it has now.
    pub(super) now: f64,
    /// The model that predictions were made by then.
    pub(super) used: Expert,
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
    scale: Vec<f64>,
    /// The last `H` commands and measurements, twice, so that they always stand in one piece.
    commands: Vec<f64>,
    measured: Vec<f64>,
    /// Samples of this run, and commands.
    seen: usize,
    held: usize,
    /// Of the origins that are still tested: snapshots of each model, and the one that was used.
    snapshots: Vec<f64>,
    used: Vec<Expert>,
    shadow: Box<dyn Predictor>,
    work: Workspace,
    predicted: Vec<f64>,
    mixed: Vec<f64>,
}

impl Trial {
    pub(super) fn new(learner: &dyn Adapter, scale: &[f64], settings: &GuardSettings) -> Self {
        let (horizon, stride) = (settings.horizon, settings.stride);
        let (outputs, inputs, len) = (learner.outputs(), learner.inputs(), learner.snapshot_len());
        let slots = horizon / stride + 1;
        Self {
            horizon,
            stride,
            outputs,
            inputs,
            len,
            weights: learner.weights().len(),
            scale: scale.to_vec(),
            commands: vec![0.0; 2 * horizon * inputs],
            measured: vec![f64::NAN; 2 * horizon * outputs],
            seen: 0,
            held: 0,
            snapshots: vec![0.0; slots * EXPERTS * len],
            used: vec![Expert::default(); slots],
            shadow: learner.fork(),
            work: Workspace::new(),
            predicted: vec![0.0; horizon * outputs],
            mixed: vec![0.0; len],
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

    /// Whether the sample that was just seen is one at which models are tested, and tested from later.
    pub(super) fn is_due(&self) -> bool {
        self.origin().is_multiple_of(self.stride) && self.held == self.origin()
    }

    /// Number of the present sample.
    fn origin(&self) -> usize {
        self.seen.saturating_sub(1)
    }

    /// Tests the models that stood at the origins a horizon and a stride ago; none where there are none yet, or nothing was
    /// measured.
    pub(super) fn test(&mut self, learner: &dyn Adapter) -> Option<Tested> {
        let now = self.origin();
        if now < self.horizon {
            return None;
        }
        let (far, near) = (self.slot(now - self.horizon), self.slot(now - self.stride));
        let mut tested = Tested {
            far: [f64::NAN; EXPERTS],
            near: [f64::NAN; EXPERTS],
            now: f64::NAN,
            used: self.used[far],
        };
        for e in 0..EXPERTS {
            self.take(far, e);
            tested.far[e] = self.error(self.horizon)?;
        }
        // The state of then, the weights of now.
        learner.snapshot(&mut self.mixed);
        let kept = self.len - self.weights;
        let at = (far * EXPERTS + Expert::Learner.index()) * self.len;
        self.mixed[..kept].copy_from_slice(&self.snapshots[at..at + kept]);
        self.shadow.restore(&self.mixed);
        tested.now = self.error(self.horizon)?;
        for expert in [Expert::Learner, Expert::Frozen] {
            self.take(near, expert.index());
            tested.near[expert.index()] = self.error(self.stride)?;
        }
        Some(tested)
    }

    /// Keeps the models as they are, to be tested later.
    pub(super) fn mark(&mut self, experts: [&dyn Adapter; EXPERTS], used: Expert) {
        let slot = self.slot(self.origin());
        let part = &mut self.snapshots[slot * EXPERTS * self.len..][..EXPERTS * self.len];
        for (expert, into) in experts.iter().zip(part.chunks_exact_mut(self.len)) {
            expert.snapshot(into);
        }
        self.used[slot] = used;
    }

    fn slot(&self, origin: usize) -> usize {
        origin / self.stride % self.used.len()
    }

    fn take(&mut self, slot: usize, expert: usize) {
        let at = (slot * EXPERTS + expert) * self.len;
        self.shadow.restore(&self.snapshots[at..at + self.len]);
    }

    /// Error of the shadow's rollout over the last `steps` samples, in its last stride; none if nothing was measured there.
    fn error(&mut self, steps: usize) -> Option<f64> {
        let (n, m) = (self.outputs, self.inputs);
        let last = |count: usize, end: usize, width: usize| {
            let end = (end + self.horizon - 1) % self.horizon + self.horizon + 1;
            (end - count) * width..end * width
        };
        let commands = &self.commands[last(steps, self.held, m)];
        let predicted = &mut self.predicted[..steps * n];
        self.shadow.rollout(commands, &mut self.work, predicted);
        let judged = self.stride.min(steps);
        let measured = &self.measured[last(judged, self.seen, n)];
        let (mut sum, mut count) = (0.0, 0);
        let rows = predicted[(steps - judged) * n..].chunks_exact(n).zip(measured.chunks_exact(n));
        for (p, y) in rows {
            for ((p, y), scale) in p.iter().zip(y).zip(&self.scale) {
                if !y.is_nan() {
                    let off = (p - y).abs() / scale;
                    sum += if off.is_finite() { off } else { f64::INFINITY };
                    count += 1;
                }
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }

    pub(super) fn memory_len(&self) -> usize {
        self.commands.len() + self.measured.len() + self.snapshots.len() + self.used.len() + 2
    }

    pub(super) fn save(&self, into: &mut Writer<'_>) {
        into.numbers(&self.commands);
        into.numbers(&self.measured);
        into.numbers(&self.snapshots);
        for used in &self.used {
            into.count(used.index());
        }
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
        self.seen = from.count(MOST_COUNTED);
        self.held = from.count(MOST_COUNTED);
    }
}

/// Puts a row in both copies of a ring.
fn keep(ring: &mut [f64], at: usize, row: &[f64]) {
    let half = ring.len() / 2;
    let place = at * row.len();
    ring[place..place + row.len()].copy_from_slice(row);
    ring[half + place..half + place + row.len()].copy_from_slice(row);
}
