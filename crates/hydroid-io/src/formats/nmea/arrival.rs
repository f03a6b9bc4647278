//! The time of arrival in front of a sentence: ISO 8601, Unix time, or a tag block (NMEA 0183, section 7, "TAG
//! block").

use super::sentence::{digits, fraction_ns};
use crate::formats::time::{DAY, SECOND, days};

/// A time of arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Arrival {
    /// UTC \[ns\].
    pub(super) utc_ns: i64,
    /// Whether the text states a zone.
    pub(super) zone: bool,
}

/// The time in a text in front of a sentence. Anything may follow it.
pub(super) fn arrival(prefix: &[u8]) -> Option<Arrival> {
    let text = prefix.trim_ascii_start();
    if let Some(tags) = text.strip_prefix(b"\\") {
        let mut tags = tags.split(|byte| matches!(byte, b',' | b'*' | b'\\'));
        return unix(tags.find_map(|tag| tag.strip_prefix(b"c:"))?);
    }
    let text = text.strip_prefix(b"[").or(text.strip_prefix(b"\"")).unwrap_or(text);
    iso(text).or_else(|| unix(text))
}

/// Unix time in seconds, with or without decimals, or in milliseconds, microseconds or nanoseconds.
fn unix(text: &[u8]) -> Option<Arrival> {
    let size = text.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let whole = digits(&text[..size.min(18)])?;
    // From 1973 on; a smaller number is a counter or a time since the start of a device.
    let utc_ns = match size {
        9..=10 if whole > 100_000_000 => {
            let fraction = text[size..].strip_prefix(b".").unwrap_or_default();
            let fraction = &fraction[..fraction.iter().take_while(|byte| byte.is_ascii_digit()).count()];
            whole.checked_mul(SECOND)?.checked_add(fraction_ns(fraction)?)?
        }
        12..=13 => whole.checked_mul(1_000_000)?,
        15..=16 => whole.checked_mul(1000)?,
        18 => whole,
        // Without the last digit.
        19 => whole.checked_mul(10)?,
        _ => return None,
    };
    Some(Arrival { utc_ns, zone: true })
}

/// `2026-04-16T07:44:00.000Z`, with a space for the T, a comma for the point, a zone of `+02:00`, `+0200`, `+02`,
/// or none.
fn iso(text: &[u8]) -> Option<Arrival> {
    let fixed = text.get(..19)?;
    let separators = [fixed[4], fixed[7], fixed[13], fixed[16]];
    if !matches!(separators, [b'-', b'-', b':', b':'] | [b'/', b'/', b':', b':'])
        || !matches!(fixed[10], b'T' | b' ')
    {
        return None;
    }
    let part = |from: usize, to: usize| digits(&fixed[from..to]);
    let day = days(part(0, 4)?, part(5, 7)?, part(8, 10)?)?;
    let (hour, minute, second) = (part(11, 13)?, part(14, 16)?, part(17, 19)?);
    if hour > 23 || minute > 59 || second > 60 {
        return None;
    }
    let mut rest = &text[19..];
    let mut fraction = 0;
    if let [b'.' | b',', behind @ ..] = rest {
        let size = behind.iter().take_while(|byte| byte.is_ascii_digit()).count();
        fraction = fraction_ns(&behind[..size])?;
        rest = &behind[size..];
    }
    let offset_min = match rest {
        [b'Z', ..] => Some(0),
        [sign @ (b'+' | b'-'), zone @ ..] => {
            let minutes = match zone {
                [_, _, b':', minutes @ ..] => minutes.get(..2),
                [_, _, minutes @ ..] => minutes.get(..2).filter(|minutes| digits(minutes).is_some()),
                _ => None,
            };
            let offset = digits(zone.get(..2)?)? * 60 + minutes.map_or(Some(0), digits)?;
            Some(if *sign == b'-' { -offset } else { offset })
        }
        _ => None,
    };
    let seconds = day * DAY + hour * 3600 + (minute - offset_min.unwrap_or(0)) * 60 + second;
    Some(Arrival { utc_ns: seconds * SECOND + fraction, zone: offset_min.is_some() })
}
