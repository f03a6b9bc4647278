//! Time stamps in a log: ISO 8601, or a time of day.

use jiff::fmt::temporal::Pieces;
use jiff::tz::Offset;

/// A time stamp, as read from a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamp {
    /// Seconds since 1970-01-01T00:00:00Z, or since midnight without a date.
    pub seconds: f64,
    /// Whether the cell has a date.
    pub dated: bool,
    /// Whether the cell has an offset; without one the time is UTC.
    pub zoned: bool,
}

/// Whether a cell begins with a year and a hyphen, or with an hour and a colon: a quick test for every cell that is not a number.
pub fn looks_like(cell: &str) -> bool {
    let digits = cell.bytes().take_while(u8::is_ascii_digit).count();
    matches!((digits, cell.as_bytes().get(digits)), (4, Some(b'-')) | (1 | 2, Some(b':')))
}

/// Seconds of a time of day, or a duration, with hours, minutes and seconds: `9:05:00`, `23:59:59.9`, `23:59:59,9`, `31:00:00`.
fn time_of_day(cell: &str) -> Option<f64> {
    let mut parts = cell.split(':');
    let (hours, minutes, seconds) = (parts.next()?, parts.next()?, parts.next()?);
    let whole = |text: &str, below: u32| text.parse().ok().filter(|x: &u32| *x < below);
    let is_plain = seconds.bytes().all(|b| b.is_ascii_digit() || [b'.', b','].contains(&b));
    let rest = seconds.replacen(',', ".", 1).parse::<f64>().ok().filter(|x| is_plain && *x < 61.0)?;
    if minutes.len() != 2 || parts.next().is_some() {
        return None;
    }
    Some(f64::from(3600 * whole(hours, 100)? + 60 * whole(minutes, 60)?) + rest)
}

/// Lets times of day go on after midnight.
pub fn pass_midnight(seconds: &mut [f64]) {
    let (mut last, mut days) = (f64::NAN, 0.0);
    for x in seconds.iter_mut().filter(|x| !x.is_nan()) {
        if !last.is_nan() {
            days = (days - ((*x - last) / DAY_S).round()).max(0.0);
        }
        last = *x;
        *x += DAY_S * days;
    }
}

const DAY_S: f64 = 86_400.0;

/// Reads a time of day, or `2020-08-03T11:04:37.125Z`: `T` or a space between date and time, seconds with or without a fraction, and
/// `Z`, `+hh`, `+hhmm`, `+hh:mm` or no offset. The result is `None` for other text and for dates and times that do
/// not exist. A leap second counts as the first second of the next day, as in Unix time.
pub fn parse(cell: &str) -> Option<Stamp> {
    if !looks_like(cell) {
        return None;
    }
    if let Some(seconds) = time_of_day(cell) {
        return Some(Stamp { seconds, dated: false, zoned: false });
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
    Some(Stamp { seconds, dated: true, zoned: pieces.offset().is_some() })
}
