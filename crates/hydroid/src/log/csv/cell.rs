//! Cells: numbers, time stamps, missing values, and other text.

use super::super::stamp;

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
pub(super) fn text(cell: &[u8]) -> &str {
    std::str::from_utf8(cell.trim_ascii()).unwrap_or("\u{fffd}")
}
