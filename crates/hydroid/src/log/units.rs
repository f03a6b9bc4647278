//! Unit conversion: units of columns, and their factors to SI.
//!
//! Values are stored in metres, seconds, radians, newtons and volts, but shaft speeds in revolutions per second
//! (`rps`), the unit of propeller coefficients. An unknown unit is kept with factor 1.
//!
//! `/sec` and `/second` are read as `/s`. Case matters only for units that differ in case alone (`Nm`, `NM`, `nm`;
//! `Ns`, `ns`; `mV` and a megavolt). `kn` is knots and `kN` is kilonewtons. Any other spelling of the two (`KN`, `Kn`)
//! is read as knots, because nearly every log contains speeds; [`Unit::is_doubtful`] reports this guess.

use std::f64::consts::TAU;

/// Physical quantity of a unit. Only units of the same quantity can be converted into each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// m/s.
    Speed,
    /// m/s^2.
    Acceleration,
    /// rad/s, rps.
    Rotation,
    /// rad.
    Angle,
    /// m.
    Length,
    /// N.
    Force,
    /// N m.
    Moment,
    /// N s.
    Impulse,
    /// s.
    Time,
    /// V.
    Voltage,
    /// Dimensionless.
    Number,
}

/// An ambiguous unit or an impossible conversion.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum UnitError {
    #[error("the unit `nm` may mean nautical miles or newton metres; write `NM`, `N m` or `m`")]
    Ambiguous,
    #[error("the unit `{text}` may mean {one} or {other}; write it in the usual case")]
    AmbiguousCase { text: String, one: &'static str, other: &'static str },
    #[error("`{from}` cannot be converted to `{to}`: they measure different things")]
    Incompatible { from: String, to: String },
}

/// A parsed unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// Text of the unit in the log.
    pub text: String,
    /// Symbol of the unit of the stored values.
    pub si: String,
    /// Stored value divided by the value in the log.
    pub factor: f64,
    /// Physical quantity; `None` for an unknown unit.
    pub quantity: Option<Quantity>,
    /// Value in the base unit of the quantity divided by the value in the log.
    base: f64,
}

struct Known {
    names: &'static [&'static str],
    quantity: Quantity,
    si: &'static str,
    base: f64,
    si_base: f64,
}

const fn known(quantity: Quantity, si: &'static str, base: f64, names: &'static [&'static str]) -> Known {
    Known { names, quantity, si, base, si_base: 1.0 }
}

const DEGREE: f64 = TAU / 360.0;

// Names are compared without spaces, `*`, `·`, `.` and `^`, and with `/sec` as `/s`: first with case, then without.
const TABLE: &[Known] = &[
    known(Quantity::Speed, "m/s", 1.0, &["m/s", "mps", "ms-1", "meter/s", "metre/s", "meters/s", "metres/s"]),
    known(Quantity::Speed, "m/s", 1852.0 / 3600.0, &["kn", "knot", "knots", "kt", "kts"]),
    known(Quantity::Speed, "m/s", 1.0 / 3.6, &["km/h", "kmh", "kph", "km/hr"]),
    known(Quantity::Speed, "m/s", 0.01, &["cm/s", "cmps"]),
    known(Quantity::Speed, "m/s", 0.001, &["mm/s", "mmps"]),
    known(Quantity::Speed, "m/s", 0.3048, &["ft/s", "fps"]),
    known(Quantity::Acceleration, "m/s^2", 1.0, &["m/s2", "m/s/s", "ms-2"]),
    known(Quantity::Acceleration, "m/s^2", 9.806_65, &["g"]),
    known(Quantity::Rotation, "rad/s", 1.0, &["rad/s", "radps", "rads-1", "radian/s", "radians/s"]),
    known(
        Quantity::Rotation,
        "rad/s",
        DEGREE,
        &["deg/s", "degps", "°/s", "dps", "degs/s", "degree/s", "degrees/s"],
    ),
    known(Quantity::Rotation, "rad/s", DEGREE / 60.0, &["deg/min", "°/min", "degree/min", "degrees/min"]),
    Known {
        names: &["rps", "rev/s", "1/s"],
        quantity: Quantity::Rotation,
        si: "rps",
        base: TAU,
        si_base: TAU,
    },
    Known {
        names: &["rpm", "rev/min", "1/min"],
        quantity: Quantity::Rotation,
        si: "rps",
        base: TAU / 60.0,
        si_base: TAU,
    },
    known(Quantity::Angle, "rad", 1.0, &["rad", "radian", "radians"]),
    known(Quantity::Angle, "rad", DEGREE, &["deg", "degs", "°", "degree", "degrees"]),
    known(Quantity::Length, "m", 1.0, &["m", "meter", "metre", "meters", "metres"]),
    known(Quantity::Length, "m", 0.01, &["cm"]),
    known(Quantity::Length, "m", 0.001, &["mm"]),
    known(Quantity::Length, "m", 0.3048, &["ft"]),
    known(Quantity::Length, "m", 1000.0, &["km"]),
    known(Quantity::Length, "m", 1852.0, &["NM", "nmi"]),
    known(Quantity::Force, "N", 1.0, &["N"]),
    known(Quantity::Force, "N", 1000.0, &["kN"]),
    known(Quantity::Moment, "N m", 1.0, &["Nm"]),
    known(Quantity::Moment, "N m", 1000.0, &["kNm"]),
    known(Quantity::Impulse, "N s", 1.0, &["Ns"]),
    known(Quantity::Time, "s", 1.0, &["s", "sec", "second", "seconds"]),
    known(Quantity::Time, "s", 1e-3, &["ms"]),
    // Pulse widths are not converted; times are.
    Known { names: &["us", "µs", "μs"], quantity: Quantity::Time, si: "us", base: 1e-6, si_base: 1e-6 },
    known(Quantity::Time, "s", 1e-9, &["ns"]),
    known(Quantity::Time, "s", 60.0, &["min"]),
    known(Quantity::Time, "s", 3600.0, &["h"]),
    known(Quantity::Time, "s", 86_400.0, &["d"]),
    known(Quantity::Voltage, "V", 1.0, &["V"]),
    known(Quantity::Voltage, "V", 1e-3, &["mV"]),
    known(Quantity::Number, "1", 1.0, &["1", "-"]),
    known(Quantity::Number, "1", 0.01, &["%"]),
];

impl Unit {
    /// Parses the unit of a header.
    ///
    /// # Errors
    /// For the ambiguous unit `nm` and for a spelling such as `NS` that matches two units.
    pub fn parse(text: &str) -> Result<Self, UnitError> {
        let text = text.trim();
        let squeezed: String = text
            .chars()
            .filter(|c| !c.is_whitespace() && !matches!(c, '*' | '·' | '⋅' | '.' | '^'))
            .collect();
        if squeezed == "nm" {
            return Err(UnitError::Ambiguous);
        }
        let found = find(&squeezed, text)?;
        Ok(match found {
            Some(k) => Self {
                text: text.to_owned(),
                si: k.si.to_owned(),
                factor: if k.base == k.si_base { 1.0 } else { k.base / k.si_base },
                quantity: Some(k.quantity),
                base: k.base,
            },
            None => {
                Self { text: text.to_owned(), si: text.to_owned(), factor: 1.0, quantity: None, base: 1.0 }
            }
        })
    }

    /// Whether the unit is known.
    pub fn is_known(&self) -> bool {
        self.quantity.is_some()
    }

    /// Whether the spelling matches two units and the likelier one was chosen: `KN` as knots.
    pub fn is_doubtful(&self) -> bool {
        self.text.eq_ignore_ascii_case("kn") && !matches!(self.text.as_str(), "kn" | "kN")
    }

    /// Factor from this unit to another.
    ///
    /// # Errors
    /// If the units have different quantities, or if they differ and one of them is unknown.
    pub fn to(&self, other: &Self) -> Result<f64, UnitError> {
        if self.si == other.si && !self.is_known() && !other.is_known() {
            return Ok(1.0);
        }
        if self.is_known() && self.quantity == other.quantity {
            return Ok(self.base / other.base);
        }
        Err(UnitError::Incompatible { from: self.text.clone(), to: other.text.clone() })
    }
}

/// Looks up a normalized unit: first with case, then without if only one entry matches.
fn find(squeezed: &str, text: &str) -> Result<Option<&'static Known>, UnitError> {
    let exact = |name: &str| TABLE.iter().find(|k| k.names.contains(&name));
    if let Some(known) = exact(squeezed) {
        return Ok(Some(known));
    }
    let lower = squeezed.to_lowercase();
    let plain = ["/seconds", "/second", "/sec"].iter().fold(lower, |name, long| name.replace(long, "/s"));
    match plain.as_str() {
        // `KN` is knots (see the module). `MV` is not guessed: milli and mega differ by a factor of 1e9.
        "kn" => return Ok(exact("kn")),
        "mv" if squeezed.starts_with('M') => return Ok(None),
        _ => {}
    }
    let mut found = TABLE.iter().filter(|k| k.names.iter().any(|name| name.to_lowercase() == plain));
    match (found.next(), found.next()) {
        (Some(one), Some(other)) => {
            Err(UnitError::AmbiguousCase { text: text.to_owned(), one: one.names[0], other: other.names[0] })
        }
        (found, _) => Ok(found),
    }
}

/// Whether the text in parentheses at the end of a name, as in `Speed (kn)`, is a unit. Numbers (`thruster (1)`) and
/// single letters in another case (`rudder (S)`) belong to the name. An ambiguous unit counts as one, so that it is
/// refused like an ambiguous unit in brackets.
pub(crate) fn is_unit_in_parentheses(text: &str) -> bool {
    let text = text.trim();
    let single = text.chars().count() == 1;
    let exact = TABLE.iter().any(|k| k.names.contains(&text));
    match Unit::parse(text) {
        Ok(unit) if unit.quantity == Some(Quantity::Number) => text == "%",
        Ok(unit) => unit.is_known() && (exact || !single),
        Err(_) => true,
    }
}

/// The unit in the suffix of a column name (`u_mps`, `u_m_s`, `heading_deg`), if any, and the name without it. The
/// suffixes `_ms` and `_us` are units of the time column only (`clock`); elsewhere they denote pulse widths, which are
/// not converted.
pub fn from_name(name: &str, clock: bool) -> Option<(&str, &'static str)> {
    // Before the others: `u_m_s` does not end in seconds.
    const QUOTIENTS: &[(&str, &str)] = &[
        ("m_s", "m/s"),
        ("cm_s", "cm/s"),
        ("mm_s", "mm/s"),
        ("km_h", "km/h"),
        ("ft_s", "ft/s"),
        ("m_s2", "m/s^2"),
        ("rad_s", "rad/s"),
        ("deg_s", "deg/s"),
        ("deg_min", "deg/min"),
    ];
    const ENDINGS: &[(&str, &str)] = &[
        ("mps", "m/s"),
        ("radps", "rad/s"),
        ("degps", "deg/s"),
        ("dps", "deg/s"),
        ("kn", "kn"),
        ("kt", "kn"),
        ("knots", "kn"),
        ("kts", "kn"),
        ("kmh", "km/h"),
        ("rad", "rad"),
        ("deg", "deg"),
        ("rpm", "rpm"),
        ("rps", "rps"),
        ("m", "m"),
        ("s", "s"),
        ("N", "N"),
        ("Nm", "N m"),
        ("V", "V"),
    ];
    const CLOCK: &[(&str, &str)] = &[("ms", "ms"), ("us", "us"), ("ns", "ns"), ("sec", "s")];
    let clock_endings = if clock { CLOCK } else { &[] };
    QUOTIENTS.iter().chain(ENDINGS).chain(clock_endings).find_map(|(ending, unit)| {
        let at = name.len().checked_sub(ending.len()).filter(|&at| name.is_char_boundary(at))?;
        let (stem, found) = name.split_at(at);
        let stem = stem.strip_suffix('_').filter(|stem| !stem.is_empty())?;
        // Short suffixes are case-sensitive (`N`, `n`); long suffixes are not.
        let fits = *ending == found || ending.len() > 2 && ending.eq_ignore_ascii_case(found);
        fits.then_some((stem, *unit))
    })
}
