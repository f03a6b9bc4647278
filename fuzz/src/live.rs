//! Streams of the small models, their lines, and the properties of their answers.

use std::sync::Arc;

use hydroid::adapt::adapter;
use hydroid::closed_loop::{ControlMethod, SpeedOptions, Task, Track};
use hydroid::evaluate::DesignRange;
use hydroid::model::{Model, Port};
use hydroid_live::stream::{Line, Options, Pilot, Position, Stream};
use serde_json::{Map, Value, json};

use crate::exercise::controller;
use crate::models;

/// Clean samples after which all predictions are finite, whatever came before.
pub const RECOVERY: usize = 20;

/// A stream and its clock.
pub struct Live {
    stream: Stream,
    model: Model,
    is_json: bool,
    is_steered: bool,
    /// Time of the last sample \[s\].
    pub t: f64,
    k: usize,
}

impl Live {
    /// A stream of a [variant](models::variant), which `+steered` gives a controller; the header is not sent yet.
    pub fn new(variant: &str, is_json: bool) -> Self {
        let (model, options) = models::variant(variant);
        let steered = variant.split('+').find_map(|part| match part {
            "steered" => Some(ControlMethod::FeedbackLinearization),
            "planned" => Some(ControlMethod::CrossEntropy),
            _ => None,
        });
        let (mut adapter, _) = adapter(&model, &options, &[]).expect("the models can be adapted");
        let reading = model.description.reading.clone();
        let options = Options { name: "fuzz".to_owned(), reading, horizons: vec![1, 5, 20], timing: false };
        let pilot = steered.map(|method| {
            adapter.freeze(true);
            let track = Track::new(&Task::Circle { radius: 20.0 }, &SpeedOptions::cruise(1.0));
            let track = track.expect("a valid track");
            let options = controller(&Arc::new(model.clone()), method);
            Pilot::new(&options, track, 1, None).expect("the vessel can be steered")
        });
        let mut stream = Stream::new(&model, adapter, options).expect("valid options");
        let is_steered = pilot.is_some();
        if let Some(pilot) = pilot {
            stream.steer(pilot, Position::default()).expect("valid options");
        }
        Self { stream, model, is_json, is_steered, t: 0.0, k: 0 }
    }

    /// The stream.
    pub fn stream(&mut self) -> &mut Stream {
        &mut self.stream
    }

    /// Sample time \[s\].
    pub fn dt(&self) -> f64 {
        self.model.description.dt
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    fn ports(&self) -> impl Iterator<Item = &Port> {
        self.model.description.outputs.iter().chain(&self.model.description.inputs)
    }

    /// Columns after the time: outputs, inputs, pose.
    fn columns(&self) -> Vec<(String, DesignRange)> {
        let ports = self.ports().map(|port| (port.channel.name.clone(), port.range));
        let pose = if self.is_steered { &["x", "y", "psi"][..] } else { &[] };
        let metres = DesignRange { low: -1.0, high: 1.0 };
        ports.chain(pose.iter().map(|name| ((*name).to_owned(), metres))).collect()
    }

    /// Sends the header or the first object.
    pub fn begin(&mut self) {
        if self.is_json {
            self.clean();
        } else {
            let names: Vec<String> = self.columns().into_iter().map(|(name, _)| name).collect();
            assert!(self.serve(format!("t,{}", names.join(",")).as_bytes()).is_none());
        }
    }

    /// Sends a clean sample one step after the last, and gives its answer.
    pub fn clean(&mut self) -> Option<Value> {
        self.t += self.dt();
        let line = self.line(Some(self.t.to_string()), |_, clean, _| Some(clean.to_string()));
        self.serve(line.as_bytes())
    }

    /// A line from its time and the cell of each column, given its index, its clean value and its range; cells without
    /// a value are missing.
    fn line(
        &mut self,
        t: Option<String>,
        mut cell: impl FnMut(usize, f64, DesignRange) -> Option<String>,
    ) -> String {
        self.k += 1;
        let phase = 0.3 * self.k as f64;
        let columns = self.columns();
        let value = |i: usize, range: DesignRange| {
            let wave = (phase + i as f64).sin();
            0.5 * (range.low + range.high) + 0.05 * (range.high - range.low) * wave
        };
        let cells = columns.iter().enumerate().map(|(i, (_, range))| cell(i, value(i, *range), *range));
        let cells: Vec<Option<String>> = std::iter::once(t).chain(cells).collect();
        if !self.is_json {
            return cells.into_iter().map(Option::unwrap_or_default).collect::<Vec<_>>().join(",");
        }
        let names = std::iter::once("t").chain(columns.iter().map(|(name, _)| name.as_str()));
        let value = |text: String| serde_json::from_str(&text).unwrap_or(Value::String(text));
        let pairs = names.zip(cells).filter_map(|(name, cell)| Some((name.to_owned(), value(cell?))));
        Value::Object(pairs.collect::<Map<_, _>>()).to_string()
    }

    /// A sample from codes: the first for its time, then one for each column; `a` is clean, and missing codes are.
    pub fn coded(&mut self, codes: &[u8]) -> Option<Value> {
        let dt = self.dt();
        let (&time, codes) = codes.split_first().unwrap_or((&b'a', &[]));
        let t = self.t
            + match time.to_ascii_lowercase() {
                b'b' => 2.5 * dt,
                b'c' => 0.0,
                b'd' => -3.0 * dt,
                b'e' => 50.0 * dt,
                b'f' => -3600.0,
                b'g' => 5e7,
                b'h' => 0.3 * dt,
                b'i' => 1e11,
                _ => dt,
            };
        // A capital sets the clock; a single stamp of a small letter is wrong.
        if time.is_ascii_uppercase() || !(b'd'..=b'i').contains(&time) {
            self.t = t;
        }
        let stamp = match time {
            b'x' => None,
            b'y' => Some("noon".to_owned()),
            b'z' => Some("1e300".to_owned()),
            _ => Some(t.to_string()),
        };
        let line = self.line(stamp, |i, clean, DesignRange { low, high }| {
            let width = high - low;
            let value = match codes.get(i).copied().unwrap_or(b'a') {
                b'b' => return None,
                b'c' => 1e200,
                b'd' => -1e200,
                b'e' => 1e30,
                b'f' => 1e9,
                b'g' => -1e5,
                b'h' => high + 9.9 * width,
                b'i' => low - 9.9 * width,
                b'j' => return Some("NaN".to_owned()),
                b'k' => return Some("inf".to_owned()),
                b'l' => return Some("five".to_owned()),
                b'm' => 0.0,
                b'n' => 1e-300,
                b'o' => clean + 0.5 * width,
                b'p' => clean - 0.5 * width,
                b'q' => clean + 3.0 * width,
                b'r' => high,
                b's' => low,
                _ => clean,
            };
            Some(value.to_string())
        });
        self.serve(line.as_bytes())
    }

    /// Sends a line, and checks and gives its answer; lines that are blank and the header have none.
    pub fn serve(&mut self, line: &[u8]) -> Option<Value> {
        let is_header = !self.stream.has_begun() && !self.is_json;
        let is_blank = std::str::from_utf8(line).is_ok_and(|line| line.trim().is_empty());
        let mut answer = Vec::new();
        self.stream.serve(Line::Whole(line), &mut answer).expect("a line does not end a stream");
        if answer.is_empty() {
            return None;
        }
        let shown = || String::from_utf8_lossy(line);
        assert!(!is_header && !is_blank, "an answer to {}", shown());
        let answer = std::str::from_utf8(&answer).expect("answers are text");
        assert!(answer.ends_with('\n') && answer.matches('\n').count() == 1, "{answer}");
        let answer: Value = serde_json::from_str(answer).expect("an answer is JSON");
        if let Err(reason) = self.check(&answer) {
            panic!("{reason}: {} -> {answer}", shown());
        }
        Some(answer)
    }

    fn check(&self, answer: &Value) -> Result<(), &'static str> {
        let status = answer["status"].as_str().ok_or("no status")?;
        let explained = answer["note"].is_string() || ["waiting", "reset", "rejected"].contains(&status);
        if self.is_steered && has_null(&answer["command"]) {
            return Err("a command that is not a number");
        }
        if status == "error" {
            return if answer["message"].is_string() { Ok(()) } else { Err("an error without a message") };
        }
        let is_used =
            ["accepted", "inflated", "rejected", "rolled_back", "waiting", "used", "reset"].contains(&status);
        if !is_used {
            return Ok(());
        }
        let [estimate, prediction] = ["estimate", "prediction"].map(|key| &answer[key]);
        if estimate.is_null() || prediction.is_null() {
            return Err("no prediction");
        }
        // The innovation of an output that the line does not contain is null.
        if !explained && (has_null(estimate) || has_null(prediction)) {
            return Err("a number is null, and nothing says why");
        }
        Ok(())
    }

    /// After clean samples every prediction is finite.
    pub fn recover(&mut self) {
        let mut last = json!(null);
        for _ in 0..RECOVERY {
            last = self.clean().unwrap_or_default();
        }
        let used =
            ["estimate", "prediction"].iter().all(|key| last[key].is_object() && !has_null(&last[key]));
        assert!(used, "no prediction after {RECOVERY} clean samples: {last}");
    }
}

/// Whether a number of a part of an answer is null; absent parts have none.
fn has_null(value: &Value) -> bool {
    match value {
        Value::Object(object) => object.values().any(|value| value.is_null() || has_null(value)),
        Value::Array(list) => list.iter().any(|value| value.is_null() || has_null(value)),
        _ => false,
    }
}
