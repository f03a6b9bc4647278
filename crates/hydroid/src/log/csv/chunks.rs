//! The parts in which a log is read: whole lines, and whole records where a cell is quoted.

use std::io::{self, Read};

use memchr::{memchr, memchr_iter, memchr2, memrchr2};

/// Longest line of a log \[bytes\]; a longer one is not a table, and would fill the memory.
pub(super) const LONGEST_LINE: usize = 1 << 24;
/// Size of a part \[bytes\].
pub(super) const CHUNK: usize = 1 << 18;
/// Lines of the first part, which shows the header and the decimals.
const FIRST_LINES: usize = 201;

/// A part of a log. It ends after an end of line, or at the end of the file.
pub(super) struct Chunk {
    pub(super) bytes: Vec<u8>,
    /// Whether the file ends here.
    pub(super) last: bool,
    /// The part is longer than [`LONGEST_LINE`] and is not contained in `bytes`.
    pub(super) endless: Option<Endless>,
}

/// A part that has no end where it should.
#[derive(Clone, Copy, Debug)]
pub(super) enum Endless {
    /// A line of this many bytes.
    Line(usize),
    /// A record after a quotation mark.
    Quote,
}

/// Reads a log part by part.
pub(super) struct Chunks<R> {
    reader: R,
    /// `None` in the first part.
    delimiter: Option<u8>,
    size: usize,
    /// Beginning of the next part.
    carry: Vec<u8>,
    lines: usize,
    ended: bool,
}

impl<R: Read> Chunks<R> {
    pub(super) fn new(reader: R, size: usize) -> Self {
        Self { reader, delimiter: None, size, carry: Vec::new(), lines: FIRST_LINES, ended: false }
    }

    /// Sets the separator of cells, which decides what a quotation mark encloses.
    pub(super) fn set_delimiter(&mut self, delimiter: u8) {
        self.delimiter = Some(delimiter);
        self.lines = 1;
    }

    /// Up to `count` further parts.
    pub(super) fn take(&mut self, count: usize) -> io::Result<Vec<Chunk>> {
        let mut chunks = Vec::new();
        while chunks.len() < count
            && let Some(chunk) = self.next()?
        {
            chunks.push(chunk);
        }
        Ok(chunks)
    }

    pub(super) fn next(&mut self) -> io::Result<Option<Chunk>> {
        if self.ended {
            return Ok(None);
        }
        let mut bytes = std::mem::take(&mut self.carry);
        let mut size = self.size.max(bytes.len() + 1);
        loop {
            let missing = (size - bytes.len()) as u64;
            let ended = self.reader.by_ref().take(missing).read_to_end(&mut bytes)? as u64 != missing;
            let first_line = memchr2(b'\n', b'\r', &bytes).unwrap_or(bytes.len());
            if first_line > LONGEST_LINE {
                return self.endless_line(&bytes).map(Some);
            }
            if ended {
                self.ended = true;
                return Ok(Some(Chunk { bytes, last: true, endless: None }));
            }
            let cut = self.cut(&bytes);
            let limit = bytes.len() > LONGEST_LINE;
            if cut > 0 && (limit || self.lines == 1 || lines(&bytes[..cut]) >= self.lines) {
                self.carry = bytes[cut..].to_vec();
                bytes.truncate(cut);
                return Ok(Some(Chunk { bytes, last: false, endless: None }));
            }
            if limit {
                self.ended = true;
                return Ok(Some(Chunk { bytes: Vec::new(), last: true, endless: Some(Endless::Quote) }));
            }
            size = (2 * size).min(LONGEST_LINE + 2);
        }
    }

    /// End of the last complete record that is not at the end of the bytes, so that the last part of a file is known.
    fn cut(&self, bytes: &[u8]) -> usize {
        let end = bytes.len().saturating_sub(1);
        let cut = memrchr2(b'\n', b'\r', &bytes[..end]).map_or(0, |at| at + 1);
        if memchr(b'"', &bytes[..cut]).is_none() {
            return cut;
        }
        // The last record may continue beyond the bytes, even beyond an end of line.
        let delimiter = self.delimiter.unwrap_or_else(|| super::delimiter(bytes));
        let mut reader = super::rows::records(&bytes[..cut], delimiter);
        let mut record = csv::ByteRecord::new();
        let mut start = 0;
        while reader.read_byte_record(&mut record).is_ok_and(|found| found) {
            start = record.position().map_or(0, csv::Position::byte);
        }
        usize::try_from(start).unwrap_or(0)
    }

    /// Counts the bytes of a line without keeping them.
    fn endless_line(&mut self, begun: &[u8]) -> io::Result<Chunk> {
        self.ended = true;
        let mut length = memchr2(b'\n', b'\r', begun);
        let mut before = begun.len();
        let mut more = vec![0; CHUNK];
        while length.is_none() {
            let read = self.reader.read(&mut more)?;
            length = memchr2(b'\n', b'\r', &more[..read]).map(|at| before + at);
            before += read;
            if read == 0 {
                length = Some(before);
            }
        }
        let endless = length.map(Endless::Line);
        Ok(Chunk { bytes: Vec::new(), last: true, endless })
    }
}

fn lines(bytes: &[u8]) -> usize {
    let ends = |byte: u8| memchr_iter(byte, bytes).count();
    ends(b'\n').max(ends(b'\r'))
}
