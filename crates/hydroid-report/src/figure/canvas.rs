//! Strokes, fills and text in pixels, written by the SVG backend of plotters.
//!
//! plotters rounds positions to whole pixels. The canvas is therefore ten times as large, and a view box scales it
//! back.

use plotters::backend::SVGBackend;
use plotters::prelude::{DrawingBackend, RGBAColor, ShapeStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color as _, FontStyle, IntoFont as _, RGBColor, TextStyle};

use super::clip::{Point, dashes};
use super::{Dash, FigureError, Stroke};

/// SVG units per pixel.
const FINE: f64 = 10.0;

/// plotters divides the font size by this factor.
const FONT_FACTOR: f64 = 1.24;

/// Horizontal alignment of a text at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Align {
    Start,
    Middle,
    End,
}

pub(crate) struct Canvas<'a> {
    backend: SVGBackend<'a>,
    failure: Option<FigureError>,
}

/// Draws a page (width and height in pixels) as an `<svg>` element for HTML, without ids, name spaces or fonts. `title`
/// is the text for screen readers; `panels` holds frames and ranges for the script of the page.
pub(crate) fn draw(
    (width, height): Point,
    title: &str,
    panels: &[String],
    paint: impl FnOnce(&mut Canvas<'_>),
) -> Result<String, FigureError> {
    let mut raw = String::new();
    let size = (whole(width), whole(height));
    let mut canvas = Canvas {
        backend: SVGBackend::with_string(&mut raw, (size.0.unsigned_abs(), size.1.unsigned_abs())),
        failure: None,
    };
    paint(&mut canvas);
    let presented = canvas.backend.present();
    canvas.keep(presented);
    let failure = canvas.failure.take();
    drop(canvas);
    if let Some(failure) = failure {
        return Err(failure);
    }
    let body = raw.split_once('>').map_or("", |(_, rest)| rest);
    let title = maud::html! { title { (title) } };
    let label = maud::html! { (title_attribute(&title.0)) };
    // Quotes within texts are escaped: these matches can only be attributes.
    let body = body
        .replace(" opacity=\"1\"", "")
        .replace(" font-family=\"sans-serif\"", "")
        .replace(" stroke=\"none\"", "")
        .replace(" \"/>", "\"/>")
        .replace(">\n", ">")
        .replace("\n<", "<");
    let panels =
        if panels.is_empty() { String::new() } else { format!(" data-panels=\"{}\"", panels.join(";")) };
    Ok(format!(
        "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\"{panels}>{}{body}",
        size.0, size.1, label.0, title.0
    ))
}

fn title_attribute(element: &str) -> maud::PreEscaped<&str> {
    maud::PreEscaped(element.trim_start_matches("<title>").trim_end_matches("</title>"))
}

/// A coordinate in SVG units. Callers clip to the page; NaN becomes 0.
#[allow(clippy::cast_possible_truncation)] // clamped far inside i32
pub(crate) fn whole(x: f64) -> i32 {
    (x * FINE).round().clamp(-1e8, 1e8) as i32
}

impl Canvas<'_> {
    fn keep(&mut self, result: Result<(), impl std::fmt::Display>) {
        if let Err(error) = result {
            self.failure.get_or_insert(FigureError(error.to_string()));
        }
    }

    pub(crate) fn line(&mut self, points: &[Point], stroke: Stroke) {
        match stroke.dash {
            Dash::Solid => self.polyline(points, stroke),
            Dash::Dashed => {
                for part in dashes(points, 6.0, 4.0) {
                    self.polyline(&part, stroke);
                }
            }
            Dash::Dotted => {
                for part in dashes(points, 1.6, 2.8) {
                    self.polyline(&part, stroke);
                }
            }
        }
    }

    fn polyline(&mut self, points: &[Point], stroke: Stroke) {
        let style = ShapeStyle {
            color: stroke.colour.mix(1.0),
            filled: false,
            stroke_width: whole(stroke.width).unsigned_abs(),
        };
        let result = self.backend.draw_path(places(points), &style);
        self.keep(result);
    }

    pub(crate) fn area(&mut self, points: &[Point], fill: RGBAColor) {
        let result = self.backend.fill_polygon(places(points), &fill);
        self.keep(result);
    }

    pub(crate) fn rectangle(&mut self, a: Point, b: Point, fill: RGBAColor) {
        let result = self.backend.draw_rect(place(a), place(b), &fill, true);
        self.keep(result);
    }

    pub(crate) fn disc(&mut self, centre: Point, radius: f64, fill: RGBAColor) {
        let result = self.backend.draw_circle(place(centre), whole(radius).unsigned_abs(), &fill, true);
        self.keep(result);
    }

    pub(crate) fn ring(&mut self, centre: Point, radius: f64, stroke: Stroke) {
        let style = ShapeStyle {
            color: stroke.colour.mix(1.0),
            filled: false,
            stroke_width: whole(stroke.width).unsigned_abs(),
        };
        let result = self.backend.draw_circle(place(centre), whole(radius).unsigned_abs(), &style, false);
        self.keep(result);
    }

    /// A text, vertically centred at the point.
    pub(crate) fn text(&mut self, at: Point, text: &str, size: f64, colour: RGBColor, align: Align) {
        self.write(at, text, size, colour, align, FontStyle::Normal);
    }

    pub(crate) fn bold(&mut self, at: Point, text: &str, size: f64, colour: RGBColor, align: Align) {
        self.write(at, text, size, colour, align, FontStyle::Bold);
    }

    fn write(
        &mut self,
        (x, y): Point,
        text: &str,
        size: f64,
        colour: RGBColor,
        align: Align,
        weight: FontStyle,
    ) {
        let h = match align {
            Align::Start => HPos::Left,
            Align::Middle => HPos::Center,
            Align::End => HPos::Right,
        };
        let units = (size * FINE).round();
        let font = ("sans-serif", units * FONT_FACTOR).into_font().style(weight);
        let style = TextStyle::from(font).color(&colour).pos(Pos::new(h, VPos::Center));
        let result = self.backend.draw_text(text, &style, place((x, y)));
        self.keep(result);
    }
}

fn place((x, y): Point) -> (i32, i32) {
    (whole(x), whole(y))
}

fn places(points: &[Point]) -> impl Iterator<Item = (i32, i32)> + '_ {
    points.iter().map(|p| place(*p))
}
