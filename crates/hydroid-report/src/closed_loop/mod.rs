//! The page of a closed-loop run, or of Monte Carlo trials.

mod figures;
mod monte_carlo;

use maud::{Markup, html};

use super::ReportError;
use super::number::{self, text};
use super::page::{Section, cell, columns, figure, page, readable, table};
use hydroid::closed_loop::{Metrics, MonteCarlo, Run, TunedAutopilot};
use hydroid::plant::Outside;
use hydroid_core::guidance::Path;

/// Content of a closed-loop page.
#[derive(Clone, Copy, Debug)]
pub struct ClosedLoopReport<'a> {
    /// Heading of the page.
    pub title: &'a str,
    /// Command line that reproduces the page.
    pub command: &'a str,
    /// Settings of controller, model, task and conditions: name and value.
    pub facts: &'a [(String, String)],
    pub path: &'a Path,
    /// The run; the first one of Monte Carlo trials.
    pub run: &'a Run,
    /// Metrics of the run.
    pub metrics: &'a Metrics,
    /// Monte Carlo trials, if any.
    pub trials: Option<&'a MonteCarlo>,
    /// Inputs and velocities that leave the range in which the model of the plant was seen.
    pub outside: &'a [Outside],
    /// Tuning of the autopilot, if used.
    pub tuned: Option<&'a TunedAutopilot>,
}

/// The page.
pub fn closed_loop(subject: &ClosedLoopReport<'_>) -> Result<String, ReportError> {
    let mut sections = vec![summary(subject)];
    if let Some(trials) = subject.trials {
        sections.push(monte_carlo::section(trials)?);
    }
    sections.push(track(subject)?);
    sections.push(errors(subject)?);
    sections.push(commands(subject)?);
    sections.push(settings(subject));
    Ok(page(subject.title, &sections))
}

fn summary(subject: &ClosedLoopReport<'_>) -> Section {
    let ClosedLoopReport { metrics, trials, outside, .. } = subject;
    let (class, title, words) = match trials {
        Some(trials) if trials.held < trials.runs => (
            "bad",
            "Not always within the tolerance.",
            format!(
                "{} of {} runs left the tolerance or did not settle.",
                number::count(trials.runs - trials.held),
                number::count(trials.runs)
            ),
        ),
        Some(trials) => (
            "good",
            "Within the tolerance.",
            format!("All {} runs stayed within the tolerance.", number::count(trials.runs)),
        ),
        None if metrics.held => ("good", "Within the tolerance.", held(metrics)),
        None if metrics.diverged => {
            ("bad", "Lost.", String::from("The state of the vessel became non-finite."))
        }
        None if metrics.arrived == Some(false) => {
            ("bad", "Not arrived.", String::from("The end of the path was not reached in time."))
        }
        None => (
            "bad",
            "Lost.",
            String::from("The vessel was outside the tolerance after the start of the evaluation."),
        ),
    };
    let (class, title) = match class {
        "good" if !outside.is_empty() => ("usable", "Within the tolerance, and not validated."),
        _ => (class, title),
    };
    let body = html! {
        header {
            p.kicker { "hydroid · closed-loop report" }
            h1 { (subject.title) }
        }
        div class={ "banner " (class) } role="status" {
            strong { (title) } " " (words)
            @for outside in *outside { " Not validated: " (outside) "." }
        }
        @if trials.is_none() { (figures_table(metrics)) }
        dl.facts { @for (name, value) in subject.facts { dt { (name) } dd { (readable(value)) } } }
    };
    Section::new("summary", "Summary", body)
}

fn held(metrics: &Metrics) -> String {
    match metrics.settled_after {
        Some(after) if after > 0.0 => {
            format!("The vessel settled within the tolerance after {} s.", text(after, 3))
        }
        _ => String::from("The vessel never left the tolerance."),
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
        (table(&[cell("quantity"), cell("value"), cell("")], &rows, 1))
        p.small { "Errors are those of the controlled point. The evaluation starts at " (text(metrics.from_s, 3)) " s." }
    }
}

fn track(subject: &ClosedLoopReport<'_>) -> Result<Section, ReportError> {
    let caption = html! {
        "Reference path and track of the vessel’s origin. The colour of the track is the status of the controller. "
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

fn errors(subject: &ClosedLoopReport<'_>) -> Result<Section, ReportError> {
    let errors = html! { "Cross-track error of the controlled point, positive to starboard, and its distance from the reference. The vertical line is the start of the evaluation." };
    let speeds = html! { "Speed error, and speed over ground of vessel and reference." };
    let body = html! {
        (columns(&[
            figure(&figures::errors(subject).svg()?, &errors),
            figure(&figures::speeds(subject).svg()?, &speeds),
        ]))
    };
    Ok(Section::new("errors", "Errors", body))
}

fn commands(subject: &ClosedLoopReport<'_>) -> Result<Section, ReportError> {
    let limits = html! { "Commands (solid) and their limits (dashed)." };
    let times = html! { "Computing time of a command, including adaptation. The last bar contains all longer times." };
    let body = html! {
        (columns(&[
            figure(&figures::commands(subject).svg()?, &limits),
            figure(&figures::times(subject).svg()?, &times),
        ]))
    };
    Ok(Section::new("commands", "Commands", body))
}

fn settings(subject: &ClosedLoopReport<'_>) -> Section {
    let body = html! {
        details {
            summary { "Command that reproduces this page" }
            pre.copy.wrap { (readable(subject.command)) }
        }
        @if let Some(tuned) = subject.tuned {
            h3 { "Tuning of the autopilot" }
            p {
                "The autopilot has the best of " (number::count(tuned.tried)) " grid points. They were compared on " (tuned.seeds.len()) " separate seeds without current. "
                "The score is the sum of the cross-track error relative to the tolerance and the speed error relative to the cruising speed, here " (text(tuned.score, 3)) "."
            }
            dl.facts {
                dt { "natural frequency of the heading" } dd { (text(tuned.best.omega, 3)) " rad/s" }
                dt { "look-ahead" } dd { (text(tuned.best.lookahead, 3)) " m" }
                dt { "integral gain of the line of sight" } dd { (text(tuned.best.sigma, 3)) " m/s" }
                dt { "gain of the speed controller" } dd { (text(tuned.best.proportional, 3)) " of full ahead per m/s" }
                dt { "exponent of the speed in the gains of the heading" } dd { (text(tuned.best.exponent, 2)) }
            }
        }
    };
    Section::new("settings", "Settings", body)
}
