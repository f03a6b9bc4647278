//! Heads and fields of the records of MCAP (MCAP format specification, "Records").

use crate::formats::unpack::Codec;

/// First and last bytes of a file.
pub(super) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Opcodes.
pub(super) const HEADER: u8 = 0x01;
pub(super) const FOOTER: u8 = 0x02;
pub(super) const SCHEMA: u8 = 0x03;
pub(super) const CHANNEL: u8 = 0x04;
pub(super) const MESSAGE: u8 = 0x05;
pub(super) const CHUNK: u8 = 0x06;
pub(super) const MESSAGE_INDEX: u8 = 0x07;
pub(super) const CHUNK_INDEX: u8 = 0x08;
pub(super) const ATTACHMENT: u8 = 0x09;
pub(super) const ATTACHMENT_INDEX: u8 = 0x0a;
pub(super) const STATISTICS: u8 = 0x0b;
pub(super) const SUMMARY_OFFSET: u8 = 0x0e;
pub(super) const DATA_END: u8 = 0x0f;

/// Beginning of the key of a unit in the metadata of a channel; the name of the field follows.
pub(super) const UNIT_KEY: &str = "unit.";

/// Opcode and length before each record.
pub(super) const HEAD: usize = 9;

/// Beginning of a chunk.
pub(super) struct Chunk {
    /// Bytes of its fields before the records.
    pub(super) head: usize,
    pub(super) unpacked: u64,
    pub(super) crc: u32,
    pub(super) compression: Compression,
    /// Bytes of its records as they are stored.
    pub(super) records: u64,
}

pub(super) enum Compression {
    None,
    Codec(Codec),
    Unknown,
}

/// Whether a chunk of a known compression begins here whose two lengths agree.
pub(super) fn is_chunk(window: &[u8]) -> bool {
    let (Some((_, length)), Some(chunk)) = (head(window), chunk(window)) else { return false };
    !matches!(chunk.compression, Compression::Unknown)
        && (chunk.head as u64).checked_add(chunk.records) == Some(length)
}

/// Opcode and length of a record.
pub(super) fn head(window: &[u8]) -> Option<(u8, u64)> {
    let (&opcode, rest) = window.split_first()?;
    Some((opcode, Fields(rest).u64()?))
}

/// Fields of a chunk, from its opcode.
pub(super) fn chunk(window: &[u8]) -> Option<Chunk> {
    let body = window.get(HEAD..)?;
    let mut fields = Fields(body);
    let (from, to) = (fields.u64()?, fields.u64()?);
    let unpacked = fields.u64()?;
    let crc = fields.u32()?;
    let compression = match fields.text()? {
        b"" => Compression::None,
        b"zstd" => Compression::Codec(Codec::Zstd),
        b"lz4" => Compression::Codec(Codec::Lz4),
        _ => Compression::Unknown,
    };
    let records = fields.u64()?;
    // A chunk that was not closed has no times.
    let ordered = from <= to || to == 0;
    ordered.then(|| Chunk { head: body.len() - fields.0.len(), unpacked, crc, compression, records })
}

/// Fields of a record, taken from its beginning.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    /// Bytes with their length before them.
    pub(super) fn text(&mut self) -> Option<&'a [u8]> {
        let length = usize::try_from(self.u32()?).ok()?;
        let (text, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(text)
    }
}
