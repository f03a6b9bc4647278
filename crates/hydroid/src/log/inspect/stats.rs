//! Statistics of each column, and disagreements between columns of the same quantity.

use rayon::prelude::*;

use super::super::csv::{RawColumn, RawLog};
use super::super::summary::{PairSummary, Summary};
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
        let computed = column.left_out.is_none().then(|| Summary::of(&column.values));
        let summary = computed.as_ref().or(column.left_out.as_ref()).cloned().unwrap_or_default();
        let (rows, n) = summary.counts();
        let some = |x: f64| (n > 0 && x.is_finite()).then_some(x);
        let (mean, variance) = summary.mean_and_variance();
        Self {
            name: column.name.clone(),
            unit: unit_of(column),
            min: some(summary.min),
            max: some(summary.max),
            mean: some(mean),
            std: some(variance.sqrt()),
            missing: rows - n,
            longest_missing: summary.longest_missing,
            not_numbers: column.bad_cells,
            repeated: summary.repeats as f64 / summary.pairs.max(1) as f64,
            constant: n > 0 && summary.is_constant(),
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

/// Pairs of columns such as `v_mps` and `v_from_pos_mps`.
pub(super) fn comparable(log: &RawLog) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for (i, a) in log.columns.iter().enumerate() {
        let Some((letter, _)) = velocity(a) else { continue };
        for (j, b) in log.columns.iter().enumerate().skip(i + 1) {
            if velocity(b).is_some_and(|other| other.0 == letter) && si_of(a) == si_of(b) {
                found.push((i, j));
            }
        }
    }
    found
}

/// Comparable pairs that do not agree.
pub(super) fn disagreements(log: &RawLog) -> Vec<Disagreement> {
    let correlated = comparable(log).into_par_iter().map(|(i, j)| {
        let (a, b) = (&log.columns[i], &log.columns[j]);
        let read = log.rest.pairs.iter().find(|(a, b, _)| (*a, *b) == (i, j));
        let correlation = match read {
            Some((_, _, pair)) => correlation(pair),
            None => correlation(&PairSummary::of(&a.values, &b.values)),
        }?;
        let quantity = velocity(a)?.1;
        let (first, second) = (a.name.clone(), b.name.clone());
        (correlation < DOUBTFUL).then_some(Disagreement { first, second, quantity, correlation })
    });
    correlated.collect::<Vec<_>>().into_iter().flatten().collect()
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

fn correlation(pair: &PairSummary) -> Option<f64> {
    Some(pair.correlation()).filter(|r| pair.count() >= 10 && r.is_finite())
}
