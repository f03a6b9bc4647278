//! The page of trials in logs beside their predictions.

use std::path::Path;

use hydroid::atomic;
use hydroid::manoeuvre::{
    Comparison, Figure as Value, RecognisedKind, Track, interval_words, write_comparisons_csv,
};
use hydroid::model::Model;
use maud::{Markup, html};
use serde_json::Value as Document;

use super::figure::{Figure, Key, Line, Mark, Panel};
use super::manoeuvre::{MEMBER, MEMBERS, covered, over_time, position};
use super::number::text;
use super::page::{Section, cell, columns, figure, page, readable, table};
use super::style;
use super::{FolderError, ReportError};

/// Content of a page of trials in logs.
#[derive(Clone, Copy, Debug)]
pub struct ComparisonReport<'a> {
    /// Command line that reproduces the page.
    pub command: &'a str,
    pub model: &'a Model,
    /// The trials and their predictions.
    pub comparisons: &'a [Comparison],
}

/// The page.
pub fn comparisons(subject: &ComparisonReport<'_>) -> Result<String, ReportError> {
    let mut all = vec![summary(subject)];
    all.extend(sections(subject.comparisons)?);
    all.push(definitions(subject));
    Ok(page("Trials in logs", &all))
}

/// A section for each trial.
pub(super) fn sections(comparisons: &[Comparison]) -> Result<Vec<Section>, ReportError> {
    let mut sections = Vec::new();
    for (i, comparison) in comparisons.iter().enumerate() {
        let Comparison { run, at_s, trial, .. } = comparison;
        let title = trial.title();
        let heading = format!("{run}, {at_s:.1} s: {title}");
        let track_caption = html! { "Tracks from the first sample of the trial on. Thin lines are members of the model. Both axes have the same scale." };
        let mut figures = vec![figure(&tracks(comparison).svg()?, &track_caption)];
        if trial.kind == RecognisedKind::Zigzag {
            let caption = html! { "Change of the heading over time." };
            figures.push(figure(&headings(comparison).svg()?, &caption));
        }
        figures.push(values(comparison));
        sections.push(Section::new(format!("trial-{i}"), heading, html! { (columns(&figures)) }));
    }
    Ok(sections)
}

impl ComparisonReport<'_> {
    /// Writes a folder: the document of the comparisons in `comparisons.json`, the tracks in `tracks.csv`, and the page in
    /// `report.html`.
    pub fn write(&self, folder: &Path, document: &Document) -> Result<(), FolderError> {
        let page = comparisons(self)?;
        atomic::write(&folder.join("comparisons.json"), |out| writeln!(out, "{document:#}"))?;
        atomic::write(&folder.join("tracks.csv"), |out| write_comparisons_csv(self.comparisons, out))?;
        atomic::write(&folder.join("report.html"), |out| out.write_all(page.as_bytes()))?;
        Ok(())
    }
}

/// That trials in logs are those of the ship, if the boat has a scale.
pub(super) fn scale_of(model: &Model) -> Markup {
    let scale = model.description.boat.particulars.scale.filter(|scale| *scale != 1.0);
    html! {
        @if let Some(scale) = scale {
            dt { "Scale" }
            dd { (text(scale, 4)) ": figures and tracks of trials in logs are those of the ship, by Froude's law." }
        }
    }
}

fn summary(subject: &ComparisonReport<'_>) -> Section {
    let all = subject.comparisons;
    let trained = all.iter().filter(|comparison| comparison.in_training).count();
    let words = match (all.len(), trained) {
        (0, _) => {
            String::from("The logs contain no turn by 90° or more under constant commands, and no zigzag.")
        }
        (all, 0) => format!("{all} trials in runs that the model was not fitted to."),
        (all, trained) => format!(
            "{trained} of {all} trials are in runs that the model was fitted to: those predictions are better than predictions of new runs."
        ),
    };
    let is_doubtful = |of: &Comparison| !of.doubts.is_empty() || of.tracks[1].not_valid.is_some();
    let class = if all.is_empty() || trained > 0 || all.iter().any(is_doubtful) { "usable" } else { "good" };
    let body = html! {
        header {
            p.kicker { "hydroid · manoeuvring trials" }
            h1 { "Trials in logs" }
        }
        div class={ "banner " (class) } role="status" { (words) }
        dl.facts {
            dt { "Model" } dd { (subject.model.title()) " (" (subject.model.kind()) ")" }
            (scale_of(subject.model))
        }
    };
    Section::new("summary", "Summary", body)
}

fn values(comparison: &Comparison) -> Markup {
    let heads = ["", "measured", "predicted", "E", "U"].map(cell);
    let value = |value: Option<f64>| value.map_or_else(|| String::from("–"), |value| text(value, 4));
    let rows: Vec<Vec<Markup>> = comparison
        .measured
        .iter()
        .zip(&comparison.predicted)
        .filter(|(measured, _)| measured.value.is_some() || measured.not_valid.is_some())
        .map(|(measured, predicted)| {
            let (name, unit) = measured.name_and_unit();
            let mark = if predicted.extrapolated && predicted.value.is_some() { " *" } else { "" };
            let error = comparison.errors.iter().find(|error| error.name == measured.name);
            let uncertainty = error.and_then(|error| error.uncertainty);
            vec![
                html! { (name) br; span.small { "[" (unit) "]" } },
                html! {
                    (value(measured.value))
                    @if let Some([low, high]) = measured.interval { br; span.small { "± " (text(0.5 * (high - low), 2)) } }
                },
                html! {
                    (value(predicted.value)) (mark)
                    @if let Some([low, high]) = predicted.interval { br; span.small { (text(low, 3)) " to " (text(high, 3)) (predicted.left_out_text()) } }
                    @if predicted.no_interval.is_some() { br; span.small { "no interval" } }
                },
                cell(error.map(|error| text(error.error, 2)).unwrap_or_default()),
                cell(uncertainty.map(|of| text(of, 2)).unwrap_or_default()),
            ]
        })
        .collect();
    let [north, east] = comparison.current;
    html! {
        (table(&heads, &rows, 1))
        p.small {
            "Measured path: " (comparison.path_words()) ". Approach: " (text(comparison.approach.speed_m_s, 3)) " m/s over ground."
        }
        @for doubt in &comparison.doubts { p.warning { "Doubtful: " (doubt) "." } }
        @if let Some(reason) = comparison.measured.iter().find_map(|figure| figure.not_valid.as_ref()) {
            p.warning { "Figures without a value are not measured: " (reason) "." }
        }
        @if let Some(reason) = &comparison.tracks[1].not_valid { p.warning { "The prediction is not valid: " (reason) "." } }
        @if comparison.in_training { p.warning { "The model was fitted to a run of this name." } }
        @if [north, east] != [0.0; 2] {
            p.small {
                "In a current of " (text(north, 2)) " m/s north and " (text(east, 2)) " m/s east, "
                @if comparison.current_of_turn { "that of the turn itself." } @else { "estimated before the trial." }
            }
        }
        @for outside in &comparison.outside { p.small { "* " (outside) "." } }
        @for (names, reason) in &no_interval(&comparison.predicted) {
            p.small { "No interval of " (names.join(", ")) ": " (reason) "." }
        }
        @if let Some(words) = interval_words(&comparison.predicted, comparison.members) {
            p.small { "Intervals: " (words) "." }
        }
    }
}

/// Figures without an interval, by their reasons.
fn no_interval(figures: &[Value]) -> Vec<(Vec<String>, &str)> {
    let mut all: Vec<(Vec<String>, &str)> = Vec::new();
    for (figure, reason) in figures.iter().filter_map(|figure| Some((figure, figure.no_interval.as_deref()?)))
    {
        let name = figure.name_and_unit().0;
        match all.iter_mut().find(|(_, known)| *known == reason) {
            Some((names, _)) => names.push(name),
            None => all.push((vec![name], reason)),
        }
    }
    all
}

fn tracks(comparison: &Comparison) -> Figure {
    let mut panel = Panel::new("north [m]");
    for track in comparison.member_tracks.iter().take(MEMBERS) {
        panel = panel.mark(Mark::Line(Line::new(position(track), MEMBER)));
    }
    let [measured, predicted] = comparison.tracks.each_ref().map(position);
    let all = [&measured[..], &predicted].concat();
    panel = panel.mark(Mark::Line(Line::new(predicted, style::MODEL_LINE)));
    panel = panel.mark(Mark::Line(Line::new(measured, style::MEASURED_LINE)));
    let ((left, right), (low, high)) = (covered(&all, |p| p.0), covered(&all, |p| p.1));
    keyed(Figure::new("Track", "east [m]").equal_axes()).x_range(left, right).panel(panel.range(low, high))
}

fn headings(comparison: &Comparison) -> Figure {
    let of =
        |track: &Track| over_time(track, |k| (track.eta[k][2] - track.eta[track.execute][2]).to_degrees());
    let mut panel = Panel::new("heading [deg]").height(220.0);
    for track in comparison.member_tracks.iter().take(MEMBERS) {
        panel = panel.mark(Mark::Line(Line::new(of(track), MEMBER)));
    }
    let [measured, predicted] = comparison.tracks.each_ref().map(of);
    panel = panel.mark(Mark::Line(Line::new(predicted, style::MODEL_LINE)));
    panel = panel.mark(Mark::Line(Line::new(measured, style::MEASURED_LINE)));
    keyed(Figure::new("Heading", "time [s]")).panel(panel)
}

fn keyed(figure: Figure) -> Figure {
    figure.key(Key::Line(style::MEASURED_LINE), "measured").key(Key::Line(style::MODEL_LINE), "predicted")
}

fn definitions(subject: &ComparisonReport<'_>) -> Section {
    let body = html! {
        p {
            "Each prediction starts from the measurements up to the first sample of the trial, and has the measured commands. A zigzag is reversed at the measured headings. "
            "Advance and transfer are the distances along and across the initial course up to a change of heading by 90°, the tactical diameter is that across up to 180°. "
            "An overshoot is the change of heading in the old direction after the steering was reversed. "
            "± is half the 90 % interval that the noise of positions and headings leaves, E the measured less the predicted value, and U the uncertainty of this comparison: the root of the sum of the squares of half of both intervals. A smaller error may be that of the measurement."
        }
        details {
            summary { "Command that reproduces this page" }
            pre.copy.wrap { (readable(subject.command)) }
        }
    };
    Section::new("definitions", "Definitions", body)
}
