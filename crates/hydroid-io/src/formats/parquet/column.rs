//! Values of a column in a row group, page by page: Apache Parquet format, "Data Pages".

use super::codec::Codecs;
use super::encoding::{Runs, Values, plain};
use super::footer::{Chunk, Leaf, Physical};
use super::page::{PageHeader, PageKind};
use super::thrift::{ENDS, Part};
use crate::error::IoError;
use crate::input::{Input, LARGEST_PART};
use crate::sink::Summary;

/// Longest header of a page; its statistics may hold texts.
const LONGEST_HEADER: usize = 1 << 20;

/// Times that the bytes of the file are read, where columns lie upon each other.
const MOST_READ: u64 = 4;

/// What the columns share.
pub(super) struct Shared<'a> {
    pub(super) input: &'a mut Input,
    pub(super) codecs: Codecs,
    pub(super) summary: Summary,
    /// Bytes that are read at once.
    pub(super) block: usize,
    /// Memory that is left for the pages of a column.
    pub(super) memory: usize,
    /// Bytes of all pages that were read.
    pub(super) done: u64,
}

/// Values of a batch of rows.
#[derive(Debug, Default)]
pub(super) struct Cells {
    pub(super) bits: Vec<u64>,
    pub(super) present: Vec<bool>,
}

impl Cells {
    pub(super) fn clear(&mut self) {
        self.resize(0);
    }

    /// Cuts the cells, or adds empty ones.
    pub(super) fn resize(&mut self, rows: usize) {
        self.bits.resize(rows, 0);
        self.present.resize(rows, false);
    }
}

/// Place in a column.
#[derive(Debug)]
pub(super) struct Column {
    name: String,
    physical: Physical,
    optional: bool,
    codec: i64,
    /// Bytes of the file from `place`; those before `raw_at` have been read.
    raw: Vec<u8>,
    raw_at: usize,
    place: u64,
    end: u64,
    /// Content of the page, and its values.
    page: Vec<u8>,
    levels: Option<Runs>,
    values: Values,
    page_place: (u64, u64),
    page_left: u64,
    broken: bool,
    dictionary: Vec<u64>,
    /// Content of the dictionary of a column of texts.
    words: Vec<u8>,
    /// Values that are not in the pages so far.
    left: u64,
}

impl Column {
    pub(super) fn new(leaf: &Leaf, chunk: Chunk, input: &Input) -> Part<Self> {
        if !chunk.has(leaf.physical) {
            return Err("its type differs from that of the schema");
        }
        let end = chunk.start.checked_add(chunk.length).filter(|end| *end <= input.length());
        Ok(Self {
            name: leaf.name.clone(),
            physical: leaf.physical,
            optional: leaf.optional,
            codec: chunk.codec,
            raw: Vec::new(),
            raw_at: 0,
            place: chunk.start,
            end: end.ok_or("it ends behind the end of the file")?,
            page: Vec::new(),
            levels: None,
            values: Values::Plain { at: 0 },
            page_place: (0, 0),
            page_left: 0,
            broken: false,
            dictionary: Vec::new(),
            words: Vec::new(),
            left: chunk.values,
        })
    }

    /// Memory that it holds.
    pub(super) fn held(&self) -> usize {
        self.raw.capacity() + self.page.capacity() + self.words.capacity() + 8 * self.dictionary.capacity()
    }

    /// Values of the next rows; fewer at the end of the column. Values of damaged pages are absent.
    pub(super) fn fill(
        &mut self,
        shared: &mut Shared,
        rows: usize,
        cells: &mut Cells,
    ) -> Result<(), IoError> {
        cells.clear();
        while cells.bits.len() < rows {
            if self.page_left == 0 {
                if !self.next_page(shared)? {
                    break;
                }
                continue;
            }
            let before = cells.bits.len();
            let count = (rows - before).min(usize::try_from(self.page_left).unwrap_or(usize::MAX));
            if !self.broken
                && let Err(reason) = self.decode(count, cells)
            {
                self.lose_page(shared, reason);
                cells.resize(before);
            }
            if self.broken {
                cells.resize(before + count);
            }
            self.page_left -= count as u64;
        }
        Ok(())
    }

    fn decode(&mut self, count: usize, cells: &mut Cells) -> Part<()> {
        let before = cells.present.len();
        match &mut self.levels {
            Some(levels) => levels.read(&self.page, count, |level| cells.present.push(level != 0))?,
            None => cells.present.resize(before + count, true),
        }
        let mut present = cells.present[before..].iter().filter(|present| **present).count();
        self.values.read(self.physical, &self.page, &self.dictionary, present, &mut cells.bits)?;
        if present < count {
            // The values move to their rows, the last one first.
            cells.bits.resize(before + count, 0);
            for row in (0..count).rev() {
                if cells.present[before + row] {
                    present -= 1;
                    cells.bits[before + row] = cells.bits[before + present];
                }
            }
        }
        Ok(())
    }

    /// Goes to the next page of data; false at the end of the column.
    fn next_page(&mut self, shared: &mut Shared) -> Result<bool, IoError> {
        loop {
            if self.left == 0 {
                return Ok(false);
            }
            let start = self.place;
            let header = match self.header(shared)? {
                Ok(header) => header,
                Err(reason) => {
                    shared.summary.lose(
                        start,
                        self.end - start,
                        &format!("column '{}': {reason}", self.name),
                    );
                    self.left = 0;
                    return Ok(false);
                }
            };
            let size = header.size + header.packed;
            self.page_place = (start, size as u64);
            self.broken = false;
            self.levels = None;
            self.page_left = match header.kind {
                PageKind::Data | PageKind::DataV2 { .. } => header.values.min(self.left),
                PageKind::Dictionary | PageKind::Other => 0,
            };
            self.left -= self.page_left;
            let fits = header.unpacked.saturating_add(header.packed) <= shared.memory;
            if fits {
                self.need(shared, size)?;
            }
            let read = if !fits {
                Err("the page is too large to be read together with those of the other columns")
            } else if self.raw.len() - self.raw_at < size {
                Err("a page ends behind the end of the file")
            } else {
                let memory = shared.memory;
                self.unpack(&mut shared.codecs, &header, memory)
            };
            if let Err(reason) = read {
                self.lose_page(shared, reason);
            }
            self.advance(size);
            shared.done = shared.done.saturating_add(size as u64);
            if shared.done > shared.input.length().saturating_mul(MOST_READ) {
                self.lose_page(shared, "the columns lie upon each other");
                self.left = 0;
            }
            if self.page_left > 0 {
                return Ok(true);
            }
        }
    }

    fn lose_page(&mut self, shared: &mut Shared, reason: &str) {
        let (start, size) = self.page_place;
        shared.summary.lose(start, size, &format!("column '{}': {reason}", self.name));
        self.broken = true;
    }

    /// The header at the place, once all of it is in memory.
    fn header(&mut self, shared: &mut Shared) -> Result<Part<PageHeader>, IoError> {
        let mut wanted = 256;
        loop {
            self.need(shared, wanted)?;
            let data = &self.raw[self.raw_at..];
            if data.is_empty() {
                return Ok(Err("it has fewer pages than the file states"));
            }
            let parsed = PageHeader::parse(data);
            if parsed.as_ref().err() == Some(&ENDS) && data.len() >= wanted && wanted < LONGEST_HEADER {
                wanted *= 4;
                continue;
            }
            return Ok(parsed.and_then(|header| {
                let size = header.size.saturating_add(header.packed);
                if size as u64 > self.end - self.place {
                    Err("a page ends behind its column")
                } else if size > LARGEST_PART || header.unpacked > LARGEST_PART {
                    Err("a page is larger than 256 MiB")
                } else {
                    Ok(header)
                }
            }));
        }
    }

    /// Reads until `size` bytes are in memory, or all that are left.
    fn need(&mut self, shared: &mut Shared, size: usize) -> Result<(), IoError> {
        if self.raw.len() - self.raw_at < size {
            self.raw.drain(..self.raw_at);
            self.raw_at = 0;
            let from = self.place + self.raw.len() as u64;
            let left = usize::try_from(self.end - from).unwrap_or(usize::MAX);
            let wanted = (size - self.raw.len()).max(shared.block).min(left);
            shared.input.read_at(from, wanted, &mut self.raw)?;
        }
        Ok(())
    }

    /// Moves the place; the file may be shorter than it was.
    fn advance(&mut self, size: usize) {
        self.place += size as u64;
        self.raw_at += size;
        if self.raw_at > self.raw.len() {
            self.raw.clear();
            self.raw_at = 0;
        }
    }

    /// Content of a page that is in memory behind its header.
    fn unpack(&mut self, codecs: &mut Codecs, header: &PageHeader, memory: usize) -> Part<()> {
        let from = self.raw_at + header.size;
        let packed = &self.raw[from..from + header.packed];
        if let Some(stated) = header.crc {
            let mut crc = flate2::Crc::new();
            crc.update(packed);
            if i64::from(crc.sum()) != stated {
                return Err("the checksum of a page is wrong");
            }
        }
        self.page.clear();
        match header.kind {
            PageKind::Other => {}
            PageKind::Dictionary => {
                codecs.unpack(self.codec, packed, header.unpacked, &mut self.page)?;
                if self.physical == Physical::Bytes {
                    std::mem::swap(&mut self.page, &mut self.words);
                } else if !matches!(header.encoding, 0 | 2) {
                    return Err("the encoding of a dictionary is not supported");
                } else if self.page.len().saturating_mul(3) > memory {
                    return Err("the dictionary is too large");
                } else {
                    self.dictionary.clear();
                    plain(self.physical, &self.page, &mut self.dictionary);
                }
            }
            PageKind::Data => {
                codecs.unpack(self.codec, packed, header.unpacked, &mut self.page)?;
                let mut at = 0;
                if self.optional {
                    if header.levels != 3 {
                        return Err("the encoding of the levels is not supported");
                    }
                    let (levels, end) = Runs::sized(1, &self.page, 0)?;
                    self.levels = Some(levels);
                    at = end;
                }
                self.values = Values::new(header.encoding, self.physical, &self.page, at)?;
            }
            PageKind::DataV2 { repetition, definition, packed: compressed } => {
                let levels = repetition.checked_add(definition).ok_or(ENDS)?;
                let rest = header.unpacked.checked_sub(levels).ok_or(ENDS)?;
                self.page.extend_from_slice(packed.get(..levels).ok_or(ENDS)?);
                let codec = if compressed { self.codec } else { 0 };
                // A page without values has no content that could be decompressed.
                if rest > 0 {
                    codecs.unpack(codec, &packed[levels..], rest, &mut self.page)?;
                }
                if self.optional {
                    self.levels = Some(Runs::new(1, repetition, levels)?);
                }
                self.values = Values::new(header.encoding, self.physical, &self.page, levels)?;
            }
        }
        Ok(())
    }

    /// First value of a column of texts, if its first page with values has it in a plain way.
    pub(super) fn first_text(&mut self, shared: &mut Shared) -> Result<Option<String>, IoError> {
        while self.next_page(shared)? {
            let bytes = match &mut self.values {
                _ if self.broken => return Ok(None),
                Values::Plain { at } => text(&self.page, *at),
                Values::Dictionary(runs) => {
                    let mut index = 0;
                    if runs.read(&self.page, 1, |value| index = value).is_err() {
                        None
                    } else {
                        let mut at = Some(0);
                        for _ in 0..index {
                            at = at.and_then(|at| Some(at + 4 + text(&self.words, at)?.len()));
                            if at.is_none() {
                                break;
                            }
                        }
                        at.and_then(|at| text(&self.words, at))
                    }
                }
                _ => return Ok(None),
            };
            if let Some(bytes) = bytes {
                return Ok(Some(String::from_utf8_lossy(&bytes[..bytes.len().min(256)]).into_owned()));
            }
        }
        Ok(None)
    }
}

/// A text with its size in front.
fn text(data: &[u8], at: usize) -> Option<&[u8]> {
    let size = u32::from_le_bytes(*data.get(at..)?.first_chunk()?);
    data.get(at + 4..)?.get(..usize::try_from(size).ok()?)
}
