//! Columns of tables: units in their names, and columns that hold the time.

use crate::sink::Clock;

/// Nanoseconds of a unit of time.
fn unit_ns(unit: &str) -> Option<i64> {
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

/// Name and unit of a column `name [unit]`. The index of an element of an array, `pwm_us[0]`, belongs to the name.
pub(crate) fn split_unit(header: &str) -> (String, Option<String>) {
    let header = header.trim();
    if let Some((name, rest)) = header.rsplit_once('[')
        && let Some(unit) = rest.strip_suffix(']')
        && !name.trim().is_empty()
        && (name.ends_with(char::is_whitespace)
            || unit.is_empty()
            || !unit.bytes().all(|c| c.is_ascii_digit()))
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

/// Scale and clock of a column of numbers by its first value, its unit, and that in its name. Without a unit, numbers are
/// seconds unless they are a date of this century in a smaller unit. Times of this century are UTC, others those of a
/// device.
pub(crate) fn clock(first: Option<f64>, unit: Option<&str>, name: &str) -> (i64, Clock) {
    let first = first.unwrap_or(0.0);
    let unit_ns = unit.and_then(unit_ns).or_else(|| time_name(name).and_then(unit_ns));
    let this_century = |ns: i64| (946_684_800e9..4_102_444_800e9).contains(&(first * ns as f64));
    let stated = unit_ns.as_ref().map_or(&[1_000_000_000, 1_000_000, 1_000, 1][..], std::slice::from_ref);
    match stated.iter().find(|ns| this_century(**ns)) {
        Some(ns) => (*ns, Clock::Utc),
        None => (stated[0], Clock::Boot),
    }
}

/// Stamp of a number of units of `ns` nanoseconds; `None` if it is beyond the stamps.
#[allow(clippy::cast_possible_truncation, reason = "both parts are in the range of the stamps")]
pub(crate) fn stamp(value: f64, ns: i64) -> Option<i64> {
    // The fraction is scaled by itself: the product would be rounded to the 256 ns of a double of this size.
    let whole = value.trunc();
    // False for what is not a number, too.
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
