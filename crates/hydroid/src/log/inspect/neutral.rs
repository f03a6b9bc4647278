//! Neutral position of commands that are pulse widths.

use super::super::csv::RawLog;
use super::super::note::Note;
use super::super::pulses::{self, Pulses};
use super::super::resolve::{Resolved, Source};
use super::super::selection::{ChannelSpec, Selection};
use crate::key::key;

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
        .with_remedy(format!("subtract the neutral position: {}", key("inputs").is(corrected.join(",")))),
    );
}

/// The neutral position of a pulse width without an offset.
fn neutral(log: &RawLog, source: &Source) -> Option<f64> {
    if source.has_offset() {
        return None;
    }
    let column = &log.columns[source.column];
    Some(Pulses::of(&column.values).neutral(pulses::is_stated(&column.name, column.unit.as_deref()))?.value)
}
