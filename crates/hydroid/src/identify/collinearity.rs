//! Collinear inputs: inputs whose effects the training runs cannot separate.

use hydroid_core::model::sparse::{Shape, Signal, Term};

use super::Candidate;
use super::data_summary::ChannelSummary;
use crate::key::key;
use crate::log::Note;

pub(super) fn warnings(candidate: &Candidate, data: &[ChannelSummary]) -> Vec<Note> {
    let inputs: Vec<&ChannelSummary> = data.iter().filter(|summary| summary.input).collect();
    let mut notes = Vec::new();
    let mut named: Vec<&str> = Vec::new();
    let description = &candidate.model.description;
    for together in &description.provenance.moved_together {
        let names = together.inputs(&description.inputs);
        notes.push(
            Note::warning(format!(
                "inputs '{}' move together in the training runs ({} hardly moves): their effects cannot be separated, their coefficients may be exchanged, and trials and control with other commands are not valid",
                names.join("' and '"),
                together.name(&description.inputs)
            ))
            .with_remedy(format!(
                "log a run in which each moves independently, or remove one of them from {}",
                key("inputs")
            )),
        );
        named.extend(names);
    }
    for (name, terms) in unidentifiable_inputs(candidate, &inputs) {
        if !named.contains(&name) {
            notes.push(
                Note::warning(format!(
                    "input '{name}' moves only together with other channels in the training runs: its effect cannot be separated from theirs, and these terms are omitted: {}",
                    terms.join(", ")
                ))
                .with_remedy("log a run in which it moves independently, or remove one of the inputs"),
            );
        }
    }
    notes
}

/// Inputs that are linearly dependent on others, with the first terms that are omitted because of them.
fn unidentifiable_inputs<'a>(
    candidate: &Candidate,
    inputs: &[&'a ChannelSummary],
) -> Vec<(&'a str, Vec<String>)> {
    let (Some(found), Some(motion)) = (candidate.found(), candidate.model.equations()) else {
        return Vec::new();
    };
    let equations = &found.fit.equations;
    let outputs = equations.outputs();
    let source = |variable: u16| match usize::from(variable).checked_sub(outputs + equations.inputs()) {
        Some(signal) => equations.signals().get(signal).map(Signal::source).map(usize::from),
        None => Some(usize::from(variable)),
    };
    // A linear term of an input or of its lag state, in all modes or in one.
    let alone = |term: &Term| {
        let mut rest =
            term.factors().iter().filter(|f| !matches!(f.shape, Shape::Above(_) | Shape::Below(_)));
        let factor = rest.next().filter(|f| f.shape == Shape::Power(1))?;
        if rest.next().is_some() { None } else { source(factor.variable)?.checked_sub(outputs) }
    };
    let mut lost: Vec<usize> = found.unidentifiable.iter().filter_map(alone).collect();
    lost.sort_unstable();
    lost.dedup();
    let (names, modes) = (motion.variable_names(), motion.modes());
    let with_terms = |input: usize| {
        let summary = inputs.get(input).filter(|s| s.parts[0].max > s.parts[0].min)?;
        let of = |term: &&Term| term.factors().iter().any(|f| source(f.variable) == Some(outputs + input));
        let terms = found.unidentifiable.iter().filter(of).take(6).map(|term| modes.name(term, &names));
        Some((summary.channel.name.as_str(), terms.collect()))
    };
    lost.into_iter().filter_map(with_terms).collect()
}
