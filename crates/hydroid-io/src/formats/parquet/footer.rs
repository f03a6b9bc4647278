//! Footer of a Parquet file: Apache Parquet format, `parquet.thrift`, section "File metadata".

use super::arrow;
use super::thrift::{Kind, Part, STRUCT, Thrift};
use crate::error::IoError;
use crate::input::Input;

/// Longest footer.
const LONGEST: u64 = 64 << 20;
/// Elements of a schema that are read.
const MOST_ELEMENTS: u64 = 1 << 16;
/// Longest name of a column; messages repeat it.
const LONGEST_NAME: usize = 1024;

const AGAIN: &str = "write it again; the footer of a Parquet file is its last part, which is missing if the \
                     writer was stopped before it closed the file";

/// Type in which values are stored (`Type`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Physical {
    Boolean,
    Int32,
    Int64,
    Int96,
    Float,
    Double,
    Bytes,
}

impl Physical {
    fn new(code: i64) -> Option<Self> {
        Some(match code {
            0 => Self::Boolean,
            1 => Self::Int32,
            2 => Self::Int64,
            3 => Self::Int96,
            4 => Self::Float,
            5 => Self::Double,
            6 => Self::Bytes,
            _ => return None,
        })
    }

    /// Bytes of a value with the encoding PLAIN; 0 where they are not whole.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Int32 | Self::Float => 4,
            Self::Int64 | Self::Double => 8,
            Self::Int96 => 12,
            Self::Boolean | Self::Bytes => 0,
        }
    }
}

/// What the values mean (`LogicalType`, `ConvertedType`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meaning {
    Number,
    Unsigned,
    /// Time since 1970 in units of `ns` nanoseconds.
    Stamp {
        ns: i64,
        utc: bool,
    },
    Text,
    /// Decimal numbers, intervals and the like.
    Other,
}

/// A column that is not nested.
#[derive(Clone, Debug)]
pub(super) struct Leaf {
    pub(super) name: String,
    /// Place among all columns, nested ones included.
    pub(super) index: usize,
    pub(super) physical: Physical,
    pub(super) meaning: Meaning,
    /// Unit that the type states.
    pub(super) unit: Option<&'static str>,
    pub(super) optional: bool,
}

/// Content of the footer.
#[derive(Debug, Default)]
pub(super) struct Footer<'a> {
    pub(super) leaves: Vec<Leaf>,
    /// Names of the nested columns and those of unknown types.
    pub(super) left_out: Vec<String>,
    /// All columns.
    columns: usize,
    /// The entry `ARROW:schema`.
    pub(super) arrow: Option<&'a [u8]>,
    /// Place of the row groups. They are parsed one by one because a footer may state millions of them.
    groups: Thrift<'a>,
    group_count: u64,
}

/// A row group.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) rows: u64,
    /// A chunk of each column, nested ones included.
    pub(super) chunks: Vec<Chunk>,
}

/// Part of a column in a row group (`ColumnMetaData`).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Chunk {
    pub(super) physical: i64,
    pub(super) codec: i64,
    pub(super) values: u64,
    pub(super) start: u64,
    pub(super) length: u64,
}

impl Chunk {
    pub(super) fn has(&self, physical: Physical) -> bool {
        Physical::new(self.physical) == Some(physical)
    }
}

/// Bytes of the footer.
pub(super) fn load(input: &mut Input) -> Result<Vec<u8>, IoError> {
    let length = input.length();
    let mut tail = Vec::new();
    input.read_at(length.saturating_sub(8), 8, &mut tail)?;
    input.seek(length.saturating_sub(8))?;
    let Ok([a, b, c, d, magic @ ..]) = <[u8; 8]>::try_from(tail) else {
        return Err(input.damaged("the file is shorter than a footer", AGAIN));
    };
    if &magic == b"PARE" {
        return Err(input.damaged("the footer is encrypted", "write the file without encryption"));
    }
    if &magic != b"PAR1" || length < 12 {
        return Err(input.damaged("the file does not end with a footer", AGAIN));
    }
    let size = u64::from(u32::from_le_bytes([a, b, c, d]));
    if size > length - 12 || size > LONGEST {
        return Err(input.damaged(format!("the footer states a length of {size} bytes"), AGAIN));
    }
    let mut footer = Vec::new();
    // At most 64 MiB, and not more than the file has.
    input.read_at(length - 8 - size, usize::try_from(size).unwrap_or(0), &mut footer)?;
    Ok(footer)
}

impl<'a> Footer<'a> {
    /// Parses `FileMetaData`.
    pub(super) fn parse(data: &'a [u8]) -> Part<Self> {
        let mut thrift = Thrift::new(data);
        let mut footer = Self { groups: thrift, ..Self::default() };
        let mut id = 0;
        while let Some(kind) = thrift.member(&mut id)? {
            match id {
                2 if footer.columns > 0 || !footer.left_out.is_empty() => {
                    return Err("the footer has two schemas");
                }
                2 => footer.schema(&mut thrift, kind)?,
                4 => {
                    footer.group_count = thrift.structures(kind)?;
                    footer.groups = thrift;
                    for _ in 0..footer.group_count {
                        thrift.skip(STRUCT)?;
                    }
                }
                5 => {
                    for _ in 0..thrift.structures(kind)? {
                        let (key, value) = entry(&mut thrift)?;
                        if key == arrow::ENTRY {
                            footer.arrow = Some(value);
                        }
                    }
                }
                _ => thrift.skip(kind)?,
            }
        }
        Ok(footer)
    }

    /// The schema is a tree whose elements are listed with the parent before its children.
    fn schema(&mut self, thrift: &mut Thrift<'a>, kind: Kind) -> Part<()> {
        let count = thrift.structures(kind)?;
        if count > MOST_ELEMENTS {
            return Err("the schema has more than 65536 elements");
        }
        let mut open: Vec<u64> = Vec::new();
        for i in 0..count {
            let element = Element::parse(thrift)?;
            if i == 0 {
                open.push(element.children);
                continue;
            }
            while open.last() == Some(&0) {
                open.pop();
            }
            let Some(left) = open.last_mut() else {
                return Err("the schema has more elements than it states");
            };
            *left -= 1;
            let name = || String::from_utf8_lossy(element.name).into_owned();
            let top = open.len() == 1;
            let Some(code) = element.physical else {
                if top {
                    self.left_out.push(name());
                }
                open.push(element.children);
                continue;
            };
            let index = self.columns;
            self.columns += 1;
            let (meaning, unit) = element.meaning();
            match Physical::new(code) {
                Some(physical) if top && element.repetition != 2 && meaning != Meaning::Other => {
                    let optional = element.repetition == 1;
                    self.leaves.push(Leaf { name: name(), index, physical, meaning, unit, optional });
                }
                _ if top => self.left_out.push(name()),
                _ => {}
            }
        }
        Ok(())
    }

    /// The row groups from the first.
    pub(super) fn groups(&self) -> Groups<'a> {
        Groups { thrift: self.groups, left: self.group_count, columns: self.columns }
    }
}

/// Place in the row groups.
pub(super) struct Groups<'a> {
    thrift: Thrift<'a>,
    left: u64,
    columns: usize,
}

impl Groups<'_> {
    pub(super) fn next_group(&mut self) -> Option<Part<Group>> {
        self.left = self.left.checked_sub(1)?;
        let mut thrift = self.thrift;
        // The row groups were skipped once, so this does not fail.
        self.thrift.skip(STRUCT).ok()?;
        Some(group(&mut thrift, self.columns))
    }
}

/// `RowGroup`.
fn group(thrift: &mut Thrift<'_>, columns: usize) -> Part<Group> {
    let mut group = Group { rows: 0, chunks: Vec::new() };
    let mut id = 0;
    while let Some(kind) = thrift.member(&mut id)? {
        match id {
            1 => {
                if thrift.structures(kind)? != columns as u64 {
                    return Err("it has not the columns of the schema");
                }
                group.chunks.clear();
                for _ in 0..columns {
                    group.chunks.push(chunk(thrift)?);
                }
            }
            3 => group.rows = thrift.count(kind)?,
            _ => thrift.skip(kind)?,
        }
    }
    if group.chunks.len() != columns {
        return Err("it has not the columns of the schema");
    }
    Ok(group)
}

/// `ColumnChunk` and the `ColumnMetaData` in it.
fn chunk(thrift: &mut Thrift<'_>) -> Part<Chunk> {
    let mut chunk = Chunk { physical: -1, ..Chunk::default() };
    let (mut pages, mut dictionary) = (0, 0);
    let mut id = 0;
    while let Some(kind) = thrift.member(&mut id)? {
        if id != 3 || kind != STRUCT {
            thrift.skip(kind)?;
            continue;
        }
        let mut id = 0;
        while let Some(kind) = thrift.member(&mut id)? {
            match id {
                1 => chunk.physical = thrift.integer(kind)?,
                4 => chunk.codec = thrift.integer(kind)?,
                5 => chunk.values = thrift.count(kind)?,
                7 => chunk.length = thrift.count(kind)?,
                9 => pages = thrift.count(kind)?,
                11 => dictionary = thrift.count(kind)?,
                _ => thrift.skip(kind)?,
            }
        }
    }
    // Some writers state 0 for "no dictionary".
    chunk.start = if dictionary > 0 { pages.min(dictionary) } else { pages };
    Ok(chunk)
}

/// `KeyValue`.
fn entry<'a>(thrift: &mut Thrift<'a>) -> Part<(&'a [u8], &'a [u8])> {
    let mut entry: (&[u8], &[u8]) = (&[], &[]);
    let mut id = 0;
    while let Some(kind) = thrift.member(&mut id)? {
        match id {
            1 => entry.0 = thrift.binary(kind)?,
            2 => entry.1 = thrift.binary(kind)?,
            _ => thrift.skip(kind)?,
        }
    }
    Ok(entry)
}

/// `SchemaElement`.
#[derive(Default)]
struct Element<'a> {
    physical: Option<i64>,
    repetition: i64,
    name: &'a [u8],
    children: u64,
    converted: Option<i64>,
    logical: Option<Logical>,
}

/// `LogicalType`: its number, the unit of times, and whether they are UTC; whether an integer is signed.
#[derive(Clone, Copy)]
struct Logical {
    number: i16,
    unit: i16,
    flag: bool,
}

impl<'a> Element<'a> {
    fn parse(thrift: &mut Thrift<'a>) -> Part<Self> {
        let mut element = Self::default();
        let mut id = 0;
        while let Some(kind) = thrift.member(&mut id)? {
            match id {
                1 => element.physical = Some(thrift.integer(kind)?),
                3 => element.repetition = thrift.integer(kind)?,
                4 => {
                    let name = thrift.binary(kind)?;
                    element.name = &name[..name.len().min(LONGEST_NAME)];
                }
                5 => element.children = thrift.count(kind)?,
                6 => element.converted = Some(thrift.integer(kind)?),
                10 if kind == STRUCT => element.logical = logical(thrift)?,
                _ => thrift.skip(kind)?,
            }
        }
        Ok(element)
    }

    fn meaning(&self) -> (Meaning, Option<&'static str>) {
        const SCALES: [(i64, &str); 3] = [(1_000_000, "ms"), (1_000, "us"), (1, "ns")];
        let scale = |unit: i16| SCALES.get(usize::try_from(unit.checked_sub(1)?).ok()?).copied();
        match (self.physical, self.logical, self.converted) {
            (Some(3), ..) => (Meaning::Stamp { ns: 1, utc: true }, None),
            (_, Some(Logical { number: 8, unit, flag: utc }), _) => {
                scale(unit).map_or((Meaning::Other, None), |(ns, _)| (Meaning::Stamp { ns, utc }, None))
            }
            (_, Some(Logical { number: 7, unit, .. }), _) => {
                (Meaning::Number, scale(unit).map(|(_, name)| name))
            }
            (_, Some(Logical { number: 10, flag: signed, .. }), _) => {
                (if signed { Meaning::Number } else { Meaning::Unsigned }, None)
            }
            (_, Some(Logical { number: 6, .. }), _) | (_, None, Some(6)) => (Meaning::Number, Some("d")),
            (_, None, Some(9)) => (Meaning::Stamp { ns: 1_000_000, utc: true }, None),
            (_, None, Some(10)) => (Meaning::Stamp { ns: 1_000, utc: true }, None),
            (_, None, Some(7)) => (Meaning::Number, Some("ms")),
            (_, None, Some(8)) => (Meaning::Number, Some("us")),
            (_, None, Some(11..=14)) => (Meaning::Unsigned, None),
            (Some(6), Some(Logical { number: 1, .. }), _) | (Some(6), None, None | Some(0)) => {
                (Meaning::Text, None)
            }
            (Some(0..=2 | 4..=5), None, None | Some(15..=18)) => (Meaning::Number, None),
            _ => (Meaning::Other, None),
        }
    }
}

fn logical(thrift: &mut Thrift<'_>) -> Part<Option<Logical>> {
    let mut logical = None;
    let mut id = 0;
    while let Some(kind) = thrift.member(&mut id)? {
        if !matches!(id, 7 | 8 | 10) || kind != STRUCT {
            logical = Some(Logical { number: id, unit: 0, flag: false });
            thrift.skip(kind)?;
            continue;
        }
        let mut found = Logical { number: id, unit: 0, flag: false };
        let mut member = 0;
        while let Some(kind) = thrift.member(&mut member)? {
            match (id, member) {
                (7 | 8, 1) | (10, 2) => found.flag = Thrift::truth(kind)?,
                (7 | 8, 2) if kind == STRUCT => {
                    let mut unit = 0;
                    while let Some(kind) = thrift.member(&mut unit)? {
                        found.unit = unit;
                        thrift.skip(kind)?;
                    }
                }
                _ => thrift.skip(kind)?,
            }
        }
        logical = Some(found);
    }
    Ok(logical)
}
