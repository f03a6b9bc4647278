//! Chosen fields of a file in memory.

use crate::error::IoError;
use crate::open::scan;
use crate::sink::{Clock, Sink, Summary, Topic};

/// Topics of a file with the values of the chosen fields.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The topics that have rows, in the order of the file.
    pub topics: Vec<TopicColumns>,
    /// Losses, parameters, notes.
    pub summary: Summary,
}

/// Columns of a topic.
#[derive(Clone, Debug)]
pub struct TopicColumns {
    /// Name, type and texts.
    pub topic: Topic,
    /// Stamps \[ns\] of the rows, in the order of the file. Those of [`Clock::Boot`] are UTC if the offset is known.
    pub stamps_ns: Vec<i64>,
    /// Stamps \[ns\] of reception; empty if the file has one stamp for each row.
    pub received_ns: Vec<i64>,
    /// The chosen fields.
    pub columns: Vec<Column>,
}

/// Values of a field.
#[derive(Clone, Debug)]
pub struct Column {
    /// Index in [`Topic::fields`].
    pub field: usize,
    /// One value for each row; NaN where the message has none.
    pub values: Vec<f64>,
}

struct Collector<'a> {
    wanted: &'a dyn Fn(&str, &str) -> bool,
    proceed: &'a dyn Fn(u64, u64) -> bool,
    topics: Vec<TopicColumns>,
}

impl Sink for Collector<'_> {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        if id == self.topics.len() {
            let empty = Topic { fields: Vec::new(), ..topic.clone() };
            self.topics.push(TopicColumns {
                topic: empty,
                stamps_ns: Vec::new(),
                received_ns: Vec::new(),
                columns: Vec::new(),
            });
        }
        let kept = &mut self.topics[id];
        for (i, field) in topic.fields.iter().enumerate().skip(kept.topic.fields.len()) {
            if (self.wanted)(&topic.name, &field.name) {
                kept.columns.push(Column { field: i, values: vec![f64::NAN; kept.stamps_ns.len()] });
            }
        }
        kept.topic = topic.clone();
        !kept.columns.is_empty()
    }

    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]) {
        let kept = &mut self.topics[id];
        kept.stamps_ns.push(stamp_ns);
        kept.received_ns.extend(received_ns);
        for column in &mut kept.columns {
            column.values.push(values.get(column.field).copied().unwrap_or(f64::NAN));
        }
    }

    fn proceed(&mut self, done: u64, total: u64) -> bool {
        (self.proceed)(done, total)
    }
}

/// Reads the fields of a file for which `wanted(topic, field)` holds. `proceed(done, total)` is called after each MB and
/// stops the reading if its answer is false.
///
/// # Errors
/// As [`scan`].
pub fn read(
    path: &str,
    wanted: &dyn Fn(&str, &str) -> bool,
    proceed: &dyn Fn(u64, u64) -> bool,
) -> Result<Recording, IoError> {
    let mut collector = Collector { wanted, proceed, topics: Vec::new() };
    let summary = scan(path, &mut collector)?;
    let mut topics = collector.topics;
    topics.retain(|topic| !topic.stamps_ns.is_empty());
    if let Some(offset) = summary.utc_offset_ns {
        for topic in topics.iter_mut().filter(|topic| topic.topic.clock == Clock::Boot) {
            topic.topic.clock = Clock::Utc;
            for stamp in &mut topic.stamps_ns {
                *stamp = stamp.saturating_add(offset);
            }
        }
    }
    Ok(Recording { topics, summary })
}
