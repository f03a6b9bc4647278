//! Logs as files.

use std::io::{self, Write};
use std::path::Path;

use hydroid_io::{Field, write_parquet};

use super::csv::RawLog;

/// Format of a log that is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// CSV, with units in the header: `u [m/s]`.
    Csv,
    /// Parquet, with units in the metadata of the columns.
    Parquet,
}

impl TableFormat {
    /// The format that the extension of a file names: `.csv` or `.parquet`.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        [("csv", Self::Csv), ("parquet", Self::Parquet)]
            .into_iter()
            .find_map(|(name, format)| extension.eq_ignore_ascii_case(name).then_some(format))
    }
}

impl RawLog {
    /// Writes the log as [`write_csv`](Self::write_csv) or [`write_parquet`](Self::write_parquet) do.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_as(&self, format: TableFormat, writer: impl Write) -> io::Result<()> {
        match format {
            TableFormat::Csv => self.write_csv(writer),
            TableFormat::Parquet => self.write_parquet(writer),
        }
    }

    /// Writes the log as Parquet, in its units. Missing values are null, and so is a cell that was no number.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_parquet(&self, writer: impl Write) -> io::Result<()> {
        let columns: Vec<(Field, &[f64])> = self
            .columns
            .iter()
            .map(|c| (Field { name: c.name.clone(), unit: c.unit.clone() }, c.values.as_slice()))
            .collect();
        write_parquet(&columns, writer)
    }
}
