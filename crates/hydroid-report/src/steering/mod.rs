//! The page of a voyage, or of many.

mod figures;
mod many;

use maud::{Markup, html};

use super::ReportError;
use super::number::{self, text};
use super::page::{Section, cell, columns, figure, page, readable, table};
use hydroid::closed_loop::{Metrics, MonteCarlo, Run, TunedAutopilot};
use hydroid_core::guidance::Path;
use hydroid_core::vessel::VesselParams;

/// What a page about steering is made from.
#[derive(Clone, Copy, Debug)]
pub struct Steered<'a> {
    /// Heading of the page.
    pub title: &'a str,
    /// The command line that makes the page again.
    pub command: &'a str,
    /// What is to be told of controller, model, task and conditions: name and value.
    pub facts: &'a [(String, String)],
    /// The true vessel: names and units of the commands.
    pub vessel: &'a VesselParams,
    /// The path.
    pub path: &'a Path,
    /// A voyage, sample by sample; of many the first.
    pub run: &'a Run,
    /// Its figures.
    pub metrics: &'a Metrics,
    /// All voyages, where there are many.
    pub fleet: Option<&'a MonteCarlo>,
    /// How the autopilot was tuned, where it steers.
    pub tuned: Option<&'a TunedAutopilot>,
}

/// The page.
///
/// # Errors
/// If a figure cannot be written.
pub fn steering(subject: &Steered<'_>) -> Result<String, ReportError> {
    let mut sections = vec![summary(subject)];
    if let Some(fleet) = subject.fleet {
        sections.push(many::section(fleet)?);
    }
    sections.push(track(subject)?);
    sections.push(errors(subject)?);
    sections.push(commands(subject)?);
    sections.push(settings(subject));
    Ok(page(subject.title, &sections))
}

fn summary(subject: &Steered<'_>) -> Section {
    let Steered { metrics, fleet, .. } = subject;
    let (class, title, words) = match fleet {
        Some(fleet) if fleet.held < fleet.runs => (
            "bad",
            "Not always held.",
            format!(
                "{} of {} voyages left their course or did not settle.",
                number::count(fleet.runs - fleet.held),
                number::count(fleet.runs)
            ),
        ),
        Some(fleet) => {
            ("good", "Held.", format!("All {} voyages held their course.", number::count(fleet.runs)))
        }
        None if metrics.held => ("good", "Held.", held(metrics)),
        None if metrics.diverged => {
            ("bad", "Lost.", String::from("The state of the vessel stopped being a number."))
        }
        None if metrics.arrived == Some(false) => {
            ("bad", "Not arrived.", String::from("The end of the path was not reached in time."))
        }
        None => (
            "bad",
            "Lost.",
            String::from(
                "The vessel was farther from its reference than the tolerance after the time from which errors count.",
            ),
        ),
    };
    let body = html! {
        header {
            p.kicker { "hydroid · steering report" }
            h1 { (subject.title) }
        }
        div class={ "banner " (class) } role="status" { strong { (title) } " " (words) }
        @if fleet.is_none() { (figures_table(metrics)) }
        dl.facts { @for (name, value) in subject.facts { dt { (name) } dd { (readable(value)) } } }
    };
    Section::new("summary", "Summary", body)
}

fn held(metrics: &Metrics) -> String {
    match metrics.settled_after {
        Some(after) if after > 0.0 => format!("Settled after {} s, and stayed.", text(after, 3)),
        _ => String::from("The vessel was never farther from its reference than the tolerance."),
    }
}

fn figures_table(metrics: &Metrics) -> Markup {
    let rows = [
        ("distance from the reference, RMS", text(metrics.rms_position, 3), "m"),
        ("distance from the path, RMS", text(metrics.rms_cross_track, 3), "m"),
        ("distance from the path, largest", text(metrics.max_cross_track, 3), "m"),
        ("speed error, RMS", text(metrics.rms_speed, 3), "m/s"),
        ("samples with a command at its limit", text(100.0 * metrics.saturated, 3), "%"),
        ("time for a command, median", text(metrics.us_per_command.median, 3), "µs"),
        ("time for a command, longest", text(metrics.us_per_command.max, 3), "µs"),
    ];
    let rows: Vec<Vec<Markup>> =
        rows.iter().map(|(name, value, unit)| vec![cell(name), cell(value), cell(unit)]).collect();
    html! {
        (table(&[cell("figure"), cell("value"), cell("")], &rows, 1))
        p.small { "Errors count from " (text(metrics.from_s, 3)) " s on, and are those of the point that is to be on the path." }
    }
}

fn track(subject: &Steered<'_>) -> Result<Section, ReportError> {
    let caption = html! {
        "The path, and the track of the vessel’s origin, coloured by what the controller said of its command. "
        "Both axes have the same scale."
    };
    let counts: Vec<Vec<Markup>> = subject
        .metrics
        .status
        .iter()
        .map(|(name, count)| {
            let share = 100.0 * *count as f64 / subject.run.samples.len().max(1) as f64;
            vec![cell(name.replace('_', " ")), cell(number::count(*count)), cell(format!("{share:.1} %"))]
        })
        .collect();
    let body = html! {
        (columns(&[
            figure(&figures::track(subject).svg()?, &caption),
            table(&[cell("status"), cell("samples"), cell("share")], &counts, 1),
        ]))
    };
    Ok(Section::new("track", "Track", body))
}

fn errors(subject: &Steered<'_>) -> Result<Section, ReportError> {
    let errors = html! { "How far the point that is to be on the path is to starboard of it, and from its reference. Errors count from the upright line on." };
    let speeds = html! { "Its speed over ground less the one asked for, and both." };
    let body = html! {
        (columns(&[
            figure(&figures::errors(subject).svg()?, &errors),
            figure(&figures::speeds(subject).svg()?, &speeds),
        ]))
    };
    Ok(Section::new("errors", "Errors", body))
}

fn commands(subject: &Steered<'_>) -> Result<Section, ReportError> {
    let limits = html! { "Commands as they were given, with their limits dashed." };
    let times = html! { "Time from what was measured to the command, with all that was learned before it; the last bar holds all that took longer." };
    let body = html! {
        (columns(&[
            figure(&figures::commands(subject).svg()?, &limits),
            figure(&figures::times(subject).svg()?, &times),
        ]))
    };
    Ok(Section::new("commands", "Commands", body))
}

fn settings(subject: &Steered<'_>) -> Section {
    let body = html! {
        details {
            summary { "Command that reproduces this page" }
            pre.copy.wrap { (readable(subject.command)) }
        }
        @if let Some(tuned) = subject.tuned {
            h3 { "How the autopilot was tuned" }
            p {
                "The best of " (number::count(tuned.tried)) " points of a grid on " (tuned.seeds.len()) " seeds of its own, in still water: "
                "cross-track and speed error together " (text(tuned.score, 3)) "."
            }
            dl.facts {
                dt { "natural frequency of the heading" } dd { (text(tuned.best.omega, 3)) " rad/s" }
                dt { "look-ahead" } dd { (text(tuned.best.lookahead, 3)) " m" }
                dt { "integral of the line of sight" } dd { (text(tuned.best.sigma, 3)) " m/s" }
                dt { "gain of the speed" } dd { (text(tuned.best.proportional, 3)) " N s/m" }
                dt { "exponent of the speed" } dd { (text(tuned.best.exponent, 2)) }
            }
        }
    };
    Section::new("settings", "Settings", body)
}

#[cfg(test)]
mod tests;
