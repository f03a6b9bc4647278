//! Recordings: topics, fields, and a proposal of sensors and commands.

use std::path::Path;

use hydroid::log::Inspection;
use hydroid::model::Reading;
use hydroid::recording::{FieldSurvey, Proposal, Survey, TopicSurvey, survey};
use serde_json::json;

use crate::args::Global;
use crate::ui;

/// Fields of a topic that are listed; `--json` has all.
const LISTED: usize = 40;

pub fn json(survey: &Survey, proposal: &Proposal) -> anyhow::Result<serde_json::Value> {
    let mut document = serde_json::to_value(survey)?;
    document["proposal"] = json!(proposal);
    document["config"] = json!(proposal.to_toml(&survey.path));
    Ok(document)
}

pub fn show(survey: &Survey, proposal: &Proposal, global: Global) {
    outln!("{}: {}, {} topics", survey.path, survey.format, survey.topics.len());
    for topic in &survey.topics {
        show_topic(topic);
    }
    ui::print_notes(&survey.notes, global);
    show_proposal(proposal);
}

/// What is proposed for a table that has no velocities, if it has a position or a heading.
pub fn of_table(file: &Path, inspection: &Inspection, reading: &Reading) -> Option<(Survey, Proposal)> {
    let has = |name: &str| inspection.columns.iter().any(|column| column.name == name);
    if ["u", "v", "r"].into_iter().any(has) {
        return None;
    }
    let survey = survey(file, reading.selection.time.as_deref()).ok()?;
    let proposal = survey.proposal();
    let is_any =
        proposal.selection.sensors.as_ref().is_some_and(|sensors| sensors.columns().next().is_some());
    is_any.then_some((survey, proposal))
}

pub fn show_proposal(proposal: &Proposal) {
    outln!("\nproposal (a guess from names; --write-config writes it to a file):");
    for remark in &proposal.remarks {
        outln!("  {remark}");
    }
}

fn show_topic(topic: &TopicSurvey) {
    let kind = if topic.type_name.is_empty() { String::new() } else { format!(" ({})", topic.type_name) };
    let seconds =
        |name: &str, value: Option<f64>| value.map_or_else(String::new, |x| format!(", {name} {x:.3} s"));
    outln!(
        "\n{}{kind}: {} rows{}{}{}{}",
        topic.name,
        topic.rows,
        topic.start_s.map_or_else(String::new, |t| format!(", from {}", time(t))),
        seconds("duration", topic.duration_s),
        seconds("usual step", topic.step_s),
        seconds("longest", topic.longest_s)
    );
    let width =
        topic.fields.iter().take(LISTED).map(|f| f.column.chars().count()).max().unwrap_or(0).clamp(26, 60);
    let unit_width = 8;
    outln!(
        "  {:<width$} {:<unit_width$} {:>14} {:>14} {:>14} {:>8}",
        "column",
        "unit",
        "min",
        "max",
        "mean",
        "missing"
    );
    for field in topic.fields.iter().take(LISTED) {
        let text = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), number);
        let FieldSurvey { column, unit, low, high, mean, missing, .. } = field;
        outln!(
            "  {column:<width$} {:<unit_width$} {:>14} {:>14} {:>14} {missing:>8}",
            unit.as_deref().unwrap_or_default(),
            text(*low),
            text(*high),
            text(*mean)
        );
    }
    if topic.fields.len() > LISTED {
        outln!("  and {} more fields (--json lists all)", topic.fields.len() - LISTED);
    }
}

fn number(x: f64) -> String {
    if x != 0.0 && !(1e-4..1e9).contains(&x.abs()) { format!("{x:.5e}") } else { format!("{x:.5}") }
}

fn time(seconds: f64) -> String {
    hydroid::recording::time_text(seconds)
}

/// Writes the proposal to a new file.
pub fn write_config(path: &Path, survey: &Survey, proposal: &Proposal) -> anyhow::Result<()> {
    anyhow::ensure!(
        !path.exists(),
        "{} exists: --write-config writes a new file; name another one, or remove it",
        path.display()
    );
    hydroid::atomic::write(path, |out| out.write_all(proposal.to_toml(&survey.path).as_bytes()))?;
    Ok(())
}
