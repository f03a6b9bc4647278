//! Layout of axes, ticks, labels and legend.

use super::canvas::{self, Align, Canvas};
use super::clip::{Frame, Point};
use super::marks;
use super::scale::{Scale, Ticks, cover, padded};
use super::{Figure, FigureError, Key, Mark, Panel, Sign, style, text};

/// Space above a panel, for its label \[px\].
const HEAD: f64 = 30.0;
/// Space below the last panel, for tick labels and axis name.
const FOOT: f64 = 42.0;
const LEGEND: f64 = 22.0;
/// Space between the frame and its tick labels.
const GAP: f64 = 7.0;
/// Largest width of labels beside lines.
const LABELS: f64 = 130.0;

struct Placed<'a> {
    panel: &'a Panel,
    frame: Frame,
    y: Scale,
    ticks: Ticks,
}

pub(super) fn draw(figure: &Figure) -> Result<String, FigureError> {
    let mut ranges: Vec<_> = figure.panels.iter().map(|panel| (value_range(panel), panel.height)).collect();
    let with_ticks = |ranges: &[((f64, f64), f64)]| -> Vec<(Scale, Ticks)> {
        figure
            .panels
            .iter()
            .zip(ranges)
            .map(|(panel, &(range, height))| vertical(panel, range, height))
            .collect()
    };
    let mut scales = with_ticks(&ranges);
    let tick_width = scales
        .iter()
        .flat_map(|(_, ticks)| ticks.values.iter().map(|v| text::width(&ticks.label(*v), style::SMALL)))
        .fold(0.0, f64::max);
    let left = (tick_width + GAP + 4.0).max(34.0);
    let label_width = labels(figure).map(|l| text::width(l, style::TEXT)).fold(0.0, f64::max);
    let right = style::WIDTH - if label_width > 0.0 { (label_width + 12.0).min(LABELS) } else { 14.0 };
    let mut x_range = horizontal(figure);
    if figure.equal_axes {
        for (range, height) in &mut ranges {
            (x_range, *range, *height) = equal_scale(x_range, *range, right - left);
        }
        scales = with_ticks(&ranges);
    }
    let legend = legend_rows(&figure.legend);
    let mut top = LEGEND * legend.len() as f64;
    let mut placed = Vec::with_capacity(figure.panels.len());
    for ((panel, (scale, ticks)), (_, height)) in figure.panels.iter().zip(scales).zip(ranges) {
        let frame = Frame { left, top: top + HEAD, right, bottom: top + HEAD + height };
        top = frame.bottom + 7.0;
        placed.push(Placed { panel, frame, y: Scale::new(scale.range(), frame.bottom, frame.top), ticks });
    }
    let x = Scale::new(x_range, left, right);
    let size = (style::WIDTH, top + FOOT);
    canvas::draw(size, &figure.title, &panel_data(figure, &placed, &x), |canvas| {
        for (row, keys) in legend.iter().enumerate() {
            draw_legend(canvas, keys, LEGEND * (row as f64 + 0.5));
        }
        let x_ticks = roomy(&x, right - left, figure.x_decades);
        for (i, panel) in placed.iter().enumerate() {
            let last = i + 1 == placed.len();
            draw_axes(canvas, panel, &x, &x_ticks, last.then_some(figure.x_label.as_str()));
            if marks::draw(canvas, &panel.panel.marks, panel.frame, &x, &panel.y) == 0 {
                let middle = (0.5 * (left + right), 0.5 * (panel.frame.top + panel.frame.bottom));
                canvas.text(middle, "no data", style::TEXT, style::MUTED, Align::Middle);
            }
        }
    })
}

/// Ticks whose labels do not overlap.
fn roomy(x: &Scale, width: f64, decades: bool) -> Ticks {
    let fits = |ticks: &Ticks| {
        let widest =
            ticks.values.iter().map(|v| text::width(&ticks.label(*v), style::SMALL)).fold(0.0, f64::max);
        let (low, high) = x.range();
        let apart = match ticks.values[..] {
            [a, b, ..] => (b - a) / (high - low) * width,
            _ => width,
        };
        widest + 14.0 <= apart
    };
    let of = |wanted: usize, most: usize| if decades { x.decades(most) } else { x.ticks(wanted, most) };
    [6, 5, 4, 3, 2].into_iter().map(|wanted| of(wanted, wanted + 3)).find(fits).unwrap_or_else(|| of(2, 3))
}

fn labels(figure: &Figure) -> impl Iterator<Item = &str> {
    figure.panels.iter().flat_map(|p| &p.marks).filter_map(|mark| match mark {
        Mark::Line(line) => line.label.as_deref(),
        _ => None,
    })
}

/// Largest and least height of a panel with equal axes \[px\].
const TALLEST: f64 = 560.0;
const SHORTEST: f64 = 140.0;

/// Horizontal range, vertical range and height of a panel with equal axes. The range that needs more space decides; the
/// other one is widened about its centre.
fn equal_scale(x: (f64, f64), y: (f64, f64), width: f64) -> ((f64, f64), (f64, f64), f64) {
    let unit = ((x.1 - x.0) / width).max((y.1 - y.0) / TALLEST);
    let height = ((y.1 - y.0) / unit).max(SHORTEST);
    let about = |(low, high): (f64, f64), pixels: f64| {
        let (middle, half) = (0.5 * (low + high), 0.5 * unit * pixels);
        (middle - half, middle + half)
    };
    if unit > 0.0 && unit.is_finite() {
        (about(x, width), about(y, height), height)
    } else {
        (x, y, SHORTEST)
    }
}

/// Frame in SVG units, ranges and logarithmic axes of each panel, for the script of the page. `None` for tracks, which
/// are not functions of the horizontal axis.
fn panel_data(figure: &Figure, placed: &[Placed<'_>], x: &Scale) -> Vec<String> {
    if figure.equal_axes {
        return Vec::new();
    }
    let of = |panel: &Placed<'_>| {
        let Frame { left, top, right, bottom } = panel.frame;
        let [left, top, right, bottom] = [left, top, right, bottom].map(canvas::whole);
        let ((x0, x1), (y0, y1)) = (x.range(), panel.y.range());
        let (log_x, log_y) = (u8::from(figure.x_decades), u8::from(panel.panel.decades));
        format!("{left},{top},{right},{bottom},{x0:.6e},{x1:.6e},{y0:.6e},{y1:.6e},{log_x},{log_y}")
    };
    placed.iter().map(of).collect()
}

fn value_range(panel: &Panel) -> (f64, f64) {
    panel.range.unwrap_or_else(|| {
        let covered = cover(panel.marks.iter().flat_map(marks::heights)).unwrap_or((0.0, 1.0));
        let has_bars = panel.marks.iter().any(|m| matches!(m, Mark::Bars { .. }));
        let (low, high) = padded(covered, 0.06);
        if has_bars && covered.0 >= 0.0 { (0.0, high) } else { (low, high) }
    })
}

/// The vertical scale of a panel (before placement) and its ticks.
fn vertical(panel: &Panel, range: (f64, f64), height: f64) -> (Scale, Ticks) {
    let scale = Scale::new(range, height, 0.0);
    // 17 px per label; the count is small and positive.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let room = |pixels: f64| (height / pixels).clamp(2.0, 9.0) as usize;
    let ticks =
        if panel.decades { scale.decades(room(17.0)) } else { scale.ticks(room(28.0), room(17.0) + 1) };
    (scale, ticks)
}

fn horizontal(figure: &Figure) -> (f64, f64) {
    figure.x_range.unwrap_or_else(|| {
        let all = figure.panels.iter().flat_map(|p| &p.marks).flat_map(marks::places);
        let covered = cover(all).unwrap_or((0.0, 1.0));
        // A logarithmic axis carries points; a margin keeps them off the frame.
        if figure.x_decades { padded(covered, 0.06) } else { covered }
    })
}

fn draw_axes(
    canvas: &mut Canvas<'_>,
    placed: &Placed<'_>,
    x: &Scale,
    x_ticks: &Ticks,
    x_label: Option<&str>,
) {
    let Frame { left, top, right, bottom } = placed.frame;
    let hair = |colour| super::Stroke { colour, width: 1.0, dash: super::Dash::Solid };
    for &value in &placed.ticks.values {
        let y = placed.y.place(value);
        canvas.line(&[(left, y), (right, y)], hair(style::GRID));
        let label = placed.ticks.label(value);
        canvas.text((left - GAP, y), &label, style::SMALL, style::MUTED, Align::End);
    }
    for &value in &x_ticks.values {
        let at = x.place(value);
        canvas.line(&[(at, top), (at, bottom)], hair(style::GRID));
    }
    let (low, high) = placed.y.range();
    // On a logarithmic axis 0 is only the position of 1.
    let zero = if low <= 0.0 && high >= 0.0 && !placed.panel.decades { placed.y.place(0.0) } else { bottom };
    canvas.line(&[(left, zero), (right, zero)], hair(style::AXIS));
    let factor = placed.ticks.factor();
    let room = style::WIDTH - 8.0 - text::width(&factor, style::SMALL);
    let label = text::fit(&placed.panel.label, style::TEXT, room);
    canvas.bold((2.0, top - 18.0), &label, style::TEXT, style::INK, Align::Start);
    if !factor.is_empty() {
        let after = 2.0 + 1.08 * text::width(&label, style::TEXT) + 8.0;
        canvas.text((after, top - 18.0), &factor, style::SMALL, style::MUTED, Align::Start);
    }
    let Some(x_label) = x_label else { return };
    canvas.line(&[(left, bottom), (right, bottom)], hair(style::AXIS));
    for &value in &x_ticks.values {
        let at = x.place(value);
        canvas.line(&[(at, bottom), (at, bottom + 4.0)], hair(style::AXIS));
        canvas.text((at, bottom + 14.0), &x_ticks.label(value), style::SMALL, style::MUTED, Align::Middle);
    }
    let factor = x_ticks.factor();
    let room = style::WIDTH - 20.0 - text::width(&factor, style::TEXT);
    let label = format!("{} {factor}", text::fit(x_label, style::TEXT, room));
    let half = 0.5 * text::width(label.trim(), style::TEXT);
    let middle = (0.5 * (left + right)).min(style::WIDTH - half - 4.0).max(half + 2.0);
    canvas.text((middle, bottom + 33.0), label.trim(), style::TEXT, style::INK, Align::Middle);
}

fn key_width(label: &str) -> f64 {
    32.0 + text::width(label, style::TEXT) + 14.0
}

fn legend_rows(legend: &[(Key, String)]) -> Vec<Vec<(f64, Key, &str)>> {
    let mut rows: Vec<Vec<(f64, Key, &str)>> = Vec::new();
    let mut at = f64::INFINITY;
    for (key, label) in legend {
        let width = key_width(label);
        if at + width - 14.0 > style::WIDTH {
            rows.push(Vec::new());
            at = 2.0;
        }
        if let Some(row) = rows.last_mut() {
            row.push((at, *key, label));
        }
        at += width;
    }
    rows
}

fn draw_legend(canvas: &mut Canvas<'_>, keys: &[(f64, Key, &str)], y: f64) {
    for &(x, key, label) in keys {
        match key {
            Key::Line(stroke) => canvas.line(&[(x, y), (x + 26.0, y)], stroke),
            Key::Sign(sign, colour) => marks::sign(canvas, sign, (x + 13.0, y), key_radius(sign), colour),
            Key::Area(colour) => {
                use plotters::style::Color as _;
                let corner: Point = (x + 4.0, y - 5.0);
                canvas.rectangle(corner, (x + 22.0, y + 5.0), colour.mix(1.0));
            }
        }
        let room = style::WIDTH - x - 32.0;
        let label = text::fit(label, style::TEXT, room);
        canvas.text((x + 32.0, y), &label, style::TEXT, style::INK, Align::Start);
    }
}

fn key_radius(sign: Sign) -> f64 {
    if sign == Sign::Disc { 4.5 } else { 4.0 }
}
