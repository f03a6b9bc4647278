//! Reader of CSV files: named columns of numbers with their line numbers in the file.
//!
//! A cell that is not a number is stored ([`RawColumn::bad`]) and reported only if its column is selected.
//!
//! The reader accepts commas, semicolons and tabs as separators (detected in the header), quotes, a byte order
//! mark, line ends of every system, spaces around cells, a decimal comma if the separator is not a comma,
//! a `#` before the header, and ISO 8601 time stamps. Blank, `NaN`, `NA`, `null` and `-` are missing.

use std::fs;
use std::io::{ErrorKind, Read};
use std::path::Path;

use super::error::LogError;
use super::stamp;
use super::units;

/// The columns of a log file before selection.
#[derive(Clone, Debug, PartialEq)]
pub struct RawLog {
    /// Path of the file as given.
    pub path: String,
    /// Columns in the order of the file.
    pub columns: Vec<RawColumn>,
    /// Line of each row in the file, from 1, header and skipped lines included.
    pub lines: Vec<u64>,
}

/// One column of a log file.
#[derive(Clone, Debug, PartialEq)]
pub struct RawColumn {
    /// Name from the header, without the unit.
    pub name: String,
    /// Unit from the header (`name [unit]`).
    pub unit: Option<String>,
    /// One value per row in the unit of the file; NaN without a finite number. Stamps are seconds since 1970 (UTC).
    pub values: Vec<f64>,
    /// The first cell that is neither blank nor a finite number.
    pub bad: Option<BadCell>,
    /// Number of cells that are neither blank nor a finite number.
    pub bad_cells: usize,
    /// The first cell of a column of time stamps.
    pub stamps: Option<FirstStamp>,
}

/// The first cell of a column of time stamps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FirstStamp {
    /// Line in the file, from 1.
    pub line: u64,
    /// Text of the cell.
    pub text: String,
    /// Whether the stamp contains a time zone; the default is UTC.
    pub zoned: bool,
}

/// A cell that is neither blank nor a finite number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadCell {
    /// Line in the file, from 1.
    pub line: u64,
    /// Beginning of the text of the cell.
    pub text: String,
    /// Whether the cell holds an infinite number.
    pub infinite: bool,
}

impl RawLog {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.lines.len()
    }

    /// Position of the column with exactly this name.
    pub fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c.name == name)
    }

    /// Name of the file without its folder.
    pub fn file_name(&self) -> String {
        Path::new(&self.path)
            .file_name()
            .map_or_else(|| self.path.clone(), |n| n.to_string_lossy().into_owned())
    }
}

/// Reads the log in a file.
///
/// # Errors
/// If the file cannot be read or is not a table with a header; see [`LogError`].
pub fn read(path: &Path) -> Result<RawLog, LogError> {
    parse(&bytes(path)?, &path.display().to_string())
}

/// The bytes of a file.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, LogError> {
    let name = path.display().to_string();
    let failed = |source: std::io::Error| match source.kind() {
        ErrorKind::NotFound => LogError::NotFound { path: name.clone() },
        ErrorKind::IsADirectory => LogError::IsDirectory { path: name.clone() },
        _ => LogError::Read { path: name.clone(), source },
    };
    if path.is_dir() {
        return Err(LogError::IsDirectory { path: name });
    }
    fs::read(path).map_err(failed)
}

/// Reads a log from any reader; `name` is the file name in messages.
///
/// # Errors
/// As [`read`].
pub fn read_from(mut reader: impl Read, name: &str) -> Result<RawLog, LogError> {
    let mut bytes = Vec::new();
    reader.read_to_end(&mut bytes).map_err(|source| LogError::Read { path: name.to_owned(), source })?;
    parse(&bytes, name)
}

fn parse(bytes: &[u8], name: &str) -> Result<RawLog, LogError> {
    let path = || name.to_owned();
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(LogError::NotUtf8 {
            path: path(),
            line: 1,
            remedy: "the encoding is UTF-16: save the file as `CSV UTF-8`",
        });
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if let Err(e) = std::str::from_utf8(bytes) {
        let before = &bytes[..e.valid_up_to()];
        let line = 1 + count(before, b'\n');
        let remedy = if bytes.contains(&0) {
            "the file does not seem to be CSV: export the log as CSV"
        } else {
            "save the file as `CSV UTF-8` (a degree sign or an umlaut from an old encoding is the usual cause)"
        };
        return Err(LogError::NotUtf8 { path: path(), line, remedy });
    }
    if bytes.iter().all(u8::is_ascii_whitespace) {
        return Err(LogError::Empty { path: path() });
    }
    check_lines(bytes, name)?;
    let delimiter = delimiter(bytes);
    let decimal_comma = delimiter != b',' && has_decimal_comma(bytes, delimiter);
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::None)
        .from_reader(bytes);
    let mut record = csv::ByteRecord::new();
    // A reader over bytes in memory cannot fail: ragged lines are allowed and no text is decoded.
    let mut next = |record: &mut csv::ByteRecord| {
        reader
            .read_byte_record(record)
            .map_err(|e| LogError::Read { path: name.to_owned(), source: std::io::Error::other(e) })
    };
    let header: Vec<String> = loop {
        if !next(&mut record)? {
            return Err(LogError::Empty { path: path() });
        }
        if record.iter().any(|c| !text(c).is_empty()) {
            break record.iter().map(|c| text(c).to_owned()).collect();
        }
    };
    let mut columns = header_columns(&header, name)?;
    // A row may end after the last named column.
    let needed = header.iter().rposition(|h| !h.is_empty()).map_or(0, |p| p + 1);
    let mut lines = Vec::new();
    let mut counter = LineCounter::new(bytes);
    let estimate = bytes.len() / (8 * columns.len().max(1));
    for c in &mut columns {
        c.values.reserve(estimate);
    }
    while next(&mut record)? {
        let line = counter.line_of(&record);
        let found = record.len();
        let extra = record.iter().skip(columns.len()).any(|c| !text(c).is_empty());
        if found < needed || extra {
            let at_end = !bytes.ends_with(b"\n") && !next(&mut csv::ByteRecord::new())?;
            return Err(if at_end && found < needed {
                LogError::Truncated { path: path(), line, found, expected: needed }
            } else {
                LogError::Ragged { path: path(), line, found, expected: needed }
            });
        }
        lines.push(line);
        for (i, column) in columns.iter_mut().enumerate() {
            column.push(record.get(i).unwrap_or_default(), line, decimal_comma);
        }
    }
    if lines.is_empty() {
        return Err(LogError::HeaderOnly { path: path() });
    }
    // A column without a name comes from a trailing separator or is an index written by a program.
    columns.retain(|c| !c.name.is_empty() || c.values.iter().any(|v| !v.is_nan()));
    name_the_nameless(&mut columns);
    Ok(RawLog { path: path(), columns, lines })
}

/// Longest line of a log \[bytes\]; a longer one is no table, and would be read into memory again.
const LONGEST_LINE: usize = 1 << 24;

fn check_lines(bytes: &[u8], name: &str) -> Result<(), LogError> {
    let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
    let (mut line, mut rest) = (1, bytes);
    loop {
        let len = rest.iter().position(is_end).unwrap_or(rest.len());
        if len > LONGEST_LINE {
            return Err(LogError::BadLine {
                path: name.to_owned(),
                line,
                reason: format!(
                    "{len} bytes without an end of line: the file is not a table; export the log as CSV"
                ),
            });
        }
        let after = &rest[len..];
        rest = match after.strip_prefix(b"\r\n").or_else(|| after.get(1..)) {
            Some(next) => next,
            None => return Ok(()),
        };
        line += 1;
    }
}

#[allow(
    clippy::naive_bytecount,
    reason = "each byte is counted once; a crate of its own would gain a millisecond"
)]
fn count(bytes: &[u8], byte: u8) -> u64 {
    bytes.iter().filter(|&&b| b == byte).count() as u64
}

/// Line numbers as in an editor. The position of a record from the parser includes the blank lines before it.
struct LineCounter<'a> {
    bytes: &'a [u8],
    end_of_line: u8,
    at: usize,
    line: u64,
}

impl<'a> LineCounter<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        let end_of_line = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
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

impl RawColumn {
    fn push(&mut self, cell: &[u8], line: u64, decimal_comma: bool) {
        let value = match number(text(cell), decimal_comma) {
            Cell::Number(x) if self.stamps.is_none() => x,
            Cell::Stamp(stamp) if self.takes_stamps() => {
                self.stamps.get_or_insert_with(|| FirstStamp {
                    line,
                    text: text(cell).to_owned(),
                    zoned: stamp.zoned,
                });
                stamp.seconds
            }
            Cell::Missing => f64::NAN,
            bad => {
                let infinite = matches!(bad, Cell::Bad { infinite: true });
                self.bad_cells += 1;
                if self.bad.is_none() {
                    self.bad = Some(BadCell { line, text: text(cell).chars().take(40).collect(), infinite });
                }
                f64::NAN
            }
        };
        self.values.push(value);
    }

    /// Whether all cells so far are time stamps; a column does not mix stamps and numbers.
    fn takes_stamps(&self) -> bool {
        self.stamps.is_some() || self.bad_cells == 0 && self.values.iter().all(|x| x.is_nan())
    }
}

/// Content of a cell.
pub enum Cell {
    /// A finite number.
    Number(f64),
    /// A time stamp.
    Stamp(stamp::Stamp),
    /// A missing value.
    Missing,
    /// Any other text.
    Bad {
        /// Whether the text is an infinite number.
        infinite: bool,
    },
}

/// Parses a trimmed cell.
pub fn number(cell: &str, decimal_comma: bool) -> Cell {
    if cell.is_empty() {
        return Cell::Missing;
    }
    let parsed = match cell.parse::<f64>() {
        Err(_) if decimal_comma && cell.bytes().filter(|&b| b == b',').count() == 1 => {
            cell.replace(',', ".").parse::<f64>()
        }
        other => other,
    };
    match parsed {
        Ok(x) if x.is_finite() => Cell::Number(x),
        Ok(x) if x.is_nan() => Cell::Missing,
        Ok(_) => Cell::Bad { infinite: true },
        Err(_) if is_missing(cell) => Cell::Missing,
        Err(_) if stamp::looks_like(cell) => {
            stamp::parse(cell).map_or(Cell::Bad { infinite: false }, Cell::Stamp)
        }
        Err(_) => Cell::Bad { infinite: false },
    }
}

fn is_missing(cell: &str) -> bool {
    cell == "-" || ["na", "n/a", "nan", "null", "none"].iter().any(|m| cell.eq_ignore_ascii_case(m))
}

/// Trims a cell. The file is valid UTF-8 and separators are ASCII.
fn text(cell: &[u8]) -> &str {
    std::str::from_utf8(cell.trim_ascii()).unwrap_or("\u{fffd}")
}

/// The most frequent separator in the first line, outside quotes.
pub fn delimiter(bytes: &[u8]) -> u8 {
    let mut counts = [(b',', 0_usize), (b';', 0), (b'\t', 0)];
    let mut quoted = false;
    for &b in bytes.trim_ascii_start().iter().take_while(|&&b| b != b'\n' && b != b'\r') {
        if b == b'"' {
            quoted = !quoted;
        } else if !quoted && let Some(c) = counts.iter_mut().find(|c| c.0 == b) {
            c.1 += 1;
        }
    }
    // A tie selects the first candidate, the comma.
    counts.iter().rev().max_by_key(|c| c.1).map_or(b',', |c| c.0)
}

/// Whether numbers have a decimal comma: the first rows contain cells like `1,5` and none like `1.5`.
fn has_decimal_comma(bytes: &[u8], delimiter: u8) -> bool {
    let rows = bytes.split(|&b| b == b'\n').skip(1).take(200);
    let mut comma = false;
    for cell in rows.flat_map(|row| row.split(|&b| b == delimiter)) {
        let cell = text(cell).trim_matches('"');
        if cell.contains('.') && cell.parse::<f64>().is_ok() {
            return false;
        }
        comma |= cell.contains(',') && cell.replacen(',', ".", 1).parse::<f64>().is_ok();
    }
    comma
}

/// Empty columns with the names and units of the header.
///
/// # Errors
/// If the line is no header, or two columns have the same name.
pub fn header_columns(header: &[String], path: &str) -> Result<Vec<RawColumn>, LogError> {
    if header.iter().all(|h| h.is_empty() || h.parse::<f64>().is_ok() || stamp::parse(h).is_some()) {
        let first_row =
            header.iter().take(4).map(|h| h.chars().take(20).collect()).collect::<Vec<String>>().join(", ");
        return Err(LogError::NoHeader { path: path.to_owned(), first_row });
    }
    let mut columns: Vec<RawColumn> = Vec::with_capacity(header.len());
    let mut seen = std::collections::HashMap::new();
    for (i, cell) in header.iter().enumerate() {
        let cell = if i == 0 { cell.trim_start_matches('#').trim_start() } else { cell };
        let (mut name, unit) = name_and_unit(cell);
        // `speed (kn)` beside `speed (km/h)` or `speed`: the unit distinguishes the names.
        let twin = |(j, other): (usize, &String)| j != i && name_and_unit(other).0 == name;
        if cell.ends_with(')') && unit.is_some() && header.iter().enumerate().any(twin) {
            name = cell.trim();
        }
        if !name.is_empty()
            && let Some(first) = seen.insert(name.to_owned(), i)
        {
            return Err(LogError::DuplicateColumn {
                path: path.to_owned(),
                name: name.to_owned(),
                first: first + 1,
                second: i + 1,
            });
        }
        columns.push(RawColumn {
            name: name.to_owned(),
            unit: unit.map(str::to_owned),
            values: Vec::new(),
            bad: None,
            bad_cells: 0,
            stamps: None,
        });
    }
    Ok(columns)
}

/// Names columns without a name by their number.
pub fn name_the_nameless(columns: &mut [RawColumn]) {
    for i in 0..columns.len() {
        if columns[i].name.is_empty() {
            let mut name = format!("column {}", i + 1);
            while columns.iter().any(|c| c.name == name) {
                name.push('\'');
            }
            columns[i].name = name;
        }
    }
}

/// Name and unit of `name [unit]` or `name (unit)`. A text in parentheses that is no known unit belongs to the name.
pub(crate) fn name_and_unit(cell: &str) -> (&str, Option<&str>) {
    let cell = cell.trim();
    if let Some(inner) = cell.strip_suffix(')')
        && let Some((name, unit)) = inner.rsplit_once('(')
        && !name.trim().is_empty()
        && units::is_unit_in_parentheses(unit)
    {
        return (name.trim(), Some(unit.trim()));
    }
    if let Some(inner) = cell.strip_suffix(']')
        && let Some((name, unit)) = inner.rsplit_once('[')
        && !name.trim().is_empty()
    {
        let unit = unit.trim();
        return (name.trim(), (!unit.is_empty()).then_some(unit));
    }
    (cell, None)
}
