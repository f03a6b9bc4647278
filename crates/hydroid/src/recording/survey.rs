//! Content of a recording.

use std::collections::BTreeMap;

use hydroid_io::{Clock, Format, LogFile, Sink, Summary, Topic};

use super::clock::Steps;
use super::open::{self, qualified};
use crate::log::pulses::{self, Pulses};
use crate::log::{LogError, Neutral, Note};

/// Content of a recording.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Survey {
    /// The file or folder.
    pub path: String,
    /// Its format.
    pub format: String,
    /// Topics with rows, in the order of the file.
    pub topics: Vec<TopicSurvey>,
    /// The column of the time of CSV files, if it was named.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<String>,
    /// Parameters of the device.
    pub parameters: BTreeMap<String, f64>,
    /// Losses, and notes of the reader.
    pub notes: Vec<Note>,
}

/// A topic of a recording.
#[derive(Clone, Debug, serde::Serialize)]
pub struct TopicSurvey {
    /// Name.
    pub name: String,
    /// Type of its messages as the file names it.
    pub type_name: String,
    /// Number of rows.
    pub rows: u64,
    /// Time of the first row: UTC in seconds since 1970, or on the clock of the device; `None` for rows without a time.
    pub start_s: Option<f64>,
    /// Time from the first row to the last \[s\].
    pub duration_s: Option<f64>,
    /// Usual step \[s\].
    pub step_s: Option<f64>,
    /// Longest step \[s\].
    pub longest_s: Option<f64>,
    /// First values of the fields that are texts, with their names.
    pub texts: Vec<(String, String)>,
    /// Fields.
    pub fields: Vec<FieldSurvey>,
}

/// A field of a topic.
#[derive(Clone, Debug, serde::Serialize)]
pub struct FieldSurvey {
    /// Name of the column for a selection.
    pub column: String,
    /// Unit, as the file writes it.
    pub unit: Option<String>,
    /// Smallest value.
    pub low: Option<f64>,
    /// Largest value.
    pub high: Option<f64>,
    /// Mean.
    pub mean: Option<f64>,
    /// Rows without a value.
    pub missing: u64,
    /// Neutral position \[us\] of values that are pulse widths by the name or the unit of the field, or by its topic.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub neutral: Option<Neutral>,
    /// Share of the rows that repeat the value of the row before: that of a held command is near 1.
    pub held: Option<f64>,
    /// Whether the values alone are those of pulse widths.
    #[serde(skip)]
    pub(super) is_pulse: bool,
}

impl FieldSurvey {
    /// Whether the field has different values.
    pub fn varies(&self) -> bool {
        self.low < self.high
    }

    /// Largest size of its values.
    pub(super) fn fastest(&self) -> f64 {
        [self.low, self.high].into_iter().flatten().map(f64::abs).fold(0.0, f64::max)
    }
}

struct Statistics {
    topic: Topic,
    rows: u64,
    highest_ns: i64,
    lowest_ns: i64,
    fields: Vec<FieldStatistics>,
}

#[derive(Clone, Debug)]
struct FieldStatistics {
    low: f64,
    high: f64,
    sum: f64,
    found: u64,
    last: f64,
    held: u64,
    pulses: Pulses,
}

#[derive(Default)]
struct Surveyor {
    topics: Vec<Statistics>,
}

impl Sink for Surveyor {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        if id == self.topics.len() {
            self.topics.push(Statistics {
                topic: topic.clone(),
                rows: 0,
                highest_ns: i64::MIN,
                lowest_ns: i64::MAX,
                fields: Vec::new(),
            });
        }
        let known = &mut self.topics[id];
        known.topic = topic.clone();
        let empty = FieldStatistics {
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
            sum: 0.0,
            found: 0,
            last: f64::NAN,
            held: 0,
            pulses: Pulses::default(),
        };
        known.fields.resize(topic.fields.len(), empty);
        true
    }

    fn row(&mut self, id: usize, stamp_ns: i64, _received_ns: Option<i64>, values: &[f64]) {
        let topic = &mut self.topics[id];
        topic.rows += 1;
        topic.lowest_ns = topic.lowest_ns.min(stamp_ns);
        topic.highest_ns = topic.highest_ns.max(stamp_ns);
        for (field, &x) in topic.fields.iter_mut().zip(values) {
            if x.is_finite() {
                field.low = field.low.min(x);
                field.high = field.high.max(x);
                field.sum += x;
                field.found += 1;
                field.held += u64::from(x == field.last);
                field.last = x;
                field.pulses.add(x);
            }
        }
    }
}

/// Reads a recording once and states its content, in memory that does not grow with the file. The time of CSV files is the
/// column `time`, which the proposal then names; default: that of a usual name.
///
/// # Errors
/// If nothing of it can be read.
pub fn survey(source: impl Into<LogFile>, time: Option<&str>) -> Result<Survey, LogError> {
    let source = source.into();
    let shown = source.name();
    let mut notes = Vec::new();
    let mut surveyor = Surveyor::default();
    let (summary, clocks) = open::scan(&source, time, &mut surveyor, &mut notes)?;
    open::note_losses(&shown, &summary, &clocks, &mut notes);
    let format = if source.is_folder() {
        "folder".to_owned()
    } else {
        hydroid_io::detect(&source)?.map_or("CSV", Format::name).to_owned()
    };
    let with_rows = surveyor.topics.into_iter().enumerate().filter(|(_, topic)| topic.rows > 0);
    let topics: Vec<(usize, Statistics)> = with_rows.collect();
    let single = topics.len() == 1;
    let of = |(id, topic): (usize, Statistics)| topic.survey(&summary, clocks.steps(id), single);
    let topics = topics.into_iter().map(of).collect();
    let time = time.map(str::to_owned);
    Ok(Survey { path: shown, format, topics, time, parameters: summary.parameters, notes })
}

/// Whether a topic contains the outputs of an autopilot.
pub(super) fn is_output(topic: &str) -> bool {
    let name = topic.to_ascii_lowercase();
    ["rcou", "servo_output_raw", "actuator_outputs"].iter().any(|of| name.starts_with(of))
        || name.ends_with("rc/out")
}

impl Statistics {
    fn survey(self, summary: &Summary, steps: &Steps, single: bool) -> TopicSurvey {
        let timed = self.topic.clock != Clock::None;
        let offset = if self.topic.clock == Clock::Boot { summary.utc_offset_ns.unwrap_or(0) } else { 0 };
        let seconds = |ns: i64| ns as f64 / 1e9;
        let rows = self.rows;
        let field = |(field, of): (&hydroid_io::Field, &FieldStatistics)| FieldSurvey {
            column: if single { field.name.clone() } else { qualified(&self.topic.name, &field.name) },
            unit: field.unit.clone(),
            low: (of.found > 0).then_some(of.low),
            high: (of.found > 0).then_some(of.high),
            mean: (of.found > 0).then(|| of.sum / of.found as f64),
            missing: rows - of.found,
            held: (of.found > 1).then(|| of.held as f64 / (of.found - 1) as f64),
            is_pulse: of.pulses.neutral(false).is_some(),
            neutral: {
                let is_pulse =
                    is_output(&self.topic.name) || pulses::is_stated(&field.name, field.unit.as_deref());
                of.pulses.neutral(true).filter(|_| is_pulse)
            },
        };
        TopicSurvey {
            rows,
            start_s: timed.then(|| seconds(self.lowest_ns.saturating_add(offset))),
            duration_s: timed.then(|| seconds(self.highest_ns.saturating_sub(self.lowest_ns))),
            step_s: steps.usual_s().filter(|_| timed),
            longest_s: timed.then(|| seconds(steps.longest_ns)),
            fields: self.topic.fields.iter().zip(&self.fields).map(field).collect(),
            texts: self.topic.texts.clone(),
            name: self.topic.name.clone(),
            type_name: self.topic.type_name.clone(),
        }
    }
}
