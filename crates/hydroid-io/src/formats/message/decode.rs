//! Execution of a plan on the bytes of a message: CDR (DDS-XTypes 1.3, section 7.4.3) or the serialization of ROS 1
//! (ROS 1 wiki, "Message serialization"), which is the same without alignment.

use super::plan::{Op, Plan};
use super::schema::RosNumber;
use crate::LONGEST_ARRAY;

/// Longest first value of a text that is kept, in bytes.
const LONGEST_TEXT: usize = 200;

/// Elements without bytes in a message.
const MOST_EMPTY: usize = 1 << 16;

/// Reason why a message ends before its plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// The message is too short for its definition.
    Short,
    /// The plan stops here.
    Stop,
    /// The encapsulation of CDR is not supported.
    Encapsulation,
}

/// The values of a message.
#[derive(Debug, Default)]
pub(super) struct Row {
    /// A value for each field of the plan.
    pub(super) values: Vec<f64>,
    /// Stamp of the header.
    pub(super) stamp_ns: Option<i64>,
    /// First values of texts.
    pub(super) texts: Vec<(String, String)>,
    /// Whether fields or texts have been added.
    pub(super) changed: bool,
}

/// A place in a message.
#[derive(Debug)]
pub(super) struct Cursor<'a> {
    data: &'a [u8],
    at: usize,
    /// Greatest alignment: 8 in CDR, 4 in XCDR2, 1 in ROS 1.
    alignment: usize,
    big: bool,
    delimited: bool,
}

impl<'a> Cursor<'a> {
    /// The body of a message of ROS 1.
    pub(super) fn ros1(data: &'a [u8]) -> Self {
        Self { data, at: 0, alignment: 1, big: false, delimited: false }
    }

    /// The body of a CDR message behind its encapsulation header; alignment counts from there.
    pub(super) fn cdr(message: &'a [u8]) -> Result<Self, Fault> {
        let Some((&[high, low, _, _], data)) = message.split_first_chunk() else { return Err(Fault::Short) };
        // The second numbers of XCDR2 are those of DDS-XTypes 1.2. Lists of parameters are not supported.
        let (big, second) = match (high, low) {
            (0, 0 | 1) => (low == 0, false),
            (0, 0x06 | 0x07 | 0x10 | 0x11) => (low & 1 == 0, true),
            _ => return Err(Fault::Encapsulation),
        };
        Ok(Self { data, at: 0, alignment: if second { 4 } else { 8 }, big, delimited: second })
    }

    /// Bytes that have not been read.
    pub(super) fn rest(&self) -> usize {
        self.data.len().saturating_sub(self.at)
    }

    fn take(&mut self, size: usize, count: usize) -> Result<&'a [u8], Fault> {
        let mask = size.min(self.alignment) - 1;
        let from = self.at.checked_add(mask).ok_or(Fault::Short)? & !mask;
        let to = size.checked_mul(count).and_then(|bytes| from.checked_add(bytes)).ok_or(Fault::Short)?;
        let bytes = self.data.get(from..to).ok_or(Fault::Short)?;
        self.at = to;
        Ok(bytes)
    }

    fn u32(&mut self) -> Result<u32, Fault> {
        let bytes = self.take(4, 1)?.first_chunk().ok_or(Fault::Short)?;
        Ok(if self.big { u32::from_be_bytes(*bytes) } else { u32::from_le_bytes(*bytes) })
    }

    fn text(&mut self) -> Result<&'a [u8], Fault> {
        let length = self.u32()?;
        self.take(1, length as usize)
    }

    fn numbers(&mut self, kind: RosNumber, out: &mut [f64]) -> Result<(), Fault> {
        let bytes = self.take(kind.size(), out.len())?;
        macro_rules! read {
            ($number:ty, $convert:expr) => {
                for (value, bytes) in out.iter_mut().zip(bytes.as_chunks().0) {
                    let number = if self.big {
                        <$number>::from_be_bytes(*bytes)
                    } else {
                        <$number>::from_le_bytes(*bytes)
                    };
                    *value = $convert(number);
                }
            };
        }
        match kind {
            RosNumber::Bool => {
                for (value, &byte) in out.iter_mut().zip(bytes) {
                    *value = f64::from(u8::from(byte != 0));
                }
            }
            RosNumber::I8 => read!(i8, f64::from),
            RosNumber::U8 => read!(u8, f64::from),
            RosNumber::I16 => read!(i16, f64::from),
            RosNumber::U16 => read!(u16, f64::from),
            RosNumber::I32 => read!(i32, f64::from),
            RosNumber::U32 => read!(u32, f64::from),
            RosNumber::I64 => read!(i64, |number| number as f64),
            RosNumber::U64 => read!(u64, |number| number as f64),
            RosNumber::F32 => read!(f32, f64::from),
            RosNumber::F64 => read!(f64, f64::from),
        }
        Ok(())
    }
}

impl Plan {
    /// Decodes a message into a row; the answer is whether all of the definition could be read. The plan and the row
    /// grow with the sequences of the message.
    pub(super) fn decode(&mut self, cursor: &mut Cursor, row: &mut Row) -> Result<bool, Fault> {
        // An element of an empty struct has no bytes that would end the loop over it.
        self.elements = cursor.rest().saturating_add(MOST_EMPTY);
        row.stamp_ns = None;
        row.values.clear();
        row.values.resize(self.fields.len(), f64::NAN);
        match self.run(0, cursor, row) {
            Ok(()) => Ok(true),
            Err(Fault::Stop) => Ok(false),
            Err(fault) => Err(fault),
        }
    }

    /// Executes a block. Blocks are nested at most as deep as types may be.
    fn run(&mut self, block: usize, cursor: &mut Cursor, row: &mut Row) -> Result<(), Fault> {
        for i in 0..self.blocks[block].len() {
            match self.blocks[block][i] {
                Op::Numbers { kind, count, column } => {
                    let from = column as usize;
                    // The row has a value for each field, and columns are indices of fields.
                    cursor.numbers(kind, &mut row.values[from..from + count as usize])?;
                }
                Op::Skip { kind, count } => {
                    cursor.take(kind.size(), count as usize)?;
                }
                Op::Text { slot } => self.text(slot as usize, cursor.text()?, row),
                Op::SkipTexts { count } => {
                    for _ in 0..count {
                        cursor.text()?;
                    }
                }
                Op::Stamp { signed } => {
                    let seconds = cursor.u32()?;
                    let nanoseconds = cursor.u32()?;
                    let seconds = if signed { i64::from(seconds.cast_signed()) } else { i64::from(seconds) };
                    row.stamp_ns = Some(seconds * 1_000_000_000 + i64::from(nanoseconds));
                }
                Op::Sequence(index) => self.sequence(index as usize, cursor, row)?,
                Op::Loop { block, count } => self.repeat(block as usize, count as usize, cursor, row)?,
                Op::Delimiter => {
                    if cursor.delimited {
                        cursor.u32()?;
                    }
                }
                Op::Stop => return Err(Fault::Stop),
            }
        }
        Ok(())
    }

    fn repeat(
        &mut self,
        block: usize,
        count: usize,
        cursor: &mut Cursor,
        row: &mut Row,
    ) -> Result<(), Fault> {
        if !self.blocks[block].is_empty() {
            for _ in 0..count {
                self.elements = self.elements.checked_sub(1).ok_or(Fault::Short)?;
                self.run(block, cursor, row)?;
            }
        }
        Ok(())
    }

    fn sequence(&mut self, index: usize, cursor: &mut Cursor, row: &mut Row) -> Result<(), Fault> {
        let count = cursor.u32()? as usize;
        let sequence = &self.sequences[index];
        if sequence.smallest.saturating_mul(count as u64) > cursor.rest() as u64 {
            return Err(Fault::Short);
        }
        let (number, skip) = (sequence.number, sequence.skip as usize);
        let mut done = 0;
        if count > LONGEST_ARRAY {
            self.too_long(index);
        } else {
            while done < count {
                if self.sequences[index].elements.len() == done {
                    if !self.sequences[index].growing {
                        break;
                    }
                    self.grow(index);
                    row.values.resize(self.fields.len(), f64::NAN);
                    row.changed = true;
                    continue;
                }
                let block = self.sequences[index].elements[done] as usize;
                self.run(block, cursor, row)?;
                done += 1;
            }
        }
        match number {
            Some(kind) if done < count => cursor.take(kind.size(), count - done).map(|_| ()),
            _ => self.repeat(skip, count - done, cursor, row),
        }
    }

    fn text(&mut self, slot: usize, bytes: &[u8], row: &mut Row) {
        let slot = &mut self.slots[slot];
        if slot.filled {
            return;
        }
        let end = bytes.iter().take(LONGEST_TEXT).position(|&byte| byte == 0);
        let bytes = &bytes[..end.unwrap_or(bytes.len().min(LONGEST_TEXT))];
        if !bytes.is_empty() {
            slot.filled = true;
            row.changed = true;
            row.texts.push((slot.name.clone(), String::from_utf8_lossy(bytes).into_owned()));
        }
    }
}
