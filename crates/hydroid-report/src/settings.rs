//! The section on settings.

use maud::{Markup, html};

use super::number::{self, seconds_text};
use super::page::{Section, readable};
use super::{Subject, selection};
use hydroid::identify::Candidate;

pub(super) fn section(subject: &Subject<'_>) -> Section {
    let context = subject.context;
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut add = |name: &str, value: String| rows.push((name.to_owned(), value));
    add("hydroid", format!("version {}", context.hydroid));
    add("seed", context.seed.to_string());
    if let Some(candidate) = subject.candidate {
        let description = &candidate.model.description;
        let test = candidate.judged();
        add("model", format!("{} ({})", description.name, candidate.model.kind()));
        add("sample time", format!("{} s", seconds_text(description.dt)));
        let horizon = test.horizons.last().copied().unwrap_or(0);
        let seconds = seconds_text(horizon as f64 * test.dt);
        add("horizon", format!("{} samples, {seconds} s", number::count(horizon)));
        if let Some(chosen) = candidate.found().and_then(|found| found.trials.get(found.chosen)) {
            add("library", chosen.structure.to_string());
            add("regression", selection::regression(chosen.regression, description.dt));
            add("selection of terms", selection::optimizer(chosen.optimizer));
            add("ridge", selection::ridge(chosen.ridge));
        }
    }
    rows.extend(context.settings.iter().map(|(name, value)| (name.clone(), readable(value))));
    let body = html! {
        dl.facts { @for (name, value) in &rows { dt { (name) } dd { (value) } } }
        @if !context.sources.is_empty() {
            details {
                summary { "Files (" (context.sources.len()) ")" }
                ul.files { @for source in &context.sources { li { (readable(source)) } } }
            }
        }
        @if !context.command.is_empty() {
            details {
                summary { "Command that reproduces this page" }
                pre.copy.wrap { (readable(&context.command)) }
            }
        }
        @if let Some(candidate) = subject.candidate { (details(candidate)) }
    };
    Section::new("settings", "Settings", body)
}

fn details(candidate: &Candidate) -> Markup {
    let description = &candidate.model.description;
    let json = |value: &serde_json::Value| serde_json::to_string_pretty(value).unwrap_or_default();
    // Plain data always converts to JSON.
    let reading = serde_json::to_value(&description.reading).unwrap_or_default();
    html! {
        details {
            summary { "How the logs were read, as in the model file" }
            pre.copy { (json(&reading)) }
        }
        details {
            summary { "All settings, as in the model file" }
            pre.copy { (json(&description.provenance.settings)) }
        }
    }
}
