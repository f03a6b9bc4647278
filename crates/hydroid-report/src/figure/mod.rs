//! Figures: panels over a common horizontal axis, drawn as SVG for HTML.
//!
//! A [`Figure`] is data: panels with lines, bands, bars and points. [`Figure::svg`] draws it. NaN is a gap in a line,
//! marks are clipped to their panel, and an empty panel says so. The same figure gives the same bytes.
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
#[doc(hidden)]
pub mod clip;
mod decimate;
mod layout;
mod marks;
mod ranges;
#[doc(hidden)]
pub mod scale;
#[doc(hidden)]
pub mod text;

use plotters::style::RGBColor;

use super::style;

pub use decimate::{envelope, steps};
pub use ranges::{Interval, RangeRow, range_chart};
pub(crate) use scale::{cover, superscript};

/// A figure cannot be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a figure could not be drawn: {0}")]
pub struct FigureError(pub(crate) String);

/// Dash pattern of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dash {
    Solid,
    Dashed,
    Dotted,
}

/// Style of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    pub colour: RGBColor,
    /// Width \[px\].
    pub width: f64,
    pub dash: Dash,
}

/// A line through points; NaN is a gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Points, from left to right.
    pub points: Vec<(f64, f64)>,
    pub stroke: Stroke,
    /// Text at the end of the line.
    pub label: Option<String>,
}

impl Line {
    /// A line without a label.
    pub fn new(points: Vec<(f64, f64)>, stroke: Stroke) -> Self {
        Self { points, stroke, label: None }
    }

    /// Adds a label at the end of the line.
    pub fn labelled(mut self, label: impl Into<String>) -> Self {
        self.label = Some(label.into());
        self
    }
}

/// Symbol of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    Disc,
    Ring,
    Cross,
    /// A triangle that points beyond the upper edge.
    Up,
}

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    pub points: Vec<(f64, f64)>,
    pub sign: Sign,
    pub colour: RGBColor,
    /// Radius \[px\].
    pub radius: f64,
    /// Text at the first point.
    pub label: Option<String>,
}

/// A mark in a panel. Later marks are drawn over earlier ones.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    Line(Line),
    Points(Points),
    /// The area between two values over `x`: `(x, low, high)`.
    Band {
        /// Position, lower and upper value.
        points: Vec<(f64, f64, f64)>,
        colour: RGBColor,
        /// Opacity, 0 to 1.
        opacity: f64,
    },
    /// Bars from zero, `(from, to, height)`.
    Bars {
        /// Left and right edge and height of each bar.
        bars: Vec<(f64, f64, f64)>,
        colour: RGBColor,
    },
    /// A horizontal line across the panel.
    Level {
        at: f64,
        stroke: Stroke,
    },
    Verticals {
        at: Vec<f64>,
        stroke: Stroke,
    },
}

/// A pair of axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Quantity and unit of the vertical axis, written above the panel.
    pub label: String,
    /// Height of the frame \[px\].
    pub height: f64,
    /// Range of the vertical axis; without it, the range of the marks.
    pub range: Option<(f64, f64)>,
    /// Logarithmic vertical axis: marks contain logarithms to base 10, tick labels the values.
    pub decades: bool,
    /// Marks, in drawing order.
    pub marks: Vec<Mark>,
}

impl Panel {
    /// An empty panel of default height.
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), height: 110.0, range: None, decades: false, marks: Vec::new() }
    }

    /// Sets the height \[px\].
    pub fn height(mut self, height: f64) -> Self {
        self.height = height;
        self
    }

    /// Sets the range of the vertical axis.
    pub fn range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    /// Makes the vertical axis logarithmic: marks contain logarithms to base 10.
    pub fn decades(mut self) -> Self {
        self.decades = true;
        self
    }

    pub fn mark(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }
}

/// Symbol of a legend entry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Key {
    Line(Stroke),
    Sign(Sign, RGBColor),
    Area(RGBColor),
}

/// Panels over a common horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Description for screen readers.
    pub title: String,
    /// Quantity and unit on the horizontal axis.
    pub x_label: String,
    /// Range of the horizontal axis; without it, the range of the marks.
    pub x_range: Option<(f64, f64)>,
    /// Logarithmic horizontal axis: marks contain logarithms to base 10, tick labels the values.
    pub x_decades: bool,
    /// Equal scale of both axes.
    pub equal_axes: bool,
    /// Panels, from top to bottom.
    pub panels: Vec<Panel>,
    /// Legend above the panels, for figures without labels at their lines.
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

    /// Sets the range of the horizontal axis.
    pub fn x_range(mut self, low: f64, high: f64) -> Self {
        self.x_range = Some((low, high));
        self
    }

    /// Makes the horizontal axis logarithmic: marks contain logarithms to base 10.
    pub fn x_decades(mut self) -> Self {
        self.x_decades = true;
        self
    }

    /// Gives both axes the same scale, as for a track. Ranges and heights follow from the marks or from the stated
    /// ranges, which are widened where necessary.
    pub fn equal_axes(mut self) -> Self {
        self.equal_axes = true;
        self
    }

    /// Adds a panel at the bottom.
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Adds a legend entry.
    pub fn key(mut self, key: Key, text: impl Into<String>) -> Self {
        self.legend.push((key, text.into()));
        self
    }

    /// The figure as an `<svg>` element.
    pub fn svg(&self) -> Result<String, FigureError> {
        layout::draw(self)
    }

    /// The figure as an SVG file, with name space, size and font.
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
