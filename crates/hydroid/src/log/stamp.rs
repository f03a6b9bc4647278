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
pub(crate) fn looks_like(cell: &str) -> bool {
    let bytes = cell.as_bytes();
    bytes.len() > 4 && bytes[..4].iter().all(u8::is_ascii_digit) && bytes[4] == b'-'
}

/// Reads `2020-08-03T11:04:37.125Z`: `T` or a space between date and time, seconds with or without a fraction, and
/// `Z`, `+hh`, `+hhmm`, `+hh:mm` or no offset. The result is `None` for other text and for dates and times that do
/// not exist. A leap second counts as the first second of the next day, as in Unix time.
pub(crate) fn parse(cell: &str) -> Option<Stamp> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(text: &str) -> f64 {
        parse(text).unwrap_or_else(|| panic!("{text}")).seconds
    }

    #[test]
    fn moments_that_are_known() {
        assert_eq!(seconds("1970-01-01T00:00:00Z"), 0.0);
        assert_eq!(seconds("1969-12-31T23:59:59Z"), -1.0);
        assert_eq!(seconds("2000-02-29T00:00:00Z"), 951_782_400.0);
        assert_eq!(seconds("2000-03-01T00:00:00Z"), 951_868_800.0);
        assert_eq!(seconds("2001-09-09T01:46:40Z"), 1e9);
        assert_eq!(seconds("2020-08-03T11:04:37.125Z"), 1_596_452_677.125);
        assert_eq!(seconds("2038-01-19T03:14:08Z"), 2_147_483_648.0);
        assert_eq!(seconds("2100-03-01T00:00:00Z") - seconds("2100-02-28T00:00:00Z"), 86_400.0);
    }

    #[test]
    fn all_forms_of_one_moment() {
        for text in [
            "2020-08-03T11:04:37Z",
            "2020-08-03t11:04:37z",
            "2020-08-03 11:04:37",
            "2020-08-03 11:04:37.000000000",
            "2020-08-03T13:04:37+02:00",
            "2020-08-03T13:04:37+0200",
            "2020-08-03 13:04:37 +02",
            "2020-08-02T23:34:37-11:30",
            "2020-08-04T01:04:37,0+14:00",
        ] {
            assert_eq!(seconds(text), 1_596_452_677.0, "{text}");
            assert!(looks_like(text));
        }
        assert_eq!(seconds("2020-08-03T11:04"), 1_596_452_640.0);
        assert!(parse("2020-08-03T11:04:37Z").unwrap().zoned);
        assert!(!parse("2020-08-03T11:04:37").unwrap().zoned);
        assert_eq!(seconds("2016-12-31T23:59:60Z"), seconds("2017-01-01T00:00:00Z"));
    }

    #[test]
    fn moments_that_do_not_exist() {
        for text in [
            "2020-13-03T11:04:37Z",
            "2020-00-03T11:04:37Z",
            "2021-02-29T11:04:37Z",
            "1900-02-29T11:04:37Z",
            "2020-04-31T11:04:37Z",
            "2020-08-00T11:04:37Z",
            "2020-08-03T24:04:37Z",
            "2020-08-03T11:60:37Z",
            "2020-08-03T11:04:61Z",
            "2020-08-03T11:04:60Z",
            "2020-08-03T11:04:37.Z",
            "2020-08-03T11:04:37+2",
            "2020-08-03T11:04:37+02:0",
            "2020-08-03T11:04:37+25:00",
            "2020-08-03T11:04:37Zulu",
            "2020-08-03",
            "2020-8-3T11:04:37",
            "2020-",
            "",
            "\u{fffd}020-08",
        ] {
            assert!(parse(text).is_none(), "{text}");
        }
    }
}
