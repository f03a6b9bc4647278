//! MCAP files (MCAP format specification, version 0). The records are read forward; the summary and the indexes behind
//! them are not needed. `write` is the writer.

mod record;
mod write;

use std::collections::{BTreeMap, HashMap};

use self::record::{
    CHANNEL, CHUNK, Chunk, Compression, DATA_END, FOOTER, Fields, HEAD, MAGIC, MESSAGE, SCHEMA, UNIT_KEY,
    chunk, head, is_chunk,
};
use super::message::{Channel, Envelope, LONGEST_DEFINITION, LONGEST_TOPIC, Output, Topics, text};
use super::time::STAMP_TOO_LARGE;
use crate::error::IoError;
use crate::input::{Input, LARGEST_PART};
use crate::sink::{Sink, Summary};

pub use write::{McapChannel, McapWriter};

/// Fields of a message before its data.
const MESSAGE_HEAD: usize = 22;

/// Longest beginning of a chunk up to its records.
const CHUNK_HEAD: usize = 64;

/// Bytes that are searched at once for the next record, and the longest message that is recognised there.
const SEARCH: usize = 1 << 20;

const CUT: &str = "the file ends in the middle of a record: it was cut or is still being written";

pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let output = Output { sink, summary: Summary::default() };
    let mut reader = Reader {
        topics: Topics::new(input.length()),
        schemas: HashMap::new(),
        channels: Vec::new(),
        buffer: Vec::new(),
        records: 0,
        closed: false,
        more_chunks: true,
        output,
    };
    reader.file(input)?;
    let Reader { mut output, records, closed, .. } = reader;
    if records == 0 && !closed {
        input.seek(output.summary.losses.first().map_or(MAGIC.len() as u64, |loss| loss.offset))?;
        let reason = "no record can be read behind the first bytes";
        return Err(input.damaged(reason, "copy the file again from the recorder"));
    }
    if !closed {
        output.summary.note("the file has no footer: its recording was not finished");
    }
    Ok(output.summary)
}

/// Units of fields in the metadata of a channel, with keys as [`McapChannel`](crate::McapChannel) has them.
fn units(mut metadata: Fields<'_>) -> BTreeMap<String, String> {
    let mut units = BTreeMap::new();
    while let (Some(key), Some(value)) = (metadata.text(), metadata.text()) {
        let [key, value] = [key, value].map(|bytes| text(bytes, LONGEST_TOPIC));
        if let Some(field) = key.strip_prefix(UNIT_KEY)
            && units.len() < MOST_UNITS
        {
            units.insert(field.to_owned(), value);
        }
    }
    units
}

/// Units that a channel may state.
const MOST_UNITS: usize = 1000;

/// A schema record.
#[derive(Clone, Default)]
struct SchemaRecord {
    name: String,
    encoding: String,
    text: String,
}

struct Reader<'a> {
    topics: Topics,
    schemas: HashMap<u16, SchemaRecord>,
    /// Topic of each channel.
    channels: Vec<Option<usize>>,
    /// Records of a chunk, unpacked.
    buffer: Vec<u8>,
    /// Number of records that have been read.
    records: u64,
    /// Whether the footer has been seen.
    closed: bool,
    /// Whether a search may find another chunk.
    more_chunks: bool,
    output: Output<'a>,
}

impl Reader<'_> {
    fn file(&mut self, input: &mut Input) -> Result<(), IoError> {
        input.skip(MAGIC.len() as u64)?;
        while input.rest() > 0 {
            input.tell(self.output.sink)?;
            let (start, rest) = (input.offset(), input.rest());
            let window = input.window(HEAD)?;
            if window.starts_with(MAGIC) {
                // Files may follow each other.
                input.skip(MAGIC.len() as u64)?;
                continue;
            }
            let Some((opcode, length)) = head(window) else {
                self.output.summary.lose(start, rest, CUT);
                break;
            };
            if opcode == 0 || length > rest - HEAD as u64 {
                self.damage(input, opcode)?;
                continue;
            }
            match opcode {
                CHUNK => self.chunk(input, length)?,
                SCHEMA | CHANNEL | MESSAGE if length <= LARGEST_PART as u64 / 2 => {
                    let size = usize::try_from(length).unwrap_or(LARGEST_PART);
                    if let Some(body) = input.window(HEAD + size)?.get(HEAD..HEAD + size) {
                        self.record(opcode, body, start);
                    }
                    input.skip(HEAD as u64 + length)?;
                }
                SCHEMA | CHANNEL | MESSAGE => {
                    self.output.summary.lose(start, HEAD as u64 + length, "the record is too big");
                    input.skip(HEAD as u64 + length)?;
                }
                _ => {
                    self.closed |= opcode == FOOTER;
                    self.records += 1;
                    input.skip(HEAD as u64 + length)?;
                }
            }
        }
        Ok(())
    }

    /// A chunk that ends in the file.
    fn chunk(&mut self, input: &mut Input, length: u64) -> Result<(), IoError> {
        let start = input.offset();
        let whole = HEAD as u64 + length;
        let chunk = chunk(input.window(HEAD + CHUNK_HEAD)?);
        let reason = match chunk {
            Some(chunk) if (chunk.head as u64).checked_add(chunk.records) != Some(length) => {
                "the lengths of the chunk disagree".to_owned()
            }
            Some(Chunk { compression: Compression::None, head, .. }) if length > LARGEST_PART as u64 / 2 => {
                // Too big for the memory; its records are those of the file.
                return input.skip((HEAD + head) as u64);
            }
            _ if length > LARGEST_PART as u64 / 2 => "the chunk is too big".to_owned(),
            Some(chunk) => {
                let window = input.window(HEAD + usize::try_from(length).unwrap_or(LARGEST_PART))?;
                let end = window.len().min(usize::try_from(whole).unwrap_or(LARGEST_PART));
                let packed = window.get(HEAD + chunk.head..end).unwrap_or_default();
                self.unpack(&chunk, packed).err().unwrap_or_default()
            }
            None => "the chunk has no beginning".to_owned(),
        };
        if !reason.is_empty() {
            self.output.summary.lose(start, whole, &reason);
        } else if !self.walk(start) {
            self.output.summary.lose(start, 0, "a record reaches beyond the end of its chunk");
        }
        input.skip(whole)
    }

    /// Unpacks the records of a chunk into the buffer and verifies them.
    fn unpack(&mut self, chunk: &Chunk, packed: &[u8]) -> Result<(), String> {
        match chunk.compression {
            Compression::None => {
                self.buffer.clear();
                self.buffer.extend_from_slice(packed);
            }
            Compression::Codec(codec) => self
                .topics
                .unpacker
                .unpack(codec, packed, &mut self.buffer)
                .map_err(|reason| format!("the chunk {reason}"))?,
            Compression::Unknown => return Err("the compression of the chunk is not supported".to_owned()),
        }
        if chunk.crc != 0 && crc32fast::hash(&self.buffer) != chunk.crc {
            return Err("the CRC of the chunk is wrong".to_owned());
        }
        if self.buffer.len() as u64 != chunk.unpacked {
            return Err("the chunk has another size than it states".to_owned());
        }
        Ok(())
    }

    /// Reads the records in the buffer; the answer is whether the last one is whole.
    fn walk(&mut self, start: u64) -> bool {
        let buffer = std::mem::take(&mut self.buffer);
        let mut rest = &buffer[..];
        while let Some((opcode, length)) = head(rest) {
            let Some(body) = usize::try_from(length).ok().and_then(|length| rest[HEAD..].get(..length))
            else {
                break;
            };
            self.record(opcode, body, start);
            rest = &rest[HEAD + body.len()..];
        }
        let whole = rest.is_empty();
        self.buffer = buffer;
        whole
    }

    fn record(&mut self, opcode: u8, body: &[u8], offset: u64) {
        self.records += 1;
        let read = match opcode {
            MESSAGE => self.message(body, offset),
            SCHEMA => self.schema(body),
            CHANNEL => self.channel(body),
            _ => Some(()),
        };
        if read.is_none() {
            self.output.summary.lose(offset, 0, "a record has wrong lengths or an unknown channel");
        }
    }

    fn message(&mut self, body: &[u8], offset: u64) -> Option<()> {
        let (head, data) = body.split_at_checked(MESSAGE_HEAD)?;
        let mut fields = Fields(head);
        let topic = (*self.channels.get(usize::from(fields.u16()?))?)?;
        fields.u32()?;
        let Ok(received_ns) = i64::try_from(fields.u64()?) else {
            self.output.summary.lose(offset, 0, STAMP_TOO_LARGE);
            return Some(());
        };
        // A stamp of 0 stands for none.
        let sent_ns = Some(i64::try_from(fields.u64()?).unwrap_or(0));
        self.topics.message(topic, data, Envelope { received_ns, sent_ns, offset }, &mut self.output);
        Some(())
    }

    fn schema(&mut self, body: &[u8]) -> Option<()> {
        let mut fields = Fields(body);
        let id = fields.u16()?;
        let [name, encoding, definition] = [fields.text()?, fields.text()?, fields.text()?];
        // Schemas are repeated; the first one holds.
        if !self.schemas.contains_key(&id) {
            let size = size_of::<SchemaRecord>().saturating_add(body.len());
            if self.topics.spend(size.saturating_mul(3)).is_err() {
                self.output.summary.note("schemas are left out: the definitions of the file are too big");
                return Some(());
            }
            // Each channel has a copy.
            let [name, encoding] = [name, encoding].map(|name| text(name, LONGEST_TOPIC));
            let definition = text(definition, LONGEST_DEFINITION);
            self.schemas.insert(id, SchemaRecord { name, encoding, text: definition });
        }
        Some(())
    }

    fn channel(&mut self, body: &[u8]) -> Option<()> {
        let mut fields = Fields(body);
        let id = usize::from(fields.u16()?);
        let schema = fields.u16()?;
        let [topic, encoding] = [fields.text()?, fields.text()?];
        if self.channels.get(id).is_some_and(Option::is_some) {
            return Some(());
        }
        let [topic, encoding] = [topic, encoding].map(|bytes| text(bytes, LONGEST_TOPIC));
        let units = units(Fields(fields.text().unwrap_or_default()));
        let SchemaRecord { name: type_name, encoding: definition_encoding, text: definition } =
            self.schemas.get(&schema).cloned().unwrap_or_default();
        let channel = Channel { topic, type_name, encoding, definition_encoding, definition, units };
        let topic = self.topics.add(channel, &mut self.output.summary);
        if self.channels.len() <= id {
            self.channels.resize(id + 1, None);
        }
        self.channels[id] = Some(topic);
        Some(())
    }

    /// Goes on behind a place where no whole record begins.
    fn damage(&mut self, input: &mut Input, opcode: u8) -> Result<(), IoError> {
        let (start, rest) = (input.offset(), input.rest());
        if self.more_chunks {
            if let Some(next) = self.find(input, start + 1, true)? {
                self.output.summary.lose(start, next - start, "no record begins here");
                return input.seek(next);
            }
            self.more_chunks = false;
            input.seek(start)?;
        }
        if opcode == CHUNK
            && let Some(chunk) = chunk(input.window(HEAD + CHUNK_HEAD)?)
            && !matches!(chunk.compression, Compression::Unknown)
        {
            return self.last_chunk(input, &chunk);
        }
        if let Some(next) = self.find(input, start + 1, false)? {
            self.output.summary.lose(start, next - start, "no record begins here");
            return input.seek(next);
        }
        let known = (1..=DATA_END).contains(&opcode);
        self.output.summary.lose(start, rest, if known { CUT } else { "no record begins here" });
        input.seek(start + rest)
    }

    /// Reads what there is of a chunk that reaches beyond the end of the file, or has no length because it was not
    /// closed.
    fn last_chunk(&mut self, input: &mut Input, chunk: &Chunk) -> Result<(), IoError> {
        let (start, rest) = (input.offset(), input.rest());
        input.skip((HEAD + chunk.head) as u64)?;
        if let Compression::Codec(codec) = chunk.compression {
            let packed = input.window(LARGEST_PART / 2)?;
            // The end is missing, so an error is expected; the buffer has what comes before it.
            let unpacked = self.topics.unpacker.unpack(codec, packed, &mut self.buffer);
            if !self.walk(start) || unpacked.is_err() {
                let reason = "the file ends in the middle of a chunk; messages before its end have been read";
                self.output.summary.lose(start, rest, reason);
            }
            input.seek(start + rest)?;
        }
        // The records of a chunk without compression are read as those of the file.
        Ok(())
    }

    /// The next place where a chunk begins, or a message of a known channel with another record behind it.
    fn find(&mut self, input: &mut Input, from: u64, chunks: bool) -> Result<Option<u64>, IoError> {
        input.seek(from)?;
        loop {
            input.tell(self.output.sink)?;
            let (offset, rest) = (input.offset(), input.rest());
            let window = input.window(2 * SEARCH)?;
            let searched = if window.len() as u64 >= rest { window.len() } else { SEARCH };
            for at in memchr::memchr_iter(if chunks { CHUNK } else { MESSAGE }, &window[..searched]) {
                let here = &window[at..];
                if if chunks { is_chunk(here) } else { self.is_message(here, rest - at as u64) } {
                    return Ok(Some(offset + at as u64));
                }
            }
            if searched as u64 >= rest {
                return Ok(None);
            }
            input.skip(searched as u64)?;
        }
    }

    fn is_message(&self, window: &[u8], rest: u64) -> bool {
        let Some((_, length)) = head(window) else { return false };
        let channel = window.get(HEAD..HEAD + 2).and_then(|bytes| Fields(bytes).u16());
        let known = channel.and_then(|id| self.channels.get(usize::from(id))).is_some_and(Option::is_some);
        if !known || length < MESSAGE_HEAD as u64 || length >= (SEARCH - 2 * HEAD) as u64 {
            return false;
        }
        let end = HEAD as u64 + length;
        let behind = usize::try_from(end).ok().and_then(|end| window.get(end..)).unwrap_or_default();
        match head(behind) {
            Some((opcode, next)) => (SCHEMA..=DATA_END).contains(&opcode) && next <= rest - end - HEAD as u64,
            None => end == rest,
        }
    }
}
