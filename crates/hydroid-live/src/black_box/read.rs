//! Reading a black box.

use std::path::{Path, PathBuf};

use super::BlackBoxError;
use super::head::{Head, START};
use super::ring::{MAGIC, place_of, start_sum, step_sum};
use super::step::Step;
use hydroid::fingerprint::Fingerprint;

const MAX_BYTES: u64 = 1 << 36;

const MAX_SEQUENCE: u64 = 1 << 62;

/// Content of a black box.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackBox {
    /// Path of the file.
    pub path: PathBuf,
    pub head: Head,
    pub(super) start: usize,
    /// From the oldest to the newest.
    pub(super) segments: Vec<Segment>,
    /// Segments with an incomplete start: interrupted or damaged ones.
    pub torn: usize,
}

/// A segment: state of the adapter and steps.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) sequence: u64,
    pub(super) before: u64,
    pub(super) continues: bool,
    pub(super) memory: Vec<f64>,
    pub(super) rows: Vec<f64>,
    /// Whether complete steps follow far behind an incomplete one, which an interruption cannot cause.
    pub(super) damaged: bool,
}

impl BlackBox {
    /// Reads a file.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a black box.
    pub fn read(path: &Path) -> Result<Self, BlackBoxError> {
        let wrong = |reason: String| BlackBoxError::unusable(path, reason);
        let metadata = std::fs::metadata(path)
            .map_err(|e| wrong(format!("the file cannot be read ({e}); name another file")))?;
        if !metadata.is_file() || metadata.len() > MAX_BYTES {
            return Err(wrong(
                "it is not a black box: give a file that hydroid has written as a black box".to_owned(),
            ));
        }
        let bytes = std::fs::read(path)
            .map_err(|e| wrong(format!("the file cannot be read ({e}); name another file")))?;
        let own = Self::decode(&bytes).map_err(wrong)?;
        Ok(Self { path: path.to_owned(), ..own })
    }

    /// Decodes the content of a file, without partially written steps.
    ///
    /// # Errors
    /// If the bytes are not a black box, or the header is damaged; the text is the reason.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        let (head, start) = Head::decode(bytes)?;
        let (mut segments, mut torn) = (Vec::new(), 0);
        for place in 0..head.segments {
            // The sizes were checked.
            let at = start.saturating_add(place * head.segment_len());
            let Some(from) = bytes.get(at..) else { break };
            match segment(&from[..from.len().min(head.segment_len())], &head, place) {
                Some(segment) => segments.push(segment),
                // A segment that was never written is missing or zero.
                None => torn += usize::from(from.iter().take(8 * START).any(|&byte| byte != 0)),
            }
        }
        segments.sort_by_key(|segment| segment.sequence);
        Ok(Self { path: PathBuf::new(), head, start, segments, torn })
    }

    /// Whether steps other than the last ones cannot be read.
    pub fn is_damaged(&self) -> bool {
        self.segments.iter().any(|segment| segment.damaged)
    }

    /// All steps, from the oldest to the newest.
    pub fn steps(&self) -> impl Iterator<Item = Step<'_>> {
        let len = self.head.layout().len();
        let rows = self.segments.iter().flat_map(move |segment| segment.rows.chunks_exact(len));
        rows.map(|row| Step::new(&self.head, row))
    }
}

fn segment(bytes: &[u8], head: &Head, place: usize) -> Option<Segment> {
    let (words, rest) = bytes.split_at_checked(8 * START)?;
    let (words, _) = words.as_chunks::<8>();
    let words: [u64; START] = std::array::from_fn(|i| u64::from_le_bytes(words[i]));
    let [magic, sequence, before, continues, memory_sum, sum] = words;
    let in_place = place_of(sequence, head.segments as u64) == place as u64;
    if magic != MAGIC || sum != start_sum(&words) || !in_place || sequence.max(before) > MAX_SEQUENCE {
        return None;
    }
    let (memory, steps) = rest.split_at_checked(8 * head.memory)?;
    let memory = numbers(memory);
    let mut hash = Fingerprint::new();
    hash.numbers(&memory);
    if hash.value() != memory_sum {
        return None;
    }
    let len = head.layout().len();
    let whole = |(at, bytes): (usize, &[u8])| {
        let row = numbers(bytes);
        let sum = row.last().map(|sum| sum.to_bits());
        (sum == Some(step_sum(sequence, at as u64, &row[..len]))).then_some(row)
    };
    let mut steps = steps.chunks_exact(8 * (len + 1)).enumerate();
    let mut rows = Vec::new();
    for mut row in steps.by_ref().map_while(whole) {
        row.truncate(len);
        rows.extend(row);
    }
    // After a power failure the disk may contain the end of a write without its beginning.
    let damaged = steps.skip(head.buffer_steps()).any(|step| whole(step).is_some());
    Some(Segment { sequence, before, continues: continues != 0, memory, rows, damaged })
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    let (numbers, _) = bytes.as_chunks::<8>();
    numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
}
