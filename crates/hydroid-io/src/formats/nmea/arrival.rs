//! The time of arrival in front of a sentence: ISO 8601, Unix time, or a tag block (NMEA 0183, section 7, "TAG
//! block").

use crate::formats::time::{self, SECOND, digits, fraction_ns};

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

/// A date and time with seconds.
fn iso(text: &[u8]) -> Option<Arrival> {
    let found = time::iso(text).filter(|_| text.get(16) == Some(&b':'))?;
    Some(Arrival { utc_ns: found.utc_ns, zone: found.zone })
}
