//! Excitation of the inputs.

use super::super::note::Note;
use super::super::trajectory::Trajectory;
use super::delay::DelayEstimate;

const MOST_LEVELS: usize = 1000;
/// Smallest rate of moves of a well excited input \[1/min\].
pub(super) const FEW_MOVES: f64 = 0.5;
/// Smallest change that counts as a move, as a share of the range; smaller changes are sensor noise.
const SMALL_MOVE: f64 = 0.02;

/// Excitation of one input over all runs of the log.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct InputReport {
    /// Name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Whether the input is constant.
    pub constant: bool,
    /// Number of different values (1000 stands for 1000 and more).
    pub levels: usize,
    /// Moves by more than 2 % of the range, per minute.
    pub moves_per_minute: f64,
    /// Share of the samples within 0.5 % of the range from the smallest or the largest value.
    pub at_limits: f64,
    /// Delay of this input, with the others at the common delay.
    pub delay: Option<DelayEstimate>,
}

pub(super) fn reports(runs: &[Trajectory], notes: &mut Vec<Note>) -> Vec<InputReport> {
    let minutes: f64 = runs.iter().map(|r| r.len() as f64 * r.dt / 60.0).sum();
    let Some(first) = runs.first() else { return Vec::new() };
    let mut reports = Vec::new();
    for (i, channel) in first.inputs.channels().iter().enumerate() {
        let values = || runs.iter().flat_map(move |r| r.inputs.column(i));
        let (min, max) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let range = max - min;
        let constant = range <= 0.0;
        let mut levels = std::collections::HashSet::new();
        let mut at_limits = 0_usize;
        let mut last = None;
        for x in values() {
            if levels.len() < MOST_LEVELS && last != Some(x) {
                levels.insert((x + 0.0).to_bits());
                last = Some(x);
            }
            at_limits += usize::from(!constant && (x - min <= 0.005 * range || max - x <= 0.005 * range));
        }
        let moves: usize = runs.iter().map(|r| moves(r.inputs.column(i), SMALL_MOVE * range)).sum();
        let samples: usize = runs.iter().map(Trajectory::len).sum();
        let report = InputReport {
            name: channel.name.clone(),
            unit: channel.unit.clone(),
            min,
            max,
            constant,
            levels: levels.len(),
            moves_per_minute: moves as f64 / minutes.max(f64::MIN_POSITIVE),
            at_limits: at_limits as f64 / samples.max(1) as f64,
            delay: None,
        };
        if !constant && report.moves_per_minute < FEW_MOVES {
            notes.push(
                Note::warning(format!(
                    "the input `{}` hardly moves ({moves} moves in {minutes:.1} min): its effect is hard to separate from drift and wind",
                    channel.name
                ))
                .with_remedy("record manoeuvres in which it moves often and over its full range"),
            );
        }
        reports.push(report);
    }
    reports
}

/// Number of changes by more than `least` from the last level; a ramp counts once per `least`.
fn moves(values: impl Iterator<Item = f64>, least: f64) -> usize {
    let mut level = None;
    let mut moves = 0;
    for x in values {
        match level {
            None => level = Some(x),
            Some(at) if (x - at).abs() > least => {
                moves += 1;
                level = Some(x);
            }
            Some(_) => {}
        }
    }
    moves
}
