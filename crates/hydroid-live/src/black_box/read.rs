//! A box that was read.

use std::path::{Path, PathBuf};

use super::BlackBoxError;
use super::head::{Head, START};
use super::ring::{MAGIC, place_of, start_sum, step_sum};
use super::step::Step;
use hydroid::fingerprint::Fingerprint;

/// Larger files are none of these.
const LARGEST: u64 = 1 << 36;

/// Segments are counted from 1, and no box has so many.
const MOST: u64 = 1 << 62;

/// The content of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackBox {
    /// Where it was.
    pub path: PathBuf,
    /// What it is of.
    pub head: Head,
    /// Where the ring begins.
    pub(super) start: usize,
    /// From the oldest to the newest.
    pub(super) segments: Vec<Segment>,
    /// Segments of which the start is not whole: one that was being written when the kill came, or damaged ones.
    pub torn: usize,
}

/// A stretch of steps, and the memory that it begins from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Segment {
    pub(super) sequence: u64,
    /// Steps before it.
    pub(super) before: u64,
    /// Whether it begins where the one before ended.
    pub(super) goes_on: bool,
    pub(super) memory: Vec<f64>,
    /// Row by row.
    pub(super) rows: Vec<f64>,
    /// Whether there are whole steps far behind one that is not: neither a kill nor a failing power leaves such.
    pub(super) damaged: bool,
}

impl BlackBox {
    /// Reads a file.
    ///
    /// # Errors
    /// If it cannot be read, or is no box.
    pub fn read(path: &Path) -> Result<Self, BlackBoxError> {
        let wrong = |reason: String| BlackBoxError::unusable(path, reason);
        let metadata = std::fs::metadata(path)
            .map_err(|e| wrong(format!("it cannot be read ({e}); name another file")))?;
        if !metadata.is_file() || metadata.len() > LARGEST {
            return Err(wrong("it is no black box: give a file that --black-box has written".to_owned()));
        }
        let bytes =
            std::fs::read(path).map_err(|e| wrong(format!("it cannot be read ({e}); name another file")))?;
        let own = Self::decode(&bytes).map_err(wrong)?;
        Ok(Self { path: path.to_owned(), ..own })
    }

    /// From the bytes of a file; says what is wrong with them. What was being written when the kill came is left out.
    ///
    /// # Errors
    /// If they are no box, or the head is damaged.
    pub fn decode(bytes: &[u8]) -> Result<Self, String> {
        let (head, start) = Head::decode(bytes)?;
        let (mut segments, mut torn) = (Vec::new(), 0);
        for place in 0..head.segments {
            // The product was checked with the sizes.
            let at = start.saturating_add(place * head.segment_len());
            let Some(from) = bytes.get(at..) else { break };
            match segment(&from[..from.len().min(head.segment_len())], &head, place) {
                Some(segment) => segments.push(segment),
                // A place that was never written is not there, or zero.
                None => torn += usize::from(from.iter().take(8 * START).any(|&byte| byte != 0)),
            }
        }
        segments.sort_by_key(|segment| segment.sequence);
        Ok(Self { path: PathBuf::new(), head, start, segments, torn })
    }

    pub(super) fn last_sequence(&self) -> Option<u64> {
        self.segments.last().map(|segment| segment.sequence)
    }

    /// Whether steps in the middle cannot be read, and not only those that were being written at the end.
    pub fn is_damaged(&self) -> bool {
        self.segments.iter().any(|segment| segment.damaged)
    }

    /// All steps, from the oldest to the newest.
    pub fn steps(&self) -> impl Iterator<Item = Step<'_>> {
        let len = self.head.places().len();
        let rows = self.segments.iter().flat_map(move |segment| segment.rows.chunks_exact(len));
        rows.map(|row| Step::new(&self.head, row))
    }
}

/// A segment that is whole up to some step.
fn segment(bytes: &[u8], head: &Head, place: usize) -> Option<Segment> {
    let (words, rest) = bytes.split_at_checked(8 * START)?;
    let (words, _) = words.as_chunks::<8>();
    let words: [u64; START] = std::array::from_fn(|i| u64::from_le_bytes(words[i]));
    let [magic, sequence, before, goes_on, memory_sum, sum] = words;
    let in_place = place_of(sequence, head.segments as u64) == place as u64;
    if magic != MAGIC || sum != start_sum(&words) || !in_place || sequence.max(before) > MOST {
        return None;
    }
    let (memory, steps) = rest.split_at_checked(8 * head.memory)?;
    let memory = numbers(memory);
    let mut hash = Fingerprint::new();
    hash.numbers(&memory);
    if hash.value() != memory_sum {
        return None;
    }
    let len = head.places().len();
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
    // Where the power failed, the disk may have the end of what was written at once, and not its beginning.
    let damaged = steps.skip(head.room()).any(|step| whole(step).is_some());
    Some(Segment { sequence, before, goes_on: goes_on != 0, memory, rows, damaged })
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    let (numbers, _) = bytes.as_chunks::<8>();
    numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()
}
