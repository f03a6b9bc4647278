//! Range bars of quantities with different units, each in percent of its first interval.

use plotters::style::{Color as _, RGBColor};

use super::canvas::{self, Align};
use super::clip::Frame;
use super::scale::Scale;
use super::{Dash, FigureError, Stroke, style, text};

/// An interval with its mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    pub low: f64,
    pub high: f64,
    pub mean: f64,
}

/// A quantity with one interval for each part.
#[derive(Clone, Debug, PartialEq)]
pub struct RangeRow {
    /// Name and unit.
    pub name: String,
    /// Intervals, in the order of the parts. The first one defines the scale.
    pub intervals: Vec<Interval>,
}

const ROW: f64 = 13.0;
const LEGEND: f64 = 26.0;
const FOOT: f64 = 42.0;

/// Draws intervals as bars, in percent of the interval of the first part: its lower end is 0, its upper end 100.
/// `parts` are names and colours.
pub fn range_chart(
    title: &str,
    parts: &[(&str, RGBColor)],
    rows: &[RangeRow],
) -> Result<String, FigureError> {
    let height = |row: &RangeRow| ROW * row.intervals.len() as f64 + 10.0;
    let names = rows.iter().map(|r| text::width(&r.name, style::TEXT)).fold(0.0, f64::max);
    let left = (names + 12.0).min(170.0);
    let bottom = LEGEND + rows.iter().map(height).sum::<f64>() + 4.0;
    let frame = Frame { left, top: LEGEND, right: style::WIDTH - 14.0, bottom };
    let shares: Vec<Vec<[f64; 3]>> = rows.iter().map(in_percent).collect();
    let (low, high) = shares.iter().flatten().flatten().filter(|s| s.is_finite()).fold(
        (-10.0f64, 110.0f64),
        // Bars far outside the training range are clipped, so that the others remain legible.
        |(low, high), s| (low.min(s.max(-150.0) - 4.0), high.max(s.min(250.0) + 4.0)),
    );
    let x = Scale::new((low, high), frame.left, frame.right);
    let hair = |colour| Stroke { colour, width: 1.0, dash: Dash::Solid };
    canvas::draw((style::WIDTH, bottom + FOOT), title, &[], |canvas| {
        let mut at = frame.left;
        for (name, colour) in parts {
            canvas.rectangle((at, 6.0), (at + 16.0, 15.0), colour.mix(1.0));
            canvas.text((at + 22.0, 10.0), name, style::TEXT, style::INK, Align::Start);
            at += 22.0 + text::width(name, style::TEXT) + 16.0;
        }
        canvas.rectangle(
            (x.place(0.0), frame.top),
            (x.place(100.0), frame.bottom),
            style::PERSISTENCE.mix(0.1),
        );
        let ticks = x.ticks(5, 8);
        for &tick in &ticks.values {
            let place = x.place(tick);
            canvas.line(&[(place, frame.top), (place, frame.bottom)], hair(style::GRID));
            let label = ticks.label(tick);
            canvas.text((place, frame.bottom + 13.0), &label, style::SMALL, style::MUTED, Align::Middle);
        }
        let foot = (0.5 * (frame.left + frame.right), frame.bottom + 32.0);
        canvas.text(foot, "share of the training range [%]", style::TEXT, style::INK, Align::Middle);
        let mut top = frame.top + 7.0;
        for (row, shares) in rows.iter().zip(&shares) {
            let middle = top + 0.5 * ROW * row.intervals.len() as f64 - 1.0;
            let name = text::fit(&row.name, style::TEXT, left - 10.0);
            canvas.text((left - 8.0, middle), &name, style::TEXT, style::INK, Align::End);
            if !shares.iter().flatten().any(|s| s.is_finite()) {
                let note = "does not vary in the training runs";
                canvas.text((x.place(0.0) + 6.0, middle), note, style::SMALL, style::MUTED, Align::Start);
            }
            for (i, (&[low, high, mean], (_, colour))) in shares.iter().zip(parts).enumerate() {
                let y = top + ROW * i as f64;
                if low.is_finite() && high.is_finite() {
                    let inside = |s: f64| x.place(s).clamp(frame.left, frame.right);
                    canvas.rectangle(
                        (inside(low), y),
                        (inside(high).max(inside(low) + 1.0), y + ROW - 4.0),
                        colour.mix(0.85),
                    );
                    let mean = inside(mean);
                    canvas.rectangle((mean - 1.0, y), (mean + 1.0, y + ROW - 4.0), style::INK.mix(1.0));
                }
            }
            top += height(row);
        }
    })
}

/// Lower end, upper end and mean of each interval in percent of the first; NaN if the first has zero width.
fn in_percent(row: &RangeRow) -> Vec<[f64; 3]> {
    let Some(first) = row.intervals.first() else { return Vec::new() };
    let width = first.high - first.low;
    let share = |v: f64| if width > 0.0 { 100.0 * (v - first.low) / width } else { f64::NAN };
    row.intervals.iter().map(|i| [share(i.low), share(i.high), share(i.mean)]).collect()
}
