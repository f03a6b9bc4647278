//! A table in a sheet: a row of names, perhaps one of units, and rows of numbers.

use std::io::Read;

use super::rows::{Cell, Row, Rows};
use super::xml::Stop;
use crate::formats::columns::{clock, looks_like_unit, split_unit, stamp, time_name};
use crate::formats::time::iso_stamp;
use crate::sink::{Clock, Field, Sink, Summary, Topic};

/// Rows that decide which columns hold numbers.
const FIRST_ROWS: usize = 50;
/// Rows in which the names are looked for.
const HIGHEST_HEADER: u64 = 1000;

/// Where the stamps come from.
#[derive(Clone, Copy, Debug, Default)]
enum Time {
    /// A column of dates or of texts with a date.
    Dates(usize),
    /// A column of numbers in units of nanoseconds.
    Numbers(usize, i64),
    #[default]
    Rows,
}

/// A sheet while it is read.
#[derive(Default)]
pub(super) struct Table<'a> {
    name: &'a str,
    id: usize,
    /// Names and units that may be those of the table.
    names: Vec<Option<(String, Option<String>)>>,
    confirmed: bool,
    first: Vec<Row>,
    time: Time,
    columns: Vec<usize>,
    values: Vec<f64>,
    lines: u64,
    given: i64,
    untimed: u64,
    stated: bool,
    wanted: bool,
}

impl<'a> Table<'a> {
    pub(super) fn new(name: &'a str, id: usize) -> Self {
        Self { name, id, ..Self::default() }
    }

    /// Rows of the sheet that were read.
    pub(super) fn lines(&self) -> u64 {
        self.lines
    }

    pub(super) fn is_stated(&self) -> bool {
        self.stated
    }

    /// Takes the next row; false if no more are wanted.
    pub(super) fn add(&mut self, row: &mut Row, sink: &mut dyn Sink) -> bool {
        self.lines += 1;
        if self.stated {
            self.give(row, sink);
            return self.wanted;
        }
        if !self.confirmed && !self.is_below(row) {
            self.name_columns(row);
            return self.lines < HIGHEST_HEADER;
        }
        self.confirmed = true;
        self.first.push(std::mem::take(row));
        if self.first.len() == FIRST_ROWS {
            self.start(sink);
            return self.wanted;
        }
        true
    }

    /// The sheet has ended: the rows so far are given, and the checksum is compared.
    pub(super) fn finish<R: Read>(
        &mut self,
        rows: &mut Rows<'_, R>,
        sink: &mut dyn Sink,
    ) -> Result<(), Stop> {
        self.start(sink);
        rows.finish()
    }

    /// Whether a row has a number below a name.
    fn is_below(&self, row: &Row) -> bool {
        let number = |cell: &Cell| matches!(cell, Cell::Number(_) | Cell::Date(_) | Cell::Time(_));
        self.names.iter().zip(&row.cells).any(|(name, cell)| name.is_some() && number(cell))
    }

    /// A row of texts has names, or the units of the names above. A row with fewer texts than there are names is a remark.
    fn name_columns(&mut self, row: &Row) {
        let filled = row.cells.iter().filter(|cell| **cell != Cell::Empty).count();
        let texts: Vec<Option<&str>> = (0..row.cells.len()).map(|column| row.text(column)).collect();
        let count = texts.iter().flatten().count();
        let named = self.names.iter().flatten().count();
        if named > 0 && count == filled && texts.iter().flatten().all(|text| looks_like_unit(text)) {
            for (name, unit) in self.names.iter_mut().zip(&texts) {
                if let (Some((_, known)), Some(unit)) = (name, unit) {
                    let unit = unit.trim().trim_matches(['[', ']', '(', ')']).trim();
                    *known = known.take().or_else(|| (!matches!(unit, "-" | "")).then(|| unit.to_owned()));
                }
            }
        } else if 2 * count > filled && count >= named {
            self.names = texts.iter().map(|text| text.map(split_unit)).collect();
        }
    }

    /// States the topic and gives the first rows.
    pub(super) fn start(&mut self, sink: &mut dyn Sink) {
        if self.stated || self.first.is_empty() {
            return;
        }
        let rows = std::mem::take(&mut self.first);
        let cells =
            |column: usize| rows.iter().map(move |row| row.cell(column)).filter(|cell| **cell != Cell::Empty);
        let is_date = |column: usize| {
            cells(column).next().is_some()
                && rows.iter().all(|row| match row.cell(column) {
                    Cell::Date(_) | Cell::Empty => true,
                    Cell::Text(_) => row.text(column).and_then(iso_stamp).is_some(),
                    Cell::Number(_) | Cell::Time(_) => false,
                })
        };
        let named: Vec<usize> =
            (0..self.names.len()).filter(|column| self.names[*column].is_some()).collect();
        let name = |column: usize| self.names[column].as_ref().map_or("", |(name, _)| name);
        let unit = |column: usize| self.names[column].as_ref().and_then(|(_, unit)| unit.as_deref());
        let times: Vec<usize> =
            named.iter().copied().filter(|column| time_name(name(*column)).is_some()).collect();
        let mut found = Clock::None;
        // A day that is the same in all rows is not a time.
        let changes = |column: usize| {
            let stamp = |row| stamp_of(row, column);
            rows.len() == 1 || rows.iter().map(stamp).any(|other| other != stamp(&rows[0]))
        };
        let date = times.iter().chain(&named).copied().find(|column| is_date(*column) && changes(*column));
        if let Some(column) = date {
            (self.time, found) = (Time::Dates(column), Clock::Utc);
        } else if let Some(column) =
            times.iter().copied().find(|column| cells(*column).any(|cell| number(cell).is_some()))
        {
            let first = cells(column).find_map(number);
            let of_type = matches!(cells(column).next(), Some(Cell::Time(_))).then_some("s");
            let (ns, clock) = clock(first, of_type.or(unit(column)), name(column));
            (self.time, found) = (Time::Numbers(column, ns), clock);
        }
        let mut topic = Topic {
            name: self.name.to_owned(),
            type_name: String::new(),
            clock: found,
            fields: Vec::new(),
            texts: Vec::new(),
        };
        for column in named {
            let is_text = |cell: &Cell| matches!(cell, Cell::Text(_));
            if date == Some(column) {
                continue;
            }
            if cells(column).next().is_some() && cells(column).all(is_text) {
                let text = rows.iter().find_map(|row| row.text(column)).unwrap_or_default();
                topic.texts.push((name(column).to_owned(), text.chars().take(256).collect()));
                continue;
            }
            let seconds = cells(column).any(|cell| matches!(cell, Cell::Date(_) | Cell::Time(_)));
            let unit = unit(column).or(seconds.then_some("s")).map(str::to_owned);
            topic.fields.push(Field { name: name(column).to_owned(), unit });
            self.columns.push(column);
        }
        self.stated = true;
        self.wanted = sink.topic(self.id, &topic);
        for row in &rows {
            self.give(row, sink);
        }
    }

    fn give(&mut self, row: &Row, sink: &mut dyn Sink) {
        if !self.wanted || row.cells.iter().all(|cell| *cell == Cell::Empty) {
            return;
        }
        let stamp = match self.time {
            Time::Dates(column) => stamp_of(row, column),
            Time::Numbers(column, ns) => number(row.cell(column)).and_then(|value| stamp(value, ns)),
            Time::Rows => Some(self.given),
        };
        self.given += 1;
        let Some(stamp) = stamp else {
            self.untimed += 1;
            return;
        };
        self.values.clear();
        let value = |column: &usize| number(row.cell(*column)).unwrap_or(f64::NAN);
        self.values.extend(self.columns.iter().map(value));
        sink.row(self.id, stamp, None, &self.values);
    }

    pub(super) fn note(&self, summary: &mut Summary) {
        if !self.stated {
            summary.note(format!("sheet '{}' has no row of names with numbers below", self.name));
        }
        if self.untimed > 0 {
            summary.note(format!(
                "sheet '{}': {} rows have no time; they are left out",
                self.name, self.untimed
            ));
        }
    }
}

/// Stamp in a column of dates.
fn stamp_of(row: &Row, column: usize) -> Option<i64> {
    match row.cell(column) {
        Cell::Date(ns) => Some(*ns),
        Cell::Text(_) => row.text(column).and_then(iso_stamp),
        _ => None,
    }
}

/// Number in a cell; that of a date is in seconds since 1970.
fn number(cell: &Cell) -> Option<f64> {
    match cell {
        Cell::Number(number) | Cell::Time(number) => Some(*number),
        Cell::Date(ns) => Some(*ns as f64 / 1e9),
        Cell::Empty | Cell::Text(_) => None,
    }
}
