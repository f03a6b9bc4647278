//! Number formats of the pages: significant digits, typographic minus, powers of ten.

use maud::{Markup, html};

use super::figure::superscript;

/// Placeholder for a missing value.
pub const NONE: &str = "–";

/// A rounded number: `digits` with an optional power of ten.
struct Rounded {
    negative: bool,
    digits: String,
    power: i32,
}

fn rounded(value: f64, significant: usize) -> Rounded {
    let significant = significant.max(1);
    let text = format!("{:.*e}", significant - 1, value.abs());
    // The exponent format of finite numbers always contains an `e`.
    let (mantissa, power) = text.split_once('e').unwrap_or((&text, "0"));
    let power: i32 = power.parse().unwrap_or(0);
    let negative = value < 0.0;
    if value == 0.0 {
        return Rounded { negative: false, digits: "0".to_owned(), power: 0 };
    }
    if (-4..5).contains(&power) {
        let digits = i32::try_from(significant).unwrap_or(i32::MAX);
        let decimals = usize::try_from(digits - 1 - power).unwrap_or(0);
        let exact: f64 = text.parse().unwrap_or(value.abs());
        Rounded { negative, digits: format!("{exact:.decimals$}"), power: 0 }
    } else {
        Rounded { negative, digits: mantissa.to_owned(), power }
    }
}

/// The magnitude of a number in HTML; the equation writes the sign.
pub fn magnitude(value: f64, significant: usize) -> Markup {
    let Rounded { digits, power, .. } = rounded(value, significant);
    html! {
        (digits)
        @if power != 0 { " × 10" sup { (minus(&power.to_string())) } }
    }
}

/// A number in plain text: `-1.234e-5`.
pub fn plain(value: f64, significant: usize) -> String {
    let Rounded { negative, digits, power } = rounded(value, significant);
    let sign = if negative { "-" } else { "" };
    if power == 0 { format!("{sign}{digits}") } else { format!("{sign}{digits}e{power}") }
}

/// A number with at most the given significant digits and without trailing zeros: `0.1`, `1e-7`.
pub fn shortest(value: f64, significant: usize) -> String {
    format!("{value:.*e}", significant.max(1) - 1).parse::<f64>().unwrap_or(value).to_string()
}

/// A number for text and tables.
pub fn text(value: f64, significant: usize) -> String {
    if value.is_nan() {
        return NONE.to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "−∞" }.to_owned();
    }
    let Rounded { negative, digits, power } = rounded(value, significant);
    let sign = if negative { "−" } else { "" };
    if power == 0 { format!("{sign}{digits}") } else { format!("{sign}{digits} × 10{}", superscript(power)) }
}

/// A number with fixed decimals or, if it is too large, with a power of ten; a dash if it is not finite.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() || value.abs() >= 1e5 {
        return text(value, 3);
    }
    let text = format!("{value:.decimals$}");
    let zero = !text.bytes().any(|b| (b'1'..=b'9').contains(&b));
    minus(if zero { text.trim_start_matches('-') } else { &text })
}

/// A ratio such as an NRMSE: two decimals, fewer if it is large.
pub fn ratio(value: f64) -> String {
    if value.abs() >= 10.0 { text(value, 3) } else { fixed(value, 2) }
}

/// A whole number with thin spaces between thousands.
pub fn count(n: usize) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) && digits.len() > 4 {
            text.push('\u{202f}');
        }
        text.push(c);
    }
    text
}

/// A duration in a suitable unit.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() {
        NONE.to_owned()
    } else if (60.0..120.0).contains(&seconds) {
        format!("{}\u{a0}s", fixed(seconds, 0))
    } else if seconds < 120.0 {
        format!("{}\u{a0}s", seconds_text(seconds))
    } else if seconds < 7200.0 {
        format!("{}\u{a0}min", fixed(seconds / 60.0, 1))
    } else {
        format!("{}\u{a0}h", fixed(seconds / 3600.0, 1))
    }
}

/// Seconds without trailing zeros: `5`, `0.05`, `12.5`.
pub fn seconds_text(seconds: f64) -> String {
    let text = format!("{seconds:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    minus(text)
}

fn minus(text: &str) -> String {
    match text.strip_prefix('-') {
        Some(rest) => format!("−{rest}"),
        None => text.to_owned(),
    }
}

/// Name and unit: `u [m/s]`.
pub fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_owned() } else { format!("{name} [{}]", self::unit(unit)) }
}

/// A unit with superscript exponents: `m^2/s^2` becomes `m²/s²`.
pub fn unit(unit: &str) -> String {
    let mut pieces = unit.split('^');
    let mut text = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let end = piece
            .char_indices()
            .find(|&(i, c)| !(c.is_ascii_digit() || i == 0 && c == '-'))
            .map_or(piece.len(), |(i, _)| i);
        if let Ok(power) = piece[..end].parse::<i32>() {
            text.push_str(&superscript(power));
        } else {
            text.push('^');
            text.push_str(&piece[..end]);
        }
        text.push_str(&piece[end..]);
    }
    text
}
