//! Units and text of XML.

/// Exponents of the SI base units of a unit; `None` for a unit that is not known.
pub(super) fn base(unit: &str) -> Option<&'static [(&'static str, i32)]> {
    Some(match unit {
        "1" => &[],
        "s" => &[("s", 1)],
        "m" => &[("m", 1)],
        "m/s" => &[("m", 1), ("s", -1)],
        "m/s^2" => &[("m", 1), ("s", -2)],
        "rad" => &[("rad", 1)],
        "rad/s" => &[("s", -1), ("rad", 1)],
        "rad/s^2" => &[("s", -2), ("rad", 1)],
        "Hz" | "1/s" => &[("s", -1)],
        "N" => &[("kg", 1), ("m", 1), ("s", -2)],
        "N/s" => &[("kg", 1), ("m", 1), ("s", -3)],
        "N m" => &[("kg", 1), ("m", 2), ("s", -2)],
        "W" => &[("kg", 1), ("m", 2), ("s", -3)],
        "V" => &[("kg", 1), ("m", 2), ("s", -3), ("A", -1)],
        "A" => &[("A", 1)],
        _ => return None,
    })
}

/// Text that XML can hold in an attribute: control characters and those that XML excludes become underscores. Escaping is
/// that of the writer.
pub(super) fn clean(text: &str) -> String {
    let allowed = |c: char| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}');
    text.trim().chars().map(|c| if allowed(c) { c } else { '_' }).collect()
}
