//! The shadow test: past predictions of both models under the recorded commands, compared with the measurements.

use alloc::boxed::Box;
use alloc::vec;
use alloc::vec::Vec;

use super::bounded::Metric;
use super::event::Expert;
use crate::adapt::Adapter;
use crate::memory::{MOST_COUNTED, Memory};
use crate::predict::{Predictor, Workspace};

const EXPERTS: usize = Expert::ALL.len();

/// Result of a test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Tested {
    /// Mean error of each model over the measured outputs; NaN without measurements.
    pub(super) errors: [f64; EXPERTS],
    /// Error of the answer beyond `factor` times the error of the reference model; outputs that were not measured count 0.
    pub(super) cost: f64,
}

pub(super) struct ShadowTest {
    metric: Metric,
    factor: f64,
    outputs: usize,
    inputs: usize,
    /// Length of a snapshot.
    len: usize,
    /// The last `H` commands and measurements, each stored twice, so that they are contiguous.
    commands: Vec<f64>,
    measured: Vec<f64>,
    samples: usize,
    held: usize,
    /// For each origin under test: snapshots of both models, and whether the adapted one predicted.
    snapshots: Vec<f64>,
    adapted: Vec<bool>,
    shadow: Box<dyn Predictor>,
    work: Workspace,
    predicted: [Vec<f64>; EXPERTS],
}

impl ShadowTest {
    pub(super) fn new(learner: &dyn Adapter, metric: Metric, factor: f64) -> Self {
        let (horizon, stride) = (metric.horizon, metric.stride);
        let (outputs, inputs, len) = (learner.outputs(), learner.inputs(), learner.snapshot_len());
        let slots = horizon / stride + 1;
        Self {
            metric,
            factor,
            outputs,
            inputs,
            len,
            commands: vec![0.0; 2 * horizon * inputs],
            measured: vec![f64::NAN; 2 * horizon * outputs],
            samples: 0,
            held: 0,
            snapshots: vec![0.0; slots * EXPERTS * len],
            adapted: vec![false; slots],
            shadow: learner.fork(),
            work: Workspace::new(),
            predicted: core::array::from_fn(|_| vec![0.0; horizon * outputs]),
        }
    }

    pub(super) fn reset(&mut self) {
        (self.samples, self.held) = (0, 0);
    }

    pub(super) fn push_command(&mut self, c: &[f64]) {
        push(&mut self.commands, self.held % self.metric.horizon, c);
        self.held += 1;
    }

    pub(super) fn push_measurement(&mut self, y: &[f64]) {
        push(&mut self.measured, self.samples % self.metric.horizon, y);
        self.samples += 1;
    }

    pub(super) fn is_due(&self) -> bool {
        self.index().is_multiple_of(self.metric.stride) && self.held == self.index()
    }

    fn index(&self) -> usize {
        self.samples.saturating_sub(1)
    }

    fn slot(&self, index: usize) -> usize {
        index / self.metric.stride % self.adapted.len()
    }

    /// Stores the origin of a later test.
    pub(super) fn store(&mut self, experts: [&dyn Adapter; EXPERTS], adapted: bool) {
        let slot = self.slot(self.index());
        let part = &mut self.snapshots[slot * EXPERTS * self.len..][..EXPERTS * self.len];
        for (expert, into) in experts.iter().zip(part.chunks_exact_mut(self.len)) {
            expert.snapshot(into);
        }
        self.adapted[slot] = adapted;
    }

    /// Tests the predictions of a horizon ago, whose deviation was limited; `None` within the first horizon.
    pub(super) fn test(&mut self, limit: f64) -> Option<Tested> {
        let horizon = self.metric.horizon;
        let from = self.index().checked_sub(horizon)?;
        let slot = self.slot(from);
        let commands = &self.commands[last(horizon, horizon, self.held, self.inputs)];
        for (e, predicted) in self.predicted.iter_mut().enumerate() {
            let at = (slot * EXPERTS + e) * self.len;
            self.shadow.restore(&self.snapshots[at..at + self.len]);
            self.shadow.rollout(commands, &mut self.work, predicted);
        }
        let errors = [self.error(Expert::Adapted), self.error(Expert::Reference)];
        let [answer, reference] = &mut self.predicted;
        if self.adapted[slot] {
            self.metric.limit(answer, reference, limit);
        } else {
            answer.copy_from_slice(reference);
        }
        Some(Tested { errors, cost: self.cost() })
    }

    /// Measurements, and rows of a prediction, in the last stride.
    fn compared(&self, expert: Expert) -> impl Iterator<Item = (usize, f64, f64)> {
        let stride = self.metric.stride;
        let measured = &self.measured[last(self.metric.horizon, stride, self.samples, self.outputs)];
        let predicted = &self.predicted[expert.index()][(self.metric.horizon - stride) * self.outputs..];
        measured.iter().zip(predicted).enumerate().map(|(i, (y, p))| (i % self.outputs, *y, *p))
    }

    fn error(&self, expert: Expert) -> f64 {
        let measured = self.compared(expert).filter(|(_, y, _)| !y.is_nan());
        let (sum, count) = measured.fold((0.0, 0_u32), |(sum, count), (output, y, p)| {
            (sum + self.metric.error(output, p, y), count + 1)
        });
        sum / f64::from(count)
    }

    /// See [`Tested::cost`]; the answer has replaced the prediction of the adapted model.
    fn cost(&self) -> f64 {
        let both = self.compared(Expert::Adapted).zip(self.compared(Expert::Reference));
        let cost = |((output, y, answer), (_, _, reference)): ((usize, f64, f64), (usize, f64, f64))| {
            let error = |p: f64| self.metric.error(output, p, y);
            if y.is_nan() { 0.0 } else { error(answer) - self.factor * error(reference) }
        };
        both.map(cost).sum::<f64>() / (self.metric.stride * self.outputs) as f64
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        memory.numbers(&mut self.commands);
        memory.numbers(&mut self.measured);
        memory.numbers(&mut self.snapshots);
        self.adapted.iter_mut().for_each(|adapted| memory.flag(adapted));
        memory.count(&mut self.samples, MOST_COUNTED);
        memory.count(&mut self.held, MOST_COUNTED);
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
