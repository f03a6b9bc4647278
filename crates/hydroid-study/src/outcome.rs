//! Result of an experiment.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;

use hydroid_report::figure::Figure;

#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum Cell {
    Number(f64),
    Count(usize),
    Text(String),
    /// Missing: a dash on the page, empty in a file.
    Nothing,
}

impl From<f64> for Cell {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}

impl From<usize> for Cell {
    fn from(n: usize) -> Self {
        Self::Count(n)
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

/// A table; its headings contain the units in brackets.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Sheet {
    pub(super) name: String,
    pub(super) columns: Vec<String>,
    pub(super) rows: Vec<Vec<Cell>>,
}

impl Sheet {
    pub(super) fn new(name: impl Into<String>, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|column| (*column).to_owned()).collect();
        Self { name: name.into(), columns, rows: Vec::new() }
    }

    pub(super) fn row(&mut self, cells: Vec<Cell>) {
        self.rows.push(cells);
    }

    /// As CSV; text with commas is quoted.
    pub(super) fn csv(&self) -> String {
        let quoted = |text: &str| {
            if text.contains([',', '"', '\n']) {
                format!("\"{}\"", text.replace('"', "\"\""))
            } else {
                text.to_owned()
            }
        };
        let mut csv = self.columns.iter().map(|column| quoted(column)).collect::<Vec<_>>().join(",");
        csv.push('\n');
        for row in &self.rows {
            let cells = row.iter().map(|cell| match cell {
                Cell::Number(x) => x.to_string(),
                Cell::Count(n) => n.to_string(),
                Cell::Text(text) => quoted(text),
                Cell::Nothing => String::new(),
            });
            let _ = writeln!(csv, "{}", cells.collect::<Vec<_>>().join(","));
        }
        csv
    }
}

#[derive(Clone, Debug)]
pub(super) enum Picture {
    Chart(Box<Figure>),
    Drawing(String),
}

#[derive(Clone, Debug)]
pub(super) struct Shown {
    pub(super) name: String,
    pub(super) picture: Picture,
    pub(super) caption: String,
}

/// A table for the page, rounded to significant digits.
#[derive(Clone, Debug)]
pub(super) struct Tabled {
    pub(super) sheet: Sheet,
    pub(super) caption: String,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Outcome {
    pub(super) pictures: Vec<Shown>,
    pub(super) tables: Vec<Tabled>,
    /// All numbers of the pictures.
    pub(super) sheets: Vec<Sheet>,
    /// Measured values by name, for the claims.
    pub(super) measures: BTreeMap<String, f64>,
    /// Seeds and records of each measured value.
    pub(super) over: BTreeMap<String, String>,
    /// Seeds and records of the values that are measured next.
    pub(super) basis: String,
    /// Results in words by name, for the reasons of the claims.
    pub(super) words: BTreeMap<String, String>,
    pub(super) remarks: Vec<String>,
}

impl Outcome {
    pub(super) fn chart(&mut self, name: &str, figure: Figure, caption: impl Into<String>) {
        let picture = Picture::Chart(Box::new(figure));
        self.pictures.push(Shown { name: name.to_owned(), picture, caption: caption.into() });
    }

    pub(super) fn table(&mut self, sheet: Sheet, caption: impl Into<String>) {
        self.tables.push(Tabled { sheet, caption: caption.into() });
    }

    pub(super) fn measure(&mut self, name: &str, value: f64) {
        self.measures.insert(name.to_owned(), value);
        self.over.insert(name.to_owned(), self.basis.clone());
    }

    /// States the seeds and records of the values that are measured next.
    pub(super) fn basis(&mut self, seeds: usize, records: &[impl AsRef<str>]) {
        let seeds = if seeds == 1 { "1 seed".to_owned() } else { format!("{seeds} seeds") };
        let records: Vec<&str> = records.iter().map(AsRef::as_ref).collect();
        self.basis = match records[..] {
            [] => seeds,
            [one] => format!("{seeds}, record {one}"),
            _ => format!("{seeds}, {} records ({})", records.len(), records.join(", ")),
        };
    }
}
