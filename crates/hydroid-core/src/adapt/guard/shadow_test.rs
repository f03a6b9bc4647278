//! The shadow test: past predictions of the models under the recorded commands, compared with the measurements.

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
    /// Mean error of each model over the measured outputs, in the order of [`Expert::ALL`]; NaN without measurements.
    pub(super) errors: [f64; EXPERTS],
    /// Error of the answer beyond `factor` times the error of its companions, the reference model on the used measurements
    /// and the unguarded learner on all of them. Outputs that were not measured count 0, and so do exempt answers in the
    /// second cost.
    pub(super) costs: [f64; 2],
    /// Distance of the learner and the unguarded learner.
    pub(super) apart: f64,
}

/// The state of the guard at an origin.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Origin {
    /// Whether the adapted model predicted, not the reference model.
    pub(super) adapted: bool,
    /// Whether the unguarded learner differed from the learner.
    pub(super) apart: bool,
    /// Whether a measurement was held back.
    pub(super) held: bool,
}

pub(super) struct ShadowTest {
    metric: Metric,
    factor: f64,
    outputs: usize,
    inputs: usize,
    /// Length of a snapshot.
    len: usize,
    /// The last `H` commands, all measurements and used ones, each stored twice, so that they are contiguous.
    commands: Vec<f64>,
    measured: Vec<f64>,
    used: Vec<f64>,
    samples: usize,
    held: usize,
    /// For each origin under test: snapshots of the models.
    snapshots: Vec<f64>,
    origins: Vec<Origin>,
    shadow: Box<dyn Predictor>,
    work: Workspace,
    predicted: [Vec<f64>; EXPERTS],
    /// Mean square error of the learner in each output at the last test; NaN if it was not measured.
    pub(super) squares: Vec<f64>,
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
            used: vec![f64::NAN; 2 * horizon * outputs],
            samples: 0,
            held: 0,
            snapshots: vec![0.0; slots * EXPERTS * len],
            origins: vec![Origin::default(); slots],
            shadow: learner.fork(),
            work: Workspace::new(),
            predicted: core::array::from_fn(|_| vec![0.0; horizon * outputs]),
            squares: vec![f64::NAN; outputs],
        }
    }

    pub(super) fn reset(&mut self) {
        (self.samples, self.held) = (0, 0);
    }

    pub(super) fn push_command(&mut self, c: &[f64]) {
        push(&mut self.commands, self.held % self.metric.horizon, c);
        self.held += 1;
    }

    /// Begins a sample.
    pub(super) fn begin(&mut self) {
        self.samples += 1;
    }

    pub(super) fn push_measurement(&mut self, y: &[f64], used: &[f64]) {
        let at = self.index() % self.metric.horizon;
        push(&mut self.measured, at, y);
        push(&mut self.used, at, used);
    }

    pub(super) fn is_due(&self) -> bool {
        self.index().is_multiple_of(self.metric.stride) && self.held == self.index()
    }

    fn index(&self) -> usize {
        self.samples.saturating_sub(1)
    }

    fn slot(&self, index: usize) -> usize {
        index / self.metric.stride % self.origins.len()
    }

    /// Stores the origin of a later test; the models in the order of [`Expert::ALL`].
    pub(super) fn store(&mut self, models: [&dyn Adapter; EXPERTS], origin: Origin) {
        let slot = self.slot(self.index());
        let part = &mut self.snapshots[slot * EXPERTS * self.len..][..EXPERTS * self.len];
        for (model, into) in models.iter().zip(part.chunks_exact_mut(self.len)) {
            model.snapshot(into);
        }
        self.origins[slot] = origin;
    }

    /// Tests the predictions of a horizon ago, whose deviations were limited; `None` within the first horizon.
    pub(super) fn test(&mut self, limits: [f64; 2]) -> Option<Tested> {
        let horizon = self.metric.horizon;
        let slot = self.slot(self.index().checked_sub(horizon)?);
        let Origin { adapted, apart, held } = self.origins[slot];
        let commands = &self.commands[last(horizon, horizon, self.held, self.inputs)];
        for (e, predicted) in self.predicted.iter_mut().enumerate() {
            if e == Expert::Unguarded.index() && !apart {
                continue;
            }
            let at = (slot * EXPERTS + e) * self.len;
            self.shadow.restore(&self.snapshots[at..at + self.len]);
            self.shadow.rollout(commands, &mut self.work, predicted);
        }
        let [answer, _, unguarded] = &mut self.predicted;
        if !apart {
            unguarded.copy_from_slice(answer);
        }
        let apart = self.metric.distance(answer, unguarded);
        let errors = Expert::ALL.map(|expert| self.error(expert));
        let mut squares = core::mem::take(&mut self.squares);
        squares.fill(0.0);
        for (output, y, p) in self.compared(Expert::Adapted, Expert::Adapted) {
            squares[output] += (p - y) * (p - y) / self.metric.stride as f64;
        }
        self.squares = squares;
        let [answer, reference, _] = &mut self.predicted;
        if adapted {
            self.metric.limit(answer, reference, limits[0]);
        } else {
            answer.copy_from_slice(reference);
        }
        let to_reference = self.cost(Expert::Reference);
        if held {
            return Some(Tested { errors, costs: [to_reference, 0.0], apart });
        }
        let [answer, _, unguarded] = &mut self.predicted;
        self.metric.limit(answer, unguarded, limits[1]);
        Some(Tested { errors, costs: [to_reference, self.cost(Expert::Unguarded)], apart })
    }

    /// What the unguarded learner predicted for this sample a number of tests ago.
    pub(super) fn unguarded(&mut self, tests: usize) -> Option<&[f64]> {
        let steps = tests * self.metric.stride;
        let expert = Expert::Unguarded.index();
        let at = (self.slot(self.index().checked_sub(steps)?) * EXPERTS + expert) * self.len;
        let predicted = &mut self.predicted[expert][..steps * self.outputs];
        self.shadow.restore(&self.snapshots[at..at + self.len]);
        let commands = &self.commands[last(self.metric.horizon, steps, self.held, self.inputs)];
        self.shadow.rollout(commands, &mut self.work, predicted);
        Some(&predicted[(steps - 1) * self.outputs..])
    }

    /// The measurements by which a model is judged, and its prediction, in the last stride.
    fn compared(&self, of: Expert, model: Expert) -> impl Iterator<Item = (usize, f64, f64)> {
        let Metric { horizon, stride, .. } = self.metric;
        let measured = if of == Expert::Unguarded { &self.measured } else { &self.used };
        let measured = &measured[last(horizon, stride, self.samples, self.outputs)];
        let predicted = &self.predicted[model.index()][(horizon - stride) * self.outputs..];
        measured.iter().zip(predicted).enumerate().map(|(i, (y, p))| (i % self.outputs, *y, *p))
    }

    fn error(&self, expert: Expert) -> f64 {
        let measured = self.compared(expert, expert).filter(|(_, y, _)| !y.is_nan());
        let (sum, count) = measured.fold((0.0, 0_u32), |(sum, count), (output, y, p)| {
            (sum + self.metric.error(output, p, y), count + 1)
        });
        sum / f64::from(count)
    }

    /// See [`Tested::costs`]; the answer has replaced the prediction of the adapted model.
    fn cost(&self, companion: Expert) -> f64 {
        let both = self.compared(companion, Expert::Adapted).zip(self.compared(companion, companion));
        let cost = |((output, y, answer), (_, _, other)): ((usize, f64, f64), (usize, f64, f64))| {
            let error = |p: f64| self.metric.error(output, p, y);
            if y.is_nan() { 0.0 } else { error(answer) - self.factor * error(other) }
        };
        both.map(cost).sum::<f64>() / (self.metric.stride * self.outputs) as f64
    }

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        for numbers in [&mut self.commands, &mut self.measured, &mut self.used, &mut self.snapshots] {
            memory.numbers(numbers);
        }
        for Origin { adapted, apart, held } in &mut self.origins {
            for flag in [adapted, apart, held] {
                memory.flag(flag);
            }
        }
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
