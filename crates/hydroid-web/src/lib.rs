//! Scripts and styles that the pages of hydroid share, as texts. A page puts them into itself, or serves them.

/// Plots over time: uPlot, under the licence of [`UPLOT_LICENCE`].
pub const UPLOT: &str = include_str!("uplot.js");
/// Style of uPlot.
pub const UPLOT_STYLE: &str = include_str!("uplot.css");
/// Licence of uPlot.
pub const UPLOT_LICENCE: &str = include_str!("uplot-licence.txt");
/// `Plots`: colours of the page, a chart of positions, plots over time. It needs [`UPLOT`].
pub const PLOTS: &str = include_str!("plots.js");
/// Elements and numbers as text.
pub const ELEMENTS: &str = include_str!("elements.js");
/// `Plant`: a model that runs.
pub const PLANT: &str = include_str!("plant.js");
/// `DriveView`: a model that is driven. It needs all of the above and [`DRIVE_TEXTS`].
pub const DRIVE: &str = include_str!("drive.js");
/// English texts of the driving view.
pub const DRIVE_TEXTS: &str = include_str!("drive_texts.js");
/// Style of the driving view.
pub const DRIVE_STYLE: &str = include_str!("drive.css");

/// The script of a page with a driving view, in the order of dependence.
pub const DRIVING: [&str; 6] = [UPLOT, PLOTS, ELEMENTS, PLANT, DRIVE_TEXTS, DRIVE];
