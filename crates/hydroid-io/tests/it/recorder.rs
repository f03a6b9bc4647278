//! All that a reader gives, and checks that hold for each format whatever the file.

use std::fs;
use std::ops::RangeBounds;

use hydroid_io::{Format, IoError, LogFile, Sink, Summary, Topic, detect, scan};
use proptest::prelude::*;

/// Stamp, stamp of reception, and values as bits, because NaN is not equal to itself.
pub(crate) type Row = (i64, Option<i64>, Vec<u64>);

/// A topic with all its rows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rows {
    pub(crate) topic: Topic,
    pub(crate) rows: Vec<Row>,
}

impl Rows {
    fn field(&self, field: &str) -> usize {
        let fields = &self.topic.fields;
        let at = fields.iter().position(|other| other.name == field);
        at.unwrap_or_else(|| panic!("{field} is none of {fields:?}"))
    }

    pub(crate) fn unit(&self, field: &str) -> Option<&str> {
        self.topic.fields[self.field(field)].unit.as_deref()
    }

    /// A row may be older than the field.
    pub(crate) fn value(&self, row: usize, field: &str) -> f64 {
        self.rows[row].2.get(self.field(field)).map_or(f64::NAN, |&bits| f64::from_bits(bits))
    }

    pub(crate) fn column(&self, field: &str) -> Vec<f64> {
        (0..self.rows.len()).map(|row| self.value(row, field)).collect()
    }

    pub(crate) fn stamps(&self) -> Vec<i64> {
        self.rows.iter().map(|row| row.0).collect()
    }

    /// Stamps and values.
    pub(crate) fn table(&self) -> Vec<(i64, Vec<f64>)> {
        let values = |row: &Row| row.2.iter().map(|&bits| f64::from_bits(bits)).collect();
        self.rows.iter().map(|row| (row.0, values(row))).collect()
    }
}

/// All topics of a file.
#[derive(Debug, Default)]
pub(crate) struct Recorder {
    pub(crate) topics: Vec<Rows>,
    pub(crate) summary: Summary,
    /// Topics that are not wanted.
    unwanted: Vec<String>,
}

impl Sink for Recorder {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        assert!(id <= self.topics.len(), "topics are numbered in order");
        if id == self.topics.len() {
            assert!(self.topics.iter().all(|other| other.topic.name != topic.name), "{} twice", topic.name);
            self.topics.push(Rows { topic: topic.clone(), rows: Vec::new() });
        }
        let known = &mut self.topics[id].topic;
        assert_eq!(known.name, topic.name);
        assert!(topic.fields.starts_with(&known.fields), "fields are added at the end");
        *known = topic.clone();
        !self.unwanted.contains(&topic.name)
    }

    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]) {
        let Rows { topic, rows } = &mut self.topics[id];
        assert_eq!(values.len(), topic.fields.len(), "a value for each field of {}", topic.name);
        assert!(!self.unwanted.contains(&topic.name), "rows of an unwanted topic");
        rows.push((stamp_ns, received_ns, values.iter().map(|value| value.to_bits()).collect()));
    }

    fn proceed(&mut self, done: u64, total: u64) -> bool {
        assert!(done <= total, "{done} of {total} bytes");
        // No test has that many rows: a file that claims more is left.
        self.all() < 100_000
    }
}

impl Recorder {
    pub(crate) fn of(path: &str) -> Result<Self, IoError> {
        Self::without(path, &[])
    }

    /// Without the rows of some topics.
    pub(crate) fn without(path: &str, unwanted: &[&str]) -> Result<Self, IoError> {
        let unwanted = unwanted.iter().map(|&name| name.to_owned()).collect();
        let mut recorder = Self { unwanted, ..Self::default() };
        recorder.summary = scan(path, &mut recorder)?;
        Ok(recorder)
    }

    /// Of a file with these bytes.
    pub(crate) fn of_bytes(bytes: &[u8]) -> Result<Self, IoError> {
        // In memory where the system has such a folder: the tests write thousands of files.
        let file = tempfile::NamedTempFile::new_in("/dev/shm");
        let file = file.or_else(|_| tempfile::NamedTempFile::new()).expect("a file");
        fs::write(file.path(), bytes).expect("a file");
        Self::of(file.path().to_str().expect("a path"))
    }

    pub(crate) fn names(&self) -> Vec<&str> {
        self.topics.iter().map(|rows| rows.topic.name.as_str()).collect()
    }

    pub(crate) fn get(&self, topic: &str) -> &Rows {
        let found = self.topics.iter().find(|rows| rows.topic.name == topic);
        found.unwrap_or_else(|| panic!("{topic} is none of {:?}", self.names()))
    }

    pub(crate) fn topic(&self, topic: &str) -> &Topic {
        &self.get(topic).topic
    }

    pub(crate) fn count(&self, topic: &str) -> usize {
        self.get(topic).rows.len()
    }

    /// Number of all rows.
    pub(crate) fn all(&self) -> usize {
        self.topics.iter().map(|rows| rows.rows.len()).sum()
    }

    pub(crate) fn stamps(&self, topic: &str) -> Vec<i64> {
        self.get(topic).stamps()
    }

    pub(crate) fn unit(&self, topic: &str, field: &str) -> Option<&str> {
        self.get(topic).unit(field)
    }

    pub(crate) fn column(&self, topic: &str, field: &str) -> Vec<f64> {
        self.get(topic).column(field)
    }
}

/// Reads what is left of a file that is cut after each `step` bytes: its rows are the first rows of the whole
/// file. Returns their number and the summary of each part.
pub(crate) fn truncated(bytes: &[u8], step: usize) -> Vec<(usize, Summary)> {
    let whole = Recorder::of_bytes(bytes).expect("a whole file");
    let (mut seen, mut parts) = (0, Vec::new());
    for length in (step..bytes.len()).step_by(step) {
        let part = match Recorder::of_bytes(&bytes[..length]) {
            Ok(part) => part,
            Err(IoError::Damaged { .. }) => continue,
            Err(error) => panic!("{length} bytes: {error}"),
        };
        assert_part_of(&part, &whole);
        assert!(part.all() >= seen, "{length} bytes give fewer rows than before");
        assert!(part.summary.lost_bytes <= length as u64);
        seen = part.all();
        parts.push((seen, part.summary));
    }
    assert!(seen * 10 > whole.all() * 9, "{seen} of {} rows before the end", whole.all());
    parts
}

/// Flips up to 19 bytes from a place on: what is left has a number of rows in this range; `None` is an error.
pub(crate) fn flipped(bytes: &[u8], from: usize, rows: impl RangeBounds<Option<usize>>) {
    let flip = (from..bytes.len(), prop_oneof![1..=u8::MAX, (0..8).prop_map(|bit| 1u8 << bit)]);
    proptest!(ProptestConfig::with_cases(64), |(flips in prop::collection::vec(flip, 1..20))| {
        let mut bytes = bytes.to_vec();
        for (at, flip) in flips {
            bytes[at] ^= flip;
        }
        let read = survives(&bytes).map(|log| log.all());
        prop_assert!(rows.contains(&read), "{:?} rows", read);
    });
}

/// Asserts that a damaged file gives the first rows of each topic of the whole file, and nothing else.
pub(crate) fn assert_part_of(part: &Recorder, whole: &Recorder) {
    for Rows { topic, rows } in &part.topics {
        let all = &whole.get(&topic.name).rows;
        assert!(rows.len() <= all.len(), "{} rows of {}", rows.len(), topic.name);
        assert_eq!(rows[..], all[..rows.len()], "{}", topic.name);
    }
}

/// Reads a file that may be damaged in any way: it has an error that says so, or topics, and losses within the file. If
/// the bytes of the format are read once, one behind the other, the losses and the rows are not more than they.
pub(crate) fn survives(bytes: &[u8]) -> Option<Recorder> {
    match Recorder::of_bytes(bytes) {
        Ok(read) => {
            let (summary, length) = (&read.summary, bytes.len() as u64);
            assert!(summary.losses.iter().all(|loss| loss.offset <= length), "{summary:?}");
            let format = detect(LogFile::in_memory("log", bytes)).expect("a log");
            if let Some(Format::DataFlash | Format::ULog | Format::Nmea) = format {
                assert!(summary.lost_bytes <= length && read.all() <= bytes.len(), "{summary:?}");
            }
            Some(read)
        }
        Err(
            IoError::Damaged { .. } | IoError::Unknown { .. } | IoError::Empty { .. } | IoError::Interrupted,
        ) => None,
        Err(error) => panic!("{error}"),
    }
}
