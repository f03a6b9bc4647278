//! Rows of a sheet: ECMA-376 part 1, section 18.3.1 (`row`, `c`).

use std::io::Read;
use std::ops::Range;

use super::book::{Book, Style};
use super::xml::{Step, Stop, Xml};

/// Columns of a sheet; the format has no more.
pub(super) const MOST_COLUMNS: usize = 16_384;
/// Bytes of texts of a row.
const MOST_TEXT: usize = 4 << 20;

/// Content of a cell.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell {
    Empty,
    Number(f64),
    /// Stamp \[ns\].
    Date(i64),
    /// Time of the day or duration \[s\].
    Time(f64),
    /// Place in the texts of the row.
    Text(Range<usize>),
}

/// A row.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    pub(super) cells: Vec<Cell>,
    texts: String,
}

impl Row {
    pub(super) fn text(&self, column: usize) -> Option<&str> {
        let Some(Cell::Text(place)) = self.cells.get(column) else { return None };
        self.texts.get(place.clone())
    }

    pub(super) fn cell(&self, column: usize) -> &Cell {
        self.cells.get(column).unwrap_or(&Cell::Empty)
    }
}

/// Type of a cell (section 18.18.11).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Number,
    Shared,
    Text,
    Truth,
    Error,
}

/// The rows of a sheet, one by one.
pub(super) struct Rows<'a, R: Read> {
    xml: Xml<R>,
    book: &'a Book,
    /// Column of the next cell that states none.
    column: usize,
    style: Style,
    kind: Kind,
    value: String,
    in_value: bool,
}

impl<'a, R: Read> Rows<'a, R> {
    pub(super) fn new(xml: Xml<R>, book: &'a Book) -> Self {
        Self {
            xml,
            book,
            column: 0,
            style: Style::Number,
            kind: Kind::Number,
            value: String::new(),
            in_value: false,
        }
    }

    /// The next row that is in the file; false at the end of the sheet.
    pub(super) fn next(&mut self, row: &mut Row) -> Result<bool, Stop> {
        row.cells.clear();
        row.texts.clear();
        let mut in_phonetic = false;
        loop {
            let (column, style, kind) = (&mut self.column, &mut self.style, &mut self.kind);
            let (value, in_value, book) = (&mut self.value, &mut self.in_value, self.book);
            let end = self.xml.next(|step| {
                match step {
                    Step::Open(tag, closed) => match tag.local_name().as_ref() {
                        "row" => {
                            *column = 0;
                            return closed.then_some(true);
                        }
                        "c" => {
                            (*style, *kind) = (Style::Number, Kind::Number);
                            value.clear();
                            for known in tag.attributes().with_checks(false).flatten() {
                                match known.key.as_ref() {
                                    "r" => *column = letters(&known.value).unwrap_or(*column),
                                    "s" => *style = style_of(book, &known.value),
                                    "t" => *kind = kind_of(&known.value),
                                    _ => {}
                                }
                            }
                            if closed {
                                *column += 1;
                            }
                        }
                        "v" | "t" => *in_value = !closed && !in_phonetic,
                        "rPh" => in_phonetic = !closed,
                        _ => {}
                    },
                    Step::Text(text) if *in_value && value.len() + text.len() <= MOST_TEXT => {
                        value.push_str(text);
                    }
                    Step::Text(_) => {}
                    Step::Close(name) => match name {
                        b"c" => {
                            if *column < MOST_COLUMNS {
                                set(row, *column, book, *style, *kind, value);
                            }
                            *column += 1;
                        }
                        b"v" | b"t" => *in_value = false,
                        b"rPh" => in_phonetic = false,
                        b"row" => return Some(true),
                        b"sheetData" => return Some(false),
                        _ => {}
                    },
                    Step::End => return Some(false),
                }
                None
            })?;
            if let Some(more) = end {
                return Ok(more);
            }
        }
    }

    /// Reads what is behind the rows: the checksum is that of the whole part.
    pub(super) fn finish(&mut self) -> Result<(), Stop> {
        while !self.xml.next(|step| matches!(step, Step::End))? {}
        Ok(())
    }
}

/// Column of a place such as `AB12`.
fn letters(place: &str) -> Option<usize> {
    let letters = place.bytes().take_while(u8::is_ascii_alphabetic).take(4);
    let number =
        letters.fold(0, |number, letter| number * 26 + usize::from(letter.to_ascii_uppercase() - b'A') + 1);
    number.checked_sub(1)
}

fn style_of(book: &Book, number: &str) -> Style {
    let style = number.parse().ok().and_then(|number: usize| book.styles.get(number));
    style.copied().unwrap_or(Style::Number)
}

fn kind_of(name: &str) -> Kind {
    match name {
        "s" => Kind::Shared,
        "str" | "inlineStr" | "d" => Kind::Text,
        "b" => Kind::Truth,
        "e" => Kind::Error,
        _ => Kind::Number,
    }
}

fn set(row: &mut Row, column: usize, book: &Book, style: Style, kind: Kind, value: &str) {
    let mut add = |text: &str| {
        let start = row.texts.len();
        if text.is_empty() || start + text.len() > MOST_TEXT {
            return Cell::Empty;
        }
        row.texts.push_str(text);
        Cell::Text(start..row.texts.len())
    };
    let cell = match kind {
        Kind::Text => add(value),
        Kind::Shared => add(value.trim().parse().ok().and_then(|i| book.strings.get(i)).unwrap_or_default()),
        Kind::Error => Cell::Number(f64::NAN),
        Kind::Truth | Kind::Number => match (value.trim().parse::<f64>(), style) {
            (Err(_), _) => Cell::Empty,
            (Ok(number), Style::Time) if kind == Kind::Number => Cell::Time((number * DAY).round() / 1e5),
            (Ok(number), Style::Date) if kind == Kind::Number => date(number, book.since_1904),
            (Ok(number), _) => Cell::Number(number),
        },
    };
    if cell != Cell::Empty {
        if row.cells.len() <= column {
            row.cells.resize(column + 1, Cell::Empty);
        }
        row.cells[column] = cell;
    }
}

/// Units of time in a day. A date of this century is written with 16 digits at most, which hold it to a few
/// microseconds, so it is rounded to 10.
const DAY: f64 = 86_400e5;

/// Stamp of a number of days (section 18.17.4.1).
fn date(days: f64, since_1904: bool) -> Cell {
    let days = days - if since_1904 { 24_107.0 } else { 25_569.0 };
    let units = (days.fract() * DAY).round() + days.trunc() * DAY;
    if units.abs() < 9.2e14 {
        #[allow(clippy::cast_possible_truncation, reason = "the range is checked")]
        return Cell::Date(units as i64 * 10_000);
    }
    Cell::Number(f64::NAN)
}
