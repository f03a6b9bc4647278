//! The section on the error over the horizon.

use maud::{Markup, html};

use super::figure::{Dash, Figure, Line, Mark, Panel, Stroke};
use super::number::{self, ratio, seconds_text};
use super::page::{Section, cell, columns, figure, nothing, table};
use super::style;
use super::{ReportError, judged_on};
use hydroid::evaluate::Evaluation;
use hydroid::identify::Candidate;

const ROWS: usize = 5;

pub(super) fn section(candidate: &Candidate) -> Result<Section, ReportError> {
    let (heading, id) = ("Error over the horizon", "error");
    let test = candidate.judged();
    if test.windows == 0 || test.horizons.is_empty() {
        let why = "No rollout was possible, so the error is unknown.";
        return Ok(Section::new(id, heading, nothing(why)));
    }
    let caption = html! {
        "NRMSE of open-loop predictions of each output: the error in standard deviations of this output. "
        "Predicting the mean gives 1."
        @if test.nrmse.iter().chain(&candidate.validation.nrmse).flatten().any(|nrmse| *nrmse > TOP) {
            " Curves are cut off at " (TOP) "; the tables contain the values."
        }
    };
    let chart = figure(&chart(candidate).svg()?, &caption);
    let tables = html! {
        @for c in 0..test.channels.len() { (channel_table(test, c)) }
        p.small {
            "Values are from " (judged_on(candidate)) ". MAE is the mean absolute error. RMSE is the root mean square error. NRMSE is the RMSE in standard deviations of the output. R"
            sup { "2" } " is 1 − NRMSE" sup { "2" } ". “Last value” is the NRMSE of persistence, which keeps the measurement at the origin."
        }
    };
    let body = html! {
        p { (windows(candidate)) }
        (columns(&[chart, tables]))
    };
    Ok(Section::new(id, heading, body))
}

const TOP: f64 = 3.0;

fn chart(candidate: &Candidate) -> Figure {
    let (test, validation) = (candidate.judged(), &candidate.validation);
    let mut figure = Figure::new("NRMSE over the horizon, for each output", "time ahead [s]")
        .x_range(0.0, last_horizon(test) * test.dt);
    for (c, name) in test.channels.iter().enumerate() {
        let curve = |evaluation: &Evaluation, table: &[Vec<f64>]| -> Vec<(f64, f64)> {
            let start = (0.0, f64::NAN);
            let points = evaluation.horizons.iter().zip(table).map(|(&h, row)| {
                (h as f64 * evaluation.dt, row.get(c).copied().filter(|v| v.is_finite()).unwrap_or(f64::NAN))
            });
            std::iter::once(start).chain(points).collect()
        };
        let of_validation = candidate.test.is_some().then(|| {
            Line::new(curve(validation, &validation.nrmse), style::VALIDATION_LINE).labelled("validation")
        });
        let label = if candidate.test.is_some() { "model, test" } else { "model" };
        let lines = [
            Line::new(curve(test, &test.nrmse), style::MODEL_LINE).labelled(label),
            // Drawn over the model; the dashes show where the two coincide.
            Line::new(curve(test, &test.persistence.nrmse), style::PERSISTENCE_LINE).labelled("last value"),
        ];
        let lines: Vec<Line> = of_validation.into_iter().chain(lines).collect();
        let highest = lines.iter().flat_map(|l| l.points.iter().map(|p| p.1)).filter(|v| v.is_finite());
        // Very large errors are cut off, so that the others remain legible.
        let top = highest.fold(1.1, f64::max).min(TOP);
        let level =
            Mark::Level { at: 1.0, stroke: Stroke { colour: style::AXIS, width: 1.4, dash: Dash::Solid } };
        let mut panel =
            Panel::new(format!("NRMSE of {name}")).height(150.0).range(0.0, 1.05 * top).mark(level);
        for line in lines {
            panel = panel.mark(Mark::Line(line));
        }
        figure = figure.panel(panel);
    }
    figure
}

fn last_horizon(evaluation: &Evaluation) -> f64 {
    evaluation.horizons.last().map_or(1.0, |&h| h as f64)
}

fn windows(candidate: &Candidate) -> Markup {
    let (test, validation) = (candidate.judged(), &candidate.validation);
    let described = |evaluation: &Evaluation| {
        let diverged = if evaluation.diverged == 0 {
            "none diverged".to_owned()
        } else {
            format!(
                "{} diverged and enter the errors with limited predictions",
                number::count(evaluation.diverged)
            )
        };
        format!("{} windows, {diverged}", number::count(evaluation.windows))
    };
    html! {
        "Each rollout starts from a measured sample and uses the recorded commands, without further measurements. "
        @if candidate.test.is_some() {
            "Test: " (described(test)) ". Validation, on which the settings were chosen: " (described(validation)) "."
        } @else {
            "Cross-validation: " (described(test)) "."
        }
        @if let Some(first) = test.divergences.first() {
            " The first one to diverge is that of " (first.run) " from " (seconds_text(first.origin_s)) "\u{a0}s, in " (first.channel)
            " after " (number::duration(first.horizon as f64 * test.dt)) "."
        }
    }
}

/// Rows of the table: round times up to the longest horizon.
fn rows(test: &Evaluation) -> Vec<usize> {
    let Some(&last) = test.horizons.last() else { return Vec::new() };
    let mut chosen: Vec<usize> = Vec::new();
    for power in -3..6 {
        for base in [1.0, 2.0, 5.0] {
            let steps = base * 10f64.powi(power) / test.dt;
            let whole = steps.round();
            if (steps - whole).abs() > 0.02 * steps || whole < 1.0 || whole > last as f64 {
                continue;
            }
            let at = test.horizons.iter().position(|&h| h as f64 == whole);
            chosen.extend(at.filter(|at| !chosen.contains(at)));
        }
    }
    let end = test.horizons.len() - 1;
    if !chosen.contains(&end) {
        chosen.push(end);
    }
    chosen.split_off(chosen.len().saturating_sub(ROWS))
}

/// Errors of an output at rounded horizons.
pub(super) fn channel_table(test: &Evaluation, c: usize) -> Markup {
    let unit = test.units.get(c).map_or("", String::as_str);
    let heads = [
        cell("ahead [s]"),
        cell("MAE"),
        cell("RMSE"),
        cell("NRMSE"),
        html! { "R" sup { "2" } },
        cell("last value"),
    ];
    let at =
        |table: &[Vec<f64>], h: usize| table.get(h).and_then(|row| row.get(c)).copied().unwrap_or(f64::NAN);
    let lines: Vec<Vec<Markup>> = rows(test)
        .into_iter()
        .map(|h| {
            vec![
                cell(seconds_text(test.horizons[h] as f64 * test.dt)),
                cell(number::text(at(&test.mae, h), 3)),
                cell(number::text(at(&test.rmse, h), 3)),
                cell(ratio(at(&test.nrmse, h))),
                cell(ratio(at(&test.r2, h))),
                cell(ratio(at(&test.persistence.nrmse, h))),
            ]
        })
        .collect();
    html! { h4 { (test.channels[c]) @if !unit.is_empty() { span.small { " MAE and RMSE in " (number::unit(unit)) } } } (table(&heads, &lines, 0)) }
}
