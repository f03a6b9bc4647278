//! What must hold of recordings: they are read, and their rows are those that were received and sent.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::{Path, PathBuf};

use hydroid_io::{Sink, Topic};
use hydroid_live::link::mavlink::topics::{TOPICS, row};
use mavlink::dialects::ardupilotmega::MavMessage;

/// A row: time of reception, and its values.
type Row = (i64, u64);

/// Rows by topic.
type Rows = BTreeMap<String, Vec<Row>>;

fn sum(values: &[f64]) -> u64 {
    let mut hasher = DefaultHasher::new();
    // All numbers that are none are the same.
    for value in values {
        if value.is_nan() { 1_u64 } else { value.to_bits() }.hash(&mut hasher);
    }
    hasher.finish()
}

/// A recording that is being written, and what must be in it.
#[derive(Default)]
pub(super) struct Recordings {
    current: Option<(PathBuf, Rows)>,
    values: Vec<f64>,
    /// Recordings and rows that were read.
    pub(super) files: u64,
    pub(super) rows: u64,
    /// Rows that were left out because the disk was too slow, and those of the last chunk before a kill.
    pub(super) left_out: u64,
}

impl Recordings {
    /// The path of the recording that is being written.
    pub(super) fn path(&self) -> Option<&Path> {
        self.current.as_ref().map(|(path, _)| path.as_path())
    }

    /// A recording begins.
    pub(super) fn begin(&mut self, path: &Path) {
        assert!(self.current.is_none(), "two recordings at a time");
        self.current = Some((path.to_owned(), Rows::new()));
    }

    /// A message that was received, or a command that was sent.
    pub(super) fn add(&mut self, message: &MavMessage, now_ns: i64) {
        if let Some((_, rows)) = &mut self.current
            && let Some((topic, _)) = row(message, &mut self.values)
        {
            let rows = match rows.get_mut(TOPICS[topic].name) {
                Some(rows) => rows,
                None => rows.entry(TOPICS[topic].name.to_owned()).or_default(),
            };
            rows.push((now_ns, sum(&self.values)));
        }
    }

    /// The recording has ended; `left_out` rows were not recorded. `folder` is where the file is now.
    pub(super) fn end(&mut self, folder: &Path, left_out: u64) -> Result<(), String> {
        let Some((path, rows)) = self.current.take() else { return Err("there is no recording".to_owned()) };
        self.check(&folder.join(path.file_name().unwrap()), &rows, Some(left_out))
    }

    /// hydroid was killed: the file is as the system has it at this moment.
    pub(super) fn kill(&mut self, folder: &Path) -> Result<(), String> {
        let Some((path, rows)) = self.current.take() else { return Ok(()) };
        let copy = folder.join("killed.mcap");
        std::fs::copy(folder.join(path.file_name().unwrap()), &copy).map_err(|error| error.to_string())?;
        self.check(&copy, &rows, None)
    }

    /// Reads a file. `left_out` is the largest number of missing rows; `None` if the end may be missing.
    fn check(&mut self, path: &Path, sent: &Rows, left_out: Option<u64>) -> Result<(), String> {
        let mut read = Reader::default();
        let text = path.display().to_string();
        let summary = hydroid_io::scan(&text, &mut read).map_err(|error| format!("{text}: {error}"))?;
        if left_out.is_some() && (summary.lost_parts > 0 || !summary.notes.is_empty()) {
            return Err(format!("{text}: {:?}, {:?}", summary.losses, summary.notes));
        }
        let mut missing = 0;
        for topic in TOPICS {
            let nothing = Vec::new();
            let wanted = sent.get(topic.name).unwrap_or(&nothing);
            let rows = read.rows.get(topic.name).unwrap_or(&nothing);
            let mut expected = wanted.iter();
            for row in rows {
                if !expected.any(|sent| sent == row) {
                    return Err(format!(
                        "{text}: {} has a row at {} that nobody has sent",
                        topic.name, row.0
                    ));
                }
            }
            self.rows += rows.len() as u64;
            missing += (wanted.len() - rows.len()) as u64;
        }
        if left_out.is_some_and(|left_out| missing > left_out) {
            return Err(format!("{text}: {missing} rows are missing, and {left_out:?} are said to be"));
        }
        self.left_out += missing;
        self.files += 1;
        std::fs::remove_file(path).map_err(|error| error.to_string())
    }
}

/// The rows of a file.
#[derive(Default)]
struct Reader {
    names: Vec<String>,
    rows: Rows,
}

impl Sink for Reader {
    fn topic(&mut self, id: usize, topic: &Topic) -> bool {
        if id == self.names.len() {
            self.names.push(topic.name.clone());
        }
        !topic.name.starts_with('/')
    }

    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]) {
        let row = (received_ns.unwrap_or(stamp_ns), sum(values));
        self.rows.entry(self.names[id].clone()).or_default().push(row);
    }
}
