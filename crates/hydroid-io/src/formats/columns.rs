//! Columns of tables: units in their names, and columns that hold the time.

use crate::sink::Clock;

/// Nanoseconds of a unit of time.
pub(crate) fn unit_ns(unit: &str) -> Option<i64> {
    Some(match unit.trim() {
        "ns" => 1,
        "us" | "µs" | "μs" => 1_000,
        "ms" => 1_000_000,
        "s" | "sec" => 1_000_000_000,
        "min" => 60_000_000_000,
        "h" => 3_600_000_000_000,
        "d" => 86_400_000_000_000,
        _ => return None,
    })
}

/// Name and unit of a column `name [unit]`.
pub(crate) fn split_unit(header: &str) -> (String, Option<String>) {
    let header = header.trim();
    if let Some((name, rest)) = header.rsplit_once('[')
        && let Some(unit) = rest.strip_suffix(']')
        && !name.trim().is_empty()
    {
        let unit = unit.trim();
        return (name.trim().to_owned(), (!unit.is_empty()).then(|| unit.to_owned()));
    }
    (header.to_owned(), None)
}

/// Unit in the name of a column that is named as the time, or nothing: `t`, `time`, `timestamp`, `stamp`, `time_s`.
pub(crate) fn time_name(name: &str) -> Option<&str> {
    let (stem, unit) = name.rsplit_once('_').unwrap_or((name, ""));
    let named = ["t", "time", "timestamp", "stamp"].iter().any(|time| stem.eq_ignore_ascii_case(time));
    (named && (unit.is_empty() || unit_ns(unit).is_some())).then_some(unit)
}

/// Scale and clock of a column of numbers whose first value is known. Without a unit, numbers are seconds unless they
/// are a date of this century in a smaller unit. Times of this century are UTC.
pub(crate) fn clock(first: f64, unit_ns: Option<i64>) -> (i64, Clock) {
    let this_century = |ns: i64| (946_684_800e9..4_102_444_800e9).contains(&(first * ns as f64));
    let stated = unit_ns.as_ref().map_or(&[1_000_000_000, 1_000_000, 1_000, 1][..], std::slice::from_ref);
    match stated.iter().find(|ns| this_century(**ns)) {
        Some(ns) => (*ns, Clock::Utc),
        None => (stated[0], Clock::None),
    }
}

/// Stamp of a number of units of `ns` nanoseconds; `None` if it is beyond the stamps.
#[allow(clippy::cast_possible_truncation, reason = "both parts are in the range of the stamps")]
pub(crate) fn stamp(value: f64, ns: i64) -> Option<i64> {
    // The fraction is scaled by itself: the product would be rounded to the 256 ns of a double of this size.
    let whole = value.trunc();
    // False for what is no number, too.
    let fits = whole.abs() < 9.2e18;
    if !fits {
        return None;
    }
    let part = ((value - whole) * ns as f64).round();
    (whole as i64).checked_mul(ns)?.checked_add(part as i64)
}

/// Whether a text is a unit, such as `m/s2`, `[deg]` or `-`.
pub(crate) fn looks_like_unit(text: &str) -> bool {
    const UNITS: [&str; 52] = [
        "m", "mm", "cm", "km", "ft", "nm", "nmi", "s", "sec", "ms", "us", "µs", "ns", "min", "h", "d", "hz",
        "khz", "deg", "rad", "rev", "kn", "kt", "kts", "knots", "mph", "kmh", "n", "kn", "nm", "knm", "j",
        "w", "kw", "v", "mv", "a", "ma", "ah", "mah", "wh", "pa", "kpa", "hpa", "bar", "mbar", "c", "k", "g",
        "kg", "t", "rpm",
    ];
    let text = text.trim().trim_matches(['[', ']', '(', ')']).trim();
    let symbol = |letter: char| letter.is_ascii_digit() || "%°/*^·-⁻¹²³ ".contains(letter);
    let mut words = text.split(symbol).filter(|word| !word.is_empty());
    text.len() <= 16 && !text.is_empty() && words.all(|word| UNITS.contains(&word.to_lowercase().as_str()))
}

/// Stamp of a date and time as ISO 8601 writes it (`2026-04-07T07:44:00.5Z`, also with a space or an offset); UTC if
/// it has no offset.
pub(crate) fn iso_stamp(text: &str) -> Option<i64> {
    let text = text.trim();
    let (date, time) = text.split_once(['T', 't', ' ']).unwrap_or((text, "00:00"));
    let mut parts = date.splitn(3, '-').map(digits);
    let (year, month, day) = (parts.next()??, parts.next()??, parts.next()??);
    if date.len() != 10 || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let (time, offset) = match time.rfind(['Z', 'z', '+', '-']) {
        Some(at) if time[at..].eq_ignore_ascii_case("z") => (&time[..at], 0),
        Some(at) => {
            let (hours, minutes) =
                time[at + 1..].split_once(':').or_else(|| time[at + 1..].split_at_checked(2))?;
            let minutes = if minutes.is_empty() { "0" } else { minutes };
            let offset = digits(hours)? * 3600 + digits(minutes)? * 60;
            (&time[..at], if time[at..].starts_with('-') { -offset } else { offset })
        }
        None => (time, 0),
    };
    let mut parts = time.trim().splitn(3, ':');
    let (hours, minutes) = (digits(parts.next()?)?, digits(parts.next()?)?);
    let (seconds, fraction) = parts.next().map_or(("0", ""), |s| s.split_once(['.', ',']).unwrap_or((s, "")));
    let seconds = digits(seconds)?;
    if hours > 24 || minutes > 59 || seconds > 60 {
        return None;
    }
    let fraction = fraction.get(..fraction.len().min(9))?;
    let ns = if fraction.is_empty() {
        0
    } else {
        digits(fraction)? * 10_i64.pow(9 - u32::try_from(fraction.len()).ok()?)
    };
    let seconds = days(year, month, day) * 86_400 + hours * 3600 + minutes * 60 + seconds - offset;
    seconds.checked_mul(1_000_000_000)?.checked_add(ns)
}

fn digits(text: &str) -> Option<i64> {
    let digits = !text.is_empty() && text.len() <= 9 && text.bytes().all(|letter| letter.is_ascii_digit());
    if digits { text.parse().ok() } else { None }
}

/// Days from 1970-01-01 in the Gregorian calendar. Years begin in March, so that the day of February 29 is the last.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month < 3 { (year - 1, month + 9) } else { (year, month - 3) };
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    365 * year + leap_days + (153 * month + 2) / 5 + day - 1 - 719_468
}
