//! Writer of Parquet: Apache Parquet format 2.11, sections "File metadata", "Data Pages" and "Encodings".
//!
//! A row group has a page of each column, so a page is all that is in memory. Pages have the encoding PLAIN, are
//! compressed with Snappy and have a checksum.

use std::io::{self, Write};

use super::arrow;
use super::thrift::{Structure, push_varint};
use crate::sink::Field;

/// Rows of a row group: a page has half a MiB.
const GROUP: usize = 1 << 16;

const MAGIC: &[u8] = b"PAR1";
/// `Type.DOUBLE`.
const DOUBLE: i32 = 5;
/// `FieldRepetitionType.OPTIONAL`.
const OPTIONAL: i32 = 1;
/// `Encoding.PLAIN` of the values and `Encoding.RLE` of the levels.
const PLAIN: i32 = 0;
const RLE: i32 = 3;
/// `CompressionCodec.SNAPPY`.
const SNAPPY: i32 = 1;

/// Writes a table as Parquet: columns of doubles, of which NaN is an empty cell (null). A column that is shorter than the
/// longest one ends with empty cells. Units are the entry `unit` in the metadata of the fields, as pyarrow stores it.
///
/// # Errors
/// If the writer fails, or the footer has more than 2 GiB.
pub fn write_parquet(columns: &[(Field, &[f64])], mut out: impl Write) -> io::Result<()> {
    let rows = columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
    let mut codec = snap::raw::Encoder::new();
    out.write_all(MAGIC)?;
    let mut place = MAGIC.len() as u64;
    let mut groups = Vec::new();
    for from in (0..rows).step_by(GROUP) {
        let count = GROUP.min(rows - from);
        let mut chunks = Vec::with_capacity(columns.len());
        let mut size = 0;
        for (field, values) in columns {
            let values = &values[from.min(values.len())..(from + count).min(values.len())];
            let page = page(values, count);
            let packed = codec.compress_vec(&page)?;
            let header = page_header(&page, &packed, count)?;
            out.write_all(&header)?;
            out.write_all(&packed)?;
            let (unpacked, length) = (header.len() + page.len(), header.len() + packed.len());
            chunks.push(chunk(field, count, place, unpacked, length)?);
            place += length as u64;
            size += unpacked as u64;
        }
        let group =
            Structure::default().structures(1, &chunks).i64(2, wide(size)?).i64(3, wide(count as u64)?);
        groups.push(group.end());
    }
    let footer = footer(columns, rows, &groups)?;
    out.write_all(&footer)?;
    out.write_all(&narrow(footer.len())?.to_le_bytes())?;
    out.write_all(MAGIC)
}

/// Content of a page of `rows` cells: whether each is present, and the values of those that are.
fn page(values: &[f64], rows: usize) -> Vec<u8> {
    // One run of bits, eight in each byte; its size in front.
    let mut levels = Vec::new();
    let mut bits = vec![0_u8; rows.div_ceil(8)];
    push_varint(&mut levels, (bits.len() as u64) << 1 | 1);
    for (row, _) in values.iter().enumerate().filter(|(_, value)| !value.is_nan()) {
        bits[row / 8] |= 1 << (row % 8);
    }
    levels.extend(bits);
    let mut page = Vec::with_capacity(4 + levels.len() + 8 * values.len());
    #[expect(clippy::cast_possible_truncation, reason = "a bit for each row of a group")]
    page.extend((levels.len() as u32).to_le_bytes());
    page.extend(levels);
    values.iter().filter(|value| !value.is_nan()).for_each(|value| page.extend(value.to_le_bytes()));
    page
}

/// `PageHeader` with its `DataPageHeader`.
fn page_header(page: &[u8], packed: &[u8], rows: usize) -> io::Result<Vec<u8>> {
    const DATA_PAGE: i32 = 0;
    let data = Structure::default().i32(1, narrow(rows)?).i32(2, PLAIN).i32(3, RLE).i32(4, RLE);
    let header = Structure::default()
        .i32(1, DATA_PAGE)
        .i32(2, narrow(page.len())?)
        .i32(3, narrow(packed.len())?)
        .i32(4, crc32fast::hash(packed).cast_signed())
        .structure(5, data);
    Ok(header.end())
}

/// `ColumnChunk` with its `ColumnMetaData`.
fn chunk(field: &Field, rows: usize, place: u64, unpacked: usize, length: usize) -> io::Result<Vec<u8>> {
    let column = Structure::default()
        .i32(1, DOUBLE)
        .i32s(2, &[PLAIN, RLE])
        .binaries(3, &[field.name.as_bytes()])
        .i32(4, SNAPPY)
        .i64(5, wide(rows as u64)?)
        .i64(6, wide(unpacked as u64)?)
        .i64(7, wide(length as u64)?)
        .i64(9, wide(place)?);
    // The place of a copy of the metadata: there is none.
    Ok(Structure::default().i64(2, 0).structure(3, column).end())
}

/// `FileMetaData`.
fn footer(columns: &[(Field, &[f64])], rows: usize, groups: &[Vec<u8>]) -> io::Result<Vec<u8>> {
    let mut schema = vec![Structure::default().binary(4, b"schema").i32(5, narrow(columns.len())?).end()];
    for (field, _) in columns {
        let element = Structure::default().i32(1, DOUBLE).i32(3, OPTIONAL).binary(4, field.name.as_bytes());
        schema.push(element.end());
    }
    let units = arrow::entry(columns.iter().map(|(field, _)| field));
    let entry = Structure::default().binary(1, arrow::ENTRY).binary(2, &units);
    let footer = Structure::default()
        .i32(1, 2)
        .structures(2, &schema)
        .i64(3, wide(rows as u64)?)
        .structures(4, groups)
        .structures(5, &[entry.end()])
        .binary(6, concat!("hydroid version ", env!("CARGO_PKG_VERSION")).as_bytes());
    Ok(footer.end())
}

fn narrow(size: usize) -> io::Result<i32> {
    i32::try_from(size).map_err(too_large)
}

fn wide(size: u64) -> io::Result<i64> {
    i64::try_from(size).map_err(too_large)
}

fn too_large(_: std::num::TryFromIntError) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, "the table is too large for Parquet")
}
