//! Lines, points, bands and bars within a frame, and the labels beside them.

use plotters::style::{Color as _, RGBColor};

use super::canvas::{Align, Canvas};
use super::clip::{Frame, Point, clip};
use super::scale::Scale;
use super::{Dash, Line, Mark, Sign, Stroke, style, text};

/// Smallest distance between two labels \[px\].
const APART: f64 = 16.0;

pub(super) fn heights(mark: &Mark) -> Box<dyn Iterator<Item = f64> + '_> {
    match mark {
        Mark::Line(line) => Box::new(line.points.iter().map(|p| p.1)),
        Mark::Points(points) => Box::new(points.points.iter().map(|p| p.1)),
        Mark::Band { points, .. } => Box::new(points.iter().flat_map(|p| [p.1, p.2])),
        Mark::Bars { bars, .. } => Box::new(bars.iter().flat_map(|b| [0.0, b.2])),
        Mark::Level { at, .. } => Box::new(std::iter::once(*at)),
        Mark::Verticals { .. } => Box::new(std::iter::empty()),
    }
}

pub(super) fn places(mark: &Mark) -> Box<dyn Iterator<Item = f64> + '_> {
    match mark {
        Mark::Line(line) => Box::new(line.points.iter().map(|p| p.0)),
        Mark::Points(points) => Box::new(points.points.iter().map(|p| p.0)),
        Mark::Band { points, .. } => Box::new(points.iter().map(|p| p.0)),
        Mark::Bars { bars, .. } => Box::new(bars.iter().flat_map(|b| [b.0, b.1])),
        Mark::Verticals { at, .. } => Box::new(at.iter().copied()),
        Mark::Level { .. } => Box::new(std::iter::empty()),
    }
}

/// Draws marks; returns the number that contain data.
pub(super) fn draw(canvas: &mut Canvas<'_>, marks: &[Mark], frame: Frame, x: &Scale, y: &Scale) -> usize {
    let place = |p: &(f64, f64)| (x.place(p.0), y.place(p.1));
    let mut labels = Vec::new();
    let mut points = Vec::new();
    let mut shown = 0;
    for mark in marks {
        shown += usize::from(holds_data(mark));
        match mark {
            Mark::Line(line) => {
                let points: Vec<Point> = line.points.iter().map(place).collect();
                draw_line(canvas, &points, frame, line.stroke);
                labels.extend(label(line, &points, frame));
            }
            Mark::Points(set) => {
                for &point in &set.points {
                    let at = place(&point);
                    if at.0.is_finite() && at.1.is_finite() && inside(at, frame) {
                        sign(canvas, set.sign, at, set.radius, set.colour);
                    }
                }
                let first = set.points.first().map(place);
                if let (Some(label), Some(at)) = (&set.label, first.filter(|at| inside(*at, frame))) {
                    points.push((label.as_str(), at, set.radius));
                }
            }
            Mark::Band { points, colour, opacity } => {
                let finite = |p: &&(f64, f64, f64)| p.0.is_finite() && p.1.is_finite() && p.2.is_finite();
                let clamp = |v: f64| y.place(v).clamp(frame.top, frame.bottom);
                let upper = points.iter().filter(finite).map(|p| (x.place(p.0), clamp(p.2)));
                let lower = points.iter().filter(finite).rev().map(|p| (x.place(p.0), clamp(p.1)));
                let outline: Vec<Point> = upper.chain(lower).collect();
                canvas.area(&outline, colour.mix(*opacity));
            }
            Mark::Bars { bars, colour } => {
                let base = y.place(0.0).clamp(frame.top, frame.bottom);
                for &(from, to, height) in bars.iter().filter(|b| b.2.is_finite() && b.2 != 0.0) {
                    let (left, right) = (x.place(from).max(frame.left), x.place(to).min(frame.right));
                    let end = y.place(height).clamp(frame.top, frame.bottom);
                    // A thin gap separates neighbouring bars.
                    let inset = (0.1 * (right - left)).min(0.6);
                    let (top, bottom) = (end.min(base), end.max(base));
                    canvas.rectangle((left + inset, top), (right - inset, bottom), colour.mix(1.0));
                }
            }
            Mark::Level { at, stroke } => {
                let h = y.place(*at);
                draw_line(canvas, &[(frame.left, h), (frame.right, h)], frame, *stroke);
            }
            Mark::Verticals { at, stroke } => {
                for &v in at {
                    let v = x.place(v);
                    draw_line(canvas, &[(v, frame.top), (v, frame.bottom)], frame, *stroke);
                }
            }
        }
    }
    beside(canvas, &points, frame);
    spread(&mut labels, frame);
    for label in &labels {
        let words = text::fit(&label.words, style::TEXT, style::WIDTH - label.at.0);
        canvas.text(label.at, &words, style::TEXT, label.colour, Align::Start);
    }
    shown
}

fn holds_data(mark: &Mark) -> bool {
    match mark {
        Mark::Line(line) => line.points.iter().any(|p| p.0.is_finite() && p.1.is_finite()),
        Mark::Points(set) => set.points.iter().any(|p| p.0.is_finite() && p.1.is_finite()),
        Mark::Band { points, .. } => points.iter().any(|p| p.1.is_finite() && p.2.is_finite()),
        Mark::Bars { bars, .. } => bars.iter().any(|b| b.2.is_finite()),
        Mark::Level { .. } | Mark::Verticals { .. } => false,
    }
}

fn inside((x, y): Point, frame: Frame) -> bool {
    let slack = 0.5;
    x >= frame.left - slack && x <= frame.right + slack && y >= frame.top - slack && y <= frame.bottom + slack
}

fn draw_line(canvas: &mut Canvas<'_>, points: &[Point], frame: Frame, stroke: Stroke) {
    for part in clip(points, frame) {
        if let [alone] = part[..] {
            canvas.disc(alone, 0.5 * stroke.width + 0.4, stroke.colour.mix(1.0));
        } else {
            canvas.line(&part, stroke);
        }
    }
}

pub(super) fn sign(canvas: &mut Canvas<'_>, sign: Sign, (x, y): Point, r: f64, colour: RGBColor) {
    let stroke = Stroke { colour, width: 1.6, dash: Dash::Solid };
    match sign {
        Sign::Disc => canvas.disc((x, y), r, colour.mix(1.0)),
        Sign::Ring => canvas.ring((x, y), r, stroke),
        Sign::Cross => {
            canvas.line(&[(x - r, y - r), (x + r, y + r)], stroke);
            canvas.line(&[(x - r, y + r), (x + r, y - r)], stroke);
        }
        Sign::Up => canvas.area(&[(x - r, y + r), (x, y - r), (x + r, y + r)], colour.mix(1.0)),
    }
}

/// Labels of points, `(words, position, radius)`: below, above, right or left of the point, at the side that covers the
/// least of the labelled points and of earlier labels; ties keep this order.
fn beside(canvas: &mut Canvas<'_>, points: &[(&str, Point, f64)], frame: Frame) {
    let boxed = |(x, y): Point, half: f64, high: f64| Frame {
        left: x - half,
        top: y - high,
        right: x + half,
        bottom: y + high,
    };
    let mut taken: Vec<Frame> = points.iter().map(|(_, at, radius)| boxed(*at, *radius, *radius)).collect();
    for (label, (x, y), radius) in points {
        let half = 0.55 * text::width(label, style::TEXT);
        let (over, aside) = (radius + 12.0, radius + 6.0 + half);
        let fits = |x: f64| x.clamp(frame.left + half, (frame.right - half).max(frame.left + half));
        let places = [(fits(*x), y + over), (fits(*x), y - over), (x + aside, *y), (x - aside, *y)];
        let covered = |at: &Point| {
            let here = boxed(*at, half, 8.0);
            let beyond = share(here, here) - share(here, frame);
            taken.iter().map(|there| share(here, *there)).sum::<f64>() + beyond
        };
        let best = places.into_iter().min_by(|a, b| covered(a).total_cmp(&covered(b)));
        let at = best.unwrap_or(places[0]);
        canvas.bold(at, label, style::TEXT, style::INK, Align::Middle);
        taken.push(boxed(at, half, 8.0));
    }
}

/// The overlap of two frames \[px^2\].
fn share(a: Frame, b: Frame) -> f64 {
    let along = |from: f64, to: f64| (to - from).max(0.0);
    along(a.left.max(b.left), a.right.min(b.right)) * along(a.top.max(b.top), a.bottom.min(b.bottom))
}

struct Label {
    at: Point,
    words: String,
    colour: RGBColor,
}

fn label(line: &Line, points: &[Point], frame: Frame) -> Option<Label> {
    let words = line.label.clone()?;
    let last = points.iter().rev().find(|p| p.0.is_finite() && p.1.is_finite())?;
    let y = last.1.clamp(frame.top + 6.0, frame.bottom - 6.0);
    Some(Label { at: (frame.right + 7.0, y), words, colour: darker(line.stroke.colour) })
}

/// Text needs more contrast than a line.
fn darker(colour: RGBColor) -> RGBColor {
    let part = |c: u8| u8::try_from(u16::from(c) * 4 / 5).unwrap_or(c);
    RGBColor(part(colour.0), part(colour.1), part(colour.2))
}

/// Moves labels apart by the smallest total distance, in their vertical order.
fn spread(labels: &mut [Label], frame: Frame) {
    labels.sort_by(|a, b| a.at.1.total_cmp(&b.at.1));
    // Groups of touching labels are centred at the mean of their preferred positions.
    let mut groups: Vec<(f64, usize)> = Vec::new();
    for label in labels.iter() {
        let mut group = (label.at.1, 1);
        while let Some(&(centre, count)) = groups.last() {
            let reach = 0.5 * APART * (count + group.1) as f64;
            if group.0 - centre >= reach {
                break;
            }
            groups.pop();
            let total = count + group.1;
            group = ((centre * count as f64 + group.0 * group.1 as f64) / total as f64, total);
        }
        groups.push(group);
    }
    let mut index = 0;
    for (centre, count) in groups {
        let half = 0.5 * APART * (count - 1) as f64;
        let low = frame.top + 4.0 + half;
        let high = (frame.bottom - 4.0 - half).max(low);
        let centre = centre.clamp(low, high);
        for i in 0..count {
            labels[index].at.1 = centre - half + APART * i as f64;
            index += 1;
        }
    }
}
