//! A step as a row of numbers.
//!
//! A step has up to three calls in this order: `reset`, `advance` with a command, `observe` with a measurement. The
//! results of the measurement and predictions under a held command follow. Missing values are NaN.

use hydroid_core::adapt::guard::Guard;
use hydroid_core::adapt::{Adapter, Outcome, Rejection};
use hydroid_core::predict::Workspace;

use super::event;
use super::head::Head;

/// Calls of a step, as bits.
pub(super) const RESET: u8 = 1;
pub(super) const ADVANCE: u8 = 2;
pub(super) const OBSERVE: u8 = 4;
/// The row contains predictions.
pub(super) const PREDICTED: u8 = 8;

/// Capacity for events in addition to two for each output.
const EXTRA_EVENTS: usize = 3;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RowLayout {
    outputs: usize,
    inputs: usize,
    horizons: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Calls,
    Run,
    Time,
    Command,
    Measured,
    /// Measured heading; NaN without one.
    Heading,
    Held,
    Estimate,
    /// Predictions, by horizon.
    Prediction,
    /// Code of the outcome, and two values.
    Outcome,
    /// Number of innovations, then values, then standard deviations.
    Innovations,
    /// Values of [`Health`](hydroid_core::adapt::Health).
    Health,
    /// Active model, two limits, three balances.
    Guard,
    /// Number of events, then the events.
    Events,
}

impl Part {
    const ALL: [Self; 14] = [
        Self::Calls,
        Self::Run,
        Self::Time,
        Self::Command,
        Self::Measured,
        Self::Heading,
        Self::Held,
        Self::Estimate,
        Self::Prediction,
        Self::Outcome,
        Self::Innovations,
        Self::Health,
        Self::Guard,
        Self::Events,
    ];
}

impl RowLayout {
    pub(super) fn new(outputs: usize, inputs: usize, horizons: usize) -> Self {
        Self { outputs, inputs, horizons }
    }

    fn width(self, part: Part) -> usize {
        let Self { outputs: n, inputs: m, horizons } = self;
        match part {
            Part::Calls | Part::Run | Part::Time | Part::Heading => 1,
            Part::Command | Part::Held => m,
            Part::Measured | Part::Estimate => n,
            Part::Prediction => horizons * n,
            Part::Outcome => 3,
            Part::Innovations => 1 + 2 * n,
            Part::Health => 2,
            Part::Guard => 6,
            Part::Events => 1 + self.max_events() * event::WORDS,
        }
    }

    fn max_events(self) -> usize {
        2 * self.outputs + EXTRA_EVENTS
    }

    pub(super) fn len(self) -> usize {
        Part::ALL.into_iter().map(|part| self.width(part)).sum()
    }

    pub(super) fn range(self, part: Part) -> std::ops::Range<usize> {
        let start = Part::ALL.into_iter().take_while(|p| *p != part).map(|p| self.width(p)).sum();
        start..start + self.width(part)
    }

    /// Index of the first result; a replay computes all results.
    pub(super) fn results(self) -> usize {
        self.range(Part::Estimate).start
    }

    pub(super) fn name(self, place: usize, head: &Head) -> String {
        let output = |i: usize| head.outputs.get(i).map_or("?", |channel| channel.name.as_str());
        let n = self.outputs.max(1);
        let of = |part: Part| self.range(part).contains(&place).then(|| place - self.range(part).start);
        if let Some(i) = of(Part::Estimate) {
            format!("the estimate of {}", output(i))
        } else if let Some(i) = of(Part::Prediction) {
            let ahead = head.horizons.get(i / n).copied().unwrap_or(0);
            format!("the prediction of {} {ahead} samples ahead", output(i % n))
        } else if of(Part::Outcome).is_some() {
            "the status of the sample".to_owned()
        } else if let Some(i) = of(Part::Innovations) {
            match i.checked_sub(1) {
                None => "the number of innovations".to_owned(),
                Some(i) if i < n => format!("the innovation of {}", output(i)),
                Some(i) => format!("the standard deviation of the innovation of {}", output(i - n)),
            }
        } else if let Some(i) = of(Part::Health) {
            ["the least variance of a weight", "the smallest S/R of the filter"][i].to_owned()
        } else if let Some(i) = of(Part::Guard) {
            let names = [
                "the model that predicts",
                "the limit relative to the reference model",
                "the limit relative to the unguarded model",
                "the balance relative to the reference model",
                "the balance of the adapted model",
                "the balance relative to the unguarded model",
            ];
            names[i].to_owned()
        } else if of(Part::Events).is_some() {
            "the events of the guard".to_owned()
        } else {
            "a recorded call".to_owned()
        }
    }
}

#[derive(Debug)]
pub(super) struct RowBuilder {
    pub(super) layout: RowLayout,
    horizons: Vec<usize>,
    commands: Vec<f64>,
    rollout: Vec<f64>,
    work: Workspace,
}

impl RowBuilder {
    pub(super) fn new(head: &Head) -> Self {
        let farthest = head.horizons.last().copied().unwrap_or(0);
        Self {
            layout: head.layout(),
            horizons: head.horizons.clone(),
            commands: vec![f64::NAN; farthest * head.inputs.len()],
            rollout: vec![f64::NAN; farthest * head.outputs.len()],
            work: Workspace::new(),
        }
    }

    pub(super) fn observed(&mut self, adapter: &dyn Adapter, row: &mut [f64]) {
        let layout = self.layout;
        adapter.output(&mut row[layout.range(Part::Estimate)]);
        let (kind, a, b) = match adapter.outcome() {
            Outcome::Waiting => (0.0, f64::NAN, f64::NAN),
            Outcome::Accepted => (1.0, f64::NAN, f64::NAN),
            Outcome::Inflated { deviations, weight } => (2.0, deviations, weight),
            Outcome::Rejected(Rejection::Outlier { deviations }) => (3.0, deviations, f64::NAN),
            Outcome::Rejected(Rejection::NotFinite) => (4.0, f64::NAN, f64::NAN),
            Outcome::RolledBack => (5.0, f64::NAN, f64::NAN),
        };
        row[layout.range(Part::Outcome)].copy_from_slice(&[kind, a, b]);
        let innovations = adapter.innovations();
        let into = &mut row[layout.range(Part::Innovations)];
        into[0] = innovations.len() as f64;
        let (values, deviations) = into[1..].split_at_mut(layout.outputs);
        for ((value, deviation), innovation) in values.iter_mut().zip(deviations).zip(innovations) {
            (*value, *deviation) = (innovation.value, innovation.deviation);
        }
        // Without a measurement, health is that of an earlier sample, which the saved state does not contain.
        if !innovations.is_empty() {
            let health = adapter.health();
            row[layout.range(Part::Health)].copy_from_slice(&[health.least_variance, health.min_s_over_r]);
        }
        if let Some(guard) = adapter.guard() {
            self.guarded(guard, row);
        }
    }

    fn guarded(&self, guard: &Guard, row: &mut [f64]) {
        let ([to_reference, to_unguarded], [answers, adapted, raw]) = (guard.limits(), guard.balances());
        let active = guard.active().index() as f64;
        let row_of_guard = [active, to_reference, to_unguarded, answers, adapted, raw];
        row[self.layout.range(Part::Guard)].copy_from_slice(&row_of_guard);
        let into = &mut row[self.layout.range(Part::Events)];
        let events = &guard.events()[..guard.events().len().min(self.layout.max_events())];
        into[0] = events.len() as f64;
        for (into, event) in into[1..].chunks_exact_mut(event::WORDS).zip(events) {
            into.copy_from_slice(&event::encode(&event.action));
        }
    }

    /// Writes predictions under a held command, if the command is known.
    pub(super) fn predicted(&mut self, adapter: &dyn Adapter, held: &[f64], row: &mut [f64]) {
        if held.iter().any(|c| c.is_nan()) || self.horizons.is_empty() {
            return;
        }
        for into in self.commands.chunks_exact_mut(held.len().max(1)) {
            into.copy_from_slice(held);
        }
        adapter.rollout(&self.commands, &mut self.work, &mut self.rollout);
        row[self.layout.range(Part::Held)].copy_from_slice(held);
        let n = self.layout.outputs;
        let into = &mut row[self.layout.range(Part::Prediction)];
        for (into, horizon) in into.chunks_exact_mut(n).zip(&self.horizons) {
            into.copy_from_slice(&self.rollout[(horizon - 1) * n..horizon * n]);
        }
    }
}

pub(super) fn calls(row: &[f64]) -> u8 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // flags were written as numbers; a cast saturates
    let bits = row.first().map_or(0, |&x| x as u8);
    bits
}
