//! Reader of CSV files: named columns of numbers with their line numbers in the file.
//!
//! A cell that is not a number is stored ([`RawColumn::bad`]) and reported only if its column is selected.
//!
//! The reader accepts commas, semicolons and tabs as separators (detected in the header), quotes, a byte order
//! mark, line ends of every system, spaces around cells, a decimal comma if the separator is not a comma,
//! a `#` before the header, title lines without a separator above it, and ISO 8601 time stamps. If the first row ends before the
//! last named column, rows may omit their last cells. Blank, `NaN`, `NA`, `null` and `-` are missing.
//!
//! The file is read in parts of whole records ([`chunks`]). The parts are parsed on all cores ([`rows`]) while the next
//! ones are read, and appended in order ([`assemble`]). The text is never in memory as a whole, and the result does not
//! depend on the size of the parts.

mod assemble;
mod cell;
mod chunks;
mod header;
mod rows;
mod write;

use std::io::{ErrorKind, Read};
use std::path::Path;

use hydroid_io::{LogFile, Stream};

use super::error::LogError;
use super::lines::Lines;
use super::summary::{PairSummary, Summary};

pub use cell::{Cell, number};
pub use header::{delimiter, header_columns, name_the_nameless};
pub(crate) use write::{Rows, Shortest};

/// The columns of a log file before selection.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawLog {
    /// Path of the file as given.
    pub path: String,
    /// Columns in the order of the file.
    pub columns: Vec<RawColumn>,
    /// Line of each row in the file, from 1, header and skipped lines included.
    pub lines: Lines,
    /// Rows that end before the last named column; the cells that they lack are missing.
    pub short: ShortRows,
    /// What is known of columns whose values were left out.
    pub(super) rest: Rest,
}

/// Rows that end before the last named column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShortRows {
    /// Line of the first one in the file, from 1; 0 without one.
    pub first: u64,
    /// Number of these rows.
    pub count: u64,
}

impl ShortRows {
    /// Adds those of a part behind `before` lines.
    fn add(&mut self, part: Self, before: u64) {
        if self.count == 0 && part.count > 0 {
            self.first = before + part.first;
        }
        self.count += part.count;
    }
}

/// One column of a log file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawColumn {
    /// Name from the header, without the unit.
    pub name: String,
    /// Unit from the header (`name [unit]`).
    pub unit: Option<String>,
    /// One value per row in the unit of the file; NaN without a finite number. Stamps are seconds since 1970 (UTC), and times of day since the first midnight.
    /// Empty if the values were left out.
    pub values: Vec<f64>,
    /// The first cell that is neither blank nor a finite number.
    pub bad: Option<BadCell>,
    /// Number of cells that are neither blank nor a finite number.
    pub bad_cells: usize,
    /// The first cell of a column of time stamps.
    pub stamps: Option<FirstStamp>,
    /// Statistics of a column whose values were left out.
    pub(super) left_out: Option<Summary>,
}

/// Relations between columns, of which the values of at least one were left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rest {
    /// For each row, whether the left-out columns have the same values as in the row before; empty without such columns.
    pub(super) repeats: Vec<bool>,
    /// Pairs of columns that are compared.
    pub(super) pairs: Vec<(usize, usize, PairSummary)>,
}

/// Columns of which the values are kept, and pairs that are compared. It is decided from the header.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    pub(super) keep: Vec<bool>,
    pub(super) pairs: Vec<(usize, usize)>,
}

/// The first cell of a column of time stamps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FirstStamp {
    /// Line in the file, from 1.
    pub line: u64,
    /// Text of the cell.
    pub text: String,
    /// Whether the stamp has a date; without one, it is a time of day.
    pub dated: bool,
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
    /// A log without rows.
    #[doc(hidden)]
    pub fn without_rows(path: &str, columns: Vec<RawColumn>) -> Self {
        Self { path: path.to_owned(), columns, ..Self::default() }
    }

    /// A log of columns in memory, all with the same number of values. Rows count as lines from 1. Infinite values become
    /// missing and are reported where their column is selected, as those of a file.
    ///
    /// # Errors
    /// If there is no row, or the columns have different lengths.
    pub fn from_columns(name: &str, mut columns: Vec<RawColumn>) -> Result<Self, LogError> {
        let rows = columns.first().map_or(0, |column| column.values.len());
        if rows == 0 {
            return Err(LogError::HeaderOnly { path: name.to_owned() });
        }
        if let Some(other) = columns.iter().find(|column| column.values.len() != rows) {
            return Err(LogError::DifferentLengths {
                path: name.to_owned(),
                first: columns[0].name.clone(),
                expected: rows,
                column: other.name.clone(),
                found: other.values.len(),
            });
        }
        for column in &mut columns {
            for (k, value) in column.values.iter_mut().enumerate().filter(|(_, value)| value.is_infinite()) {
                let text = value.to_string();
                column.bad_cells += 1;
                column.bad.get_or_insert(BadCell { line: k as u64 + 1, text, infinite: true });
                *value = f64::NAN;
            }
        }
        let lines = (1..=rows as u64).collect();
        Ok(Self { path: name.to_owned(), columns, lines, ..Self::default() })
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.lines.len()
    }

    /// Leaves the rows that are used.
    pub(super) fn retain(&mut self, rows: &[bool]) {
        for column in &mut self.columns {
            let mut used = rows.iter();
            column.values.retain(|_| used.next() == Some(&true));
        }
        self.lines = self.lines.of(rows);
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

impl RawColumn {
    /// A column without rows.
    pub fn named(name: &str) -> Self {
        Self { name: name.to_owned(), ..Self::default() }
    }

    /// A column of values.
    pub(crate) fn of(name: &str, unit: Option<&str>, values: Vec<f64>) -> Self {
        Self { name: name.to_owned(), unit: unit.map(str::to_owned), values, ..Self::default() }
    }

    /// Whether most of the rows have a stamp.
    pub(crate) fn is_mostly_stamps(&self) -> bool {
        self.stamps.is_some() && 2 * self.values.iter().filter(|x| !x.is_nan()).count() > self.values.len()
    }

    /// Whether the values were left out.
    pub(super) fn is_left_out(&self) -> bool {
        self.left_out.is_some()
    }

    pub(crate) fn has_values(&self) -> bool {
        match &self.left_out {
            Some(summary) => summary.first.is_some(),
            None => self.values.iter().any(|x| !x.is_nan()),
        }
    }
}

/// Reads the log in a file.
///
/// # Errors
/// If the file cannot be read or is not a table with a header; see [`LogError`].
pub fn read(source: impl Into<LogFile>) -> Result<RawLog, LogError> {
    read_planned(&source.into(), |_| None)
}

/// Reads the log in a file without the values of some columns, which `plan` decides from the header; `None` keeps all.
pub(super) fn read_planned(
    source: &LogFile,
    plan: impl FnOnce(&RawLog) -> Option<Plan>,
) -> Result<RawLog, LogError> {
    assemble::read(open(source)?, &source.name(), chunks::CHUNK, plan)
}

fn open(source: &LogFile) -> Result<Stream, LogError> {
    if source.is_folder() {
        return Err(LogError::IsDirectory { path: source.name() });
    }
    source.open().map_err(|error| failed(source.name(), error))
}

fn failed(path: String, source: std::io::Error) -> LogError {
    match source.kind() {
        ErrorKind::NotFound => LogError::NotFound { path },
        ErrorKind::IsADirectory => LogError::IsDirectory { path },
        _ => LogError::Read { path, source },
    }
}

/// The bytes of a file.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, LogError> {
    let mut bytes = Vec::new();
    let read = open(&path.into())?.read_to_end(&mut bytes);
    read.map_err(|source| failed(path.display().to_string(), source))?;
    Ok(bytes)
}

/// Reads a log from any reader; `name` is the file name in messages.
///
/// # Errors
/// As [`read`].
pub fn read_from(reader: impl Read + Send, name: &str) -> Result<RawLog, LogError> {
    assemble::read(reader, name, chunks::CHUNK, |_| None)
}

pub(crate) use header::name_and_unit;

#[cfg(test)]
mod tests;
