//! Reader of ROS 1 bags (ROS 1 wiki, "Bags/Format/2.0"). The chunks are read forward; the index behind them is not
//! needed, so bags that were not closed are read too.

use std::collections::BTreeMap;

use super::message::{Channel, Envelope, LONGEST_DEFINITION, LONGEST_TOPIC, Output, Topics, text};
use super::unpack::Codec;
use crate::error::IoError;
use crate::input::{Input, LARGEST_PART};
use crate::sink::{Sink, Summary};

/// Bytes of the first line.
const MAGIC: u64 = 13;

const MESSAGE: u8 = 0x02;
const CHUNK: u8 = 0x05;
const CONNECTION: u8 = 0x07;

/// Connections of a file.
const MOST_CONNECTIONS: usize = 100_000;

/// Longest header of a record. That of a connection has the definition only in its data.
const LONGEST_HEADER: usize = 1 << 20;

/// Largest chunk in memory, packed.
const LARGEST_CHUNK: u64 = LARGEST_PART as u64 / 2;

/// Bytes that are searched at once for the next chunk.
const SEARCH: usize = 1 << 20;

const CUT: &str = "the file ends in the middle of a record: it was cut or is still being written";

pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let output = Output { sink, summary: Summary::default() };
    let mut reader = Reader {
        topics: Topics::new(input.length()),
        connections: Vec::new(),
        buffer: Vec::new(),
        records: 0,
        output,
    };
    reader.file(input)?;
    let Reader { output: Output { summary, .. }, records, .. } = reader;
    if records == 0 {
        input.seek(summary.losses.first().map_or(MAGIC, |loss| loss.offset))?;
        let reason = "no record can be read behind the first line";
        return Err(input.damaged(reason, "copy the file again from the recorder"));
    }
    Ok(summary)
}

struct Reader<'a> {
    topics: Topics,
    /// Topic of each connection.
    connections: Vec<Option<usize>>,
    /// Records of a chunk, unpacked.
    buffer: Vec<u8>,
    /// Number of records that have been read.
    records: u64,
    output: Output<'a>,
}

/// Fields of the header of a record that the reader needs.
#[derive(Default)]
struct Header<'a> {
    op: Option<u8>,
    connection: Option<u32>,
    time: Option<[u8; 8]>,
    compression: Option<&'a [u8]>,
    size: Option<u32>,
    topic: Option<&'a [u8]>,
    type_name: Option<&'a [u8]>,
    definition: Option<&'a [u8]>,
}

/// Where the parts of a record are: behind its header is the length of its data.
struct Frame<'a> {
    header: Header<'a>,
    /// Bytes before the data.
    before: usize,
    data: u32,
}

impl Reader<'_> {
    fn file(&mut self, input: &mut Input) -> Result<(), IoError> {
        input.skip(MAGIC)?;
        while input.rest() > 0 {
            input.tell(self.output.sink)?;
            let (start, rest) = (input.offset(), input.rest());
            let header =
                input.window(4)?.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes) as usize);
            let window = input.window(header.min(LONGEST_HEADER) + 8)?;
            let Some(Frame { header: Header { op: Some(op), .. }, before, data }) = frame(window) else {
                self.damage(input, CUT)?;
                continue;
            };
            let whole = before as u64 + u64::from(data);
            if op == CHUNK {
                self.chunk(input)?;
            } else if whole > rest {
                self.damage(input, CUT)?;
            } else if whole > LARGEST_CHUNK {
                self.output.summary.lose(start, whole, "the record is too big");
                input.skip(whole)?;
            } else if op == MESSAGE || op == CONNECTION {
                let size = usize::try_from(whole).unwrap_or(LARGEST_PART);
                self.records(input.window(size)?.get(..size).unwrap_or_default(), start);
                input.skip(whole)?;
            } else {
                self.records += 1;
                input.skip(whole)?;
            }
        }
        Ok(())
    }

    /// Reads a chunk, also if it ends behind the end of the file. The window is at its beginning.
    fn chunk(&mut self, input: &mut Input) -> Result<(), IoError> {
        let (start, rest) = (input.offset(), input.rest());
        let window = input.window(SEARCH)?;
        let Some(Frame { header, before, data }) = frame(window) else { return self.damage(input, CUT) };
        let codec = match header.compression {
            Some(b"none") => None,
            Some(b"lz4") => Some(Codec::Lz4),
            Some(b"bz2") => Some(Codec::Bzip2),
            _ => {
                let whole = before as u64 + u64::from(data);
                let reason = "the compression of the chunk is not supported";
                self.output.summary.lose(start, whole.min(rest), reason);
                return input.skip(whole);
            }
        };
        let (stated, data) = (header.size, u64::from(data));
        let whole = before as u64 + data;
        self.records += 1;
        let Some(codec) = codec else {
            // Records without compression are read as those of the file, so the chunk need not fit into the memory.
            return input.skip(before as u64);
        };
        if whole > rest
            && let Some(next) = find_chunk(input, start + 1, self.output.sink)?
        {
            self.output.summary.lose(start, next - start, "the chunk has a wrong length");
            return input.seek(next);
        }
        input.seek(start)?;
        if data.min(rest) > LARGEST_CHUNK {
            self.output.summary.lose(start, whole.min(rest), "the chunk is too big");
            return input.skip(whole);
        }
        let end = usize::try_from(whole.min(rest)).unwrap_or(LARGEST_PART);
        let packed = input.window(end)?.get(before..end).unwrap_or_default();
        let mut buffer = std::mem::take(&mut self.buffer);
        let unpacked = self.topics.unpacker.unpack(codec, packed, &mut buffer);
        let read = self.records(&buffer, start);
        if whole > rest {
            let reason = "the file ends in the middle of a chunk; messages before its end have been read";
            self.output.summary.lose(start, rest, reason);
        } else if let Err(reason) = unpacked {
            let reason = format!("the chunk {reason}; messages before that place have been read");
            self.output.summary.lose(start, whole, &reason);
        } else if read != buffer.len() || stated.is_some_and(|size| size as usize != buffer.len()) {
            self.output.summary.lose(start, 0, "the records of the chunk do not fit into it");
        }
        self.buffer = buffer;
        input.skip(whole)
    }

    /// Reads whole records that follow each other; the answer is their length.
    fn records(&mut self, bytes: &[u8], offset: u64) -> usize {
        let mut rest = bytes;
        while let Some(Frame { header, before, data }) = frame(rest) {
            let Some(record) = rest.get(..before.saturating_add(data as usize)) else { break };
            self.records += 1;
            let read = match header.op {
                Some(MESSAGE) => self.message(&header, &record[before..], offset),
                Some(CONNECTION) => self.connection(&header, &record[before..]),
                _ => Some(()),
            };
            if read.is_none() {
                self.output.summary.lose(offset, 0, "a record lacks a field or has an unknown connection");
            }
            rest = &rest[record.len()..];
        }
        bytes.len() - rest.len()
    }

    fn message(&mut self, header: &Header, data: &[u8], offset: u64) -> Option<()> {
        let topic = (*self.connections.get(header.connection? as usize)?)?;
        let [s0, s1, s2, s3, n0, n1, n2, n3] = header.time?;
        let seconds = i64::from(u32::from_le_bytes([s0, s1, s2, s3]));
        let received_ns = seconds * 1_000_000_000 + i64::from(u32::from_le_bytes([n0, n1, n2, n3]));
        self.topics.message(topic, data, Envelope { received_ns, sent_ns: None, offset }, &mut self.output);
        Some(())
    }

    fn connection(&mut self, header: &Header, data: &[u8]) -> Option<()> {
        let id = header.connection? as usize;
        if self.connections.get(id).is_some_and(Option::is_some) {
            // The index repeats the connections.
            return Some(());
        }
        let inner = fields(data)?;
        let channel = Channel {
            topic: text(header.topic?, LONGEST_TOPIC),
            type_name: text(inner.type_name?, LONGEST_TOPIC),
            encoding: "ros1".to_owned(),
            definition_encoding: "ros1msg".to_owned(),
            definition: text(inner.definition?, LONGEST_DEFINITION),
            units: BTreeMap::new(),
        };
        if id >= MOST_CONNECTIONS {
            self.output.summary.note("connections with numbers above 100,000 are left out");
            return Some(());
        }
        let topic = self.topics.add(channel, &mut self.output.summary);
        if self.connections.len() <= id {
            self.connections.resize(id + 1, None);
        }
        self.connections[id] = Some(topic);
        Some(())
    }

    /// Goes on at the next chunk.
    fn damage(&mut self, input: &mut Input, reason: &str) -> Result<(), IoError> {
        let (start, rest) = (input.offset(), input.rest());
        let next = find_chunk(input, start + 1, self.output.sink)?;
        let reason = if next.is_some() { "no record begins here" } else { reason };
        self.output.summary.lose(start, next.map_or(rest, |next| next - start), reason);
        input.seek(next.unwrap_or(start + rest))
    }
}

/// The next place where a chunk begins.
fn find_chunk(input: &mut Input, from: u64, sink: &mut dyn Sink) -> Result<Option<u64>, IoError> {
    /// A name that the header of a chunk has, and the length of a header with the other names before it.
    const NAME: &[u8] = b"compression=";
    const BEFORE: usize = 64;
    /// Longest header with the length of its data. Only that much is parsed at each place, or hostile lengths would
    /// make the search quadratic.
    const HEADER: usize = 2 * BEFORE;
    input.seek(from)?;
    loop {
        input.tell(sink)?;
        let (offset, rest) = (input.offset(), input.rest());
        let window = input.window(SEARCH + HEADER)?;
        for at in memchr::memmem::find_iter(window, NAME) {
            for begin in at.saturating_sub(BEFORE)..at {
                let chunk = frame(&window[begin..window.len().min(begin + HEADER)]);
                if chunk.is_some_and(|chunk| chunk.header.op == Some(CHUNK) && chunk.header.size.is_some()) {
                    return Ok(Some(offset + begin as u64));
                }
            }
        }
        if window.len() as u64 >= rest {
            return Ok(None);
        }
        input.skip(SEARCH as u64)?;
    }
}

/// The header of a record and the length of its data.
fn frame(bytes: &[u8]) -> Option<Frame<'_>> {
    let (length, rest) = bytes.split_first_chunk()?;
    let length = u32::from_le_bytes(*length) as usize;
    if length > LONGEST_HEADER {
        return None;
    }
    let (header, rest) = rest.split_at_checked(length)?;
    let data = u32::from_le_bytes(*rest.first_chunk()?);
    Some(Frame { header: fields(header)?, before: length + 8, data })
}

/// The fields `name=value` of a header.
fn fields(mut bytes: &[u8]) -> Option<Header<'_>> {
    let mut header = Header::default();
    while !bytes.is_empty() {
        let (length, rest) = bytes.split_first_chunk()?;
        let (field, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        bytes = rest;
        let (name, value) = field.split_at_checked(memchr::memchr(b'=', field)?)?;
        let value = value.get(1..)?;
        let number = || value.try_into().ok().map(u32::from_le_bytes);
        match name {
            b"op" => header.op = value.first().copied(),
            b"conn" => header.connection = number(),
            b"time" => header.time = value.try_into().ok(),
            b"compression" => header.compression = Some(value),
            b"size" => header.size = number(),
            b"topic" => header.topic = Some(value),
            b"type" => header.type_name = Some(value),
            b"message_definition" => header.definition = Some(value),
            _ => {}
        }
    }
    Some(header)
}
