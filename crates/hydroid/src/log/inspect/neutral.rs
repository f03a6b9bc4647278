//! Neutral position of commands that are pulse widths.

use super::super::csv::RawLog;
use super::super::note::Note;
use super::super::resolve::{Resolved, Source};
use super::super::selection::{ChannelSpec, Selection};

/// Range of the pulse widths of servos and motor controllers \[us\].
const PULSE_US: std::ops::RangeInclusive<f64> = 800.0..=2200.0;
/// Range of the usual neutral position, 1500 us, with the trim of a remote control \[us\].
const NEUTRAL_US: std::ops::RangeInclusive<f64> = 1400.0..=1600.0;
/// The neutral position of a log without rest \[us\].
const USUAL_US: f64 = 1500.0;
/// Smallest share of a log at rest, for a value that is neutral because it is the most common one.
const AT_REST: f64 = 0.1;

/// Adds a note for each input that is a pulse width and has no offset. Equations and networks take a command of zero as
/// no force: squares and signed squares of a pulse width hardly change.
pub(super) fn check(log: &RawLog, resolved: &Resolved, selection: &Selection, notes: &mut Vec<Note>) {
    let specs: Vec<ChannelSpec> = if selection.inputs.is_empty() {
        resolved
            .inputs
            .iter()
            .map(|s| ChannelSpec::renamed(&s.channel.name, &log.columns[s.column].name))
            .collect()
    } else {
        selection.inputs.clone()
    };
    let found: Vec<Option<f64>> = resolved.inputs.iter().map(|source| neutral(log, source)).collect();
    if found.iter().all(Option::is_none) {
        return;
    }
    let corrected: Vec<String> = specs
        .iter()
        .zip(&found)
        .map(|(spec, neutral)| {
            ChannelSpec { offset: neutral.unwrap_or(spec.offset), ..spec.clone() }.to_string()
        })
        .collect();
    let shown: Vec<String> = resolved
        .inputs
        .iter()
        .zip(&found)
        .filter_map(|(source, neutral)| Some(format!("`{}` ({})", source.channel.name, (*neutral)?)))
        .collect();
    notes.push(
        Note::warning(format!(
            "{}: inputs that look like pulse widths rest at a value other than 0: {}",
            log.path,
            shown.join(", ")
        ))
        .with_remedy(format!("subtract the neutral position: --inputs \"{}\"", corrected.join(","))),
    );
}

/// The neutral position of a pulse width: the most common value, if the vessel rests long enough, else the first value,
/// if it is near the usual neutral position. If neither is, a column whose unit or name says that it is a pulse width has
/// the usual one; another may be a rate of revolution.
fn neutral(log: &RawLog, source: &Source) -> Option<f64> {
    if source.has_offset() {
        return None;
    }
    let values = || log.columns[source.column].values.iter().copied().filter(|x| !x.is_nan());
    let first = values().next()?;
    if !values().all(|x| PULSE_US.contains(&x)) || values().all(|x| x == first) {
        return None;
    }
    let mut sorted: Vec<f64> = values().collect();
    sorted.sort_by(f64::total_cmp);
    let common = sorted.chunk_by(|a, b| a == b).max_by_key(|run| run.len())?;
    if common.len() as f64 >= AT_REST * sorted.len() as f64 && NEUTRAL_US.contains(&common[0]) {
        return Some(common[0]);
    }
    let column = &log.columns[source.column];
    let name = column.name.to_ascii_lowercase();
    let stated =
        column.unit.as_deref() == Some("us") || ["pwm", "_us"].iter().any(|part| name.contains(part));
    Some(first).filter(|first| NEUTRAL_US.contains(first)).or(stated.then_some(USUAL_US))
}
