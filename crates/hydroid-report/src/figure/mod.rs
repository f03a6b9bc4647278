//! Figures: a stack of panels over a common horizontal axis, drawn with plotters as SVG for use in HTML.
//!
//! A [`Figure`] is data: panels with lines, bands, bars, points. [`Figure::svg`] lays it out and draws it.
//! A value that is not a number is a gap in a line; what leaves its panel is cut off at the edge; a panel
//! without anything to show says so. The same figure gives the same bytes.
//!
//! ```
//! use hydroid_report::figure::{Figure, Line, Mark, Panel};
//! use hydroid_report::style;
//!
//! let line = Line::new(vec![(0.0, 0.0), (1.0, 0.3), (2.0, f64::NAN)], style::MODEL_LINE).labelled("model");
//! let figure = Figure::new("Speed of the model", "time [s]").panel(Panel::new("u [m/s]").mark(Mark::Line(line)));
//! assert!(figure.svg()?.contains("model"));
//! # Ok::<(), hydroid_report::figure::FigureError>(())
//! ```

mod canvas;
mod clip;
mod decimate;
mod layout;
mod marks;
mod ranges;
mod scale;
mod text;

use plotters::style::RGBColor;

use super::style;

pub use decimate::{envelope, steps};
pub use ranges::{Interval, RangeRow, range_chart};
pub(crate) use scale::{cover, superscript};

/// A figure could not be written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a figure could not be drawn: {0}")]
pub struct FigureError(pub(crate) String);

/// How a line is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dash {
    /// Not at all.
    Solid,
    /// Into dashes.
    Dashed,
    /// Into dots.
    Dotted,
}

/// How a line is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Its colour.
    pub colour: RGBColor,
    /// Its width \[px\].
    pub width: f64,
    /// How it is broken.
    pub dash: Dash,
}

/// A line through points, with gaps where a value is not a number.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Points, from left to right.
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub stroke: Stroke,
    /// Written beside its end.
    pub label: Option<String>,
}

impl Line {
    /// A line without a label.
    pub fn new(points: Vec<(f64, f64)>, stroke: Stroke) -> Self {
        Self { points, stroke, label: None }
    }

    /// The same line with a label beside its end.
    pub fn labelled(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }
}

/// The sign of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// A filled disc.
    Disc,
    /// A circle.
    Ring,
    /// A cross.
    Cross,
    /// A triangle that points beyond the upper edge.
    Up,
}

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    /// Where.
    pub points: Vec<(f64, f64)>,
    /// What they look like.
    pub sign: Sign,
    /// Their colour.
    pub colour: RGBColor,
    /// Radius \[px\].
    pub radius: f64,
    /// Written beside the first of them.
    pub label: Option<String>,
}

/// Something in a panel. Later marks lie over earlier ones.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// A line.
    Line(Line),
    /// Points.
    Points(Points),
    /// The area between two values over `x`: `(x, low, high)`.
    Band {
        /// Place, lower and upper value.
        points: Vec<(f64, f64, f64)>,
        /// Its colour.
        colour: RGBColor,
        /// How much it covers, 0 to 1.
        opacity: f64,
    },
    /// Bars from zero, `(from, to, height)`.
    Bars {
        /// Left and right edge and height of each bar.
        bars: Vec<(f64, f64, f64)>,
        /// Their colour.
        colour: RGBColor,
    },
    /// A line across the panel at a height.
    Level {
        /// The height.
        at: f64,
        /// How it is drawn.
        stroke: Stroke,
    },
    /// Lines from bottom to top.
    Verticals {
        /// Where.
        at: Vec<f64>,
        /// How they are drawn.
        stroke: Stroke,
    },
}

/// One pair of axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Quantity and unit on the vertical axis; written above it.
    pub label: String,
    /// Height of the frame \[px\].
    pub height: f64,
    /// Range of the vertical axis; without it what the marks cover.
    pub range: Option<(f64, f64)>,
    /// Whether heights are logarithms to base 10, so that the axis has the numbers themselves at its ticks.
    pub decades: bool,
    /// What is in it.
    pub marks: Vec<Mark>,
}

impl Panel {
    /// An empty panel of middling height.
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), height: 110.0, range: None, decades: false, marks: Vec::new() }
    }

    /// The same panel with another height \[px\].
    pub fn height(mut self, height: f64) -> Self {
        self.height = height;
        self
    }

    /// The same panel with a stated range.
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// The same panel with a logarithmic axis: marks hold logarithms to base 10.
    pub fn decades(mut self) -> Self {
        self.decades = true;
        self
    }

    /// The same panel with one mark more.
    pub fn mark(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }
}

/// What a key in the legend looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Key {
    /// A piece of line.
    Line(Stroke),
    /// A sign.
    Sign(Sign, RGBColor),
    /// A piece of area.
    Area(RGBColor),
}

/// Panels over a common horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What it shows, in words, for those who do not see it.
    pub title: String,
    /// Quantity and unit on the horizontal axis.
    pub x_label: String,
    /// Range of the horizontal axis; without it what the marks cover.
    pub x_range: Option<(f64, f64)>,
    /// Whether places are logarithms to base 10, so that the axis has the numbers themselves at its ticks.
    pub x_decades: bool,
    /// Whether a unit is as long on the vertical axes as on the horizontal one.
    pub equal_axes: bool,
    /// Panels from top to bottom.
    pub panels: Vec<Panel>,
    /// Keys above the panels, where labels beside the lines do not do.
    pub legend: Vec<(Key, String)>,
}

impl Figure {
    /// A figure without panels.
    pub fn new(title: impl Into<String>, x_label: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            x_label: x_label.into(),
            x_range: None,
            x_decades: false,
            equal_axes: false,
            panels: Vec::new(),
            legend: Vec::new(),
        }
    }

    /// The same figure with a stated range of the horizontal axis.
    pub fn x_range(mut self, low: f64, high: f64) -> Self {
        self.x_range = Some((low, high));
        self
    }

    /// The same figure with a logarithmic horizontal axis: marks hold logarithms to base 10.
    pub fn x_decades(mut self) -> Self {
        self.x_decades = true;
        self
    }

    /// The same figure with equal axes, as for a track: ranges and heights of the panels follow from what the marks cover, or
    /// from the stated ranges, which are widened where necessary.
    pub fn equal_axes(mut self) -> Self {
        self.equal_axes = true;
        self
    }

    /// The same figure with one panel more at the bottom.
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// The same figure with one key more in its legend.
    pub fn key(mut self, key: Key, text: impl Into<String>) -> Self {
        self.legend.push((key, text.into()));
        self
    }

    /// The figure as an `<svg>` element.
    ///
    /// # Errors
    /// If plotters cannot write it.
    pub fn svg(&self) -> Result<String, FigureError> {
        layout::draw(self)
    }

    /// The figure as a file of its own, with a name space, a size and a font, which an element in a page has from there.
    ///
    /// # Errors
    /// If plotters cannot write it.
    pub fn file(&self) -> Result<String, FigureError> {
        Ok(self.svg()?.replacen(
            "<svg ",
            &format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" font-family=\"Arial, Helvetica, 'Liberation Sans', sans-serif\" ",
                style::WIDTH
            ),
            1,
        ))
    }
}

#[cfg(test)]
mod tests;
