//! Comparison of the methods, and settings of the adaptive model.

use maud::{Markup, html};

use super::number::{self, duration, fixed};
use super::page::{Section, cell, table};
use super::{Subject, judged_on};
use hydroid::identify::Candidate;

/// The section; `None` for a single model that does not adapt.
pub(super) fn section(subject: &Subject<'_>) -> Option<Section> {
    let candidates = &subject.result.candidates;
    let first = candidates.first()?;
    let learning = candidates.iter().find_map(learning);
    if candidates.len() < 2 && learning.is_none() {
        return None;
    }
    let test = first.judged();
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
            @if first.left_out.is_empty() {
                "“Validation” is the mean NRMSE over all outputs and horizons on the validation runs."
            } @else {
                "“Validation” is the mean NRMSE over all outputs and horizons in the cross-validation. Where every run is left out in turn, the settings of equations (library, lags, changes of mode, regression) are those chosen on all runs, and their terms and coefficients are fitted without the run that is judged. Members and coefficients of a committee are chosen without it."
            }
            " The model with the smallest value is chosen, but a more complex method only if its value is at least 2 % lower, and a committee unless another value is lower by more than its standard error. "
            "The columns of the outputs are their NRMSE on " (judged_on(first)) ", " (horizon) " ahead, and “mean” is the mean over all outputs. "
            @if first.test.is_some() { "The test runs do not influence the choice. " }
            "“Weights” are the non-zero coefficients of equations, or the weights of a network. All methods are evaluated on the same rollouts."
        }
        @if let Some(learning) = learning { p { (learning) } }
    };
    Some(Section::new("methods", "Methods side by side", body))
}

fn row(candidate: &Candidate, best: bool) -> Vec<Markup> {
    let name = &candidate.model.description.name;
    let nrmse = candidate.judged().nrmse.last().map_or(&[][..], Vec::as_slice);
    let mean = nrmse.iter().sum::<f64>() / nrmse.len().max(1) as f64;
    let mut cells = vec![
        html! { @if best { strong { (name) } " (best)" } @else { (name) } },
        cell(candidate.training.about()),
        cell(number::count(candidate.model.weights())),
        cell(fixed(candidate.validation.score(), 3)),
    ];
    cells.extend(nrmse.iter().chain([&mean]).map(|value| cell(fixed(*value, 3))));
    cells.push(cell(number::count(
        candidate.validation.diverged + candidate.test.as_ref().map_or(0, |test| test.diverged),
    )));
    cells
}

fn learning(candidate: &Candidate) -> Option<Markup> {
    let settings = &candidate.model.learning.as_ref()?.settings;
    let dt = candidate.model.description.dt;
    let priors: Vec<String> = settings.priors_s.iter().map(|s| duration(*s)).collect();
    Some(html! {
        "The adaptive model consists of several experts. Each starts from equations with all terms and adapts every coefficient. The experts differ in their priors: the identified equations count as much as "
        (priors.join(", ")) " of data. The prediction is a mixture of these experts, of the initial equations and of persistence, weighted by the past errors of each. The weight of a sample decreases to 1/e in "
        (duration(settings.forgetting_s)) ". The regression uses increments over " (duration(settings.window as f64 * dt))
        ". In the evaluation the model adapts along each run. A prediction uses only samples up to its origin."
    })
}
