//! All that a reader gives, and checks that hold for each format whatever the file.

use std::fs;

use hydroid_io::{IoError, Sink, Summary, Topic, scan};

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) stamp_ns: i64,
    pub(crate) received_ns: Option<i64>,
    /// Bits, so that NaN equals NaN.
    values: Vec<u64>,
}

#[derive(Debug, Default)]
pub(crate) struct Recorder {
    pub(crate) topics: Vec<Topic>,
    pub(crate) rows: Vec<Vec<Row>>,
    pub(crate) summary: Summary,
    /// Topics that are not wanted.
    unwanted: Vec<String>,
}

impl Sink for Recorder {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        assert!(id <= self.topics.len(), "topics are numbered in order");
        if id == self.topics.len() {
            assert!(self.topics.iter().all(|other| other.name != topic.name), "{} twice", topic.name);
            self.topics.push(topic.clone());
            self.rows.push(Vec::new());
        } else {
            let before = &self.topics[id];
            assert_eq!(before.name, topic.name);
            assert_eq!(before.fields[..], topic.fields[..before.fields.len()], "fields are added at the end");
            self.topics[id] = topic.clone();
        }
        !self.unwanted.contains(&topic.name)
    }

    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]) {
        assert_eq!(
            values.len(),
            self.topics[id].fields.len(),
            "a value for each field of {}",
            self.topics[id].name
        );
        assert!(!self.unwanted.contains(&self.topics[id].name), "rows of an unwanted topic");
        let values = values.iter().map(|value| value.to_bits()).collect();
        self.rows[id].push(Row { stamp_ns, received_ns, values });
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
        let file = tempfile::NamedTempFile::new().expect("a file");
        fs::write(file.path(), bytes).expect("a file");
        Self::of(file.path().to_str().expect("a path"))
    }

    pub(crate) fn names(&self) -> Vec<&str> {
        self.topics.iter().map(|topic| topic.name.as_str()).collect()
    }

    pub(crate) fn find(&self, topic: &str) -> usize {
        let at = self.topics.iter().position(|other| other.name == topic);
        at.unwrap_or_else(|| panic!("{topic} is none of {:?}", self.names()))
    }

    pub(crate) fn topic(&self, topic: &str) -> &Topic {
        &self.topics[self.find(topic)]
    }

    pub(crate) fn count(&self, topic: &str) -> usize {
        self.rows[self.find(topic)].len()
    }

    pub(crate) fn all(&self) -> usize {
        self.rows.iter().map(Vec::len).sum()
    }

    pub(crate) fn stamps(&self, topic: &str) -> Vec<i64> {
        self.rows[self.find(topic)].iter().map(|row| row.stamp_ns).collect()
    }

    fn field(&self, topic: &str, field: &str) -> usize {
        let fields = &self.topic(topic).fields;
        let at = fields.iter().position(|other| other.name == field);
        at.unwrap_or_else(|| panic!("{field} is none of {fields:?}"))
    }

    pub(crate) fn unit(&self, topic: &str, field: &str) -> Option<&str> {
        self.topic(topic).fields[self.field(topic, field)].unit.as_deref()
    }

    pub(crate) fn column(&self, topic: &str, field: &str) -> Vec<f64> {
        let at = self.field(topic, field);
        let rows = &self.rows[self.find(topic)];
        // A row may be older than the field.
        rows.iter().map(|row| row.values.get(at).map_or(f64::NAN, |&bits| f64::from_bits(bits))).collect()
    }
}

/// Reads what is left of a file that is cut after each `step` bytes: its rows are the first rows of the whole
/// file.
pub(crate) fn truncated(bytes: &[u8], step: usize) {
    let whole = Recorder::of_bytes(bytes).expect("a whole file");
    let mut seen = 0;
    for length in (step..bytes.len()).step_by(step) {
        let part = match Recorder::of_bytes(&bytes[..length]) {
            Ok(part) => part,
            Err(IoError::Damaged { .. }) => continue,
            Err(error) => panic!("{length} bytes: {error}"),
        };
        for (topic, rows) in part.topics.iter().zip(&part.rows) {
            let all = &whole.rows[whole.find(&topic.name)];
            assert!(rows.len() <= all.len(), "{length} bytes: {} rows of {}", rows.len(), topic.name);
            assert_eq!(rows[..], all[..rows.len()], "{length} bytes: {}", topic.name);
        }
        assert!(part.all() >= seen, "{length} bytes give fewer rows than before");
        assert!(part.summary.lost_bytes <= length as u64);
        seen = part.all();
    }
    assert!(seen * 10 > whole.all() * 9, "{seen} of {} rows before the end", whole.all());
}

/// Reads a file that may be damaged in any way.
pub(crate) fn survives(bytes: &[u8]) -> Option<Recorder> {
    match Recorder::of_bytes(bytes) {
        Ok(read) => {
            assert!(read.summary.lost_bytes <= bytes.len() as u64, "{:?}", read.summary);
            assert!(read.all() <= bytes.len());
            Some(read)
        }
        Err(IoError::Damaged { .. } | IoError::Unknown { .. } | IoError::Empty { .. }) => None,
        Err(error) => panic!("{error}"),
    }
}
