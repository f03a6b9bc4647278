//! Whole content of a file in memory, and files that are damaged on purpose.

use std::fs;
use std::path::PathBuf;

use hydroid_io::{IoError, Sink, Summary, Topic, scan};
use tempfile::TempDir;

/// Rows of a topic: stamps and values.
#[derive(Debug, Default)]
pub(crate) struct Tables {
    pub(crate) topics: Vec<Topic>,
    pub(crate) rows: Vec<Vec<(i64, Vec<f64>)>>,
    pub(crate) summary: Summary,
}

impl Sink for Tables {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        assert_eq!(id, self.topics.len(), "topics are numbered in their order");
        self.topics.push(topic.clone());
        self.rows.push(Vec::new());
        true
    }

    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]) {
        assert_eq!(received_ns, None);
        assert_eq!(values.len(), self.topics[id].fields.len());
        self.rows[id].push((stamp_ns, values.to_vec()));
    }

    fn proceed(&mut self, done: u64, total: u64) -> bool {
        assert!(done <= total);
        // No test has that many rows: a file that claims more is left.
        self.rows.iter().map(Vec::len).sum::<usize>() < 100_000
    }
}

impl Tables {
    /// Values of a field of a topic.
    pub(crate) fn values(&self, topic: usize, field: &str) -> Vec<f64> {
        let at = self.topics[topic].fields.iter().position(|known| known.name == field);
        let at = at.unwrap_or_else(|| panic!("no field {field} in {:?}", self.topics[topic].fields));
        self.rows[topic].iter().map(|(_, values)| values[at]).collect()
    }

    pub(crate) fn unit(&self, topic: usize, field: &str) -> Option<&str> {
        self.topics[topic].fields.iter().find(|known| known.name == field)?.unit.as_deref()
    }
}

/// All of a file.
pub(crate) fn read(path: &str) -> Result<Tables, IoError> {
    let mut tables = Tables::default();
    tables.summary = scan(path, &mut tables)?;
    Ok(tables)
}

/// A file with this content, as [`read`].
pub(crate) fn read_bytes(name: &str, bytes: &[u8]) -> Result<Tables, IoError> {
    let folder = TempDir::new().expect("a temporary folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("a file");
    read(&path.to_string_lossy())
}

/// A file of `tests/golden`.
pub(crate) fn golden(name: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    folder.join(name).to_string_lossy().into_owned()
}

/// Whether two values are the same, those that are missing included.
pub(crate) fn same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

/// A damaged file has an error that says so, or tables.
pub(crate) fn survives(name: &str, bytes: &[u8]) -> Option<Tables> {
    match read_bytes(name, bytes) {
        Ok(tables) => Some(tables),
        Err(
            IoError::Damaged { .. } | IoError::Empty { .. } | IoError::Unknown { .. } | IoError::Interrupted,
        ) => None,
        Err(error) => panic!("{error}"),
    }
}
