//! Encodings of values: Apache Parquet format, "Encodings".
//!
//! A value is held in 64 bits: an integer with its sign, a floating-point number as the bits of a double, a truth
//! value as 0 or 1, a stamp of 96 bits as nanoseconds since 1970.

use super::footer::Physical;
use super::thrift::{Part, varint, zigzag};

const ENDS: &str = "a page has fewer values than it states";

/// Values of a page: the place of the next one.
#[derive(Debug)]
pub(super) enum Values {
    /// PLAIN; the place is in bits for truth values, in bytes for others.
    Plain { at: usize },
    /// Indices of a dictionary.
    Dictionary(Runs),
    /// RLE of truth values.
    Truths(Runs),
    /// `DELTA_BINARY_PACKED`.
    Delta(Delta),
    /// `BYTE_STREAM_SPLIT`: bytes of the same rank are together, `stride` values in each stream.
    Split { at: usize, stride: usize, next: usize },
}

impl Values {
    /// Values with an encoding from a place in the page to its end.
    pub(super) fn new(encoding: i64, physical: Physical, page: &[u8], at: usize) -> Part<Self> {
        let content = page.get(at..).ok_or(ENDS)?;
        Ok(match (encoding, physical) {
            (0, Physical::Boolean) => Self::Plain { at: at.saturating_mul(8) },
            (0, _) => Self::Plain { at },
            (2 | 8, _) => {
                // A page without values may lack the byte of the width.
                let width = content.first().copied().unwrap_or(0);
                Self::Dictionary(Runs::new(width, at + 1, page.len())?)
            }
            (3, Physical::Boolean) => Self::Truths(Runs::sized(1, page, at)?.0),
            (5, Physical::Int32 | Physical::Int64) => Self::Delta(Delta::new(page, at)?),
            (9, Physical::Int32 | Physical::Int64 | Physical::Float | Physical::Double) => {
                Self::Split { at, stride: content.len() / physical.size(), next: 0 }
            }
            _ => return Err("the encoding of a page is not supported"),
        })
    }

    /// Appends values.
    pub(super) fn read(
        &mut self,
        physical: Physical,
        page: &[u8],
        dictionary: &[u64],
        count: usize,
        out: &mut Vec<u64>,
    ) -> Part<()> {
        match self {
            Self::Plain { at } if physical == Physical::Boolean => {
                for _ in 0..count {
                    out.push(unpack(page, *at, 1).ok_or(ENDS)?);
                    *at += 1;
                }
            }
            Self::Plain { at } => {
                let size = physical.size();
                let end = size.checked_mul(count).and_then(|bytes| bytes.checked_add(*at)).ok_or(ENDS)?;
                plain(physical, page.get(*at..end).ok_or(ENDS)?, out);
                *at = end;
            }
            Self::Dictionary(runs) => {
                let mut outside = false;
                runs.read(page, count, |index| {
                    let value = usize::try_from(index).ok().and_then(|index| dictionary.get(index));
                    outside |= value.is_none();
                    out.push(value.copied().unwrap_or(0));
                })?;
                if outside {
                    return Err("a value is not in the dictionary");
                }
            }
            Self::Truths(runs) => runs.read(page, count, |value| out.push(value))?,
            Self::Delta(delta) => {
                for _ in 0..count {
                    let value = delta.next(page).ok_or(ENDS)?;
                    // Differences of 32 bits wrap at 32 bits.
                    let narrow = value << 32 >> 32;
                    out.push(if physical == Physical::Int32 { narrow } else { value }.cast_unsigned());
                }
            }
            Self::Split { at, stride, next } => {
                let size = physical.size();
                let end = next.checked_add(count).filter(|end| end <= stride).ok_or(ENDS)?;
                for i in *next..end {
                    let mut value = [0; 8];
                    for (rank, byte) in value.iter_mut().take(size).enumerate() {
                        *byte = *page.get(*at + rank * *stride + i).ok_or(ENDS)?;
                    }
                    plain(physical, &value[..size], out);
                }
                *next = end;
            }
        }
        Ok(())
    }
}

/// Appends values with the encoding PLAIN.
pub(super) fn plain(physical: Physical, bytes: &[u8], out: &mut Vec<u64>) {
    match physical {
        Physical::Int32 => out.extend(
            bytes.as_chunks().0.iter().map(|bytes| i64::from(i32::from_le_bytes(*bytes)).cast_unsigned()),
        ),
        Physical::Int64 | Physical::Double => {
            out.extend(bytes.as_chunks().0.iter().map(|bytes| u64::from_le_bytes(*bytes)));
        }
        Physical::Float => {
            out.extend(
                bytes.as_chunks().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes)).to_bits()),
            );
        }
        Physical::Int96 => out.extend(bytes.as_chunks::<12>().0.iter().map(int96)),
        Physical::Boolean | Physical::Bytes => {}
    }
}

/// A stamp of 96 bits: nanoseconds of the day and the Julian day.
fn int96(bytes: &[u8; 12]) -> u64 {
    const JULIAN_DAY_OF_1970: i64 = 2_440_588;
    let [a, b, c, d, e, f, g, h, day @ ..] = *bytes;
    let ns = i64::from_le_bytes([a, b, c, d, e, f, g, h]);
    let day = i64::from(u32::from_le_bytes(day)) - JULIAN_DAY_OF_1970;
    day.saturating_mul(86_400_000_000_000).saturating_add(ns).cast_unsigned()
}

/// A number of `width` bits, lowest first, from a place in bits.
fn unpack(data: &[u8], bit: usize, width: usize) -> Option<u64> {
    let (byte, shift) = (bit / 8, bit % 8);
    let mask = if width >= 64 { u64::MAX } else { (1 << width) - 1 };
    if shift + width <= 64
        && let Some(chunk) = data.get(byte..).and_then(|rest| rest.first_chunk())
    {
        return Some((u64::from_le_bytes(*chunk) >> shift) & mask);
    }
    let size = (shift + width).div_ceil(8);
    let bytes = data.get(byte..)?.get(..size)?;
    let value = bytes.iter().rev().fold(0_u128, |value, byte| value << 8 | u128::from(*byte));
    u64::try_from(value >> shift & u128::from(mask)).ok()
}

/// Runs of equal values and of packed ones: "Run Length Encoding / Bit-Packing Hybrid".
#[derive(Debug)]
pub(super) struct Runs {
    width: usize,
    at: usize,
    end: usize,
    left: u64,
    run: Run,
}

#[derive(Clone, Copy, Debug)]
enum Run {
    Equal(u64),
    /// Place of the next value, in bits.
    Packed(usize),
}

impl Runs {
    pub(super) fn new(width: u8, at: usize, end: usize) -> Part<Self> {
        if width > 32 {
            return Err("the width of packed values is over 32 bits");
        }
        Ok(Self { width: usize::from(width), at, end, left: 0, run: Run::Equal(0) })
    }

    /// Runs behind their size in four bytes, and the place behind them.
    pub(super) fn sized(width: u8, page: &[u8], at: usize) -> Part<(Self, usize)> {
        let size = page.get(at..).and_then(|rest| rest.first_chunk()).ok_or(ENDS)?;
        let size = usize::try_from(u32::from_le_bytes(*size)).map_err(|_| ENDS)?;
        let end = size.checked_add(at + 4).filter(|end| *end <= page.len()).ok_or(ENDS)?;
        Ok((Self::new(width, at + 4, end)?, end))
    }

    /// Gives values one by one.
    pub(super) fn read(&mut self, page: &[u8], count: usize, mut give: impl FnMut(u64)) -> Part<()> {
        let page = page.get(..self.end).ok_or(ENDS)?;
        let mut wanted = count;
        while wanted > 0 {
            if self.left == 0 {
                self.next_run(page)?;
                continue;
            }
            let n = wanted.min(usize::try_from(self.left).unwrap_or(usize::MAX));
            match &mut self.run {
                Run::Equal(value) => (0..n).for_each(|_| give(*value)),
                Run::Packed(bit) => {
                    for _ in 0..n {
                        give(unpack(page, *bit, self.width).ok_or(ENDS)?);
                        *bit += self.width;
                    }
                }
            }
            self.left -= n as u64;
            wanted -= n;
        }
        Ok(())
    }

    fn next_run(&mut self, page: &[u8]) -> Part<()> {
        let rest = page.get(self.at..).ok_or(ENDS)?;
        let (header, size) = varint(rest).ok_or(ENDS)?;
        self.at += size;
        let bytes;
        if header & 1 == 0 {
            self.left = header >> 1;
            bytes = self.width.div_ceil(8);
            self.run = Run::Equal(unpack(page, self.at.saturating_mul(8), self.width).ok_or(ENDS)?);
        } else {
            let groups = header >> 1;
            self.left = groups.checked_mul(8).ok_or(ENDS)?;
            let packed = groups.checked_mul(self.width as u64).ok_or(ENDS)?;
            bytes = usize::try_from(packed).map_err(|_| ENDS)?;
            self.run = Run::Packed(self.at.saturating_mul(8));
        }
        self.at = self.at.checked_add(bytes).ok_or(ENDS)?;
        Ok(())
    }
}

/// Differences of integers in blocks: "Delta Encoding" (`DELTA_BINARY_PACKED`).
#[derive(Debug, Default)]
pub(super) struct Delta {
    at: usize,
    /// Miniblocks of a block, and values of each.
    miniblocks: u64,
    size: u64,
    /// Values that the header states, less those that were given.
    left: u64,
    value: i64,
    first: bool,
    least: i64,
    /// Places of the widths of the miniblocks that are left in the block.
    widths: std::ops::Range<usize>,
    width: usize,
    bit: usize,
    in_miniblock: u64,
}

impl Delta {
    fn new(page: &[u8], at: usize) -> Part<Self> {
        let mut delta = Self { at, first: true, ..Self::default() };
        let block = delta.varint(page).ok_or(ENDS)?;
        delta.miniblocks = delta.varint(page).ok_or(ENDS)?;
        delta.left = delta.varint(page).ok_or(ENDS)?;
        delta.value = zigzag(delta.varint(page).ok_or(ENDS)?);
        delta.size = block.checked_div(delta.miniblocks).unwrap_or(0);
        // The format asks for multiples of 32.
        if delta.size == 0 || !delta.size.is_multiple_of(8) {
            return Err("the blocks of differences have a wrong size");
        }
        Ok(delta)
    }

    fn varint(&mut self, page: &[u8]) -> Option<u64> {
        let (value, size) = varint(page.get(self.at..)?)?;
        self.at += size;
        Some(value)
    }

    fn next(&mut self, page: &[u8]) -> Option<i64> {
        self.left = self.left.checked_sub(1)?;
        if self.first {
            self.first = false;
            return Some(self.value);
        }
        if self.in_miniblock == 0 {
            self.next_miniblock(page)?;
        }
        self.in_miniblock -= 1;
        let delta = unpack(page, self.bit, self.width)?;
        self.bit += self.width;
        self.value = self.value.wrapping_add(self.least).wrapping_add(delta.cast_signed());
        Some(self.value)
    }

    fn next_miniblock(&mut self, page: &[u8]) -> Option<()> {
        if self.widths.is_empty() {
            self.least = zigzag(self.varint(page)?);
            let end = self.at.checked_add(usize::try_from(self.miniblocks).ok()?)?;
            self.widths = self.at..end;
            self.at = end;
        }
        self.width = usize::from(*page.get(self.widths.next()?)?);
        if self.width > 64 {
            return None;
        }
        self.in_miniblock = self.size;
        self.bit = self.at.checked_mul(8)?;
        let bytes = (self.size / 8).checked_mul(self.width as u64)?;
        self.at = self.at.checked_add(usize::try_from(bytes).ok()?)?;
        Some(())
    }
}
