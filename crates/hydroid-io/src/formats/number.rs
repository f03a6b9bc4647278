//! Numbers in little-endian records.

/// Kind of a number in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F16,
    F32,
    F64,
}

impl Number {
    /// Bytes of the number.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number at a place of a record; NaN if the record ends before it.
    pub(crate) fn read(self, record: &[u8], at: usize) -> f64 {
        self.try_read(record, at).unwrap_or(f64::NAN)
    }

    fn try_read(self, record: &[u8], at: usize) -> Option<f64> {
        Some(match self {
            Self::I8 => f64::from(i8::from_le_bytes(chunk(record, at)?)),
            Self::U8 => f64::from(u8::from_le_bytes(chunk(record, at)?)),
            Self::I16 => f64::from(i16::from_le_bytes(chunk(record, at)?)),
            Self::U16 => f64::from(u16::from_le_bytes(chunk(record, at)?)),
            Self::I32 => f64::from(i32::from_le_bytes(chunk(record, at)?)),
            Self::U32 => f64::from(u32::from_le_bytes(chunk(record, at)?)),
            Self::I64 => i64::from_le_bytes(chunk(record, at)?) as f64,
            Self::U64 => u64::from_le_bytes(chunk(record, at)?) as f64,
            Self::F16 => half(u16::from_le_bytes(chunk(record, at)?)),
            Self::F32 => f64::from(f32::from_le_bytes(chunk(record, at)?)),
            Self::F64 => f64::from_le_bytes(chunk(record, at)?),
        })
    }

    /// The integer at a place of a record, without rounding; `None` if the kind is not an integer, the record ends
    /// before it, or it exceeds `i64`.
    pub(crate) fn integer(self, record: &[u8], at: usize) -> Option<i64> {
        match self {
            Self::I64 => Some(i64::from_le_bytes(chunk(record, at)?)),
            Self::U64 => i64::try_from(u64::from_le_bytes(chunk(record, at)?)).ok(),
            Self::F16 | Self::F32 | Self::F64 => None,
            #[allow(clippy::cast_possible_truncation, reason = "up to 32 bits: exact in f64")]
            _ => Some(self.try_read(record, at)? as i64),
        }
    }
}

/// Bytes of a record at a place.
pub(crate) fn chunk<const N: usize>(record: &[u8], at: usize) -> Option<[u8; N]> {
    record.get(at..)?.first_chunk().copied()
}

/// Text up to the first NUL.
pub(crate) fn text(bytes: &[u8]) -> String {
    let end = memchr::memchr(0, bytes).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// IEEE 754 binary16.
fn half(bits: u16) -> f64 {
    let exponent = i32::from(bits >> 10 & 0x1f);
    let fraction = f64::from(bits & 0x3ff) / 1024.0;
    let size = match exponent {
        0 => fraction * 2f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2f64.powi(exponent - 15),
    };
    if bits & 0x8000 == 0 { size } else { -size }
}
