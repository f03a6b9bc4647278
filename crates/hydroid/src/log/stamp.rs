//! ISO 8601 time stamps in a log.

use jiff::fmt::temporal::Pieces;
use jiff::tz::Offset;

/// A time stamp, as read from a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamp {
    /// Seconds since 1970-01-01T00:00:00Z.
    pub seconds: f64,
    /// Whether the cell has an offset; without one the time is UTC.
    pub zoned: bool,
}

/// Whether a cell begins with a year and a hyphen: a quick test for every cell that is not a number.
pub fn looks_like(cell: &str) -> bool {
    let bytes = cell.as_bytes();
    bytes.len() > 4 && bytes[..4].iter().all(u8::is_ascii_digit) && bytes[4] == b'-'
}

/// Reads `2020-08-03T11:04:37.125Z`: `T` or a space between date and time, seconds with or without a fraction, and
/// `Z`, `+hh`, `+hhmm`, `+hh:mm` or no offset. The result is `None` for other text and for dates and times that do
/// not exist. A leap second counts as the first second of the next day, as in Unix time.
pub fn parse(cell: &str) -> Option<Stamp> {
    if !looks_like(cell) {
        return None;
    }
    // Some loggers write a space before the offset; ISO 8601 has none.
    let (date, time) = cell.split_at_checked(11)?;
    let time: String = time.split_whitespace().collect();
    let text = format!("{date}{time}");
    let pieces = Pieces::parse(&text).ok()?;
    let offset = pieces.to_numeric_offset().map_or(0, Offset::seconds);
    if pieces.time_zone_annotation().is_some() || offset.abs() >= 86_400 {
        return None;
    }
    let moment = Offset::UTC.to_timestamp(pieces.date().to_datetime(pieces.time()?)).ok()?;
    let mut whole = moment.as_second() - i64::from(offset);
    // The parser reads second 60 as 59.
    if time.get(5..8) == Some(":60") {
        whole += 1;
        if whole.rem_euclid(86_400) != 0 {
            return None;
        }
    }
    let seconds = whole as f64 + f64::from(moment.subsec_nanosecond()) / 1e9;
    Some(Stamp { seconds, zoned: pieces.offset().is_some() })
}
