//! Section on Monte Carlo trials.

use maud::{Markup, html};

use super::figures::histogram;
use crate::ReportError;
use crate::figure::{Figure, Mark, Panel};
use crate::number::{self, text};
use crate::page::{Section, cell, columns, figure, table};
use crate::style;
use hydroid::closed_loop::{Metrics, MonteCarlo, Summary, Trial};

const SHOWN: usize = 12;

pub(super) fn section(trials: &MonteCarlo) -> Result<Section, ReportError> {
    let row = |name: &str, summary: &Summary, unit: &str| {
        let figures = [summary.median, summary.p95, summary.max].map(|x| cell(text(x, 3)));
        std::iter::once(cell(name)).chain(figures).chain([cell(unit)]).collect::<Vec<Markup>>()
    };
    let rows = [
        row("distance from the reference, RMS", &trials.rms_position, "m"),
        row("distance from the path, RMS", &trials.rms_cross_track, "m"),
        row("distance from the path, largest", &trials.max_cross_track, "m"),
        row("speed error, RMS", &trials.rms_speed, "m/s"),
    ];
    let heads = ["quantity", "median", "95th percentile", "largest", ""].map(cell);
    let dispersion = &trials.dispersion;
    let body = html! {
        p {
            (number::count(trials.runs)) " runs, each with its own seed. The mass varies by up to ±" (text(100.0 * dispersion.mass, 2))
            " %. Current of up to " (text(dispersion.current, 2)) " m/s and wind of up to " (text(dispersion.wind, 3))
            " N come from any direction. " (number::count(trials.held)) " runs stayed within the tolerance. " (number::count(trials.diverged))
            " runs diverged. " (number::count(trials.violations)) " commands violated their limits. "
            (number::count(trials.undetected_losses)) " samples were outside the tolerance while the status of the controller did not report it."
        }
        (table(&heads, &rows, 1))
        (columns(&[
            figure(&bars(trials, "distance from the path, RMS [m]", |m| m.rms_cross_track).svg()?, &html! { "Histogram of the RMS distance from the path." }),
            figure(&bars(trials, "speed error, RMS [m/s]", |m| m.rms_speed).svg()?, &html! { "Histogram of the RMS speed error." }),
        ]))
        h3 { "Runs with the largest errors" }
        (worst(trials))
    };
    Ok(Section::new("monte-carlo", "Monte Carlo", body))
}

fn bars(trials: &MonteCarlo, label: &str, of: fn(&Metrics) -> f64) -> Figure {
    let values: Vec<f64> = trials.trials.iter().map(|trial| of(&trial.metrics)).collect();
    let bars = Mark::Bars { bars: histogram(&values, 25), colour: style::BAND };
    Figure::new(label, label).panel(Panel::new("runs").height(130.0).mark(bars))
}

fn worst(trials: &MonteCarlo) -> Markup {
    let mut order: Vec<&Trial> = trials.trials.iter().collect();
    // The errors of a diverged run are infinite, never NaN.
    order.sort_by(|a, b| {
        let (a, b) = (&a.metrics, &b.metrics);
        a.held.cmp(&b.held).then(b.rms_position.total_cmp(&a.rms_position))
    });
    let heads = [
        "seed",
        "within tolerance",
        "position [m]",
        "path [m]",
        "speed [m/s]",
        "mass",
        "current [m/s]",
        "wind [N]",
    ]
    .map(cell);
    let rows: Vec<Vec<Markup>> = order
        .iter()
        .take(SHOWN)
        .map(|trial| {
            let (c, m) = (&trial.conditions, &trial.metrics);
            let size = |[x, y]: [f64; 2]| x.hypot(y);
            vec![
                cell(c.seed.to_string()),
                cell(if m.held { "yes" } else { "no" }),
                cell(text(m.rms_position, 3)),
                cell(text(m.rms_cross_track, 3)),
                cell(text(m.rms_speed, 3)),
                cell(text(c.mass, 3)),
                cell(text(size(c.current), 2)),
                cell(text(size(c.wind.force), 3)),
            ]
        })
        .collect();
    table(&heads, &rows, 0)
}
