//! Time series of channels as panels.

use super::figure::{Figure, Line, Mark, Panel, Stroke, envelope, steps};
use super::{number, style};
use hydroid::log::{Table, Trajectory};

/// Bins of a line: more would only enlarge the file.
pub(super) const BINS: usize = 240;

/// Height of an output panel \[px\].
pub(super) const OUTPUT: f64 = 96.0;
/// Height of a command panel \[px\].
pub(super) const COMMAND: f64 = 46.0;

pub(super) fn outputs(run: &Trajectory) -> Figure {
    let figure =
        Figure::new(format!("Outputs of {} over time", run.name), "time [s]").x_range(run.t0, end(run));
    panels(figure, run, &run.outputs, style::MEASURED_LINE, OUTPUT, false)
}

pub(super) fn inputs(run: &Trajectory) -> Figure {
    let figure =
        Figure::new(format!("Inputs of {} over time", run.name), "time [s]").x_range(run.t0, end(run));
    panels(figure, run, &run.inputs, style::COMMAND_LINE, 60.0, true)
}

fn end(run: &Trajectory) -> f64 {
    run.t0 + run.duration_s()
}

fn panels(
    mut figure: Figure,
    run: &Trajectory,
    table: &Table,
    stroke: Stroke,
    height: f64,
    held: bool,
) -> Figure {
    let thin = Stroke { width: 1.0, ..stroke };
    for (c, channel) in table.channels().iter().enumerate() {
        let points = if held {
            held_points(table, c, run, 0, table.len())
        } else {
            points(table, c, run, 0, table.len(), BINS)
        };
        let panel = Panel::new(number::with_unit(&channel.name, &channel.unit)).height(height);
        figure = figure.panel(panel.mark(Mark::Line(Line::new(points, thin))));
    }
    figure
}

/// Samples `from..to` of a channel, decimated for a figure.
pub(super) fn points(
    table: &Table,
    channel: usize,
    run: &Trajectory,
    from: usize,
    to: usize,
    bins: usize,
) -> Vec<(f64, f64)> {
    envelope((from..to).map(|k| (run.t0 + k as f64 * run.dt, table.row(k)[channel])), bins)
}

/// A held command over samples `from..to`: a staircase if it is short, else its envelope.
pub(super) fn held_points(
    table: &Table,
    channel: usize,
    run: &Trajectory,
    from: usize,
    to: usize,
) -> Vec<(f64, f64)> {
    let values = (from..to).map(|k| table.row(k)[channel]);
    let stairs = steps(values, run.t0 + from as f64 * run.dt, run.dt);
    if stairs.len() <= 4 * BINS { stairs } else { points(table, channel, run, from, to, 2 * BINS) }
}
