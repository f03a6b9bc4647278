//! Access to a recorded step.

use std::fmt::Write as _;

use hydroid_core::adapt::guard::{Action, Expert};
use serde_json::{Map, Value, json};

use super::event;
use super::head::Head;
use super::record::{ADVANCE, OBSERVE, Part, RESET, calls};
use hydroid::adapt::events::EventText;

/// A recorded step: calls of the adapter and their results.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    head: &'a Head,
    row: &'a [f64],
}

/// Status words, in the order of their codes in a row.
pub(super) const OUTCOMES: [&str; 6] =
    ["waiting", "accepted", "inflated", "rejected", "rejected", "rolled_back"];

impl<'a> Step<'a> {
    pub(super) fn new(head: &'a Head, row: &'a [f64]) -> Self {
        Self { head, row }
    }

    fn part(self, part: Part) -> &'a [f64] {
        &self.row[self.head.layout().range(part)]
    }

    fn count(x: f64) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // counts were written as numbers; a cast saturates
        let count = x as usize;
        count
    }

    /// Whether a sample was observed in this step.
    pub fn is_sample(self) -> bool {
        calls(self.row) & OBSERVE != 0
    }

    /// Whether a run begins with this step.
    pub fn is_reset(self) -> bool {
        calls(self.row) & RESET != 0
    }

    /// Time of the sample \[s\].
    pub fn t(self) -> f64 {
        self.part(Part::Time)[0]
    }

    /// Name of the run.
    pub fn run(self) -> &'a str {
        self.head.runs.get(Self::count(self.part(Part::Run)[0])).map_or("", String::as_str)
    }

    /// Measured outputs; NaN if missing.
    pub fn measured(self) -> &'a [f64] {
        self.part(Part::Measured)
    }

    /// Estimated outputs.
    pub fn estimate(self) -> &'a [f64] {
        self.part(Part::Estimate)
    }

    /// Status of the sample, as in the answers of a stream.
    pub fn status(self) -> &'static str {
        OUTCOMES.get(Self::count(self.part(Part::Outcome)[0])).unwrap_or(&OUTCOMES[0])
    }

    /// Innovations and standard deviations; empty without an update.
    fn innovations(self) -> (&'a [f64], &'a [f64]) {
        let part = self.part(Part::Innovations);
        let (values, deviations) = part[1..].split_at(self.head.outputs.len());
        let count = Self::count(part[0]).min(values.len());
        (&values[..count], &deviations[..count])
    }

    /// Normalized innovation squared (NIS); NaN without innovations.
    pub fn nis(self) -> f64 {
        let (values, deviations) = self.innovations();
        if values.is_empty() {
            return f64::NAN;
        }
        values.iter().zip(deviations).map(|(value, deviation)| (value / deviation).powi(2)).sum()
    }

    /// Least variance of a weight, and `min_s_over_r` of [`Health`](hydroid_core::adapt::Health); NaN if unknown.
    pub fn health(self) -> [f64; 2] {
        let part = self.part(Part::Health);
        [part[0], part[1]]
    }

    /// The model that predicts; `None` without a guard.
    pub fn active(self) -> Option<Expert> {
        let active = self.part(Part::Guard)[0];
        Expert::ALL.get(Self::count(active)).filter(|_| !active.is_nan()).copied()
    }

    pub(super) fn events(self) -> impl Iterator<Item = Action> {
        let part = self.part(Part::Events);
        part[1..].chunks_exact(event::WORDS).take(Self::count(part[0])).filter_map(event::decode)
    }

    /// Name and description of each event; `names` are outputs, then inputs.
    pub(super) fn described(self, names: &[String]) -> impl Iterator<Item = (&'static str, String)> {
        self.events().map(move |action| {
            let mut text = String::new();
            let _ = write!(text, "{}", EventText { action: &action, names });
            (action.name(), text)
        })
    }

    /// The step as JSON, with the keys of the answers of a stream; unknown values are `null`.
    pub fn json(self) -> Value {
        let head = self.head;
        let named = |channels: &[hydroid::log::Channel], numbers: &[f64]| -> Value {
            let pairs = channels.iter().zip(numbers).map(|(channel, x)| (channel.name.clone(), json!(x)));
            Value::Object(pairs.collect())
        };
        let mut all = Map::new();
        let mut put = |key: &str, value: Value| all.insert(key.to_owned(), value);
        put("t", json!(self.t()));
        if head.runs.len() > 1 {
            put("run", json!(self.run()));
        }
        if self.is_reset() {
            put("reset", json!(true));
        }
        if calls(self.row) & ADVANCE != 0 {
            put("command_before", named(&head.inputs, self.part(Part::Command)));
        }
        if !self.is_sample() {
            return Value::Object(all);
        }
        put("status", json!(self.status()));
        put("measured", named(&head.outputs, self.measured()));
        put("estimate", named(&head.outputs, self.estimate()));
        if let [heading] = self.part(Part::Heading)
            && !heading.is_nan()
        {
            put("heading", json!(heading));
        }
        put("held", named(&head.inputs, self.part(Part::Held)));
        let n = head.outputs.len();
        let prediction = self.part(Part::Prediction);
        let mut predicted = Map::from_iter([("horizons".to_owned(), json!(head.horizons))]);
        for (i, output) in head.outputs.iter().enumerate() {
            let numbers: Vec<f64> = prediction.iter().skip(i).step_by(n).copied().collect();
            predicted.insert(output.name.clone(), json!(numbers));
        }
        put("prediction", Value::Object(predicted));
        let (innovations, _) = self.innovations();
        if !innovations.is_empty() {
            put("innovation", json!(innovations));
            put("nis", json!(self.nis()));
        }
        let [least_variance, min_s_over_r] = self.health();
        put("health", json!({ "least_variance": least_variance, "min_s_over_r": min_s_over_r }));
        if let Some(active) = self.active() {
            put("active", json!(active.name()));
            let (limits, balances) = self.part(Part::Guard)[1..].split_at(2);
            put("limits", json!(limits));
            put("balances", json!(balances));
        }
        let names = head.names();
        let event = |(action, text)| json!({ "action": action, "text": text });
        let events: Vec<Value> = self.described(&names).map(event).collect();
        if !events.is_empty() {
            put("events", Value::Array(events));
        }
        Value::Object(all)
    }
}
