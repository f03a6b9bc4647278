//! Ring of segments in the file.

use std::fs::{File, OpenOptions};
use std::io::{self, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use super::BlackBoxError;
use super::head::{Head, START};
use super::read::BlackBox;
use hydroid::atomic::{self, WriteError};
use hydroid::fingerprint::Fingerprint;

pub(super) const MAGIC: u64 = u64::from_le_bytes(*b"SEGMENT\n");

const CHUNK: usize = 8192;

#[derive(Debug)]
pub(super) struct Ring {
    file: File,
    path: PathBuf,
    /// Offset of the ring, length of a segment, offset of its steps \[bytes\].
    start: usize,
    segment_len: usize,
    before_steps: usize,
    segments: u64,
    /// Newest segment: its number, written bytes, and whether it continues the one before.
    sequence: u64,
    written: usize,
    continues: bool,
    /// A segment below this length, which does not continue the one before, is replaced by the next such one \[bytes\].
    short: usize,
    /// Whether writes are synchronized with the disk.
    durable: bool,
    chunk: Vec<u8>,
}

impl Ring {
    /// Creates a file; an existing black box is replaced.
    pub(super) fn create(path: &Path, head: &Head, durable: bool) -> Result<Self, BlackBoxError> {
        if exists(path)? && !super::is_black_box(path) {
            return Err(BlackBoxError::unusable(
                path,
                "the file exists, is not a black box, and is not overwritten: name another file",
            ));
        }
        let failed = |source| WriteError { path: path.to_owned(), source };
        let bytes = head.encode().map_err(|e| failed(e.into()))?;
        atomic::write(path, |out| out.write_all(&bytes))?;
        Ok(Self::open(path, head, bytes.len(), durable).map_err(failed)?)
    }

    /// Creates a file, or continues one of an earlier session.
    pub(super) fn resume(path: &Path, head: &Head, durable: bool) -> Result<Self, BlackBoxError> {
        if !exists(path)? {
            return Self::create(path, head, durable);
        }
        let earlier = BlackBox::read(path)?;
        let wrong = |reason: String| BlackBoxError::unusable(path, reason);
        earlier.head.fits(head).map_err(wrong)?;
        let failed = |source| WriteError { path: path.to_owned(), source };
        let mut ring = Self::open(path, head, earlier.start, durable).map_err(failed)?;
        if let Some(newest) = earlier.segments.last() {
            ring.sequence = newest.sequence;
            ring.continues = newest.continues;
            let row = head.layout().len();
            ring.written = 8 * (newest.rows.len() / row) * (row + 1);
        }
        Ok(ring)
    }

    fn open(path: &Path, head: &Head, start: usize, durable: bool) -> io::Result<Self> {
        Ok(Self {
            file: OpenOptions::new().write(true).open(path)?,
            path: path.to_owned(),
            start,
            segment_len: head.segment_len(),
            before_steps: 8 * (START + head.memory),
            segments: head.segments as u64,
            sequence: 0,
            written: 0,
            continues: true,
            short: 8 * (head.layout().len() + 1) * head.minute(),
            durable,
            chunk: Vec::with_capacity(8 * CHUNK),
        })
    }

    pub(super) fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Number of the next segment, which decides its place: that of the oldest one. If the ring is full and the newest
    /// segment is a short one after a restart, the next restart takes the place of that one: a service that is killed
    /// again and again does not overwrite what led to the first kill.
    pub(super) fn next_sequence(&self, continues: bool) -> u64 {
        let is_loop = !continues && !self.continues && self.written < self.short;
        if is_loop && self.sequence >= self.segments {
            self.sequence + self.segments
        } else {
            self.sequence + 1
        }
    }

    /// Begins a segment with a number of [`next_sequence`](Self::next_sequence), after `steps` steps. A failed attempt leaves the ring unchanged.
    pub(super) fn begin(
        &mut self,
        sequence: u64,
        steps: u64,
        continues: bool,
        memory: &[f64],
    ) -> Result<(), WriteError> {
        let mut hash = Fingerprint::new();
        hash.numbers(memory);
        let mut words = [MAGIC, sequence, steps, u64::from(continues), hash.value(), 0];
        words[START - 1] = start_sum(&words);
        let place = self.place(sequence);
        let mut attempt = || -> io::Result<()> {
            self.file.seek(SeekFrom::Start(place + 8 * START as u64))?;
            for part in memory.chunks(CHUNK) {
                self.chunk.clear();
                for x in part {
                    self.chunk.extend_from_slice(&x.to_le_bytes());
                }
                self.file.write_all(&self.chunk)?;
            }
            self.chunk.clear();
            for word in words {
                self.chunk.extend_from_slice(&word.to_le_bytes());
            }
            self.file.seek(SeekFrom::Start(place))?;
            self.file.write_all(&self.chunk)
        };
        attempt().map_err(|source| WriteError { path: self.path.clone(), source })?;
        (self.sequence, self.written, self.continues) = (sequence, 0, continues);
        Ok(())
    }

    pub(super) fn add(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        let place = self.place(self.sequence) + (self.before_steps + self.written) as u64;
        let mut attempt = || -> io::Result<()> {
            self.file.seek(SeekFrom::Start(place))?;
            self.file.write_all(bytes)?;
            if self.durable { self.file.sync_data() } else { Ok(()) }
        };
        attempt().map_err(|source| WriteError { path: self.path.clone(), source })?;
        self.written += bytes.len();
        Ok(())
    }

    fn place(&self, sequence: u64) -> u64 {
        self.start as u64 + place_of(sequence, self.segments) * self.segment_len as u64
    }
}

/// Position of a segment in the ring; sequence numbers start at 1.
pub(super) fn place_of(sequence: u64, segments: u64) -> u64 {
    sequence.wrapping_sub(1) % segments
}

pub(super) fn start_sum(words: &[u64; START]) -> u64 {
    let mut hash = Fingerprint::new();
    for &word in &words[..START - 1] {
        hash.word(word);
    }
    hash.value()
}

/// Checksum of a step at its position in a segment.
pub(super) fn step_sum(sequence: u64, place: u64, row: &[f64]) -> u64 {
    let mut hash = Fingerprint::new();
    hash.word(sequence);
    hash.word(place);
    hash.numbers(row);
    hash.value()
}

/// Whether the file exists; folders and devices are errors.
fn exists(path: &Path) -> Result<bool, BlackBoxError> {
    match std::fs::metadata(path) {
        Ok(metadata) if metadata.is_file() => Ok(true),
        Ok(_) => Err(BlackBoxError::unusable(path, "it is a folder or a device; name a file")),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(BlackBoxError::unusable(
            path,
            format!("the file cannot be read ({error}); name another file"),
        )),
    }
}
