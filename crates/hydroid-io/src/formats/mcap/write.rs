//! Writer of MCAP files (MCAP format specification, version 0): chunks with zstd, message indexes, and a summary.
//!
//! A file that is not closed has all chunks up to the last [`flush`](McapWriter::flush). A chunk that cannot be written,
//! because the disk is full for example, is lost as a whole, and the file goes on behind the one before it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use ruzstd::encoding::{CompressionLevel, compress_to_vec};

use super::record::{
    ATTACHMENT, ATTACHMENT_INDEX, CHANNEL, CHUNK, CHUNK_INDEX, DATA_END, FOOTER, HEAD, HEADER, MAGIC,
    MESSAGE, MESSAGE_INDEX, SCHEMA, STATISTICS, SUMMARY_OFFSET, UNIT_KEY, head,
};

/// Bytes of records at which a chunk is closed.
const CHUNK_BYTES: usize = 1 << 20;

/// A channel: a topic and the form of its messages.
#[derive(Clone, Copy, Debug)]
pub struct McapChannel<'a> {
    /// Topic.
    pub topic: &'a str,
    /// Encoding of the messages: `cdr`, `json`.
    pub encoding: &'a str,
    /// Name of the schema.
    pub schema: &'a str,
    /// Encoding of the schema: `ros2msg`, `jsonschema`.
    pub schema_encoding: &'a str,
    /// The schema.
    pub definition: &'a str,
    /// Units of fields, with their names. They become metadata of the channel, with the keys `unit.FIELD`.
    pub units: &'a [(&'a str, &'a str)],
}

/// A writer of an MCAP file.
#[derive(Debug)]
pub struct McapWriter {
    file: File,
    /// End of the last whole record.
    offset: u64,
    channels: Vec<Channel>,
    /// Records of the open chunk.
    records: Vec<u8>,
    first_ns: u64,
    last_ns: u64,
    /// Time and place of each message of the open chunk, by channel.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
    chunks: Vec<ChunkIndex>,
    attachments: Vec<Vec<u8>>,
    /// Scratch.
    body: Vec<u8>,
}

#[derive(Debug)]
struct Channel {
    /// Its records of schema and channel.
    records: Vec<u8>,
    state: Stated,
    /// Messages in the file.
    count: u64,
}

/// Where the records of a channel are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stated {
    Nowhere,
    OpenChunk,
    File,
}

#[derive(Debug)]
struct ChunkIndex {
    first_ns: u64,
    last_ns: u64,
    offset: u64,
    length: u64,
    /// Offsets of the message indexes, by channel.
    indexes: Vec<(u16, u64)>,
    index_length: u64,
    compressed: u64,
    uncompressed: u64,
}

fn put_text(to: &mut Vec<u8>, text: &str) {
    to.extend(u32::try_from(text.len()).unwrap_or(u32::MAX).to_le_bytes());
    to.extend_from_slice(text.as_bytes());
}

/// Appends a record, whose content `fill` appends.
fn record(to: &mut Vec<u8>, opcode: u8, fill: impl FnOnce(&mut Vec<u8>)) {
    to.push(opcode);
    sized(to, 8, fill);
}

/// Appends content after its length in four or eight bytes.
fn sized(to: &mut Vec<u8>, width: usize, fill: impl FnOnce(&mut Vec<u8>)) {
    let at = to.len();
    to.resize(at + width, 0);
    fill(to);
    let length = (to.len() - at - width) as u64;
    to[at..at + width].copy_from_slice(&length.to_le_bytes()[..width]);
}

impl McapWriter {
    /// Creates a file; an existing one is an error. `library` names the program that writes it.
    ///
    /// # Errors
    /// If the file exists or cannot be written.
    pub fn create(path: &Path, library: &str) -> io::Result<Self> {
        let file = File::options().write(true).create_new(true).open(path)?;
        let mut writer = Self {
            file,
            offset: 0,
            channels: Vec::new(),
            records: Vec::new(),
            first_ns: u64::MAX,
            last_ns: 0,
            index: BTreeMap::new(),
            chunks: Vec::new(),
            attachments: Vec::new(),
            body: Vec::new(),
        };
        let mut head = MAGIC.to_vec();
        record(&mut head, HEADER, |body| {
            put_text(body, "");
            put_text(body, library);
        });
        writer.append(&head)?;
        Ok(writer)
    }

    /// Adds a channel; the answer is its number for [`message`](Self::message).
    ///
    /// # Errors
    /// If there are 65,535 channels.
    pub fn channel(&mut self, channel: &McapChannel<'_>) -> io::Result<u16> {
        let number = u16::try_from(self.channels.len()).ok().filter(|number| *number < u16::MAX);
        let number = number.ok_or_else(|| io::Error::other("too many channels"))?;
        let mut records = Vec::new();
        // The schema 0 stands for none.
        record(&mut records, SCHEMA, |body| {
            body.extend((number + 1).to_le_bytes());
            put_text(body, channel.schema);
            put_text(body, channel.schema_encoding);
            put_text(body, channel.definition);
        });
        record(&mut records, CHANNEL, |body| {
            body.extend(number.to_le_bytes());
            body.extend((number + 1).to_le_bytes());
            put_text(body, channel.topic);
            put_text(body, channel.encoding);
            sized(body, 4, |body| {
                for (field, unit) in channel.units {
                    put_text(body, &format!("{UNIT_KEY}{field}"));
                    put_text(body, unit);
                }
            });
        });
        self.channels.push(Channel { records, state: Stated::Nowhere, count: 0 });
        Ok(number)
    }

    /// Adds a message to the open chunk. `logged_ns` is the time of its reception, `sent_ns` that of the sender, in
    /// nanoseconds since 1970.
    ///
    /// # Errors
    /// If a full chunk cannot be written; its messages are lost.
    ///
    /// # Panics
    /// If there is no such channel.
    pub fn message(&mut self, channel: u16, logged_ns: u64, sent_ns: u64, data: &[u8]) -> io::Result<()> {
        let of = &mut self.channels[usize::from(channel)];
        if of.state == Stated::Nowhere {
            self.records.extend_from_slice(&of.records);
            of.state = Stated::OpenChunk;
        }
        let index = self.index.entry(channel).or_default();
        index.push((logged_ns, self.records.len() as u64));
        let sequence = of.count + index.len() as u64 - 1;
        record(&mut self.records, MESSAGE, |body| {
            body.extend(channel.to_le_bytes());
            // Four bytes of it: numbers begin again at 2^32.
            body.extend_from_slice(&sequence.to_le_bytes()[..4]);
            body.extend(logged_ns.to_le_bytes());
            body.extend(sent_ns.to_le_bytes());
            body.extend_from_slice(data);
        });
        self.first_ns = self.first_ns.min(logged_ns);
        self.last_ns = self.last_ns.max(logged_ns);
        if self.records.len() >= CHUNK_BYTES { self.flush() } else { Ok(()) }
    }

    /// Writes the open chunk.
    ///
    /// # Errors
    /// If it cannot be written; its messages are lost.
    pub fn flush(&mut self) -> io::Result<()> {
        if self.records.is_empty() {
            return Ok(());
        }
        let packed = compress_to_vec(&self.records[..], CompressionLevel::Fastest);
        let mut body = std::mem::take(&mut self.body);
        body.clear();
        record(&mut body, CHUNK, |body| {
            body.extend(self.first_ns.to_le_bytes());
            body.extend(self.last_ns.to_le_bytes());
            body.extend((self.records.len() as u64).to_le_bytes());
            body.extend(crc32fast::hash(&self.records).to_le_bytes());
            put_text(body, "zstd");
            body.extend((packed.len() as u64).to_le_bytes());
            body.extend_from_slice(&packed);
        });
        let length = body.len() as u64;
        let mut indexes = Vec::with_capacity(self.index.len());
        for (channel, places) in self.index.iter().filter(|(_, places)| !places.is_empty()) {
            indexes.push((*channel, self.offset + body.len() as u64));
            record(&mut body, MESSAGE_INDEX, |body| {
                body.extend(channel.to_le_bytes());
                sized(body, 4, |body| {
                    for (time, place) in places {
                        body.extend(time.to_le_bytes());
                        body.extend(place.to_le_bytes());
                    }
                });
            });
        }
        let index = ChunkIndex {
            first_ns: self.first_ns,
            last_ns: self.last_ns,
            offset: self.offset,
            length,
            indexes,
            index_length: body.len() as u64 - length,
            compressed: packed.len() as u64,
            uncompressed: self.records.len() as u64,
        };
        let written = self.append(&body);
        self.body = body;
        for (number, channel) in self.channels.iter_mut().enumerate() {
            if written.is_ok()
                && let Ok(number) = u16::try_from(number)
            {
                channel.count += self.index.get(&number).map_or(0, |places| places.len() as u64);
            }
            if channel.state == Stated::OpenChunk {
                channel.state = if written.is_ok() { Stated::File } else { Stated::Nowhere };
            }
        }
        if written.is_ok() {
            self.chunks.push(index);
        }
        self.records.clear();
        self.index.values_mut().for_each(Vec::clear);
        (self.first_ns, self.last_ns) = (u64::MAX, 0);
        written
    }

    /// Writes an attachment, after the open chunk.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn attach(&mut self, name: &str, media_type: &str, logged_ns: u64, data: &[u8]) -> io::Result<()> {
        self.flush()?;
        let mut whole = Vec::with_capacity(data.len() + 64);
        record(&mut whole, ATTACHMENT, |whole| {
            let from = whole.len();
            whole.extend(logged_ns.to_le_bytes());
            whole.extend(0_u64.to_le_bytes());
            put_text(whole, name);
            put_text(whole, media_type);
            sized(whole, 8, |whole| whole.extend_from_slice(data));
            let crc = crc32fast::hash(&whole[from..]);
            whole.extend(crc.to_le_bytes());
        });
        let offset = self.offset;
        self.append(&whole)?;
        let mut index = Vec::new();
        record(&mut index, ATTACHMENT_INDEX, |body| {
            for number in [offset, whole.len() as u64, logged_ns, 0, data.len() as u64] {
                body.extend(number.to_le_bytes());
            }
            put_text(body, name);
            put_text(body, media_type);
        });
        self.attachments.push(index);
        Ok(())
    }

    /// Writes the open chunk and the summary, and closes the file.
    ///
    /// # Errors
    /// If they cannot be written. What has been flushed before can be read all the same.
    pub fn finish(mut self) -> io::Result<()> {
        self.flush()?;
        let mut end = Vec::new();
        record(&mut end, DATA_END, |body| body.extend(0_u32.to_le_bytes()));
        let summary_start = self.offset + end.len() as u64;
        let summary_at = end.len();
        let mut groups = Vec::new();
        let mut group = |end: &mut Vec<u8>, opcode: u8, fill: &dyn Fn(&mut Vec<u8>)| {
            let from = end.len();
            fill(end);
            if end.len() > from {
                groups.push((opcode, self.offset + from as u64, (end.len() - from) as u64));
            }
        };
        let stated = || self.channels.iter().enumerate().filter(|(_, channel)| channel.state == Stated::File);
        // The two records of each channel lie one behind the other.
        let parts = |channel: &Channel| -> usize {
            let length = head(&channel.records).map_or(0, |(_, length)| length);
            HEAD + usize::try_from(length).unwrap_or_default()
        };
        group(&mut end, SCHEMA, &|end| {
            stated().for_each(|(_, channel)| end.extend_from_slice(&channel.records[..parts(channel)]));
        });
        group(&mut end, CHANNEL, &|end| {
            stated().for_each(|(_, channel)| end.extend_from_slice(&channel.records[parts(channel)..]));
        });
        group(&mut end, STATISTICS, &|end| self.statistics(end));
        group(&mut end, CHUNK_INDEX, &|end| self.chunks.iter().for_each(|chunk| chunk.put(end)));
        group(&mut end, ATTACHMENT_INDEX, &|end| {
            self.attachments.iter().for_each(|index| end.extend_from_slice(index));
        });
        let offsets_start = self.offset + end.len() as u64;
        for (opcode, start, length) in groups {
            record(&mut end, SUMMARY_OFFSET, |body| {
                body.push(opcode);
                body.extend(start.to_le_bytes());
                body.extend(length.to_le_bytes());
            });
        }
        record(&mut end, FOOTER, |body| {
            body.extend(summary_start.to_le_bytes());
            body.extend(offsets_start.to_le_bytes());
            body.extend([0; 4]);
        });
        let last = end.len() - 4;
        let crc = crc32fast::hash(&end[summary_at..last]);
        end[last..].copy_from_slice(&crc.to_le_bytes());
        end.extend_from_slice(MAGIC);
        self.append(&end)?;
        self.file.sync_all()
    }

    fn statistics(&self, to: &mut Vec<u8>) {
        let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX).to_le_bytes();
        let stated = self.channels.iter().filter(|channel| channel.state == Stated::File).count();
        let messages: u64 = self.channels.iter().map(|channel| channel.count).sum();
        let first = self.chunks.iter().map(|chunk| chunk.first_ns).min().unwrap_or(0);
        let last = self.chunks.iter().map(|chunk| chunk.last_ns).max().unwrap_or(0);
        record(to, STATISTICS, |body| {
            body.extend(messages.to_le_bytes());
            body.extend(u16::try_from(stated).unwrap_or(u16::MAX).to_le_bytes());
            body.extend(count(stated));
            body.extend(count(self.attachments.len()));
            body.extend(count(0));
            body.extend(count(self.chunks.len()));
            body.extend(first.to_le_bytes());
            body.extend(last.to_le_bytes());
            sized(body, 4, |body| {
                for (number, channel) in (0_u16..).zip(&self.channels) {
                    if channel.count > 0 {
                        body.extend(number.to_le_bytes());
                        body.extend(channel.count.to_le_bytes());
                    }
                }
            });
        });
    }

    /// Gives what has been written to the disk.
    ///
    /// # Errors
    /// If the disk fails.
    pub fn sync(&mut self) -> io::Result<()> {
        self.file.sync_data()
    }

    /// Writes whole records; if they cannot be written whole, the file keeps those before them.
    fn append(&mut self, records: &[u8]) -> io::Result<()> {
        if let Err(error) = self.file.write_all(records) {
            self.file.set_len(self.offset)?;
            self.file.seek(SeekFrom::Start(self.offset))?;
            return Err(error);
        }
        self.offset += records.len() as u64;
        Ok(())
    }
}

impl ChunkIndex {
    fn put(&self, to: &mut Vec<u8>) {
        record(to, CHUNK_INDEX, |body| {
            for number in [self.first_ns, self.last_ns, self.offset, self.length] {
                body.extend(number.to_le_bytes());
            }
            sized(body, 4, |body| {
                for (channel, offset) in &self.indexes {
                    body.extend(channel.to_le_bytes());
                    body.extend(offset.to_le_bytes());
                }
            });
            body.extend(self.index_length.to_le_bytes());
            put_text(body, "zstd");
            body.extend(self.compressed.to_le_bytes());
            body.extend(self.uncompressed.to_le_bytes());
        });
    }
}
