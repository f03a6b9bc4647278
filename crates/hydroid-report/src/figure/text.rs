//! Estimated text widths; the browser chooses the actual font.

/// Width of a text in a Helvetica-like font: an estimate on the wide side.
pub fn width(text: &str, size: f64) -> f64 {
    size * text.chars().map(advance).sum::<f64>()
}

fn advance(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | '|' | '\'' | '.' | ',' | ':' | ';' | '!' | 'I' => 0.29,
        ' ' | 'f' | 't' | 'r' | '(' | ')' | '[' | ']' | '/' | '-' => 0.35,
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.9,
        c if c.is_ascii_uppercase() => 0.7,
        c if u32::from(c) >= 0x2e80 => 1.05,
        _ => 0.57,
    }
}

pub fn fit(text: &str, size: f64, room: f64) -> String {
    if width(text, size) <= room {
        return text.to_owned();
    }
    let mut short = String::new();
    let mut used = size;
    for c in text.chars() {
        used += size * advance(c);
        if used > room {
            break;
        }
        short.push(c);
    }
    short.push('…');
    short
}
