//! Units in the entry `ARROW:schema`, where pyarrow stores the metadata of the fields: Apache Arrow, "IPC Message
//! Format" and `Schema.fbs`; `FlatBuffers`, "Internals".

/// Fields, and entries of the metadata of a field, that are read.
const MOST_FIELDS: usize = 1 << 16;
const MOST_ENTRIES: usize = 64;
const LONGEST_UNIT: usize = 64;

/// Names of fields and their units. What cannot be decoded is left out.
pub(super) fn units(entry: &[u8]) -> Vec<(String, String)> {
    let message = base64(entry);
    schema(&message).unwrap_or_default()
}

/// Bytes in letters (RFC 4648, section 4).
fn base64(letters: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let (mut bits, mut count) = (0_u32, 0);
    for letter in letters {
        let value = match letter {
            b'A'..=b'Z' => letter - b'A',
            b'a'..=b'z' => letter - b'a' + 26,
            b'0'..=b'9' => letter - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => continue,
        };
        bits = bits << 6 | u32::from(value);
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count & 255) as u8);
        }
    }
    bytes
}

/// A table: the bytes, its place, and the place and size of its list of members.
#[derive(Clone, Copy)]
struct Table<'a> {
    data: &'a [u8],
    at: usize,
    members: usize,
    size: usize,
}

impl<'a> Table<'a> {
    fn new(data: &'a [u8], at: usize) -> Option<Self> {
        let back = i32::from_le_bytes(*data.get(at..)?.first_chunk()?);
        let members = usize::try_from(i64::try_from(at).ok()? - i64::from(back)).ok()?;
        Some(Self { data, at, members, size: short(data, members)? })
    }

    /// Place of a member; `None` if it has its default.
    fn member(&self, number: usize) -> Option<usize> {
        let entry = 4 + 2 * number;
        if entry + 2 > self.size {
            return None;
        }
        let offset = short(self.data, self.members.checked_add(entry)?)?;
        if offset == 0 { None } else { self.at.checked_add(offset) }
    }

    fn table(&self, number: usize) -> Option<Self> {
        Self::new(self.data, target(self.data, self.member(number)?)?)
    }

    fn text(&self, number: usize) -> Option<&'a [u8]> {
        let at = target(self.data, self.member(number)?)?;
        self.data.get(at.checked_add(4)?..)?.get(..long(self.data, at)?)
    }

    /// Tables of a vector.
    fn tables(&self, number: usize, most: usize) -> impl Iterator<Item = Table<'a>> {
        let data = self.data;
        let vector = self.member(number).and_then(|member| target(data, member));
        let count = vector.and_then(|at| long(data, at)).unwrap_or(0).min(most);
        (0..count).map_while(move |i| Table::new(data, target(data, vector?.checked_add(4 + 4 * i)?)?))
    }
}

fn short(data: &[u8], at: usize) -> Option<usize> {
    Some(usize::from(u16::from_le_bytes(*data.get(at..)?.first_chunk()?)))
}

fn long(data: &[u8], at: usize) -> Option<usize> {
    usize::try_from(u32::from_le_bytes(*data.get(at..)?.first_chunk()?)).ok()
}

/// Place that an offset refers to.
fn target(data: &[u8], at: usize) -> Option<usize> {
    at.checked_add(long(data, at)?)
}

fn schema(message: &[u8]) -> Option<Vec<(String, String)>> {
    // The size of the message is in front, since version 0.15 behind four bytes of ones.
    let start = if message.starts_with(&[255; 4]) { 8 } else { 4 };
    let data = message.get(start..)?;
    let schema = Table::new(data, long(data, 0)?)?.table(2)?;
    let mut units = Vec::new();
    for field in schema.tables(1, MOST_FIELDS) {
        let stated = field
            .tables(6, MOST_ENTRIES)
            .find_map(|entry| matches!(entry.text(0)?, b"unit" | b"units").then_some(entry.text(1)?));
        let unit = stated.filter(|unit| unit.len() <= LONGEST_UNIT).or_else(|| duration(&field));
        if let (Some(name), Some(unit)) = (field.text(0), unit)
            && name.len() <= 1024
        {
            units.push((
                String::from_utf8_lossy(name).into_owned(),
                String::from_utf8_lossy(unit).into_owned(),
            ));
        }
    }
    Some(units)
}

/// Unit of a duration, which is a plain integer in the schema of Parquet.
fn duration(field: &Table<'_>) -> Option<&'static [u8]> {
    const DURATION: u8 = 18;
    if field.data.get(field.member(2)?) != Some(&DURATION) {
        return None;
    }
    let kind = field.table(3)?;
    // Milliseconds are the default, which is not written.
    let unit = kind.member(0).map_or(Some(1), |at| short(kind.data, at))?;
    [b"s".as_slice(), b"ms", b"us", b"ns"].get(unit).copied()
}
