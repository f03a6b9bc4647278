//! Units in the entry `ARROW:schema`, where pyarrow stores the metadata of the fields: Apache Arrow, "IPC Message
//! Format" and `Schema.fbs`; `FlatBuffers`, "Internals".

use base64::Engine;
use base64::alphabet;
use base64::engine::general_purpose::{GeneralPurpose, NO_PAD, STANDARD};

use crate::sink::Field;

/// Base64 without padding, whatever the bits behind the last byte.
const LETTERS: GeneralPurpose =
    GeneralPurpose::new(&alphabet::STANDARD, NO_PAD.with_decode_allow_trailing_bits(true));

/// The entry in the metadata of a Parquet file.
pub(super) const ENTRY: &[u8] = b"ARROW:schema";

/// Fields, and entries of the metadata of a field, that are read.
const MOST_FIELDS: usize = 1 << 16;
const MOST_ENTRIES: usize = 64;
const LONGEST_UNIT: usize = 64;

/// Names of fields and their units. What cannot be decoded is left out.
pub(super) fn units(entry: &[u8]) -> Vec<(String, String)> {
    let is_letter = |letter: &u8| letter.is_ascii_alphanumeric() || matches!(letter, b'+' | b'/');
    let mut letters: Vec<u8> = entry.iter().copied().filter(is_letter).collect();
    // The first letter of four is less than a byte.
    letters.truncate(letters.len() - usize::from(letters.len() % 4 == 1));
    schema(&LETTERS.decode(letters).unwrap_or_default()).unwrap_or_default()
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

/// The entry for columns of doubles with their units, which [`units`] reads.
pub(super) fn entry<'a>(columns: impl ExactSizeIterator<Item = &'a Field>) -> Vec<u8> {
    /// `MetadataVersion.V5`, `MessageHeader.Schema`, `Type.FloatingPoint`, `Precision.DOUBLE`.
    const V5: u32 = 4;
    const SCHEMA: u32 = 1;
    const FLOATING_POINT: u32 = 3;
    const DOUBLE: u32 = 2;
    const NULLABLE: u32 = 1;

    let mut flat = Flat { data: vec![0; 4] };
    let message = flat.table(0, &[(0, V5), (1, SCHEMA), (2, 0)]);
    let schema = flat.table(message + 8, &[(1, 0)]);
    let fields = flat.vector(schema, columns.len());
    for (i, column) in columns.enumerate() {
        let members = [(0, 0), (1, NULLABLE), (2, FLOATING_POINT), (3, 0), (5, 0), (6, 0)];
        let field = flat.table(fields + 4 * i, &members);
        flat.text(field, &column.name);
        flat.table(field + 12, &[(0, DOUBLE)]);
        // No children, and the unit as the only metadata.
        flat.vector(field + 16, 0);
        let metadata = flat.vector(field + 20, usize::from(column.unit.is_some()));
        if let Some(unit) = &column.unit {
            let pair = flat.table(metadata, &[(0, 0), (1, 0)]);
            flat.text(pair, "unit");
            flat.text(pair + 4, unit);
        }
    }
    flat.data.resize(flat.data.len().next_multiple_of(8), 0);
    let mut message = vec![255; 4];
    message.extend(u32_of(flat.data.len()));
    message.extend(flat.data);
    STANDARD.encode(message).into_bytes()
}

/// A buffer that is written from the root to the leaves. Members take four bytes each: a number, or the offset to what is
/// written later.
struct Flat {
    data: Vec<u8>,
}

impl Flat {
    /// Makes the offset at `from` lead to the end of the data.
    fn link(&mut self, from: usize) {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let offset = u32_of(self.data.len() - from);
        self.data[from..from + 4].copy_from_slice(&offset);
    }

    /// Adds a table with its members by ascending number, and returns the place of the first one.
    fn table(&mut self, from: usize, members: &[(usize, u32)]) -> usize {
        let last = members.last().map_or(0, |(number, _)| number + 1);
        // Sizes of the list of members and of the table, and the place of each member in the table; 0 without it.
        let mut list = vec![4 + 2 * last, 4 + 4 * members.len()];
        list.resize(2 + last, 0);
        for (rank, (number, _)) in members.iter().enumerate() {
            list[2 + number] = 4 + 4 * rank;
        }
        // The list is in front of the table, which is aligned.
        let size = 2 * list.len();
        self.data.resize((self.data.len() + size).next_multiple_of(4) - size, 0);
        for entry in list {
            self.data.extend(&u32_of(entry)[..2]);
        }
        self.link(from);
        self.data.extend(u32_of(size));
        self.data.extend(members.iter().flat_map(|(_, value)| value.to_le_bytes()));
        self.data.len() - 4 * members.len()
    }

    /// Adds a vector of offsets, and returns the place of the first one.
    fn vector(&mut self, from: usize, count: usize) -> usize {
        self.link(from);
        self.data.extend(u32_of(count));
        self.data.resize(self.data.len() + 4 * count, 0);
        self.data.len() - 4 * count
    }

    fn text(&mut self, from: usize, text: &str) {
        self.link(from);
        self.data.extend(u32_of(text.len()));
        self.data.extend(text.bytes());
        self.data.push(0);
    }
}

/// The lower bytes of a size; a schema is far smaller than 4 GiB.
fn u32_of(size: usize) -> [u8; 4] {
    let [a, b, c, d, ..] = (size as u64).to_le_bytes();
    [a, b, c, d]
}
