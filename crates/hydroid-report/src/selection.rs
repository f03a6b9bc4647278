//! The section on model selection: all settings and their validation scores.

use maud::{Markup, html};
use plotters::style::RGBColor;

use super::figure::{Dash, Figure, Key, Line, Mark, Panel, Points, Sign, Stroke};
use super::front::{front, stairs};
use super::number::{self, fixed, seconds_text};
use super::page::{Section, cell, columns, figure, notes, nothing, table};
use super::{ReportError, Subject, network, style};
use hydroid::identify::Candidate;
use hydroid::log::Note;
use hydroid::sindy::{Criterion, Optimizer, RegressionForm, SearchResult, Trial};

const FRONT: Stroke = Stroke { colour: style::MUTED, width: 1.4, dash: Dash::Solid };
const BEST: usize = 12;
/// The chart ends at this multiple of the best score.
const SHOWN: f64 = 3.0;

pub(super) fn section(subject: &Subject<'_>) -> Result<Section, ReportError> {
    let (heading, id) = ("How the model was chosen", "selection");
    let split: Vec<&Note> = subject.split.notes.iter().collect();
    let body = html! {
        @if !split.is_empty() { (notes(&split)) }
        @match subject.candidate {
            Some(candidate) => @match (candidate.found(), candidate.training.network()) {
                (Some(found), _) => (choice(candidate, found)?),
                (None, Some(trained)) => (network::choice(trained)),
                (None, None) => (nothing("No settings were tried.")),
            },
            None => (nothing("No settings were tried.")),
        }
    };
    Ok(Section::new(id, heading, body))
}

fn choice(candidate: &Candidate, found: &SearchResult) -> Result<Markup, ReportError> {
    let dt = candidate.model.description.dt;
    if found.trials.is_empty() {
        return Ok(nothing("No settings were tried."));
    }
    if let (Some(_), Some(trial)) = (&found.grid.noise, found.trials.get(found.chosen)) {
        return Ok(explained(candidate, found, trial));
    }
    let diverged = found.trials.iter().filter(|t| t.score.is_none()).count();
    let finalists = found.trials.iter().filter(|t| t.finalist).count();
    let (drawing, above) = chart(&found.trials, found.chosen);
    let caption = html! {
        "Each symbol is one setting. The score is a mean over all outputs; lower is better. The line is the Pareto front of the settings that were scored on all origins: the smallest score for each number of terms."
        @if above > 0 { " Triangles at the top are " (number::count(above)) " settings with larger scores." }
        @if diverged > 0 { " Crosses at the top are " (number::count(diverged)) " settings that diverged." }
    };
    let chart = figure(&drawing.svg()?, &caption);
    let (rows, skipped) = found.rows;
    Ok(html! {
        p {
            "Every setting was fitted to the training runs and rolled out on the validation runs and on excerpts of the training runs. Its score is the mean NRMSE over both, all outputs and all horizons. "
            "All settings were first scored on a sixteenth of the origins; the best quarter of them on a quarter, and of these again the best quarter, " (number::count(finalists)) " settings, on all. "
            "The chosen setting is the simplest one within one standard error of the best. Its rollouts stay bounded if those of any setting near the best do. "
            @if candidate.test.is_some() { "The test runs did not influence the choice. " }
            @if !candidate.left_out.is_empty() { "Terms and coefficients were then fitted to all runs with the chosen settings. " }
            (by_output(candidate, found))
            @if let Some(text) = found.refinement.describe(dt) { "The coefficients were " (text) ". " }
            (number::count(found.trials.len())) " settings were tried"
            @if diverged > 0 { ", of which " (number::count(diverged)) " diverged" }
            ". The chosen regression has " (number::count(usize::try_from(rows).unwrap_or(usize::MAX))) " rows"
            @if skipped > 0 { " (" (number::count(usize::try_from(skipped).unwrap_or(usize::MAX))) " omitted because of missing samples)" }
            ", and its library has the condition number " (number::text(found.condition, 2)) "."
        }
        @if found.stability.rollouts > 0 && found.stability.is_bounded() {
            p.small {
                "Stability: " (number::count(found.stability.rollouts)) " rollouts from random states with random commands inside the training range all stayed bounded."
            }
        }
        (columns(&[chart, best(&found.trials, found.chosen, dt)]))
    })
}

/// The only setting, of equations that were selected by the noise.
fn explained(candidate: &Candidate, found: &SearchResult, trial: &Trial) -> Markup {
    let dt = candidate.model.description.dt;
    html! {
        p {
            "The terms are the best subset of " (trial.structure.to_string()) " by the extended Bayesian criterion (" (regression(trial.regression, dt)) "). "
            @if let Some(text) = found.explained() { "They give " (text) ". " } @else { "They explain a part of the training runs to within their noise, and all of them together not. " }
            "No other setting was tried. "
            @if let Some(text) = found.refinement.describe(dt) { "The coefficients were " (text) ". " }
        }
    }
}

/// The settings of single equations, and the effect on the score.
fn by_output(candidate: &Candidate, found: &SearchResult) -> Markup {
    let others: Vec<(usize, &Trial)> = found
        .equations
        .iter()
        .enumerate()
        .filter(|(_, trial)| **trial != found.chosen)
        .filter_map(|(output, &trial)| Some((output, found.trials.get(trial)?)))
        .collect();
    let dt = candidate.model.description.dt;
    let chosen = found.trials.get(found.chosen).and_then(|trial| trial.score);
    html! {
        @if others.is_empty() {
            "All equations come from this setting: no other setting was significantly better for a single output. "
        } @else {
            "Then the equation of each output in turn was replaced by that of other settings. A replacement was kept if the rollouts became significantly better: "
            @for (i, (output, trial)) in others.iter().enumerate() {
                @if i > 0 { "; " }
                "the equation of " b { (candidate.model.description.outputs[*output].channel.name) } " comes from "
                (trial.structure.to_string()) ", " (regression(trial.regression, dt)) ", " (optimizer(trial.optimizer))
                ", ridge " (ridge(trial.ridge))
            }
            ". Together these equations have the score " (fixed(found.refinement.before.unwrap_or(found.score), 4))
            @if let Some(chosen) = chosen { ". The chosen setting alone has " (fixed(chosen, 4)) }
            ". "
        }
    }
}

/// Libraries in the order of trial, without duplicates of the same text.
fn structures(trials: &[Trial]) -> Vec<String> {
    let mut list: Vec<String> = Vec::new();
    for trial in trials {
        let name = trial.structure.to_string();
        if !list.contains(&name) {
            list.push(name);
        }
    }
    list
}

fn colour(index: usize) -> RGBColor {
    // The model's blue, then the colours of series from the darker ones on.
    const ORDER: [RGBColor; 4] = [style::SERIES[0], style::MODEL, style::SERIES[2], style::SERIES[3]];
    ORDER[index % ORDER.len()]
}

/// The chart, and the number of finite scores above it.
fn chart(trials: &[Trial], chosen: usize) -> (Figure, usize) {
    let scores = || trials.iter().filter_map(|t| t.score).filter(|s| s.is_finite());
    let best = scores().fold(f64::INFINITY, f64::min);
    let worst = scores().fold(0.0, f64::max);
    let (bottom, top) =
        if best.is_finite() { (0.0, (SHOWN * best).min(1.15 * worst).max(1e-9)) } else { (0.0, 1.0) };
    let most = trials.iter().map(|t| t.terms).max().unwrap_or(1) as f64;
    let mut panel = Panel::new("score (mean NRMSE)").height(250.0).range(bottom, top);
    let mut figure = Figure::new("Score against number of terms, all settings", "terms in all equations")
        .x_range(0.0, 1.05 * most + 1.0);
    let mut above = 0;
    for (i, library) in structures(trials).into_iter().enumerate() {
        let (mut inside, mut over, mut lost) = (Vec::new(), Vec::new(), Vec::new());
        for trial in trials.iter().filter(|t| t.structure.to_string() == library) {
            let terms = trial.terms as f64;
            match trial.score {
                Some(score) if score <= top => inside.push((terms, score)),
                Some(_) => over.push((terms, 0.975 * top)),
                None => lost.push((terms, 0.925 * top)),
            }
        }
        above += over.len();
        for (points, sign, radius) in
            [(inside, Sign::Disc, 3.4), (over, Sign::Up, 3.6), (lost, Sign::Cross, 3.2)]
        {
            panel = panel.mark(Mark::Points(Points { points, sign, colour: colour(i), radius, label: None }));
        }
        figure = figure.key(Key::Sign(Sign::Disc, colour(i)), library);
    }
    let end = 1.05 * most + 1.0;
    let front = front(trials);
    let line = stairs(&front, end).into_iter().map(|(terms, score)| (terms, score.min(top))).collect();
    panel = panel.mark(Mark::Line(Line::new(line, FRONT)));
    figure = figure.key(Key::Line(FRONT), "front");
    let place = |trial: &Trial| trial.score.map(|score| (trial.terms as f64, score));
    let best = front.last().copied();
    if let Some(best) = best.filter(|best| trials.get(chosen).and_then(place) != Some(*best)) {
        let points = Points {
            points: vec![best],
            sign: Sign::Ring,
            colour: style::MUTED,
            radius: 5.5,
            label: Some("best".to_owned()),
        };
        panel = panel.mark(Mark::Points(points));
    }
    let winner = trials.get(chosen).and_then(|t| t.score.map(|s| (t.terms as f64, s)));
    if let Some(winner) = winner {
        let points = Points {
            points: vec![winner],
            sign: Sign::Ring,
            colour: style::INK,
            radius: 7.0,
            label: Some("chosen".to_owned()),
        };
        panel = panel.mark(Mark::Points(points));
    }
    (figure.panel(panel), above)
}

fn best(trials: &[Trial], chosen: usize, dt: f64) -> Markup {
    let mut order: Vec<usize> = (0..trials.len()).collect();
    let key = |i: usize| trials[i].score.unwrap_or(f64::INFINITY);
    order.retain(|&i| trials[i].finalist);
    order.sort_by(|&a, &b| key(a).total_cmp(&key(b)).then((a != chosen).cmp(&(b != chosen))));
    let shown = order.len().min(BEST);
    // The chosen setting is the simplest of similar ones and may not be among the best rows.
    let behind = order.iter().skip(BEST).copied().find(|&i| i == chosen);
    let heads = ["library", "rows over", "selection", "ridge", "terms", "score"].map(cell);
    let rows: Vec<Vec<Markup>> = order
        .into_iter()
        .take(BEST)
        .chain(behind)
        .map(|i| {
            let trial = &trials[i];
            let score = trial.score.map_or_else(|| "diverged".to_owned(), |s| fixed(s, 4));
            [
                trial.structure.to_string(),
                match trial.regression {
                    RegressionForm::Midpoint { intervals } => {
                        format!("{} s", seconds_text(intervals as f64 * dt))
                    }
                    RegressionForm::Central => "central".to_owned(),
                    RegressionForm::Weak { intervals } => {
                        format!("weak, {} s", seconds_text(intervals as f64 * dt))
                    }
                    RegressionForm::Smoothed { half } => {
                        format!("smoothed, {} s", seconds_text(2.0 * half as f64 * dt))
                    }
                },
                match trial.optimizer {
                    Optimizer::Stepwise(tolerance) => format!("{} %", trimmed(100.0 * tolerance)),
                    Optimizer::Stlsq(threshold) => format!("≥ {}", trimmed(threshold)),
                    Optimizer::Criterion(Criterion::Aic) => "AIC".to_owned(),
                    Optimizer::Criterion(Criterion::Bic) => "BIC".to_owned(),
                    Optimizer::Subset => "best subset".to_owned(),
                },
                ridge(trial.ridge),
                number::count(trial.terms),
                score,
            ]
            .map(|text| {
                if i == chosen {
                    html! { b { (text) } }
                } else {
                    cell(text)
                }
            })
            .into()
        })
        .collect();
    html! {
        (table(&heads, &rows, 1))
        p.small {
            "The table shows the best " (shown) " of " (number::count(trials.len()))
            @if behind.is_some() { ", and the chosen one" } ". The chosen setting is bold. "
            "“Rows over” is the time that a row of the regression averages over; “central” means central differences. "
            "“Selection” is the criterion for dropping a term: the residual grows by less than the percentage, or (≥) the contribution is below the number. "
            "“Score” is the mean NRMSE over all outputs and horizons on validation runs and on excerpts of the training runs."
        }
    }
}

pub(super) fn regression(regression: RegressionForm, dt: f64) -> String {
    match regression {
        RegressionForm::Midpoint { intervals } => {
            format!("increments, {} s", seconds_text(intervals as f64 * dt))
        }
        RegressionForm::Central => "central differences".to_owned(),
        RegressionForm::Weak { intervals } => format!("weak form, {} s", seconds_text(intervals as f64 * dt)),
        RegressionForm::Smoothed { half } => {
            format!("smoothed differences, {} s", seconds_text(2.0 * half as f64 * dt))
        }
    }
}

pub(super) fn optimizer(optimizer: Optimizer) -> String {
    match optimizer {
        Optimizer::Stepwise(tolerance) => format!("elimination, {} %", trimmed(100.0 * tolerance)),
        Optimizer::Stlsq(threshold) => format!("threshold {}", trimmed(threshold)),
        Optimizer::Criterion(Criterion::Aic) => "stepwise, AIC".to_owned(),
        Optimizer::Criterion(Criterion::Bic) => "stepwise, BIC".to_owned(),
        Optimizer::Subset => "best subset, extended BIC".to_owned(),
    }
}

pub(super) fn ridge(value: f64) -> String {
    if value == 0.0 || value >= 1e-3 { trimmed(value) } else { number::text(value, 1) }
}

/// The shortest decimal of the number.
fn trimmed(value: f64) -> String {
    let rounded = format!("{value:.6}");
    rounded.trim_end_matches('0').trim_end_matches('.').to_owned()
}
