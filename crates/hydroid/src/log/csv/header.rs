//! The header of a log, and the separators and decimals that its first rows show.

use super::super::error::LogError;
use super::super::{stamp, units};
use super::RawColumn;
use super::cell::text;

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

/// Lines in which a header is looked for.
const FIRST_LINES: usize = 50;

/// Length of the title lines above the header.
pub(super) fn title(bytes: &[u8]) -> usize {
    let begin = without_separators(bytes);
    begin + with_fewer_cells(&bytes[begin..])
}

/// Length of the lines above the lines with as many cells as the first row of numbers, if the first one has fewer cells.
fn with_fewer_cells(bytes: &[u8]) -> usize {
    let lines: Vec<&[u8]> = bytes.split_inclusive(|&b| b == b'\n').take(FIRST_LINES).collect();
    let is_number = |cell: &&str| {
        cell.replacen(',', ".", 1).parse::<f64>().is_ok()
            || stamp::looks_like(cell) && stamp::parse(cell).is_some()
    };
    // Before the comma, which may be that of decimals.
    let separator_of = |line: &&[u8]| {
        [b';', b'\t', b','].into_iter().find(|separator| {
            let cells = line.split(|b| b == separator).map(text).filter(|cell| !cell.is_empty());
            let (numbers, others): (Vec<&str>, Vec<&str>) = cells.partition(is_number);
            numbers.len() > 1 && numbers.len() >= others.len()
        })
    };
    let first_row = lines.iter().enumerate().find_map(|(row, line)| Some((row, separator_of(line)?)));
    let Some((row, separator)) = first_row else { return 0 };
    let cells = |line: &[u8]| line.split(|&b| b == separator).count();
    let is_alike = |line: &&&[u8]| cells(line) == cells(lines[row]);
    let header = row - lines[..row].iter().rev().take_while(is_alike).count();
    let first = lines.iter().find(|line| !text(line).is_empty());
    if header == row || first.is_none_or(|first| cells(first) >= cells(lines[row])) {
        return 0;
    }
    lines[..header].iter().map(|line| line.len()).sum()
}

/// Length of the title lines that have no separator where one of the next lines has some.
fn without_separators(bytes: &[u8]) -> usize {
    let mut begin = 0;
    for line in bytes.split_inclusive(|&b| b == b'\n').take(FIRST_LINES) {
        if line.iter().any(|b| matches!(b, b',' | b';' | b'\t')) {
            // Lines with a number are rows of a table with one column, and not a title.
            let lone = bytes[..begin].split(|&b| b == b'\n').any(|line| text(line).parse::<f64>().is_ok());
            return if lone { 0 } else { begin };
        }
        begin += line.len();
    }
    0
}

/// Whether numbers have a decimal comma: the first rows contain cells like `1,5` and none like `1.5`.
pub(super) fn has_decimal_comma(bytes: &[u8], delimiter: u8, end_of_line: u8) -> bool {
    let rows = bytes.split(|&b| b == end_of_line).skip(1).take(200);
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
/// If the line is not a header, or two columns have the same name.
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
            ..RawColumn::default()
        });
    }
    Ok(columns)
}

/// Whether a row below the header holds units: at least two known ones, and nothing else but `1`, `-` and empty cells. They become those of the
/// columns whose header states none.
pub(super) fn take_units(columns: &mut [RawColumn], row: &csv::ByteRecord) -> bool {
    let cells = || row.iter().map(|cell| text(cell).trim_matches(['[', ']', '(', ')']).trim());
    let is_unit = |cell: &str| units::is_unit_in_parentheses(cell);
    let is_other = |cell: &str| !is_unit(cell) && !["", "-", "1"].contains(&cell);
    if cells().any(is_other) || cells().filter(|cell| is_unit(cell)).count() < 2 {
        return false;
    }
    for (column, unit) in columns.iter_mut().zip(cells()).filter(|(_, cell)| is_unit(cell)) {
        column.unit.get_or_insert_with(|| unit.to_owned());
    }
    true
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

/// Name and unit of `name [unit]` or `name (unit)`. A text in parentheses that is not a known unit belongs to the name, and
/// so does the index of an element of an array, `pwm_us[0]`; `slip [1]` has a unit.
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
        && !is_index(name, unit)
    {
        let unit = unit.trim();
        return (name.trim(), (!unit.is_empty()).then_some(unit));
    }
    (cell, None)
}

/// Whether a text in brackets behind a name is the index of an element.
fn is_index(name: &str, text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|c| c.is_ascii_digit()) && !name.ends_with(char::is_whitespace)
}
