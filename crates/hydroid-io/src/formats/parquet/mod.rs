//! Parquet: Apache Parquet format 2.11, with the units that Apache Arrow adds. Reader; `write` is the writer.
//!
//! A file is one topic. Its columns are read in step, a page of each in memory. A damaged page makes its values NaN.

mod arrow;
mod codec;
mod column;
mod encoding;
mod footer;
mod page;
mod thrift;
mod write;

use std::collections::HashMap;
use std::path::Path;

use self::codec::Codecs;
use self::column::{Cells, Column, Shared};
use self::footer::{Footer, Group, Leaf, Meaning, Physical};
use super::columns::{clock, split_unit, stamp, time_name};
use crate::error::IoError;
use crate::input::Input;
use crate::sink::{Clock, Field, Sink, Summary, Topic};

pub use write::write_parquet;

/// Memory for the pages of all columns. A buffer may take twice of what is in it.
const MEMORY: usize = 400 << 20;
const MOST_COLUMNS: usize = 16_384;
const MOST_TEXTS: usize = 64;
/// Rows for each byte of the file. A page of one value that is repeated has a few hundred.
const MOST_ROWS_PER_BYTE: u64 = 4096;

/// Where the stamps come from.
#[derive(Clone, Copy, Debug)]
enum Time {
    /// A column of stamps in units of nanoseconds.
    Stamps { column: usize, ns: i64 },
    /// A column of numbers in units of nanoseconds.
    Numbers { column: usize, ns: i64 },
    /// Number of the row.
    Rows,
}

pub(crate) fn scan(input: &mut Input, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let bytes = footer::load(input)?;
    let mut footer = Footer::parse(&bytes).map_err(|reason| {
        input.damaged(format!("the footer is damaged: {reason}"), "write the file again")
    })?;
    let name = Path::new(input.path()).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let mut shared = Shared {
        codecs: Codecs::new(input.length()),
        input,
        summary: Summary::default(),
        block: 256 << 10,
        memory: MEMORY,
        done: 0,
    };
    let (texts, mut columns): (Vec<Leaf>, Vec<Leaf>) =
        std::mem::take(&mut footer.leaves).into_iter().partition(|leaf| leaf.physical == Physical::Bytes);
    for name in &footer.left_out {
        shared
            .summary
            .note(format!("column '{name}' is left out: it is nested, or of a type that is not a number"));
    }
    if columns.len() > MOST_COLUMNS {
        shared.summary.note(format!("columns behind the first {MOST_COLUMNS} are left out"));
        columns.truncate(MOST_COLUMNS);
    }
    shared.block = ((128 << 20) / columns.len().max(1)).clamp(8 << 10, shared.block);

    let units: HashMap<String, String> =
        footer.arrow.map(arrow::units).unwrap_or_default().into_iter().rev().collect();
    let mut fields: Vec<Field> = columns.iter().map(|leaf| field(leaf, &units)).collect();
    let (time, clock) = find_time(&mut shared, &footer, &columns, &fields)?;
    if let Time::Stamps { column, .. } = time {
        fields.remove(column);
        if !matches!(columns[column].meaning, Meaning::Stamp { utc: true, .. }) {
            shared.summary.note("the stamps have no time zone; they are taken for UTC");
        }
    }
    let mut topic =
        Topic { name: name.unwrap_or_default(), type_name: String::new(), clock, fields, texts: Vec::new() };
    for (i, leaf) in texts.iter().enumerate() {
        let first = if i < MOST_TEXTS { first_text(&mut shared, &footer, leaf)? } else { None };
        topic.texts.extend(first.map(|text| (leaf.name.clone(), text)));
        shared.summary.note(format!("column '{}' is left out: it holds texts", leaf.name));
    }
    if sink.topic(0, &topic) {
        Table { shared: &mut shared, columns: &columns, time, sink, row: 0, untimed: 0 }.read(&mut footer)?;
    }
    Ok(shared.summary)
}

/// Name and unit of a column: that of the metadata, of the name, or of the type.
fn field(leaf: &Leaf, units: &HashMap<String, String>) -> Field {
    let (name, in_name) = split_unit(&leaf.name);
    let stated = units.get(&leaf.name).cloned();
    let of_type = match leaf.meaning {
        Meaning::Stamp { .. } => Some("s"),
        _ => leaf.unit,
    };
    match stated.or_else(|| of_type.map(str::to_owned)) {
        Some(unit) => {
            Field { name: if in_name.is_some() { name } else { leaf.name.clone() }, unit: Some(unit) }
        }
        None => Field { name, unit: in_name },
    }
}

fn find_time(
    shared: &mut Shared,
    footer: &Footer,
    columns: &[Leaf],
    fields: &[Field],
) -> Result<(Time, Clock), IoError> {
    let stamps = |leaf: &Leaf| matches!(leaf.meaning, Meaning::Stamp { .. });
    let named = |column: &usize| time_name(&fields[*column].name).is_some();
    let all = || (0..columns.len()).filter(|i| stamps(&columns[*i]));
    if let Some(column) = all().find(named).or_else(|| all().next())
        && let Meaning::Stamp { ns, .. } = columns[column].meaning
    {
        return Ok((Time::Stamps { column, ns }, Clock::Utc));
    }
    let Some(column) = (0..columns.len()).find(named) else {
        return Ok((Time::Rows, Clock::None));
    };
    let first = first_number(shared, footer, &columns[column])?;
    let (ns, clock) = clock(first, fields[column].unit.as_deref(), &fields[column].name);
    Ok((Time::Numbers { column, ns }, clock))
}

/// Tries the row groups of a column until one has a result. The summary is left as it was.
fn first<T>(
    shared: &mut Shared,
    footer: &Footer,
    leaf: &Leaf,
    mut look: impl FnMut(&mut Shared, &mut Column) -> Result<Option<T>, IoError>,
) -> Result<Option<T>, IoError> {
    const TRIES: usize = 16;
    let (kept, done) = (std::mem::take(&mut shared.summary), shared.done);
    let mut found = Ok(None);
    let mut groups = footer.groups();
    for _ in 0..TRIES {
        let Some(group) = groups.next_group() else { break };
        let Some(chunk) = group.ok().and_then(|group| group.chunks.get(leaf.index).copied()) else {
            continue;
        };
        let Ok(mut column) = Column::new(leaf, chunk, shared.input) else { continue };
        found = look(shared, &mut column);
        if !matches!(found, Ok(None)) {
            break;
        }
    }
    shared.summary = kept;
    shared.done = done;
    found
}

fn first_text(shared: &mut Shared, footer: &Footer, leaf: &Leaf) -> Result<Option<String>, IoError> {
    first(shared, footer, leaf, |shared, column| column.first_text(shared))
}

fn first_number(shared: &mut Shared, footer: &Footer, leaf: &Leaf) -> Result<Option<f64>, IoError> {
    let mut cells = Cells::default();
    first(shared, footer, leaf, |shared, column| {
        column.fill(shared, 1024, &mut cells)?;
        Ok((0..cells.bits.len()).map(|row| number(&cells, row, leaf)).find(|value| value.is_finite()))
    })
}

/// Value of a cell as a number.
fn number(cells: &Cells, row: usize, leaf: &Leaf) -> f64 {
    let bits = cells.bits[row];
    match (leaf.physical, leaf.meaning) {
        _ if !cells.present[row] => f64::NAN,
        (Physical::Float | Physical::Double, _) => f64::from_bits(bits),
        (_, Meaning::Stamp { ns, .. }) => bits.cast_signed() as f64 / (1e9 / ns as f64),
        (Physical::Int32, Meaning::Unsigned) => (bits & 0xffff_ffff) as f64,
        (_, Meaning::Unsigned) => bits as f64,
        _ => bits.cast_signed() as f64,
    }
}

/// Value of a cell of integers, without rounding; `None` if it is absent or exceeds `i64`.
fn integer(cells: &Cells, row: usize, leaf: &Leaf) -> Option<i64> {
    let bits = cells.bits[row];
    match (leaf.physical, leaf.meaning) {
        _ if !cells.present[row] => None,
        (Physical::Int32, Meaning::Unsigned) => i64::try_from(bits & 0xffff_ffff).ok(),
        (_, Meaning::Unsigned) => i64::try_from(bits).ok(),
        // A day of INT96 that is beyond the stamps becomes the first or the last of them.
        (Physical::Int96, _) => Some(bits.cast_signed()).filter(|ns| !matches!(*ns, i64::MIN | i64::MAX)),
        _ => Some(bits.cast_signed()),
    }
}

/// Rows of the file.
struct Table<'a, 'b> {
    shared: &'a mut Shared<'b>,
    columns: &'a [Leaf],
    time: Time,
    sink: &'a mut dyn Sink,
    row: u64,
    /// Rows without a stamp.
    untimed: u64,
}

impl Table<'_, '_> {
    fn read(&mut self, footer: &mut Footer) -> Result<(), IoError> {
        let mut left = self.shared.input.length().saturating_mul(MOST_ROWS_PER_BYTE);
        let mut number = 0_u64;
        let mut groups = footer.groups();
        while let Some(group) = groups.next_group() {
            match group {
                Ok(mut group) => {
                    if group.rows > left {
                        self.shared
                            .summary
                            .note("the file states more rows than it can hold; the last are left out");
                        group.rows = left;
                    }
                    left -= group.rows;
                    let end = self.row.saturating_add(group.rows);
                    self.group(&group)?;
                    self.row = end;
                }
                Err(reason) => {
                    let footer = self.shared.input.offset();
                    self.shared.summary.lose(footer, 0, &format!("row group {number}: {reason}"));
                }
            }
            number += 1;
        }
        if self.untimed > 0 {
            self.shared.summary.note(format!("{} rows have no time; they are left out", self.untimed));
        }
        Ok(())
    }

    fn group(&mut self, group: &Group) -> Result<(), IoError> {
        let mut columns = Vec::with_capacity(self.columns.len());
        for leaf in self.columns {
            // The group has a chunk of each column of the schema.
            let chunk = group.chunks.get(leaf.index).copied().unwrap_or_default();
            let column = Column::new(leaf, chunk, self.shared.input);
            if let Err(reason) = &column {
                let reason = format!("column '{}': {reason}", leaf.name);
                // The place is as the footer says, which may be outside of the file.
                let length = self.shared.input.length();
                let start = chunk.start.min(length);
                self.shared.summary.lose(start, chunk.length.min(length - start), &reason);
            }
            columns.push((column.ok(), Cells::default()));
        }
        let batch = (4_usize << 20).checked_div(columns.len()).unwrap_or(0).clamp(64, 2048);
        let mut held: usize = columns.iter().flat_map(|(column, _)| column).map(Column::held).sum();
        let mut values = Vec::with_capacity(self.columns.len());
        let mut left = group.rows;
        while left > 0 {
            let wanted = batch.min(usize::try_from(left).unwrap_or(batch));
            let mut found = 0;
            for (column, cells) in &mut columns {
                if let Some(column) = column {
                    held -= column.held();
                    self.shared.memory = MEMORY.saturating_sub(held);
                    column.fill(self.shared, wanted, cells)?;
                    held += column.held();
                    found = found.max(cells.bits.len());
                }
                // A column may be shorter than the others only if it is damaged.
                cells.resize(wanted);
            }
            if found == 0 {
                break;
            }
            self.give(&columns, found, &mut values);
            left -= found as u64;
            if !self
                .sink
                .proceed(self.shared.done.min(self.shared.input.length()), self.shared.input.length())
            {
                return Err(IoError::Interrupted);
            }
        }
        Ok(())
    }

    /// Gives rows to the sink.
    fn give(&mut self, columns: &[(Option<Column>, Cells)], rows: usize, values: &mut Vec<f64>) {
        let no_field = if let Time::Stamps { column, .. } = self.time { Some(column) } else { None };
        for row in 0..rows {
            let number_of_row = self.row;
            self.row += 1;
            let stamp = match self.time {
                Time::Rows => i64::try_from(number_of_row).ok(),
                Time::Stamps { column, ns } | Time::Numbers { column, ns } => {
                    let (leaf, cells) = (&self.columns[column], &columns[column].1);
                    match leaf.physical {
                        Physical::Int32 | Physical::Int64 | Physical::Int96 => {
                            integer(cells, row, leaf).and_then(|number| number.checked_mul(ns))
                        }
                        _ => stamp(number(cells, row, leaf), ns),
                    }
                }
            };
            let Some(stamp) = stamp else {
                self.untimed += 1;
                continue;
            };
            values.clear();
            for (i, (leaf, (_, cells))) in self.columns.iter().zip(columns).enumerate() {
                if Some(i) != no_field {
                    values.push(number(cells, row, leaf));
                }
            }
            self.sink.row(0, stamp, None, values);
        }
    }
}
