//! A step of the walk as a row of numbers.
//!
//! A step is up to three calls in this order: `reset`, `advance` with a command, `observe` with a measurement. Behind them
//! stands what came of the measurement, and what was predicted from it under a command that is held. What there is none of
//! is NaN.

use hydroid_core::adapt::guard::Guard;
use hydroid_core::adapt::{Adapter, Outcome, Rejection};
use hydroid_core::predict::Workspace;

use super::event;
use super::head::Head;

/// Calls of a step, as bits.
pub(super) const RESET: u8 = 1;
pub(super) const ADVANCE: u8 = 2;
pub(super) const OBSERVE: u8 = 4;
/// Predictions were made.
pub(super) const FORESEEN: u8 = 8;

/// Events beside one of each output.
const MORE_EVENTS: usize = 6;

/// Where what stands in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Places {
    outputs: usize,
    inputs: usize,
    horizons: usize,
}

/// Parts of a row, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// Bits of the calls.
    Calls,
    Run,
    Time,
    Command,
    Measured,
    Held,
    Estimate,
    /// Horizon by horizon.
    Prediction,
    /// Kind, and two numbers of it.
    Outcome,
    /// How many, then values, then deviations.
    Innovations,
    /// Least variance and `min S / R`.
    Health,
    /// The model that predicts, and the records of all three.
    Guard,
    /// How many, then each.
    Events,
}

impl Part {
    const ALL: [Self; 13] = [
        Self::Calls,
        Self::Run,
        Self::Time,
        Self::Command,
        Self::Measured,
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

impl Places {
    pub(super) fn new(outputs: usize, inputs: usize, horizons: usize) -> Self {
        Self { outputs, inputs, horizons }
    }

    fn width(self, part: Part) -> usize {
        let Self { outputs: n, inputs: m, horizons } = self;
        match part {
            Part::Calls | Part::Run | Part::Time => 1,
            Part::Command | Part::Held => m,
            Part::Measured | Part::Estimate => n,
            Part::Prediction => horizons * n,
            Part::Outcome => 3,
            Part::Innovations => 1 + 2 * n,
            Part::Health => 2,
            Part::Guard => 4,
            Part::Events => 1 + self.most_events() * event::WORDS,
        }
    }

    fn most_events(self) -> usize {
        self.outputs + MORE_EVENTS
    }

    /// Numbers of a row.
    pub(super) fn len(self) -> usize {
        Part::ALL.into_iter().map(|part| self.width(part)).sum()
    }

    pub(super) fn range(self, part: Part) -> std::ops::Range<usize> {
        let start = Part::ALL.into_iter().take_while(|p| *p != part).map(|p| self.width(p)).sum();
        start..start + self.width(part)
    }

    /// Where what came of the measurement begins: all behind it is made again in a replay.
    pub(super) fn results(self) -> usize {
        self.range(Part::Estimate).start
    }

    /// What the number at a place is, in words.
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
            "what became of the sample".to_owned()
        } else if let Some(i) = of(Part::Innovations) {
            match i.checked_sub(1) {
                None => "the number of innovations".to_owned(),
                Some(i) if i < n => format!("the innovation of {}", output(i)),
                Some(i) => format!("the deviation of the innovation of {}", output(i - n)),
            }
        } else if let Some(i) = of(Part::Health) {
            ["the least variance of a weight", "the smallest S/R of the filter"][i].to_owned()
        } else if let Some(i) = of(Part::Guard) {
            let names = ["the model that predicts", "the adapted model", "the snapshot", "the frozen model"];
            if i == 0 { names[0].to_owned() } else { format!("the record of {}", names[i]) }
        } else if of(Part::Events).is_some() {
            "what the guard did".to_owned()
        } else {
            "what was given".to_owned()
        }
    }
}

/// Makes rows: what an adapter says of itself after a call.
#[derive(Debug)]
pub(super) struct Gatherer {
    pub(super) places: Places,
    horizons: Vec<usize>,
    commands: Vec<f64>,
    rollout: Vec<f64>,
    work: Workspace,
}

impl Gatherer {
    pub(super) fn new(head: &Head) -> Self {
        let farthest = head.horizons.last().copied().unwrap_or(0);
        Self {
            places: head.places(),
            horizons: head.horizons.clone(),
            commands: vec![f64::NAN; farthest * head.inputs.len()],
            rollout: vec![f64::NAN; farthest * head.outputs.len()],
            work: Workspace::new(),
        }
    }

    /// After `observe`: what came of it.
    pub(super) fn observed(&mut self, adapter: &dyn Adapter, row: &mut [f64]) {
        let places = self.places;
        adapter.output(&mut row[places.range(Part::Estimate)]);
        let (kind, a, b) = match adapter.outcome() {
            Outcome::Waiting => (0.0, f64::NAN, f64::NAN),
            Outcome::Accepted => (1.0, f64::NAN, f64::NAN),
            Outcome::Inflated { deviations, weight } => (2.0, deviations, weight),
            Outcome::Rejected(Rejection::Outlier { deviations }) => (3.0, deviations, f64::NAN),
            Outcome::Rejected(Rejection::NotFinite) => (4.0, f64::NAN, f64::NAN),
            Outcome::RolledBack => (5.0, f64::NAN, f64::NAN),
        };
        row[places.range(Part::Outcome)].copy_from_slice(&[kind, a, b]);
        let innovations = adapter.innovations();
        let into = &mut row[places.range(Part::Innovations)];
        into[0] = innovations.len() as f64;
        let (values, deviations) = into[1..].split_at_mut(places.outputs);
        for ((value, deviation), innovation) in values.iter_mut().zip(deviations).zip(innovations) {
            (*value, *deviation) = (innovation.value, innovation.deviation);
        }
        // Where nothing was measured, health is that of an earlier sample, which no memory keeps.
        if !innovations.is_empty() {
            let health = adapter.health();
            row[places.range(Part::Health)].copy_from_slice(&[health.least_variance, health.min_s_over_r]);
        }
        if let Some(guard) = adapter.guard() {
            self.guarded(guard, row);
        }
    }

    fn guarded(&self, guard: &Guard, row: &mut [f64]) {
        let [learner, kept, frozen] = guard.record();
        let active = guard.active().index() as f64;
        row[self.places.range(Part::Guard)].copy_from_slice(&[active, learner, kept, frozen]);
        let into = &mut row[self.places.range(Part::Events)];
        let events = &guard.events()[..guard.events().len().min(self.places.most_events())];
        into[0] = events.len() as f64;
        for (into, event) in into[1..].chunks_exact_mut(event::WORDS).zip(events) {
            into.copy_from_slice(&event::encode(&event.action));
        }
    }

    /// Predictions under a command that is held from here on; none where it is not known.
    pub(super) fn foreseen(&mut self, adapter: &dyn Adapter, held: &[f64], row: &mut [f64]) {
        if held.iter().any(|c| c.is_nan()) || self.horizons.is_empty() {
            return;
        }
        for into in self.commands.chunks_exact_mut(held.len().max(1)) {
            into.copy_from_slice(held);
        }
        adapter.rollout(&self.commands, &mut self.work, &mut self.rollout);
        row[self.places.range(Part::Held)].copy_from_slice(held);
        let n = self.places.outputs;
        let into = &mut row[self.places.range(Part::Prediction)];
        for (into, horizon) in into.chunks_exact_mut(n).zip(&self.horizons) {
            into.copy_from_slice(&self.rollout[(horizon - 1) * n..horizon * n]);
        }
    }
}

/// The bits of the calls of a row.
pub(super) fn calls(row: &[f64]) -> u8 {
    // Casts saturate, and NaN is 0.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let bits = row.first().map_or(0, |&x| x as u8);
    bits
}
