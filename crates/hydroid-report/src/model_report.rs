//! The page of a model: what it is, its errors on logs, its trials, and driving it.

use hydroid::evaluate::Evaluation;
use hydroid::identify::Verdict;
use hydroid::manoeuvre::{Comparison, Trials};
use hydroid::model::{Model, Port};
use hydroid::plant::InputMap;
use maud::{Markup, html};

use super::growth::channel_table;
use super::number::{self, duration, text};
use super::page::{Section, cell, columns, nothing, page, page_with, readable, table};
use super::summary::tile;
use super::{ManoeuvreReport, ReportError, comparison, driving, manoeuvre};

/// Content of the page of a model.
#[derive(Clone, Copy, Debug)]
pub struct ModelReport<'a> {
    /// Command line that reproduces the page.
    pub command: &'a str,
    pub model: &'a Model,
    /// Its errors on logs, if there are logs.
    pub evaluation: Option<&'a Evaluation>,
    /// Its grades on these logs.
    pub verdicts: &'a [Verdict],
    /// Trials in the logs beside their predictions.
    pub comparisons: &'a [Comparison],
    /// Simulated trials, or why the model cannot run them.
    pub trials: Result<&'a Trials, &'a str>,
    /// The commands that push and turn the vessel, or why there are none.
    pub map: Result<&'a InputMap, &'a str>,
    /// Whether the model can be driven on the page.
    pub interactive: bool,
}

/// The page.
pub fn model_report(subject: &ModelReport<'_>) -> Result<String, ReportError> {
    let ModelReport { command, model, trials, comparisons, .. } = *subject;
    let mut sections = vec![summary(subject)];
    if subject.interactive {
        sections.push(driving::section(subject));
    }
    sections.extend(subject.evaluation.map(errors));
    sections.extend(comparison::sections(comparisons)?);
    match trials {
        Ok(trials) => {
            let of = ManoeuvreReport { command, model, trials };
            sections.push(manoeuvre::approach(&of));
            sections.extend(manoeuvre::sections(&of)?);
            sections.push(manoeuvre::definitions(&of));
        }
        Err(why) => {
            sections.push(Section::new("trials", "Trials", nothing(why)));
            sections.push(Section::new(
                "settings",
                "Command",
                html! { pre.copy.wrap { (readable(command)) } },
            ));
        }
    }
    let title = title(model);
    Ok(if subject.interactive {
        page_with(&title, &sections, &driving::style(), &driving::script())
    } else {
        page(&title, &sections)
    })
}

fn title(model: &Model) -> String {
    format!("Model {}", model.description.name)
}

fn summary(subject: &ModelReport<'_>) -> Section {
    let model = subject.model;
    let d = &model.description;
    let runs = &d.provenance.training;
    let body = html! {
        header {
            p.kicker { "hydroid · model" }
            h1 { (title(model)) }
        }
        dl.facts {
            dt { "Kind" } dd { (model.title()) " (" (model.kind()) ")" }
            @if !subject.comparisons.is_empty() { (comparison::scale_of(model)) }
            dt { "Sample time" } dd { (text(d.dt, 4)) " s" }
            @if !runs.is_empty() { dt { "Fitted to" } dd.files { (readable(&runs.join(", "))) } }
            @if d.current.is_some() { dt { "Motion" } dd { "Through the water; the model estimates the current." } }
        }
        @if !subject.verdicts.is_empty() { div.tiles { @for verdict in subject.verdicts { (tile(verdict, &d.outputs)) } } }
        (channels(model))
    };
    Section::new("summary", "Summary", body)
}

/// Outputs and inputs with the ranges in which the model may be used.
fn channels(model: &Model) -> Markup {
    let d = &model.description;
    let heads = ["", "use", "unit", "from", "to", "rate limit"].map(cell);
    let row = |port: &Port, role: &'static str| -> Vec<Markup> {
        let range = port.training_range.unwrap_or(port.range);
        let limit = port.rate_limit.map_or_else(String::new, |limit| format!("{} per s", text(limit, 3)));
        let unit = number::unit(&port.channel.unit);
        [port.channel.name.clone(), role.to_owned(), unit, text(range.low, 3), text(range.high, 3), limit]
            .map(cell)
            .to_vec()
    };
    let outputs = d.outputs.iter().map(|port| row(port, "output"));
    let rows: Vec<Vec<Markup>> = outputs.chain(d.inputs.iter().map(|port| row(port, "input"))).collect();
    html! {
        (table(&heads, &rows, 3))
        p.small { "Predictions outside of these ranges are unreliable." }
    }
}

fn errors(evaluation: &Evaluation) -> Section {
    let heading = "Errors on logs";
    if evaluation.windows == 0 {
        return Section::new("errors", heading, nothing("No rollout was possible, so the error is unknown."));
    }
    let last = evaluation.horizons.last().map_or(0.0, |&h| h as f64 * evaluation.dt);
    let tables: Vec<Markup> =
        (0..evaluation.channels.len()).map(|output| channel_table(evaluation, output)).collect();
    let body = html! {
        p {
            (number::count(evaluation.windows)) " open-loop predictions up to " (duration(last)) " ahead, with the recorded commands and without further measurements; "
            (number::count(evaluation.diverged)) " diverged."
        }
        (columns(&tables))
        p.small {
            "MAE is the mean absolute error, RMSE the root mean square error, NRMSE the RMSE in standard deviations of the output. “Last value” is the NRMSE of persistence, which keeps the measurement at the origin."
        }
    };
    Section::new("errors", heading, body)
}
