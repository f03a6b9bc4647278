//! Time stamps as loggers write them: ISO 8601 dates with a time of day.
//!
//! By hand rather than with a crate: the calendar is ten lines, and no time zone is ever looked up.

/// A moment, as read from a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamp {
    /// Seconds since 1970-01-01T00:00:00Z.
    pub seconds: f64,
    /// Whether it says its zone; without one it is taken as UTC.
    pub zoned: bool,
}

/// Whether a cell begins like a stamp: `2020-`. Cheap, for every cell that is no number.
pub(crate) fn looks_like(cell: &str) -> bool {
    let bytes = cell.as_bytes();
    bytes.len() > 4 && bytes[..4].iter().all(u8::is_ascii_digit) && bytes[4] == b'-'
}

/// `2020-08-03T11:04:37.125Z`: `T` or a space between date and time; seconds and their fraction may be left
/// out; the zone is `Z`, `+hh`, `+hhmm`, `+hh:mm` or nothing. `None` for all else, and for dates and times
/// that do not exist.
pub(crate) fn parse(cell: &str) -> Option<Stamp> {
    let mut rest = Rest(cell.as_bytes());
    let year = rest.digits(4)?;
    rest.take(b"-")?;
    let month = rest.digits(2)?;
    rest.take(b"-")?;
    let day = rest.digits(2)?;
    rest.take(b"Tt ")?;
    let hour = rest.digits(2)?;
    rest.take(b":")?;
    let minute = rest.digits(2)?;
    let (mut second, mut fraction) = (0, 0.0);
    if rest.take(b":").is_some() {
        second = rest.digits(2)?;
        if rest.take(b".,").is_some() {
            fraction = rest.fraction()?;
        }
    }
    let offset = rest.zone()?;
    let exists = (1..=12).contains(&month)
        && (1..=days_in(year, month)).contains(&day)
        && hour < 24
        && minute < 60
        && second <= 60;
    if !exists || !rest.0.is_empty() {
        return None;
    }
    let whole =
        days_since_1970(year, month, day) * 86_400 + hour * 3600 + minute * 60 + second - offset.unwrap_or(0);
    // A leap second is the last of a day, and counts as the first of the next one, as in Unix time.
    if second == 60 && whole.rem_euclid(86_400) != 0 {
        return None;
    }
    Some(Stamp { seconds: whole as f64 + fraction, zoned: offset.is_some() })
}

/// What is left of a cell.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn digits(&mut self, n: usize) -> Option<i64> {
        let (front, back) = self.0.split_at_checked(n)?;
        self.0 = back;
        front.iter().try_fold(0, |sum, b| b.is_ascii_digit().then(|| sum * 10 + i64::from(b - b'0')))
    }

    /// The next byte, if it is one of these.
    fn take(&mut self, of: &[u8]) -> Option<u8> {
        let (&first, back) = self.0.split_first()?;
        of.contains(&first).then(|| {
            self.0 = back;
            first
        })
    }

    fn fraction(&mut self) -> Option<f64> {
        let n = self.0.iter().take_while(|b| b.is_ascii_digit()).count();
        let (front, back) = self.0.split_at(n);
        self.0 = back;
        format!("0.{}", std::str::from_utf8(front).ok()?).parse().ok().filter(|_| n > 0)
    }

    /// Seconds ahead of UTC, or nothing at the end of the cell.
    #[allow(clippy::option_option, reason = "no zone is right, a wrong one is not")]
    fn zone(&mut self) -> Option<Option<i64>> {
        self.0 = self.0.trim_ascii_start();
        if self.0.is_empty() {
            return Some(None);
        }
        if self.take(b"Zz").is_some() {
            return Some(Some(0));
        }
        let sign = if self.take(b"+-")? == b'-' { -1 } else { 1 };
        let hours = self.digits(2)?;
        let _ = self.take(b":");
        let minutes = if self.0.is_empty() { 0 } else { self.digits(2)? };
        (hours < 24 && minutes < 60).then_some(Some(sign * (hours * 3600 + minutes * 60)))
    }
}

fn is_leap(year: i64) -> bool {
    year % 4 == 0 && (year % 100 != 0 || year % 400 == 0)
}

fn days_in(year: i64, month: i64) -> i64 {
    match month {
        2 if is_leap(year) => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    // Leap days before a year, counted from the year 0.
    let leaps = |y: i64| (y + 3) / 4 - (y + 99) / 100 + (y + 399) / 400;
    let years = (year - 1970) * 365 + leaps(year) - leaps(1970);
    years + (1..month).map(|m| days_in(year, m)).sum::<i64>() + day - 1
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
    fn every_day_is_one_after_the_day_before() {
        let mut before = days_since_1970(1599, 12, 31);
        for year in 1600..2500 {
            for month in 1..=12 {
                for day in 1..=days_in(year, month) {
                    let now = days_since_1970(year, month, day);
                    assert_eq!(now, before + 1, "{year}-{month}-{day}");
                    before = now;
                }
            }
        }
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
