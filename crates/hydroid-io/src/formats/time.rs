//! Dates, texts with a date and time, GPS time, and the offset between two clocks.

/// Nanoseconds of a second.
pub(crate) const SECOND: i64 = 1_000_000_000;

/// Why a message with a stamp of an unsigned integer is left out.
pub(crate) const STAMP_TOO_LARGE: &str = "the stamp of a message is larger than 2^63 ns (292 years)";

/// Seconds of a day.
pub(crate) const DAY: i64 = 86_400;

/// Days from 1970-01-01 to a date of the Gregorian calendar; `None` if it does not exist.
pub(crate) fn days(year: i64, month: i64, day: i64) -> Option<i64> {
    let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    let longest = match month {
        2 if leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        1 | 3 | 5 | 7 | 8 | 10 | 12 => 31,
        _ => return None,
    };
    if !(1900..=2200).contains(&year) || !(1..=longest).contains(&day) {
        return None;
    }
    // The year begins in March, so its leap day is the last.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let before = year * 365 + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day - 1;
    // Days from 0000-03-01 to 1970-01-01.
    Some(before - 719_468)
}

/// A whole number without sign; `None` if it has more than 18 digits.
pub(crate) fn digits(text: &[u8]) -> Option<i64> {
    if text.is_empty() || text.len() > 18 {
        return None;
    }
    text.iter().try_fold(0, |sum, byte| byte.is_ascii_digit().then(|| sum * 10 + i64::from(byte - b'0')))
}

/// Nanoseconds from the digits behind a decimal point; digits from the tenth on are left out.
pub(crate) fn fraction_ns(text: &[u8]) -> Option<i64> {
    let kept = &text[..text.len().min(9)];
    let missing = u32::try_from(9 - kept.len()).ok()?;
    if kept.is_empty() { Some(0) } else { digits(kept).map(|sum| sum * 10i64.pow(missing)) }
}

/// A date and time that a text begins with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Iso<'a> {
    /// UTC \[ns\]; a text without a zone is taken as UTC.
    pub(crate) utc_ns: i64,
    /// Whether the text states a zone.
    pub(crate) zone: bool,
    /// What follows.
    pub(crate) rest: &'a [u8],
}

/// Reads `2026-04-16T07:44:00.000Z` (ISO 8601) from the beginning of a text, with slashes in the date, with a space for
/// the T, without seconds or decimals, with a comma for the point, with a zone of `+02:00`, `+0200`, `+02`, or none.
pub(crate) fn iso(text: &[u8]) -> Option<Iso<'_>> {
    let fixed = text.first_chunk::<16>()?;
    if !matches!([fixed[4], fixed[7]], [b'-', b'-'] | [b'/', b'/'])
        || !matches!(fixed[10], b'T' | b't' | b' ')
        || fixed[13] != b':'
    {
        return None;
    }
    let part = |from: usize, to: usize| digits(&fixed[from..to]);
    let day = days(part(0, 4)?, part(5, 7)?, part(8, 10)?)?;
    let (hour, minute) = (part(11, 13)?, part(14, 16)?);
    let mut rest = &text[16..];
    let (mut second, mut fraction) = (0, 0);
    if let [b':', tens, ones, behind @ ..] = rest {
        second = digits(&[*tens, *ones])?;
        rest = behind;
        if let [b'.' | b',', behind @ ..] = rest {
            let size = behind.iter().take_while(|byte| byte.is_ascii_digit()).count();
            fraction = fraction_ns(&behind[..size])?;
            rest = &behind[size..];
        }
    }
    // A leap second is the 60th; the day may end with 24:00.
    if hour > 24 || hour == 24 && (minute, second, fraction) != (0, 0, 0) || minute > 59 || second > 60 {
        return None;
    }
    let mut offset_min = None;
    match rest {
        [b'Z' | b'z', behind @ ..] => (offset_min, rest) = (Some(0), behind),
        [sign @ (b'+' | b'-'), tens, ones, behind @ ..] => {
            rest = behind;
            let mut offset = digits(&[*tens, *ones])? * 60;
            let minutes = behind.strip_prefix(b":").unwrap_or(behind).split_first_chunk::<2>();
            if let Some((minutes, behind)) = minutes
                && let Some(minutes) = digits(minutes)
            {
                offset += minutes;
                rest = behind;
            }
            offset_min = Some(if *sign == b'-' { -offset } else { offset });
        }
        _ => {}
    }
    let seconds = day * DAY + hour * 3600 + (minute - offset_min.unwrap_or(0)) * 60 + second;
    Some(Iso { utc_ns: seconds * SECOND + fraction, zone: offset_min.is_some(), rest })
}

/// Stamp of a text that is a date, or a date and time as [`iso`] reads them, and nothing else.
pub(crate) fn iso_stamp(text: &str) -> Option<i64> {
    let text = text.trim().as_bytes();
    if text.len() == 10 {
        return iso(&[text, b"T00:00"].concat()).map(|date| date.utc_ns);
    }
    iso(text).filter(|date| date.rest.is_empty()).map(|date| date.utc_ns)
}

/// Dates from which GPS time is one second more ahead of UTC (IERS Bulletin C).
#[rustfmt::skip]
const LEAP_SECONDS: [(i64, i64); 18] = [
    (1981, 7), (1982, 7), (1983, 7), (1985, 7), (1988, 1), (1990, 1), (1991, 1), (1992, 7), (1993, 7),
    (1994, 7), (1996, 1), (1997, 7), (1999, 1), (2006, 1), (2009, 1), (2012, 7), (2015, 7), (2017, 1),
];

/// UTC \[ns since 1970\] of a GPS week (since 1980-01-06) and millisecond of the week; `None` if they cannot be.
pub(crate) fn gps_utc_ns(week: i64, millisecond: i64) -> Option<i64> {
    // 3,652 days from 1970-01-01 to 1980-01-01; weeks up to 2200 or so.
    if !(1..12_000).contains(&week) || !(0..7 * DAY * 1000).contains(&millisecond) {
        return None;
    }
    let gps_ms = ((3652 + 5 + 7 * week) * DAY) * 1000 + millisecond;
    let mut leap_s = 0;
    for (year, month) in LEAP_SECONDS {
        let from_s = days(year, month, 1)? * DAY + leap_s + 1;
        if gps_ms < from_s * 1000 {
            break;
        }
        leap_s += 1;
    }
    Some((gps_ms - leap_s * 1000) * 1_000_000)
}

/// Median of the differences between two clocks, in bounded memory: every second of the kept ones is dropped when
/// they become too many, and from then on only every second is added.
#[derive(Debug, Default)]
pub(crate) struct Offsets {
    kept: Vec<i64>,
    halvings: u32,
    seen: u64,
}

impl Offsets {
    const MOST: usize = 4096;

    pub(crate) fn add(&mut self, offset: i64) {
        if self.seen.is_multiple_of(1 << self.halvings) {
            if self.kept.len() == Self::MOST {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.halvings += 1;
            }
            self.kept.push(offset);
        }
        self.seen += 1;
    }

    pub(crate) fn median(mut self) -> Option<i64> {
        let middle = self.kept.len() / 2;
        (!self.kept.is_empty()).then(|| *self.kept.select_nth_unstable(middle).1)
    }
}
