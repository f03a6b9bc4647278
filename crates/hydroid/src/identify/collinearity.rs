//! Collinear inputs: inputs whose effects the training runs cannot separate.

use hydroid_core::model::sparse::{Shape, Signal, Term};

use super::Candidate;
use super::data_summary::ChannelSummary;
use crate::key::key;
use crate::log::{Note, Trajectory};

/// Correlation above which two inputs are collinear.
const MAX_CORRELATION: f64 = 0.999;

pub(super) fn warnings(candidate: &Candidate, data: &[ChannelSummary], training: &[Trajectory]) -> Vec<Note> {
    let inputs: Vec<&ChannelSummary> = data.iter().filter(|summary| summary.input).collect();
    let moves = |i: usize| inputs[i].parts[0].max > inputs[i].parts[0].min;
    let mut notes = Vec::new();
    let mut named: Vec<&str> = Vec::new();
    for b in (0..inputs.len()).filter(|&b| moves(b)) {
        for a in (0..b).filter(|&a| moves(a)) {
            let correlation = correlation(training, a, b);
            if correlation.abs() < MAX_CORRELATION {
                continue;
            }
            let [first, second] = [a, b].map(|i| inputs[i].channel.name.as_str());
            named.extend([first, second]);
            notes.push(
                Note::warning(format!(
                    "inputs '{first}' and '{second}' move together in the training runs (correlation {correlation:.4}): their effects cannot be separated, and their coefficients may be exchanged"
                ))
                .with_remedy(format!(
                    "log a run in which each moves independently, or remove one of them from {}",
                    key("inputs")
                )),
            );
        }
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

fn correlation(runs: &[Trajectory], a: usize, b: usize) -> f64 {
    let pairs = || {
        let rows = runs.iter().flat_map(|run| (0..run.len()).map(|k| run.inputs.row(k)));
        rows.map(move |row| (row[a], row[b])).filter(|(x, y)| x.is_finite() && y.is_finite())
    };
    let (n, x, y) = pairs().fold((0.0, 0.0, 0.0), |(n, sx, sy), (x, y)| (n + 1.0, sx + x, sy + y));
    let (x, y) = (x / n, y / n);
    let (xx, xy, yy) = pairs().fold((0.0, 0.0, 0.0), |(xx, xy, yy), (a, b)| {
        (xx + (a - x).powi(2), xy + (a - x) * (b - y), yy + (b - y).powi(2))
    });
    xy / (xx * yy).sqrt()
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
