//! Statistics of each column, and disagreements between columns of the same quantity.

use super::super::csv::{RawColumn, RawLog};
use super::super::units::{self, Unit};

/// Smallest correlation of two consistent measurements of one quantity.
const DOUBTFUL: f64 = 0.5;

/// One column of the file, in its own unit.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ColumnReport {
    /// Name.
    pub name: String,
    /// Unit, from the header or from the end of the name; empty if not stated.
    pub unit: String,
    /// Smallest value. This field and the next three are `None` for a column without values.
    pub min: Option<f64>,
    /// Largest value.
    pub max: Option<f64>,
    /// Mean.
    pub mean: Option<f64>,
    /// Standard deviation.
    pub std: Option<f64>,
    /// Rows without a value.
    pub missing: usize,
    /// Longest run of rows without a value.
    pub longest_missing: usize,
    /// Cells with text or an infinite number; also counted as missing.
    pub not_numbers: usize,
    /// Share of rows that repeat the value of the previous row.
    pub repeated: f64,
    /// Whether the column is constant.
    pub constant: bool,
}

impl ColumnReport {
    pub(super) fn of(column: &RawColumn) -> Self {
        let values = || column.values.iter().copied().filter(|x| !x.is_nan());
        let n = values().count();
        let some = |x: f64| (n > 0 && x.is_finite()).then_some(x);
        let mean = values().sum::<f64>() / n as f64;
        let variance = values().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n as f64;
        let (min, max) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let (mut longest, mut current) = (0, 0);
        for x in &column.values {
            current = if x.is_nan() { current + 1 } else { 0 };
            longest = longest.max(current);
        }
        let pairs = column.values.windows(2).filter(|p| !p[0].is_nan() && !p[1].is_nan());
        let (all, same) =
            pairs.fold((0_usize, 0_usize), |(all, same), p| (all + 1, same + usize::from(p[0] == p[1])));
        Self {
            name: column.name.clone(),
            unit: unit_of(column),
            min: some(min),
            max: some(max),
            mean: some(mean),
            std: some(variance.sqrt()),
            missing: column.values.len() - n,
            longest_missing: longest,
            not_numbers: column.bad_cells,
            repeated: same as f64 / all.max(1) as f64,
            constant: n > 0 && min == max,
        }
    }
}

fn unit_of(column: &RawColumn) -> String {
    if column.stamps.is_some() {
        return "s".to_owned();
    }
    let ending = || units::from_name(&column.name, false).map(|(_, unit)| unit.to_owned());
    column.unit.clone().or_else(ending).unwrap_or_default()
}

/// Two columns of the same velocity, by name and unit, with a low correlation.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Disagreement {
    /// First column.
    pub first: String,
    /// Second column.
    pub second: String,
    /// Name of the velocity.
    pub quantity: &'static str,
    /// Correlation of the columns.
    pub correlation: f64,
}

/// Pairs such as `v_mps` and `v_from_pos_mps`.
pub(super) fn disagreements(log: &RawLog) -> Vec<Disagreement> {
    let mut found = Vec::new();
    for (i, a) in log.columns.iter().enumerate() {
        let Some((letter, quantity)) = velocity(a) else { continue };
        for b in &log.columns[i + 1..] {
            if velocity(b).is_none_or(|other| other.0 != letter) || si_of(a) != si_of(b) {
                continue;
            }
            if let Some(correlation) = correlation(&a.values, &b.values)
                && correlation < DOUBTFUL
            {
                found.push(Disagreement {
                    first: a.name.clone(),
                    second: b.name.clone(),
                    quantity,
                    correlation,
                });
            }
        }
    }
    found
}

/// The letter of a velocity and its name, for `u`, `u_mps`, `u_from_pos_mps` and so on.
fn velocity(column: &RawColumn) -> Option<(&str, &'static str)> {
    let letter = column.name.split(['_', ' ', '.']).next()?;
    let (quantity, unit) = match letter {
        "u" => ("surge", "m/s"),
        "v" => ("sway", "m/s"),
        "w" => ("heave", "m/s"),
        "p" => ("roll rate", "rad/s"),
        "q" => ("pitch rate", "rad/s"),
        "r" => ("yaw rate", "rad/s"),
        _ => return None,
    };
    // The name of a command or a pulse width may begin with the same letter.
    let si = si_of(column);
    (si == unit || si.is_empty() && !super::super::resolve::is_command_name(&column.name))
        .then_some((letter, quantity))
}

fn si_of(column: &RawColumn) -> String {
    Unit::parse(&unit_of(column))
        .map(|u| if u.text.is_empty() { String::new() } else { u.si })
        .unwrap_or_default()
}

fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let pairs = || a.iter().zip(b).filter(|(a, b)| !a.is_nan() && !b.is_nan());
    let n = pairs().count();
    if n < 10 {
        return None;
    }
    let (ma, mb) = pairs().fold((0.0, 0.0), |(sa, sb), (a, b)| (sa + a / n as f64, sb + b / n as f64));
    let (mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0);
    for (a, b) in pairs() {
        saa += (a - ma) * (a - ma);
        sbb += (b - mb) * (b - mb);
        sab += (a - ma) * (b - mb);
    }
    let r = sab / (saa * sbb).sqrt();
    r.is_finite().then_some(r)
}
