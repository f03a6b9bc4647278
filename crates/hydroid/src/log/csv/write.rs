//! CSV files of numbers.

use std::borrow::Cow;
use std::fmt;
use std::io::{self, BufWriter, Write};

use super::{RawColumn, RawLog};
use crate::log::trajectory::Channel;

/// A table of numbers with a channel for each column.
pub(crate) trait Rows {
    fn channels(&self) -> Vec<Channel>;
    fn len(&self) -> usize;
    /// Appends the values of row `k`.
    fn row(&self, k: usize, values: &mut Vec<f64>);

    /// Writes the table as CSV. Numbers are the shortest that read back exactly.
    fn write(&self, writer: impl Write) -> io::Result<()> {
        let mut out = BufWriter::with_capacity(1 << 16, writer);
        let headings: Vec<String> = self.channels().iter().map(|c| quoted(&c.heading("")).into()).collect();
        writeln!(out, "{}", headings.join(","))?;
        let mut values = Vec::with_capacity(headings.len());
        for k in 0..self.len() {
            values.clear();
            self.row(k, &mut values);
            for (c, value) in values.iter().enumerate() {
                write!(out, "{}{}", if c > 0 { "," } else { "" }, Shortest(*value))?;
            }
            writeln!(out)?;
        }
        out.flush()
    }

    /// The table as a log that is equal to the one which is read from its file.
    fn log(&self, name: &str) -> RawLog {
        let column = |Channel { name, unit }| RawColumn {
            name,
            unit: (!unit.is_empty()).then_some(unit),
            values: Vec::with_capacity(self.len()),
            ..RawColumn::default()
        };
        let mut columns: Vec<RawColumn> = self.channels().into_iter().map(column).collect();
        let mut values = Vec::with_capacity(columns.len());
        for k in 0..self.len() {
            values.clear();
            self.row(k, &mut values);
            columns.iter_mut().zip(&values).for_each(|(column, value)| column.values.push(*value));
        }
        // The first line is the header.
        let lines = (2..self.len() as u64 + 2).collect();
        RawLog { lines, ..RawLog::without_rows(name, columns) }
    }
}

impl Rows for RawLog {
    fn channels(&self) -> Vec<Channel> {
        let channel = |c: &RawColumn| Channel::new(c.name.as_str(), c.unit.as_deref().unwrap_or_default());
        self.columns.iter().map(channel).collect()
    }

    fn len(&self) -> usize {
        self.rows()
    }

    fn row(&self, k: usize, values: &mut Vec<f64>) {
        // Values of some columns may have been left out.
        values.extend(self.columns.iter().map(|c| c.values.get(k).copied().unwrap_or(f64::NAN)));
    }
}

impl RawLog {
    /// Writes the log as CSV, in its units. Missing values are `NaN`, and so is a cell that was no number.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_csv(&self, writer: impl Write) -> io::Result<()> {
        self.write(writer)
    }
}

/// A cell of a header.
fn quoted(text: &str) -> Cow<'_, str> {
    if text.contains([',', ';', '\t', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\"")).into()
    } else {
        text.into()
    }
}

/// Shortest decimal that reads back exactly, with an exponent for very small numbers.
pub(crate) struct Shortest(pub(crate) f64);

impl fmt::Display for Shortest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0;
        if value == 0.0 || (1e-5..1e16).contains(&value.abs()) {
            value.fmt(f)
        } else {
            fmt::LowerExp::fmt(&value, f)
        }
    }
}
