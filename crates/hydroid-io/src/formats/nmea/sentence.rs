//! Fields of NMEA 0183 sentences (IEC 61162-1, section "Approved sentences"; NMEA 0183, section 6).

use crate::formats::time::{digits, fraction_ns};
use crate::sink::Field;

/// Fields of a sentence that are looked at.
pub(super) const MOST_FIELDS: usize = 20;

/// How the value of a field is read. Numbers are places in the sentence, from 0 behind the address.
#[derive(Clone, Copy, Debug)]
enum Get {
    Number(usize),
    /// Seconds of the day from `hhmmss.ss`.
    Time(usize),
    /// Degrees from `ddmm.mm`; the next field is the hemisphere.
    Position(usize),
    /// A number whose sign is the next field: W is negative.
    Signed(usize),
    /// 1 for A, 0 for V.
    Status(usize),
    /// 0 for V, 1 for any other letter.
    Mode(usize),
    /// Speed in the unit that the next field states, converted to m/s.
    Speed(usize),
}

/// A sentence that is read.
#[derive(Debug)]
pub(super) struct Sentence {
    pub(super) formatter: [u8; 3],
    /// Fields without which it is cut.
    pub(super) least: usize,
    /// Fields whose values tell topics apart.
    pub(super) variant: &'static [usize],
    columns: &'static [(&'static str, &'static str, Get)],
}

use Get::{Mode, Number, Position, Signed, Speed, Status, Time};

const fn sentence(
    formatter: [u8; 3],
    least: usize,
    variant: &'static [usize],
    columns: &'static [(&'static str, &'static str, Get)],
) -> Sentence {
    Sentence { formatter, least, variant, columns }
}

// One column a line would take five times as many.
#[rustfmt::skip]
const SENTENCES: [Sentence; 19] = [
    sentence(*b"HDT", 2, &[], &[("heading", "deg", Number(0))]),
    sentence(*b"HDM", 2, &[], &[("heading", "deg", Number(0))]),
    sentence(*b"HDG", 5, &[], &[
        ("heading", "deg", Number(0)), ("deviation", "deg", Signed(1)), ("variation", "deg", Signed(3)),
    ]),
    sentence(*b"THS", 2, &[], &[("heading", "deg", Number(0)), ("valid", "", Mode(1))]),
    sentence(*b"ROT", 2, &[], &[("rate", "deg/min", Number(0)), ("valid", "", Status(1))]),
    sentence(*b"RSA", 4, &[], &[
        ("starboard", "deg", Number(0)), ("starboard_valid", "", Status(1)),
        ("port", "deg", Number(2)), ("port_valid", "", Status(3)),
    ]),
    sentence(*b"RPM", 5, &[0, 1], &[
        ("number", "", Number(1)), ("speed", "rpm", Number(2)),
        ("pitch", "%", Number(3)), ("valid", "", Status(4)),
    ]),
    sentence(*b"GGA", 14, &[], &[
        ("utc_s", "s", Time(0)), ("latitude", "deg", Position(1)), ("longitude", "deg", Position(3)),
        ("quality", "", Number(5)), ("satellites", "", Number(6)), ("hdop", "", Number(7)),
        ("altitude", "m", Number(8)), ("geoid_separation", "m", Number(10)), ("age", "s", Number(12)),
    ]),
    sentence(*b"RMC", 11, &[], &[
        ("utc_s", "s", Time(0)), ("valid", "", Status(1)),
        ("latitude", "deg", Position(2)), ("longitude", "deg", Position(4)),
        ("sog", "kn", Number(6)), ("cog", "deg", Number(7)), ("variation", "deg", Signed(9)),
    ]),
    sentence(*b"VTG", 8, &[], &[
        ("cog", "deg", Number(0)), ("cog_magnetic", "deg", Number(2)),
        ("sog", "kn", Number(4)), ("sog_kmh", "km/h", Number(6)),
    ]),
    sentence(*b"GLL", 4, &[], &[
        ("utc_s", "s", Time(4)), ("valid", "", Status(5)),
        ("latitude", "deg", Position(0)), ("longitude", "deg", Position(2)),
    ]),
    sentence(*b"ZDA", 4, &[], &[
        ("utc_s", "s", Time(0)), ("day", "", Number(1)), ("month", "", Number(2)), ("year", "", Number(3)),
    ]),
    sentence(*b"GNS", 12, &[], &[
        ("utc_s", "s", Time(0)), ("latitude", "deg", Position(1)), ("longitude", "deg", Position(3)),
        ("satellites", "", Number(6)), ("hdop", "", Number(7)),
        ("altitude", "m", Number(8)), ("geoid_separation", "m", Number(9)), ("age", "s", Number(10)),
    ]),
    sentence(*b"GST", 8, &[], &[
        ("utc_s", "s", Time(0)), ("rms", "m", Number(1)), ("semi_major", "m", Number(2)),
        ("semi_minor", "m", Number(3)), ("orientation", "deg", Number(4)), ("latitude_error", "m", Number(5)),
        ("longitude_error", "m", Number(6)), ("altitude_error", "m", Number(7)),
    ]),
    sentence(*b"VHW", 8, &[], &[
        ("heading", "deg", Number(0)), ("heading_magnetic", "deg", Number(2)),
        ("speed", "kn", Number(4)), ("speed_kmh", "km/h", Number(6)),
    ]),
    sentence(*b"VBW", 6, &[], &[
        ("water_ahead", "kn", Number(0)), ("water_starboard", "kn", Number(1)), ("water_valid", "", Status(2)),
        ("ground_ahead", "kn", Number(3)), ("ground_starboard", "kn", Number(4)), ("ground_valid", "", Status(5)),
        ("water_starboard_stern", "kn", Number(6)), ("water_stern_valid", "", Status(7)),
        ("ground_starboard_stern", "kn", Number(8)), ("ground_stern_valid", "", Status(9)),
    ]),
    sentence(*b"MWV", 5, &[1], &[
        ("angle", "deg", Number(0)), ("speed", "m/s", Speed(2)), ("valid", "", Status(4)),
    ]),
    sentence(*b"DBT", 4, &[], &[("depth", "m", Number(2))]),
    sentence(*b"DPT", 2, &[], &[("depth", "m", Number(0)), ("offset", "m", Number(1)), ("range", "m", Number(2))]),
];

impl Sentence {
    /// The sentence of a formatter.
    pub(super) fn of(formatter: [u8; 3]) -> Option<&'static Self> {
        SENTENCES.iter().find(|sentence| sentence.formatter == formatter)
    }

    pub(super) fn fields(&self) -> Vec<Field> {
        let unit = |unit: &str| (!unit.is_empty()).then(|| unit.to_owned());
        self.columns.iter().map(|(name, of, _)| Field { name: (*name).to_owned(), unit: unit(of) }).collect()
    }

    /// Nanoseconds of the day.
    pub(super) fn time(&self, fields: &[&[u8]]) -> Option<i64> {
        self.columns.iter().find_map(|(.., get)| match get {
            Time(at) => time(fields.get(*at)?),
            _ => None,
        })
    }

    /// Day, month and year of a sentence that states them and is valid.
    pub(super) fn date(&self, fields: &[&[u8]]) -> Option<(i64, i64, i64)> {
        match &self.formatter {
            b"RMC" if fields.get(1) == Some(&&b"A"[..]) => {
                let date = fields.get(8).filter(|date| date.len() == 6)?;
                let year = digits(&date[4..])?;
                Some((digits(&date[..2])?, digits(&date[2..4])?, year + if year < 80 { 2000 } else { 1900 }))
            }
            b"ZDA" => Some((digits(fields.get(1)?)?, digits(fields.get(2)?)?, digits(fields.get(3)?)?)),
            _ => None,
        }
    }

    pub(super) fn read(&self, fields: &[&[u8]], values: &mut Vec<f64>) {
        let field = |at: usize| fields.get(at).copied().unwrap_or_default();
        values.clear();
        values.extend(self.columns.iter().map(|(.., get)| match *get {
            Number(at) => number(field(at)),
            // Nanoseconds of a day are exact.
            Time(at) => time(field(at)).map_or(f64::NAN, |time| time as f64 / 1e9),
            Position(at) => position(field(at), field(at + 1)),
            Signed(at) => match field(at + 1) {
                b"W" => -number(field(at)),
                b"E" => number(field(at)),
                _ => f64::NAN,
            },
            Status(at) => match field(at) {
                b"A" => 1.0,
                b"V" => 0.0,
                _ => f64::NAN,
            },
            Mode(at) => match field(at) {
                b"V" => 0.0,
                b"" => f64::NAN,
                _ => 1.0,
            },
            Speed(at) => match field(at + 1) {
                b"N" => number(field(at)) * 1852.0 / 3600.0,
                b"K" => number(field(at)) / 3.6,
                b"M" => number(field(at)),
                _ => f64::NAN,
            },
        }));
    }
}

const POWERS: [f64; 16] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// A decimal number without exponent; NaN if the text is none.
fn number(text: &[u8]) -> f64 {
    let (negative, unsigned) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    let (mut sum, mut point) = (0u64, None);
    if !(1..=16).contains(&unsigned.len()) {
        return f64::NAN;
    }
    for (i, byte) in unsigned.iter().enumerate() {
        match byte {
            b'0'..=b'9' => sum = sum * 10 + u64::from(byte - b'0'),
            b'.' if point.is_none() && unsigned.len() > 1 => point = Some(i),
            _ => return f64::NAN,
        }
    }
    // Both are exact up to 10^15, so the quotient is the nearest number.
    let value = sum as f64 / POWERS[point.map_or(0, |point| unsigned.len() - 1 - point)];
    if negative { -value } else { value }
}

/// Nanoseconds of the day from `hhmmss.ss`.
fn time(text: &[u8]) -> Option<i64> {
    let (whole, fraction) = match text.get(6) {
        Some(b'.') => (&text[..6], &text[7..]),
        None if text.len() == 6 => (text, &[][..]),
        _ => return None,
    };
    let (hour, minute, second) = (digits(&whole[..2])?, digits(&whole[2..4])?, digits(&whole[4..])?);
    (hour < 24 && minute < 60 && second < 61)
        .then_some(((hour * 60 + minute) * 60 + second) * 1_000_000_000 + fraction_ns(fraction)?)
}

/// Degrees from `ddmm.mm` and a hemisphere.
fn position(text: &[u8], hemisphere: &[u8]) -> f64 {
    let sign = match hemisphere {
        b"N" | b"E" => 1.0,
        b"S" | b"W" => -1.0,
        _ => return f64::NAN,
    };
    let point = memchr::memchr(b'.', text).unwrap_or(text.len());
    let Some(split) = point.checked_sub(2) else { return f64::NAN };
    let degrees = if split == 0 { 0.0 } else { number(&text[..split]) };
    let minutes = number(&text[split..]);
    if degrees.is_sign_negative() || degrees > 180.0 || !(0.0..60.0).contains(&minutes) {
        return f64::NAN;
    }
    sign * (degrees + minutes / 60.0)
}
