//! The summary: verdict, errors of the outputs, data, warnings.

use maud::{Markup, html};

use super::currents::currents;
use super::equations::Sparse;
use super::number::{self, duration, ratio};
use super::page::{Section, cell, notes, readable, table};
use super::{Subject, judged_on, runs, style};
use hydroid::evaluate::RunErrors;
use hydroid::identify::{Candidate, CrossValidation, Grade, Verdict};
use hydroid::log::{Note, Severity, Split, Trajectory};
use hydroid::model::Port;

const SHOWN: usize = 5;

pub(super) fn section(subject: &Subject<'_>) -> Section {
    let warnings = warnings(subject);
    let body = html! {
        header {
            p.kicker { "hydroid · identification report" }
            h1 { (subject.context.title) }
            @if let Some(made) = &subject.context.made { p.made { (made) } }
        }
        (headline(subject))
        @if let Some(candidate) = subject.candidate { p { (delivery(subject, candidate)) } }
        @if let Some(candidate) = subject.candidate {
            div.tiles { @for verdict in &subject.result.verdicts { (tile(verdict, &candidate.model.description.outputs)) } }
            @if !subject.result.verdicts.is_empty() { (legend(candidate)) }
        }
        (facts(subject))
        @if let Some(candidate) = subject.candidate { (errors_by_run(candidate)) }
        (currents(subject.result))
        @if !warnings.is_empty() {
            h3 { "Warnings" }
            (notes(&warnings[..warnings.len().min(SHOWN)]))
            @if warnings.len() > SHOWN {
                details {
                    summary { (number::count(warnings.len() - SHOWN)) " more" }
                    (notes(&warnings[SHOWN..]))
                }
            }
        }
    };
    Section::new("summary", "Summary", body)
}

fn warnings<'a>(subject: &'a Subject<'_>) -> Vec<&'a Note> {
    let all = subject.result.warnings.iter().chain(&subject.context.notes).chain(&subject.split.notes);
    let mut list: Vec<&Note> = Vec::new();
    for note in all.filter(|note| note.severity == Severity::Warning) {
        // The result may contain the notes of the split.
        if !list.contains(&note) {
            list.push(note);
        }
    }
    list
}

pub(super) fn list(names: &[&str]) -> Markup {
    html! {
        @for (i, name) in names.iter().enumerate() {
            @if i > 0 { @if i + 1 == names.len() { " and " } @else { ", " } }
            b { (name) }
        }
    }
}

fn headline(subject: &Subject<'_>) -> Markup {
    let verdicts = &subject.result.verdicts;
    let of = |grade: Grade| -> Vec<&str> {
        verdicts.iter().filter(|v| v.grade == grade).map(|v| v.channel.as_str()).collect()
    };
    let (good, usable) = (of(Grade::Good), of(Grade::Usable));
    let bad = [of(Grade::NotIdentified), of(Grade::NotJudged)].concat();
    let sound: Vec<&str> = [&good[..], &usable[..]].concat();
    if let Some(missing) = &subject.result.missing {
        return banner("bad", "Not enough data.", &html! { (missing.describe()) "." });
    }
    let Some(candidate) = subject.candidate else {
        return banner(
            "bad",
            "Nothing was identified.",
            &html! { "There is no model to show. The sections below describe the data." },
        );
    };
    let over = horizon(candidate);
    let (judged, validation) = (candidate.judged(), &candidate.validation);
    let on = judged_on(candidate);
    if verdicts.is_empty() || judged.windows == 0 {
        let why = html! { "No rollout was possible, so the prediction error is unknown." };
        return banner("bad", "This model was not judged.", &why);
    }
    if subject.result.best.is_none() {
        if judged.diverged + validation.diverged == 0 {
            let why = html! { "No model was good enough to be recommended. The sections below show the first one." };
            return banner("bad", "No model is recommended.", &why);
        }
        let text = html! {
            (number::count(judged.diverged)) " of " (number::count(judged.windows)) " rollouts over " (over) " on " (on)
            @if candidate.test.is_some() {
                " and " (number::count(validation.diverged)) " of " (number::count(validation.windows)) " on the validation runs"
            }
            " diverge. They enter the errors below with predictions that are limited to ten times the range."
        };
        return banner("bad", "Do not use this model: it diverges.", &text);
    }
    if sound.is_empty() {
        let text = html! { "Over " (over) ", no output is predicted at least 10 % better than by persistence or the mean." };
        return banner("bad", "This model is of no use.", &text);
    }
    if !bad.is_empty() {
        let text = html! {
            "Over " (over) ", " (list(&sound)) @if sound.len() == 1 { " is" } @else { " are" }
            " predicted better than by persistence and the mean. Do not use the prediction of " (list(&bad)) "."
            (learns(candidate))
        };
        return banner("usable", "Usable in part.", &text);
    }
    if usable.is_empty() {
        let text = html! {
            "On " (on) ", " (list(&good)) @if good.len() == 1 { " is" } @else { " are" }
            " predicted over " (over) " with at most half of the error of persistence and the mean." (learns(candidate))
        };
        return banner("good", "A good model.", &text);
    }
    let text = html! {
        "On " (on) ", all outputs are predicted over " (over) " better than by persistence and the mean"
        @if !good.is_empty() { ", and " (list(&good)) " with at most half of their error" } "." (learns(candidate))
    };
    banner("usable", "A usable model.", &text)
}

/// What was delivered, how it was judged, and what the readable equations cost.
fn delivery(subject: &Subject<'_>, candidate: &Candidate) -> Markup {
    let title = candidate.model.title();
    let mean = |candidate: &Candidate| {
        let row = candidate.judged().nrmse.last().map_or(&[][..], Vec::as_slice);
        row.iter().sum::<f64>() / row.len().max(1) as f64
    };
    let readable = subject.result.candidates.iter().filter(|other| Sparse::of(other).is_some());
    let readable = readable.min_by(|a, b| mean(a).total_cmp(&mean(b)));
    let readable = readable.filter(|_| Sparse::of(candidate).is_none() && mean(candidate) > 0.0);
    html! {
        "The delivered model (" (title.to_lowercase()) ") "
        @if candidate.test.is_none() {
            "was fitted to all runs. It was judged by cross-validation: each " (part_name(subject))
            " was predicted by a model that was fitted without it."
        } @else {
            "was judged on test runs that took no part in fitting or selection."
        }
        " Use it up to " (horizon(candidate)) " ahead, inside the ranges of speeds and commands below."
        @if let Some(equations) = readable {
            @let change = 100.0 * (mean(equations) / mean(candidate) - 1.0);
            " The equations of " (equations.model.description.name) " can be read; their mean error " (horizon(candidate)) " ahead is "
            (number::text(change.abs(), 2)) " % " @if change < 0.0 { "smaller" } @else { "larger" } "."
        }
    }
}

fn learns(candidate: &Candidate) -> Markup {
    html! {
        @if candidate.model.learning.is_some() {
            " This model adapts online: its errors are those of the model adapted along each run up to the origin. The equations below are the initial ones. The comparison of methods includes models that do not adapt."
        }
    }
}

fn banner(class: &str, title: &str, text: &Markup) -> Markup {
    html! { div class={ "banner " (class) } role="status" { strong { (title) } " " (text) } }
}

fn horizon(candidate: &Candidate) -> String {
    let test = candidate.judged();
    duration(test.horizons.last().map_or(0.0, |&h| h as f64 * test.dt))
}

const BAR_END: f64 = 1.5;

/// Grade and error of an output.
pub(super) fn tile(verdict: &Verdict, outputs: &[Port]) -> Markup {
    let (word, symbol, class) = style::grade(verdict.grade);
    let scale = BAR_END;
    let share = |value: f64| {
        let percent = if value.is_nan() { 0.0 } else { 100.0 * (value / scale).clamp(0.0, 1.0) };
        format!("width:{percent:.1}%")
    };
    let unit = outputs.iter().find(|port| port.channel.name == verdict.channel);
    html! {
        div class={ "tile " (class) } {
            p.name { (verdict.channel) @if let Some(port) = unit { @if !port.channel.unit.is_empty() { span.unit { " " (number::unit(&port.channel.unit)) } } } }
            p.grade { span.symbol aria-hidden="true" { (symbol) } " " (word) }
            @if let Some(reason) = &verdict.reason { p.small { (reason) } }
            div.bars {
                span { "model" } span.bar { span.model style=(share(verdict.nrmse)) {} } span.n { (ratio(verdict.nrmse)) }
                span { "last value" } span.bar { span.kept style=(share(verdict.persistence)) {} } span.n { (ratio(verdict.persistence)) }
            }
        }
    }
}

fn legend(candidate: &Candidate) -> Markup {
    let test = candidate.judged();
    let last = test.nrmse.last().into_iter().chain(test.persistence.nrmse.last());
    let beyond = last.flatten().any(|nrmse| *nrmse > BAR_END);
    html! {
        p.small {
            "Error of open-loop predictions " (horizon(candidate)) " ahead on " (judged_on(candidate)) ", in standard deviations of the output (NRMSE): "
            "0 is perfect, and predicting the mean gives 1. “Last value” is the error of persistence, which keeps the measurement at the origin. "
            "The grade of each output compares its error with the smaller error of persistence and the mean. Good: at most 50 %. Usable: at most 90 %."
            @if beyond { " A full bar means " (BAR_END) " or more." }
        }
    }
}

fn facts(subject: &Subject<'_>) -> Markup {
    let split = subject.split;
    let total = |runs: &[Trajectory]| runs.iter().map(Trajectory::duration_s).sum::<f64>();
    let seconds: f64 = runs(split).map(Trajectory::duration_s).sum();
    let count = runs(split).count();
    let parts = [("training", &split.train), ("validation", &split.validation), ("test", &split.test)];
    let parts: Vec<_> = parts.into_iter().filter(|(_, runs)| !runs.is_empty()).collect();
    html! {
        dl.facts {
            @if let Some(candidate) = subject.candidate {
                dt { "Model" }
                dd {
                    (candidate.model.title()) ", " (number::count(candidate.model.weights())) @if candidate.model.is_network() { " weights for " } @else { " coefficients for " }
                    (number::count(candidate.model.description.outputs.len())) " outputs and "
                    (number::count(candidate.model.description.inputs.len())) " inputs"
                    @if candidate.model.description.current.is_some() { ", of the motion through the water" }
                }
            }
            @if let Some(found) = &subject.result.for_trials {
                @let name = |i: usize| subject.result.candidates[i].model.description.name.as_str();
                dt { "For trials and control" }
                dd {
                    (found.best.map_or("no model", name))
                    @for (i, reason) in found.not_valid.iter().enumerate() {
                        @if let Some(reason) = reason { br; "not " (name(i)) ", not valid: " (reason) }
                    }
                }
            }
            dt { "Data" }
            dd {
                (runs_text(count)) ", " (duration(seconds)) " in all" (rate(split))
                @if parts.len() > 1 {
                    ": "
                    @for (i, (name, runs)) in parts.iter().enumerate() {
                        @if i > 0 { ", " }
                        (name) " " (duration(total(runs)))
                    }
                }
            }
            @if let Some(candidate) = subject.candidate {
                @let judged = candidate.judged();
                dt { "Judgement" }
                dd {
                    @if candidate.test.is_some() {
                        (number::count(judged.windows)) " rollouts of " (horizon(candidate)) " on "
                        (runs_text(judged.runs.used)) " that were not used for fitting or selection"
                    } @else {
                        "Cross-validation: each " (part_name(subject)) " was predicted by a model that was fitted without it, in "
                        (number::count(judged.windows)) " rollouts of " (horizon(candidate)) "; the delivered model was then fitted to all of them"
                    }
                    @if judged.runs.unused > 0 {
                        "; " (runs_text(judged.runs.unused)) " too short for the horizon and not evaluated"
                    }
                    @if judged.diverged > 0 { "; " (number::count(judged.diverged)) " rollouts diverged" }
                }
                dt { "Range of use" }
                dd { (range_of_use(candidate)) }
            }
        }
    }
}

/// The runs or blocks of a cross-validation.
fn part_name(subject: &Subject<'_>) -> &'static str {
    let blocks = subject.result.cross_validation.as_ref().is_some_and(CrossValidation::has_blocks);
    if blocks { "block of a run" } else { "run" }
}

/// Where the model may be used: horizon and ranges of the training runs.
fn range_of_use(candidate: &Candidate) -> Markup {
    let description = &candidate.model.description;
    let ports: Vec<&Port> = description.outputs.iter().chain(&description.inputs).collect();
    html! {
        "Up to " (horizon(candidate)) " ahead, for "
        @for (i, port) in ports.iter().enumerate() {
            @let range = port.training_range.unwrap_or(port.range);
            @if i > 0 { ", " }
            span.name { (port.channel.name) } " from " (number::text(range.low, 3)) " to " (number::text(range.high, 3))
            @if !port.channel.unit.is_empty() { " " (number::unit(&port.channel.unit)) }
        }
        ". Predictions outside these ranges are unreliable."
    }
}

/// Most runs in the table of the summary.
const MOST_RUNS: usize = 60;

/// Errors at the longest horizon, run by run; nothing for a single run.
fn errors_by_run(candidate: &Candidate) -> Markup {
    let judged = candidate.judged();
    if judged.by_run.len() < 2 {
        return html! {};
    }
    let mut heads = vec![cell("run"), cell("rollouts")];
    heads.extend(judged.channels.iter().map(cell));
    heads.extend([cell("last value, mean"), cell("diverged")]);
    let mean = |row: &[f64]| row.iter().sum::<f64>() / row.len().max(1) as f64;
    let row = |run: &RunErrors| {
        let mut cells = vec![html! { span.name { (readable(&run.run)) } }, cell(number::count(run.windows))];
        cells.extend(run.nrmse.iter().map(|value| cell(ratio(*value))));
        cells.extend([cell(ratio(mean(&run.persistence))), cell(number::count(run.diverged))]);
        cells
    };
    let rows: Vec<Vec<Markup>> = judged.by_run.iter().take(MOST_RUNS).map(row).collect();
    html! {
        h3 { "Error of each run" }
        (table(&heads, &rows, 1))
        p.small {
            "Error " (horizon(candidate)) " ahead in standard deviations of the output over all runs of the table. “Last value” is the error of persistence."
            @if judged.by_run.len() > MOST_RUNS { " The first " (MOST_RUNS) " of " (number::count(judged.by_run.len())) " runs are shown." }
        }
    }
}

fn runs_text(n: usize) -> String {
    if n == 1 { "1 run".to_owned() } else { format!("{} runs", number::count(n)) }
}

fn rate(split: &Split) -> String {
    runs(split).next().map_or_else(String::new, |run| {
        format!(" at {} Hz", number::text(1.0 / run.dt, 3).trim_end_matches(".00").trim_end_matches(".0"))
    })
}
