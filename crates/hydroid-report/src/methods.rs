//! Comparison of the methods, and settings of the model that adapts online.

use maud::{Markup, html};

use super::Subject;
use super::number::{self, duration, fixed};
use super::page::{Section, cell, table};
use hydroid::identify::Candidate;

/// The section; nothing where there is one model alone and it does not learn.
pub(super) fn section(subject: &Subject<'_>) -> Option<Section> {
    let candidates = &subject.result.candidates;
    let first = candidates.first()?;
    let learning = candidates.iter().find_map(learning);
    if candidates.len() < 2 && learning.is_none() {
        return None;
    }
    let test = &first.test;
    let horizon = duration(test.horizons.last().map_or(0.0, |&h| h as f64 * test.dt));
    let mut heads = vec![cell("method"), cell(""), cell("weights"), cell("validation")];
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
            "Validation: mean NRMSE over all outputs and horizons on the validation runs, by which the model is chosen. Outputs: NRMSE on the test runs, "
            (horizon) " ahead. All methods are evaluated on the same rollouts. Weights: non-zero coefficients, or weights of a network. A more complex method is chosen only if its validation error is at least 2 % lower; the test runs do not influence the choice."
        }
        @if let Some(learning) = learning { p { (learning) } }
    };
    Some(Section::new("methods", "Methods side by side", body))
}

fn row(candidate: &Candidate, best: bool) -> Vec<Markup> {
    let name = &candidate.model.description.name;
    let nrmse = candidate.test.nrmse.last().map_or(&[][..], Vec::as_slice);
    let mean = nrmse.iter().sum::<f64>() / nrmse.len().max(1) as f64;
    let mut cells = vec![
        html! { @if best { strong { (name) } " (best)" } @else { (name) } },
        cell(candidate.training.about()),
        cell(number::count(candidate.model.weights())),
        cell(fixed(candidate.validation.score(), 3)),
    ];
    cells.extend(nrmse.iter().chain([&mean]).map(|value| cell(fixed(*value, 3))));
    cells.push(cell(number::count(candidate.validation.diverged + candidate.test.diverged)));
    cells
}

/// Settings of the model that adapts online.
fn learning(candidate: &Candidate) -> Option<Markup> {
    let settings = &candidate.model.learning.as_ref()?.settings;
    let dt = candidate.model.description.dt;
    let priors: Vec<String> = settings.priors_s.iter().map(|s| duration(*s)).collect();
    Some(html! {
        "The adaptive model starts from equations with all terms and adapts every coefficient in several experts with different priors. The identified equations count as much as "
        (priors.join(", ")) " of data. The prediction is an expert mixture of these, of the initial equations and of persistence, weighted by their past errors. The weight of a sample falls to 1/e in "
        (duration(settings.forgetting_s)) "; increments span " (duration(settings.window as f64 * dt))
        ". In the evaluation the model adapts along each run; a prediction uses samples up to its origin only."
    })
}
