//! The section on measured and predicted outputs.

use hydroid_core::predict::Predictor;
use maud::{Markup, html};

use super::figure::{Figure, Key, Line, Mark, Panel, Points, Sign, Stroke, cover, envelope};
use super::number;
use super::page::{Section, columns, figure, nothing};
use super::rollouts::{Rollout, RunRollouts};
use super::series::{self, BINS, COMMAND, held_points, points};
use super::{ReportError, style};
use hydroid::evaluate::bands;
use hydroid::identify::Candidate;

const OVERVIEW: usize = 12;
const CLOSER: usize = 3;
/// Smallest range of a panel, as a share of the range of the run.
const LEAST: f64 = 0.15;
const COMMANDS: usize = 8;

pub(super) fn section(candidate: &Candidate, runs: &[RunRollouts<'_>]) -> Result<Section, ReportError> {
    let (heading, id) = ("Measured against predicted", "predicted");
    let longest = runs
        .iter()
        .max_by_key(|run_rollouts| run_rollouts.rollouts.len())
        .filter(|run_rollouts| !run_rollouts.rollouts.is_empty());
    let Some(run_rollouts) = longest else {
        let why = "No run is long enough for a rollout over the horizon.";
        return Ok(Section::new(id, heading, nothing(why)));
    };
    let over = number::duration(run_rollouts.horizon as f64 * run_rollouts.run.dt);
    let overview = run_rollouts.liveliest(OVERVIEW);
    let members = candidate.model.member_sessions();
    let mut blocks = vec![block(
        run_rollouts,
        &members,
        overview,
        &html! {
            "The part of " b { (run_rollouts.run.name) } " in which the outputs vary most: "
            (overview.len()) " rollouts of " (over) ", each of which starts from a measurement (circles)."
        },
    )?];
    if run_rollouts.rollouts.len() > CLOSER {
        let closer = run_rollouts.typical(CLOSER);
        let middle = closer.get(closer.len() / 2).map_or(f64::NAN, |r| r.error);
        blocks.push(block(
            run_rollouts,
            &members,
            closer,
            &html! {
                "Detail around the rollout with the median error of the "
                (number::count(run_rollouts.rollouts.len())) " rollouts in this run. Its error is " (number::ratio(middle))
                " standard deviations, as the mean over outputs and time."
            },
        )?);
    }
    let body = html! {
        p { "Each rollout starts from a measurement (circle). After that it uses the commands only." }
        (columns(&blocks))
        @if !members.is_empty() {
            p.small {
                "The shaded band contains 90 % of the rollouts of the " (members.len()) " members of the ensemble. It shows the effect of " (if candidate.model.is_network() { "the initial weights" } else { "the uncertainty of the coefficients" }) " on the prediction. The line hides a narrow band. "
                "The band does not contain sensor noise, unmeasured waves and wind, or model error. Measurements may lie outside."
            }
        }
        @if candidate.model.description.inputs.len() > COMMANDS {
            p.small { "Only the first " (COMMANDS) " inputs are drawn." }
        }
    };
    Ok(Section::new(id, heading, body))
}

fn block(
    run_rollouts: &RunRollouts<'_>,
    members: &[Box<dyn Predictor>],
    rollouts: &[Rollout],
    caption: &Markup,
) -> Result<Markup, ReportError> {
    let (drawing, left) = draw(run_rollouts, members, rollouts);
    let caption = html! {
        (caption)
        @if !left.is_empty() {
            " The prediction of " (super::summary::list(&left)) " leaves its panel: it diverges there."
        }
    };
    Ok(figure(&drawing.svg()?, &caption))
}

/// Figure of neighbouring rollouts, and the outputs whose prediction leaves its panel.
fn draw<'a>(
    run_rollouts: &RunRollouts<'a>,
    members: &[Box<dyn Predictor>],
    rollouts: &[Rollout],
) -> (Figure, Vec<&'a str>) {
    let run = run_rollouts.run;
    let from = rollouts.first().map_or(0, |r| r.origin);
    let to = rollouts.last().map_or(from, |r| r.origin + run_rollouts.horizon);
    let time = |k: usize| run.t0 + k as f64 * run.dt;
    let mut figure = Figure::new(format!("Measured and predicted outputs of {}", run.name), "time [s]")
        .x_range(time(from), time(to))
        .key(Key::Line(style::MEASURED_LINE), "measured")
        .key(Key::Line(style::MODEL_LINE), "model")
        .key(Key::Sign(Sign::Ring, style::MODEL), "origin")
        .key(Key::Line(style::COMMAND_LINE), "command");
    if !members.is_empty() {
        figure = figure.key(Key::Area(style::BAND), "90 % of the ensemble");
    }
    let at: Vec<usize> = rollouts.iter().map(|r| r.origin).collect();
    let steps: Vec<usize> = (1..=run_rollouts.horizon).collect();
    let bands = bands(members, run, &run.outputs, &at, &steps);
    let origins: Vec<f64> = rollouts.iter().map(|r| time(r.origin)).collect();
    let hair = Stroke { colour: style::AXIS, width: 0.8, dash: super::figure::Dash::Dotted };
    let verticals = || Mark::Verticals { at: origins.clone(), stroke: hair };
    let mut left = Vec::new();
    let n = run.outputs.width();
    for (c, channel) in run.outputs.channels().iter().enumerate() {
        let whole = cover(run.outputs.column(c)).unwrap_or((0.0, 0.0));
        let measured = points(&run.outputs, c, run, from, to + 1, 2 * BINS);
        let lines: Vec<Vec<(f64, f64)>> = rollouts
            .iter()
            .map(|rollout| {
                let start = std::iter::once(rollout.start[c]);
                let values: Vec<f64> = start.chain(rollout.y.iter().skip(c).step_by(n).copied()).collect();
                let line = values.iter().enumerate().map(|(i, v)| (time(rollout.origin + i), *v));
                envelope(line.collect::<Vec<_>>().into_iter(), (2 * BINS / rollouts.len().max(1)).max(12))
            })
            .collect();
        let (range, beyond) = vertical(&measured, &lines, whole);
        if beyond {
            left.push(channel.name.as_str());
        }
        let mut panel = Panel::new(number::with_unit(&channel.name, &channel.unit))
            .height(series::OUTPUT + 8.0)
            .range(range.0, range.1)
            .mark(verticals());
        for (rollout, band) in rollouts.iter().zip(&bands) {
            let edges = |i: usize| (time(rollout.origin + i + 1), band.low[i * n + c], band.high[i * n + c]);
            let points = (0..run_rollouts.horizon).map(edges).collect();
            panel = panel.mark(Mark::Band { points, colour: style::BAND, opacity: 0.45 });
        }
        panel = panel.mark(Mark::Line(Line::new(measured, style::MEASURED_LINE)));
        for line in lines {
            panel = panel.mark(Mark::Line(Line::new(line, Stroke { width: 1.7, ..style::MODEL_LINE })));
        }
        let starts = rollouts.iter().map(|r| (time(r.origin), r.start[c])).collect();
        figure = figure.panel(panel.mark(Mark::Points(Points {
            points: starts,
            sign: Sign::Ring,
            colour: style::MODEL,
            radius: 3.2,
            label: None,
        })));
    }
    for (c, channel) in run.inputs.channels().iter().enumerate().take(COMMANDS) {
        let line = Line::new(held_points(&run.inputs, c, run, from, to), style::COMMAND_LINE);
        let panel = Panel::new(number::with_unit(&channel.name, &channel.unit)).height(COMMAND);
        figure = figure.panel(panel.mark(verticals()).mark(Mark::Line(line)));
    }
    (figure, left)
}

/// Range of a panel: all measurements, at least a share of the range of the run, and predictions within one width of
/// that range; and whether a prediction leaves it.
fn vertical(measured: &[(f64, f64)], model: &[Vec<(f64, f64)>], run: (f64, f64)) -> ((f64, f64), bool) {
    let span = |values: &mut dyn Iterator<Item = f64>| {
        values
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (v.min(l), v.max(h)))
    };
    let seen = span(&mut measured.iter().map(|p| p.1));
    let said = span(&mut model.iter().flatten().map(|p| p.1));
    let not_finite = model.iter().flatten().any(|p| !p.1.is_finite());
    if seen.0 > seen.1 {
        return ((said.0.clamp(-1e9, 1e9), said.1.clamp(-1e9, 1e9)), not_finite);
    }
    let width = (run.1 - run.0).max(1e-9 * seen.1.abs()).max(1e-12);
    let (floor, ceiling) = (seen.0 - width, seen.1 + width);
    let low = seen.0.min(said.0.max(floor));
    let high = seen.1.max(said.1.min(ceiling));
    // Otherwise noise would fill the panel.
    let margin = (0.06 * (high - low)).max(0.5 * (LEAST * width - (high - low)));
    ((low - margin, high + margin), not_finite || said.0 < floor || said.1 > ceiling)
}
