//! The rows of one part of a log. Parts are read independently of each other, on all cores.

use memchr::{memchr, memchr_iter, memchr3_iter};

use super::super::error::LogError;
use super::super::lines::Lines;
use super::super::stamp::Stamp;
use super::cell::{Cell, number, text};
use super::chunks::{Chunk, Endless, LONGEST_LINE};
use super::{BadCell, FirstStamp, ShortRows};

/// What the beginning of a log shows of its rows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Format {
    pub(super) delimiter: u8,
    pub(super) decimal_comma: bool,
    /// The byte that ends a line of an editor.
    pub(super) end_of_line: u8,
    /// Number of columns, and of those up to the last one with a name: a row may end after it.
    pub(super) width: usize,
    pub(super) needed: usize,
    /// Whether the first row ends before: the program that wrote the log omits the last cells where they are empty. A single short
    /// row among whole ones is damaged.
    pub(super) omits: bool,
}

/// What a column holds, known from its first cell that is not missing. A column does not mix numbers, dates and times of day.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Kind {
    #[default]
    Unknown,
    Numbers,
    Stamps,
    TimesOfDay,
}

impl Kind {
    fn of(stamp: &Stamp) -> Self {
        if stamp.dated { Self::Stamps } else { Self::TimesOfDay }
    }
}

/// A part of one column.
#[derive(Debug, Default)]
pub(super) struct Part {
    pub(super) values: Vec<f64>,
    pub(super) kind: Kind,
    pub(super) bad: Option<BadCell>,
    pub(super) bad_cells: usize,
    pub(super) stamps: Option<FirstStamp>,
}

impl Part {
    fn push(&mut self, cell: &str, line: u64, decimal_comma: bool) {
        let value = match number(cell, decimal_comma) {
            Cell::Number(x) if [Kind::Unknown, Kind::Numbers].contains(&self.kind) => {
                self.kind = Kind::Numbers;
                x
            }
            Cell::Stamp(stamp) if [Kind::Unknown, Kind::of(&stamp)].contains(&self.kind) => {
                self.kind = Kind::of(&stamp);
                self.stamps.get_or_insert_with(|| FirstStamp {
                    line,
                    text: cell.to_owned(),
                    dated: stamp.dated,
                    zoned: stamp.zoned,
                });
                stamp.seconds
            }
            Cell::Missing => f64::NAN,
            bad => {
                if self.kind == Kind::Unknown {
                    self.kind = Kind::Numbers;
                }
                self.bad_cells += 1;
                self.bad.get_or_insert_with(|| BadCell {
                    line,
                    text: cell.chars().take(40).collect(),
                    infinite: matches!(bad, Cell::Bad { infinite: true }),
                });
                f64::NAN
            }
        };
        self.values.push(value);
    }
}

/// A defect that ends the reading, with its line within the part.
#[derive(Debug)]
pub(super) enum Defect {
    NotUtf8 { line: u64, binary: bool },
    Row { line: u64, found: usize, truncated: bool },
    Endless(Endless),
}

impl Defect {
    /// The error of the file, of which `before` lines precede the part.
    pub(super) fn error(self, path: &str, before: u64, expected: usize) -> LogError {
        let path = path.to_owned();
        match self {
            Self::NotUtf8 { line, binary } => {
                let remedy = if binary {
                    "the file does not seem to be CSV, and begins like none of the other formats (MCAP, bags of ROS 1 and 2, DataFlash, ULog, NMEA, Parquet, XLSX): check the file, or export the log as CSV"
                } else {
                    "save the file as `CSV UTF-8` (a degree sign or an umlaut from an old encoding is the usual cause)"
                };
                LogError::NotUtf8 { path, line: before + line, remedy }
            }
            Self::Row { line, found, truncated: true } => {
                LogError::Truncated { path, line: before + line, found, expected }
            }
            Self::Row { line, found, truncated: false } => {
                LogError::Ragged { path, line: before + line, found, expected }
            }
            Self::Endless(Endless::Line(bytes)) => LogError::BadLine {
                path,
                line: before + 1,
                reason: format!(
                    "{bytes} bytes without an end of line: the file is not a table; export the log as CSV"
                ),
            },
            Self::Endless(Endless::Quote) => LogError::BadLine {
                path,
                line: before + 1,
                reason: format!(
                    "more than {LONGEST_LINE} bytes after a quotation mark that is not closed: correct the line"
                ),
            },
        }
    }
}

/// The rows of one part.
#[derive(Debug)]
pub(super) struct Rows {
    pub(super) columns: Vec<Part>,
    /// Lines within the part, from 1.
    pub(super) lines: Lines,
    /// Ends of lines in the part.
    pub(super) ends: u64,
    /// Rows with fewer cells than the header names.
    pub(super) short: ShortRows,
    pub(super) defect: Option<Defect>,
}

impl Rows {
    /// Reads a part whose columns hold these kinds of cells up to here.
    pub(super) fn of(chunk: &Chunk, format: &Format, kinds: &[Kind]) -> Self {
        let columns = kinds.iter().map(|kind| Part { kind: *kind, ..Part::default() }).collect();
        let mut rows =
            Self { columns, lines: Lines::default(), ends: 0, short: ShortRows::default(), defect: None };
        if let Some(endless) = chunk.endless {
            rows.defect = Some(Defect::Endless(endless));
            return rows;
        }
        rows.ends = count(&chunk.bytes, format.end_of_line);
        rows.defect = match utf8(&chunk.bytes, format.end_of_line) {
            Ok(text) if memchr(b'"', &chunk.bytes).is_none() => rows.plain(text, chunk.last, format),
            Ok(_) => rows.quoted(&chunk.bytes, chunk.last, format),
            Err(defect) => Err(defect),
        }
        .err();
        rows
    }

    /// Rows of a text without quotation marks, in which every separator separates.
    fn plain(&mut self, all: &str, last: bool, format: &Format) -> Result<(), Defect> {
        let mut row = Row { rows: self, format, line: 1, found: 0, extra: false };
        let (mut start, mut begin) = (0, 0);
        let separators = memchr3_iter(format.delimiter, b'\n', b'\r', all.as_bytes());
        for at in separators {
            let byte = all.as_bytes()[at];
            if byte == format.delimiter {
                row.cell(trim(&all[start..at]));
            } else {
                if at > begin {
                    row.cell(trim(&all[start..at]));
                    row.end(|| last && is_blank(&all.as_bytes()[at..]), all)?;
                }
                row.line += u64::from(byte == format.end_of_line);
                begin = at + 1;
            }
            start = at + 1;
        }
        if begin < all.len() {
            row.cell(trim(&all[start..]));
            row.end(|| last, all)?;
        }
        Ok(())
    }

    /// Rows of a text with quotation marks.
    fn quoted(&mut self, bytes: &[u8], last: bool, format: &Format) -> Result<(), Defect> {
        let mut reader = records(bytes, format.delimiter);
        let mut record = csv::ByteRecord::new();
        let mut counter = LineCounter::new(bytes, format.end_of_line);
        let all = std::str::from_utf8(bytes).unwrap_or_default();
        let mut row = Row { rows: self, format, line: 1, found: 0, extra: false };
        // A reader over bytes in memory cannot fail: ragged lines are allowed and no text is decoded.
        while reader.read_byte_record(&mut record).is_ok_and(|found| found) {
            row.line = counter.line_of(&record);
            record.iter().for_each(|cell| row.cell(text(cell)));
            let at = usize::try_from(reader.position().byte()).unwrap_or(bytes.len()).min(bytes.len());
            row.end(|| last && is_blank(&bytes[at..]), all)?;
        }
        Ok(())
    }
}

/// The row that is being read.
struct Row<'a> {
    rows: &'a mut Rows,
    format: &'a Format,
    line: u64,
    found: usize,
    extra: bool,
}

impl Row<'_> {
    fn cell(&mut self, cell: &str) {
        match self.rows.columns.get_mut(self.found) {
            Some(column) => column.push(cell, self.line, self.format.decimal_comma),
            None => self.extra |= !cell.is_empty(),
        }
        self.found += 1;
    }

    /// Ends the row; `at_end` is whether it is the last one of the file.
    fn end(&mut self, at_end: impl FnOnce() -> bool, all: &str) -> Result<(), Defect> {
        let (found, short) = (self.found, self.found < self.format.needed);
        let truncated = short && !all.ends_with('\n') && at_end();
        if self.extra || short && (truncated || !self.format.omits) {
            return Err(Defect::Row { line: self.line, found, truncated });
        }
        if short {
            self.rows.short.add(ShortRows { first: self.line, count: 1 }, 0);
        }
        for column in self.rows.columns.iter_mut().skip(found) {
            column.values.push(f64::NAN);
        }
        self.rows.lines.push(self.line);
        self.found = 0;
        Ok(())
    }
}

/// A reader of the records of a part.
pub(super) fn records(bytes: &[u8], delimiter: u8) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::None)
        .from_reader(bytes)
}

/// Whether only ends of lines follow.
fn is_blank(rest: &[u8]) -> bool {
    rest.iter().all(|byte| matches!(byte, b'\n' | b'\r'))
}

fn trim(cell: &str) -> &str {
    cell.trim_matches(|c: char| c.is_ascii_whitespace())
}

/// The text of a part.
pub(super) fn utf8(bytes: &[u8], end_of_line: u8) -> Result<&str, Defect> {
    std::str::from_utf8(bytes).map_err(|error| Defect::NotUtf8 {
        line: 1 + count(&bytes[..error.valid_up_to()], end_of_line),
        binary: memchr(0, bytes).is_some(),
    })
}

pub(super) fn count(bytes: &[u8], byte: u8) -> u64 {
    memchr_iter(byte, bytes).count() as u64
}

/// Line numbers as in an editor. The position of a record from the parser includes the blank lines before it.
struct LineCounter<'a> {
    bytes: &'a [u8],
    end_of_line: u8,
    at: usize,
    line: u64,
}

impl<'a> LineCounter<'a> {
    fn new(bytes: &'a [u8], end_of_line: u8) -> Self {
        Self { bytes, end_of_line, at: 0, line: 1 }
    }

    /// Line on which a record begins; records come in order.
    fn line_of(&mut self, record: &csv::ByteRecord) -> u64 {
        let start = record.position().map_or(0, |p| usize::try_from(p.byte()).unwrap_or(usize::MAX));
        let start = start.clamp(self.at, self.bytes.len());
        let blank = self.bytes[start..].iter().take_while(|&&b| b == b'\n' || b == b'\r').count();
        let passed = &self.bytes[self.at..start + blank];
        self.line += count(passed, self.end_of_line);
        self.at = start + blank;
        self.line
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn rows_without_quotation_marks_are_those_of_the_parser_of_quoted_ones(
            text in "[tu,; \n\r0-9.\\-x]{0,80}",
            last in any::<bool>(),
            omits in any::<bool>(),
        ) {
            for delimiter in [b',', b';'] {
                let format = Format { delimiter, decimal_comma: false, end_of_line: b'\n', width: 3, needed: 2, omits };
                let rows = |quoted: bool| {
                    let chunk = Chunk { bytes: Vec::new(), last, endless: None };
                    let mut rows = Rows::of(&chunk, &format, &[Kind::Unknown; 3]);
                    let read = if quoted {
                        rows.quoted(text.as_bytes(), last, &format)
                    } else {
                        rows.plain(&text, last, &format)
                    };
                    // A row with a defect may have pushed some of its cells.
                    let whole = rows.lines.len();
                    rows.columns.iter_mut().for_each(|column| column.values.truncate(whole));
                    rows.defect = read.err();
                    format!("{rows:?}")
                };
                prop_assert_eq!(rows(false), rows(true));
            }
        }
    }
}
