//! Structures of the footer and of the page headers: Apache Thrift, "Thrift Compact Protocol Encoding".
//!
//! [`Thrift`] reads them, [`Structure`] writes them.

/// A part that can be read, or what is wrong with it.
pub(super) type Part<T> = Result<T, &'static str>;

/// Structures in structures that are skipped.
const DEEPEST: u32 = 32;

pub(super) const ENDS: &str = "a structure ends too early";
const WRONG: &str = "a structure has a member of the wrong type";

/// Type of a member (section "Struct encoding").
pub(super) type Kind = u8;
pub(super) const TRUE: Kind = 1;
const FALSE: Kind = 2;
const I32: Kind = 5;
const I64: Kind = 6;
const BINARY: Kind = 8;
pub(super) const LIST: Kind = 9;
pub(super) const STRUCT: Kind = 12;

/// Place in bytes of the compact protocol.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Thrift<'a> {
    data: &'a [u8],
    at: usize,
}

impl<'a> Thrift<'a> {
    pub(super) fn new(data: &'a [u8]) -> Self {
        Self { data, at: 0 }
    }

    /// Bytes that have been read.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    fn byte(&mut self) -> Part<u8> {
        let byte = *self.data.get(self.at).ok_or(ENDS)?;
        self.at += 1;
        Ok(byte)
    }

    fn take(&mut self, size: u64) -> Part<&'a [u8]> {
        let size = usize::try_from(size).map_err(|_| ENDS)?;
        let end = self.at.checked_add(size).ok_or(ENDS)?;
        let bytes = self.data.get(self.at..end).ok_or(ENDS)?;
        self.at = end;
        Ok(bytes)
    }

    fn varint(&mut self) -> Part<u64> {
        let (value, size) = varint(self.data.get(self.at..).unwrap_or(&[])).ok_or(ENDS)?;
        self.at += size;
        Ok(value)
    }

    /// Type of the next member of a structure; `None` at its end. `id` is that of the member before.
    pub(super) fn member(&mut self, id: &mut i16) -> Part<Option<Kind>> {
        let byte = self.byte()?;
        if byte == 0 {
            return Ok(None);
        }
        *id = if byte >> 4 == 0 {
            i16::try_from(zigzag(self.varint()?)).map_err(|_| WRONG)?
        } else {
            id.saturating_add(i16::from(byte >> 4))
        };
        Ok(Some(byte & 15))
    }

    /// An integer of any width.
    pub(super) fn integer(&mut self, kind: Kind) -> Part<i64> {
        match kind {
            3 => Ok(i64::from(self.byte()?.cast_signed())),
            4..=6 => Ok(zigzag(self.varint()?)),
            _ => Err(WRONG),
        }
    }

    /// A number that is not negative.
    pub(super) fn count(&mut self, kind: Kind) -> Part<u64> {
        u64::try_from(self.integer(kind)?).map_err(|_| "a size is negative")
    }

    pub(super) fn truth(kind: Kind) -> Part<bool> {
        match kind {
            TRUE => Ok(true),
            FALSE => Ok(false),
            _ => Err(WRONG),
        }
    }

    pub(super) fn binary(&mut self, kind: Kind) -> Part<&'a [u8]> {
        if kind != BINARY {
            return Err(WRONG);
        }
        let size = self.varint()?;
        self.take(size)
    }

    /// Number of the structures of a list.
    pub(super) fn structures(&mut self, kind: Kind) -> Part<u64> {
        if kind != LIST {
            return Err(WRONG);
        }
        let (element, count) = self.list()?;
        if count > 0 && element != STRUCT { Err(WRONG) } else { Ok(count) }
    }

    fn list(&mut self) -> Part<(Kind, u64)> {
        let byte = self.byte()?;
        let count = if byte >> 4 == 15 { self.varint()? } else { u64::from(byte >> 4) };
        Ok((byte & 15, count))
    }

    /// Passes over a member.
    pub(super) fn skip(&mut self, kind: Kind) -> Part<()> {
        self.skip_at(kind, 0)
    }

    fn skip_at(&mut self, kind: Kind, depth: u32) -> Part<()> {
        if depth > DEEPEST {
            return Err("structures are nested too deeply");
        }
        match kind {
            TRUE | FALSE => {}
            3 => drop(self.byte()?),
            4..=6 => drop(self.varint()?),
            7 => drop(self.take(8)?),
            BINARY => drop(self.binary(kind)?),
            LIST | 10 => {
                let (element, count) = self.list()?;
                for _ in 0..count {
                    self.skip_element(element, depth)?;
                }
            }
            11 => {
                let count = self.varint()?;
                let kinds = if count == 0 { 0 } else { self.byte()? };
                for _ in 0..count {
                    self.skip_element(kinds >> 4, depth)?;
                    self.skip_element(kinds & 15, depth)?;
                }
            }
            STRUCT => {
                let mut id = 0;
                while let Some(kind) = self.member(&mut id)? {
                    self.skip_at(kind, depth + 1)?;
                }
            }
            13 => drop(self.take(16)?),
            _ => return Err(WRONG),
        }
        Ok(())
    }

    /// A truth value has a byte in a list and none as a member, so each element of a list moves the place.
    fn skip_element(&mut self, kind: Kind, depth: u32) -> Part<()> {
        if kind == TRUE || kind == FALSE { self.byte().map(drop) } else { self.skip_at(kind, depth + 1) }
    }
}

/// A number of seven bits in each byte, lowest first (ULEB128), and its size.
pub(super) fn varint(data: &[u8]) -> Option<(u64, usize)> {
    let mut value = 0;
    for (i, byte) in data.iter().take(10).enumerate() {
        value |= u64::from(byte & 127) << (7 * i);
        if byte & 128 == 0 {
            return Some((value, i + 1));
        }
    }
    None
}

/// A number with its sign in the lowest bit.
pub(super) fn zigzag(value: u64) -> i64 {
    (value >> 1).cast_signed() ^ -(value & 1).cast_signed()
}

/// A structure that is written. Its members are added in the order of their numbers.
#[derive(Debug, Default)]
pub(super) struct Structure {
    data: Vec<u8>,
    last: u8,
}

impl Structure {
    /// The header of a member. Numbers of members that follow each other differ by less than 16.
    fn member(&mut self, id: u8, kind: Kind) {
        self.data.push((id - self.last) << 4 | kind);
        self.last = id;
    }

    pub(super) fn i32(mut self, id: u8, value: i32) -> Self {
        self.member(id, I32);
        push_varint(&mut self.data, to_zigzag(i64::from(value)));
        self
    }

    pub(super) fn i64(mut self, id: u8, value: i64) -> Self {
        self.member(id, I64);
        push_varint(&mut self.data, to_zigzag(value));
        self
    }

    pub(super) fn binary(mut self, id: u8, bytes: &[u8]) -> Self {
        self.member(id, BINARY);
        push_binary(&mut self.data, bytes);
        self
    }

    pub(super) fn structure(mut self, id: u8, member: Self) -> Self {
        self.member(id, STRUCT);
        self.data.extend(member.end());
        self
    }

    fn list(&mut self, id: u8, kind: Kind, count: usize) {
        self.member(id, LIST);
        let short = if count < 15 { count.to_le_bytes()[0] } else { 15 };
        self.data.push(short << 4 | kind);
        if short == 15 {
            push_varint(&mut self.data, count as u64);
        }
    }

    pub(super) fn i32s(mut self, id: u8, values: &[i32]) -> Self {
        self.list(id, I32, values.len());
        for value in values {
            push_varint(&mut self.data, to_zigzag(i64::from(*value)));
        }
        self
    }

    pub(super) fn binaries(mut self, id: u8, list: &[&[u8]]) -> Self {
        self.list(id, BINARY, list.len());
        for bytes in list {
            push_binary(&mut self.data, bytes);
        }
        self
    }

    /// A list of structures with their encodings.
    pub(super) fn structures(mut self, id: u8, encodings: &[Vec<u8>]) -> Self {
        self.list(id, STRUCT, encodings.len());
        self.data.extend(encodings.iter().flatten());
        self
    }

    /// Its encoding.
    pub(super) fn end(mut self) -> Vec<u8> {
        self.data.push(0);
        self.data
    }
}

fn push_binary(data: &mut Vec<u8>, bytes: &[u8]) {
    push_varint(data, bytes.len() as u64);
    data.extend(bytes);
}

/// The inverse of [`varint`].
pub(super) fn push_varint(data: &mut Vec<u8>, mut value: u64) {
    while value > 127 {
        data.push(value.to_le_bytes()[0] | 128);
        value >>= 7;
    }
    data.push(value.to_le_bytes()[0]);
}

/// The inverse of [`zigzag`].
fn to_zigzag(value: i64) -> u64 {
    (value << 1 ^ value >> 63).cast_unsigned()
}
