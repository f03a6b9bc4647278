//! The section on the data.

use maud::{Markup, html};

use super::figure::{Interval, RangeRow, range_chart};
use super::number::{self, duration, with_unit};
use super::page::{Section, cell, columns, figure, notes, nothing, table};
use super::{ReportError, Subject, series, style};
use hydroid::identify::{ChannelSummary, data_summary};
use hydroid::log::{Note, Split, Trajectory};

const DRAWN: usize = 3;
const PARTS: [&str; 3] = ["training", "validation", "test"];

pub(super) fn section(subject: &Subject<'_>) -> Result<Section, ReportError> {
    let (heading, id) = ("Data", "data");
    let split = subject.split;
    if super::runs(split).next().is_none() {
        return Ok(Section::new(id, heading, nothing("There are no runs.")));
    }
    let (channels, used) = (data_summary(split), used(split));
    let remarks: Vec<&Note> = subject.context.notes.iter().filter(|note| !note.is_warning()).collect();
    let warned = subject.context.notes.len() - remarks.len();
    let mut drawings = Vec::new();
    for run in split.train.iter().take(DRAWN) {
        let caption = html! { "Measured outputs of the training run " b { (run.name) } "." };
        drawings.push(figure(&series::outputs(run).svg()?, &caption));
        if run.inputs.width() > 0 {
            let caption = html! { "Inputs of the training run " b { (run.name) } "." };
            drawings.push(figure(&series::inputs(run).svg()?, &caption));
        }
    }
    let caption = html! {
        "Range of each channel in each part of the data. The range of the training runs is shaded. The mark in a bar is the mean. "
        @if !split.test.is_empty() { "Where the test runs leave the training range, the model extrapolates." }
    };
    let chart = figure(&chart(&channels, &used)?, &caption);
    let body = html! {
        (columns(&[chart, run_table(split)]))
        (channel_table(&channels, &used))
        (columns(&drawings))
        @if split.train.len() > DRAWN {
            p.small { "The figures show the first " (DRAWN) " of " (split.train.len()) " training runs." }
        }
        @if !remarks.is_empty() {
            details {
                summary {
                    "Preparation of the logs (" (number::count(remarks.len()))
                    @if remarks.len() == 1 { " note" } @else { " notes" }
                    @if warned > 0 { "; warnings are in the summary" } ")"
                }
                (notes(&remarks))
            }
        }
    };
    Ok(Section::new(id, heading, body))
}

fn run_table(split: &Split) -> Markup {
    let heads = ["run", "used for", "duration", "samples", "missing values"].map(cell);
    let mut rows = Vec::new();
    for (part, runs) in PARTS.iter().zip([&split.train, &split.validation, &split.test]) {
        for run in runs {
            rows.push(vec![
                html! { span.name { (run.name) } },
                cell(part),
                cell(duration(run.duration_s())),
                cell(number::count(run.len())),
                cell(missing(run)),
            ]);
        }
    }
    table(&heads, &rows, 2)
}

fn missing(run: &Trajectory) -> String {
    let all = run.len() * run.outputs.width();
    let missing: usize =
        (0..run.outputs.width()).map(|c| run.outputs.column(c).filter(|v| v.is_nan()).count()).sum();
    if missing == 0 {
        return "none".to_owned();
    }
    let percent = 100.0 * missing as f64 / all.max(1) as f64;
    format!("{} ({} %)", number::count(missing), number::text(percent, 2))
}

/// Parts of the split that have runs.
fn used(split: &Split) -> Vec<usize> {
    let parts = [&split.train, &split.validation, &split.test];
    (0..PARTS.len()).filter(|&i| !parts[i].is_empty()).collect()
}

fn chart(channels: &[ChannelSummary], used: &[usize]) -> Result<String, ReportError> {
    let rows: Vec<RangeRow> = channels
        .iter()
        .map(|summary| RangeRow {
            name: with_unit(&summary.channel.name, &summary.channel.unit),
            intervals: used
                .iter()
                .map(|&part| summary.parts[part])
                .map(|p| Interval { low: p.min, high: p.max, mean: p.mean })
                .collect(),
        })
        .collect();
    let parts: Vec<_> = used.iter().map(|&part| (PARTS[part], style::PARTS[part])).collect();
    Ok(range_chart("Ranges of all channels by part of the split", &parts, &rows)?)
}

fn channel_table(channels: &[ChannelSummary], used: &[usize]) -> Markup {
    let parts = used.iter().map(|&part| PARTS[part]);
    let heads: Vec<Markup> = ["channel"].into_iter().chain(parts).chain(["mean", "std"]).map(cell).collect();
    let span = |low: f64, high: f64| html! { (number::text(low, 3)) " … " (number::text(high, 3)) };
    let rows: Vec<Vec<Markup>> = channels
        .iter()
        .map(|summary| {
            let mut cells =
                vec![html! { span.name { (with_unit(&summary.channel.name, &summary.channel.unit)) } }];
            cells.extend(used.iter().map(|&part| span(summary.parts[part].min, summary.parts[part].max)));
            let train = summary.parts[0];
            cells.extend([cell(number::text(train.mean, 3)), cell(number::text(train.std, 3))]);
            cells
        })
        .collect();
    html! {
        (table(&heads, &rows, 1))
        p.small { "Smallest and largest value in each part. Mean and standard deviation (std) are those of the training runs." }
    }
}
