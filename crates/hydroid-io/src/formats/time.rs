//! Dates, GPS time, and the offset between two clocks.

/// Nanoseconds of a second.
pub(crate) const SECOND: i64 = 1_000_000_000;

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
#[derive(Debug)]
pub(crate) struct Offsets {
    kept: Vec<i64>,
    every: u64,
    seen: u64,
}

impl Offsets {
    const MOST: usize = 4096;

    pub(crate) fn new() -> Self {
        Self { kept: Vec::new(), every: 1, seen: 0 }
    }

    pub(crate) fn add(&mut self, offset: i64) {
        if self.seen.is_multiple_of(self.every) {
            if self.kept.len() == Self::MOST {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.every *= 2;
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
