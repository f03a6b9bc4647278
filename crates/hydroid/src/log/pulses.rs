//! Neutral position of commands that are pulse widths.

use std::collections::BTreeMap;

/// Range of the pulse widths of servos and motor controllers \[us\].
pub(crate) const PULSE_US: std::ops::RangeInclusive<f64> = 800.0..=2200.0;
/// Range of the usual neutral position, 1500 us, with the trim of a remote control \[us\].
const NEUTRAL_US: std::ops::RangeInclusive<f64> = 1400.0..=1600.0;
/// The neutral position of a log without rest \[us\].
pub(crate) const USUAL_US: f64 = 1500.0;
/// Smallest share of a log at rest, for a value that is neutral because it is the most common one.
const AT_REST: f64 = 0.1;
/// Most values that are counted: pulse widths are whole numbers, or nearly.
const MOST: usize = 4096;

/// A neutral position, and how it was found.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Neutral {
    /// Pulse width \[us\].
    pub value: f64,
    /// How it was found.
    pub found: NeutralBy,
}

/// How a neutral position was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NeutralBy {
    /// The most common value, which the command has for a tenth of the log or longer.
    MostCommon,
    /// The first value, near 1500 us.
    First,
    /// 1500 us, which is usual.
    Convention,
}

/// Values of a column, counted as long as all are pulse widths.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pulses {
    first: Option<f64>,
    counts: BTreeMap<u64, u64>,
    rows: u64,
    is_other: bool,
}

impl Neutral {
    /// How it was found, in words.
    pub(crate) const fn words(&self) -> &'static str {
        match self.found {
            NeutralBy::MostCommon => "the most common value of the recording",
            NeutralBy::First => "the first value of the recording",
            NeutralBy::Convention => "usual for a pulse width: the recording has no rest",
        }
    }
}

impl Pulses {
    /// Those of a column.
    pub(crate) fn of(values: &[f64]) -> Self {
        let mut pulses = Self::default();
        values.iter().filter(|x| !x.is_nan()).for_each(|x| pulses.add(*x));
        pulses
    }

    pub(crate) fn add(&mut self, x: f64) {
        if self.is_other {
            return;
        }
        if !PULSE_US.contains(&x) {
            *self = Self { is_other: true, ..Self::default() };
            return;
        }
        self.first.get_or_insert(x);
        self.rows += 1;
        if let Some(count) = self.counts.get_mut(&x.to_bits()) {
            *count += 1;
        } else if self.counts.len() < MOST {
            self.counts.insert(x.to_bits(), 1);
        }
    }

    /// The neutral position: the most common value, if the vessel rests long enough, else the first value, if it is near
    /// the usual neutral position. A column that rests at its shortest pulse belongs to a motor that only turns ahead: it has
    /// none that is known. If neither is, a column that is `stated` to be a pulse width by its unit or name has
    /// the usual one; another may be a rate of revolution. Values that are no pulse widths and constants have none.
    pub(crate) fn neutral(&self, stated: bool) -> Option<Neutral> {
        let first = self.first.filter(|_| self.counts.len() > 1)?;
        let (&bits, &count) = self.counts.iter().max_by_key(|(_, count)| **count)?;
        let common = f64::from_bits(bits);
        let at_rest = count as f64 >= AT_REST * self.rows as f64;
        let (value, found) = if at_rest && NEUTRAL_US.contains(&common) {
            (common, NeutralBy::MostCommon)
        } else if at_rest && self.counts.first_key_value().is_some_and(|(shortest, _)| *shortest == bits) {
            return None;
        } else if NEUTRAL_US.contains(&first) {
            (first, NeutralBy::First)
        } else if stated {
            (USUAL_US, NeutralBy::Convention)
        } else {
            return None;
        };
        Some(Neutral { value, found })
    }
}

/// Whether unit or name say that a column is a pulse width.
pub(crate) fn is_stated(name: &str, unit: Option<&str>) -> bool {
    let name = name.to_ascii_lowercase();
    unit == Some("us") || ["pwm", "_us"].iter().any(|part| name.contains(part))
}
