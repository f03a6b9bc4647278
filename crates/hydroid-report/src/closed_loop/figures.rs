//! Figures of a closed-loop run.

use hydroid_core::control::Status;
use plotters::style::RGBColor;

use super::ClosedLoopReport;
use crate::figure::{Dash, Figure, Key, Line, Mark, Panel, Stroke, envelope, steps};
use crate::style;
use hydroid::closed_loop::Sample;

const POINTS: usize = 1_500;

const SOLID: Dash = Dash::Solid;

/// Class of a status, index into [`KINDS`].
fn kind(status: Status) -> usize {
    match status {
        Status::Tracking => 0,
        Status::RateLimited | Status::Saturated => 1,
        Status::Lost | Status::Singular | Status::Blind => 2,
    }
}

const KINDS: [(RGBColor, &str); 3] =
    [(style::MODEL, "tracking"), (style::COMMAND, "at a limit"), (style::ALARM, "lost, singular or blind")];

pub(super) fn track(subject: &ClosedLoopReport<'_>) -> Figure {
    let moments = &subject.run.samples;
    let path = &subject.path;
    let places = 600;
    let points: Vec<(f64, f64)> = (0..=places)
        .map(|k| {
            let [north, east] = path.at(path.length() * f64::from(k) / f64::from(places)).position;
            (east, north)
        })
        .collect();
    let thin = moments.len().div_ceil(POINTS).max(1);
    let mut lines: Vec<(usize, Vec<(f64, f64)>)> = Vec::new();
    for sample in moments.iter().step_by(thin) {
        let (of, at) = (kind(sample.status), (sample.eta[1], sample.eta[0]));
        match lines.last_mut() {
            Some((last, line)) if *last == of => line.push(at),
            Some((_, before)) => {
                let joint = before.last().copied();
                lines.push((of, joint.into_iter().chain([at]).collect()));
            }
            None => lines.push((of, vec![at])),
        }
    }
    let all = || {
        points
            .iter()
            .chain(lines.iter().flat_map(|(_, line)| line))
            .filter(|p| p.0.is_finite() && p.1.is_finite())
    };
    let range = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) =
            all().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let margin = 0.04 * (high - low) + 1.0;
        (low - margin, high + margin)
    };
    let ((left, right), (low, high)) = (range(|p| p.0), range(|p| p.1));
    let wanted = Stroke { colour: style::PERSISTENCE, width: 1.6, dash: Dash::Dashed };
    let mut panel = Panel::new("north [m]").range(low, high);
    panel = panel.mark(Mark::Line(Line::new(points.clone(), wanted)));
    let mut figure = Figure::new("Track of the vessel and the path", "east [m]")
        .x_range(left, right)
        .equal_axes()
        .key(Key::Line(wanted), "path");
    for (of, (colour, name)) in KINDS.iter().enumerate() {
        let stroke = Stroke { colour: *colour, width: 1.8, dash: SOLID };
        let mut any = false;
        for (_, line) in lines.iter().filter(|(own, _)| *own == of) {
            panel = panel.mark(Mark::Line(Line::new(line.clone(), stroke)));
            any = true;
        }
        if any {
            figure = figure.key(Key::Line(stroke), *name);
        }
    }
    figure.panel(panel)
}

fn over_time(subject: &ClosedLoopReport<'_>, of: impl Fn(&Sample) -> f64) -> Vec<(f64, f64)> {
    let points: Vec<(f64, f64)> = subject.run.samples.iter().map(|m| (m.t, of(m))).collect();
    envelope(points.into_iter(), POINTS / 2)
}

const VESSEL: Stroke = Stroke { width: 1.4, ..style::MODEL_LINE };

fn line(subject: &ClosedLoopReport<'_>, of: fn(&Sample) -> f64, stroke: Stroke) -> Mark {
    Mark::Line(Line::new(over_time(subject, of), stroke))
}

/// The start of the evaluation as a vertical line.
fn counts(subject: &ClosedLoopReport<'_>) -> Mark {
    let stroke = Stroke { colour: style::AXIS, width: 1.2, dash: SOLID };
    Mark::Verticals { at: vec![subject.metrics.from_s], stroke }
}

pub(super) fn errors(subject: &ClosedLoopReport<'_>) -> Figure {
    let panel = |label: &str, of| Panel::new(label).mark(counts(subject)).mark(line(subject, of, VESSEL));
    Figure::new("Position errors over time", "time [s]")
        .panel(panel("cross-track error [m]", |m| m.cross_track))
        .panel(panel("distance from the reference [m]", |m| m.distance))
}

pub(super) fn speeds(subject: &ClosedLoopReport<'_>) -> Figure {
    let error = line(subject, |m| m.speed_error, VESSEL);
    Figure::new("Speed over time", "time [s]")
        .key(Key::Line(VESSEL), "vessel")
        .key(Key::Line(style::PERSISTENCE_LINE), "reference")
        .panel(Panel::new("speed error [m/s]").mark(counts(subject)).mark(error))
        .panel(
            Panel::new("speed over ground [m/s]")
                .mark(line(subject, |m| m.reference.speed + m.speed_error, VESSEL))
                .mark(line(subject, |m| m.reference.speed, style::PERSISTENCE_LINE)),
        )
}

pub(super) fn commands(subject: &ClosedLoopReport<'_>) -> Figure {
    let run = subject.run;
    let limit = Stroke { colour: style::ALARM, width: 1.0, dash: Dash::Dashed };
    let mut figure = Figure::new("Commands over time", "time [s]");
    for (i, channel) in run.inputs.iter().enumerate() {
        let limits = run.limits[i];
        let margin = 0.05 * (limits.high - limits.low);
        let values = (0..run.samples.len()).map(|k| run.command(k)[i]);
        let stairs = if run.samples.len() <= POINTS {
            steps(values, 0.0, run.dt_s)
        } else {
            envelope(values.zip(&run.samples).map(|(value, m)| (m.t, value)), POINTS / 2)
        };
        figure = figure.panel(
            Panel::new(format!("{} [{}]", channel.name, channel.unit))
                .height(130.0)
                .range(limits.low - margin, limits.high + margin)
                .mark(Mark::Level { at: limits.low, stroke: limit })
                .mark(Mark::Level { at: limits.high, stroke: limit })
                .mark(Mark::Line(Line::new(stairs, style::COMMAND_LINE))),
        );
    }
    figure
}

/// Histogram; the last bar contains the largest 1 %.
pub(super) fn histogram(values: &[f64], bins: usize) -> Vec<(f64, f64, f64)> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let (Some(&low), Some(&high)) =
        (sorted.first(), sorted.get((sorted.len() * 99).div_ceil(100).saturating_sub(1)))
    else {
        return Vec::new();
    };
    let width = if high > low { (high - low) / bins as f64 } else { low.abs().max(1.0) / bins as f64 };
    let mut counts = vec![0.0; bins];
    for value in &sorted {
        // Clamped to the last bin in the next line but one.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let bin = ((value - low) / width) as usize;
        counts[bin.min(bins - 1)] += 1.0;
    }
    counts
        .iter()
        .enumerate()
        .map(|(k, count)| (low + width * k as f64, low + width * (k + 1) as f64, *count))
        .collect()
}

pub(super) fn times(subject: &ClosedLoopReport<'_>) -> Figure {
    let times: Vec<f64> = subject.run.samples.iter().map(|m| m.time_us).collect();
    let (times, unit) = if subject.metrics.us_per_command.median >= 1000.0 {
        (times.iter().map(|t| 1e-3 * t).collect(), "ms")
    } else {
        (times, "µs")
    };
    let bars = Mark::Bars { bars: histogram(&times, 30), colour: style::BAND };
    Figure::new("Time for a command", format!("time for a command [{unit}]"))
        .panel(Panel::new("samples").height(130.0).mark(bars))
}
