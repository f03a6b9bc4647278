//! All methods that were tried, side by side, and how fast the one that learns does so.

use maud::{Markup, html};

use super::Subject;
use super::number::{self, duration, fixed};
use super::page::{Section, cell, table};
use crate::identify::{Candidate, Pace, Training};

/// The section; nothing where there is one model alone and it does not learn.
pub(super) fn section(subject: &Subject<'_>) -> Option<Section> {
    let candidates = &subject.result.candidates;
    let first = candidates.first()?;
    let paces = candidates.iter().find_map(paces);
    if candidates.len() < 2 && paces.is_none() {
        return None;
    }
    let test = &first.test;
    let horizon = duration(test.horizons.last().map_or(0.0, |&h| h as f64 * test.dt));
    let mut heads = vec![cell("method"), cell(""), cell("coefficients"), cell("validation")];
    heads.extend(test.channels.iter().map(cell));
    heads.extend([cell("mean"), cell("diverged")]);
    let rows: Vec<Vec<Markup>> = candidates
        .iter()
        .enumerate()
        .map(|(i, candidate)| row(candidate, subject.result.best == Some(i)))
        .collect();
    let body = html! {
        (table(&heads, &rows, 2))
        p.small {
            "Validation: mean NRMSE over all outputs and horizons on the validation runs, which decides. Then the NRMSE on the test runs, "
            (horizon) " ahead. All are judged on the same windows. A method further down is called best only if it is better on the validation runs by more than the noise of the comparison."
        }
        @if let Some((chosen, paces)) = paces { p { (learning(chosen, paces)) } }
    };
    Some(Section { id: "methods", heading: "Methods side by side", body })
}

fn row(candidate: &Candidate, best: bool) -> Vec<Markup> {
    let name = &candidate.model.description.name;
    let nrmse = candidate.test.nrmse.last().map_or(&[][..], Vec::as_slice);
    let mean = nrmse.iter().sum::<f64>() / nrmse.len().max(1) as f64;
    let mut cells = vec![
        html! { @if best { strong { (name) } " (best)" } @else { (name) } },
        cell(about(candidate)),
        cell(number::count(candidate.model.weights())),
        cell(fixed(candidate.validation.score(), 3)),
    ];
    cells.extend(nrmse.iter().chain([&mean]).map(|value| cell(fixed(*value, 3))));
    cells.push(cell(number::count(candidate.validation.diverged + candidate.test.diverged)));
    cells
}

fn about(candidate: &Candidate) -> &'static str {
    let has_past = candidate.found().trials.iter().any(|trial| !trial.structure.past.is_empty());
    match (&candidate.training, has_past) {
        (Training::Recursive(..), _) => "equations that keep learning on the way",
        (Training::Equations(_), true) => "equations that also see the past",
        (Training::Equations(_), false) => "equations of the present",
    }
}

fn paces(candidate: &Candidate) -> Option<(&Candidate, &[Pace])> {
    match &candidate.training {
        Training::Recursive(_, paces) => Some((candidate, paces)),
        Training::Equations(_) => None,
    }
}

/// What was chosen for the model that learns.
fn learning(candidate: &Candidate, paces: &[Pace]) -> Markup {
    let dt = candidate.model.description.dt;
    html! {
        @if let Some(settings) = &candidate.model.learning {
            "The model that learns takes " (duration(settings.prior_s)) " of lively sailing to believe the log as much as the equations it starts from, forgets a sample to 1/e in "
            (duration(settings.forgetting_s)) ", and learns from increments over " (duration(settings.window as f64 * dt))
            ": the most cautious of " (number::count(paces.len())) " paces that the validation runs cannot tell from the best. "
            "Evaluation lets it learn along each run; at every origin it knows what came before, and nothing later."
        }
    }
}
