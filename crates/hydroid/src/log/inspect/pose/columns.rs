//! Columns of a log that hold the pose: heading and position.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::super::super::csv::{RawColumn, RawLog};
use super::super::super::resolve::{Resolved, Source};
use super::super::super::units::{self, Quantity, Unit};
use crate::log::median;
use crate::log::metres_per_radian;

/// Columns of a pose, each the only one of its kind in the log.
pub(super) struct PoseColumns {
    /// Heading \[rad\].
    pub(super) heading: Source,
    /// Two axes of the position \[m\].
    pub(super) position: Option<[Source; 2]>,
    /// Whether the name says that the heading grows clockwise: a compass.
    pub(super) compass: bool,
    /// Whether the heading is named `psi`, which is clockwise in the notation of Fossen.
    pub(super) psi: bool,
    /// Whether the axes are named north and east.
    pub(super) north_east: bool,
}

/// Parts of the names of references and of quantities that are not a pose.
const NOT_MEASURED: &[&str] = &[
    "ref",
    "reference",
    "des",
    "desired",
    "target",
    "sp",
    "setpoint",
    "cmd",
    "rate",
    "vel",
    "velo",
    "velocity",
    "speed",
    "acc",
    "wind",
    "true",
    "std",
    "var",
    "error",
    "err",
];
/// Parts of the names of positions whose unit is not stated.
const POSITION: &[&str] = &["pos", "position", "pose"];

/// The pose of a log; nothing if the heading is missing, ambiguous, or of an unknown unit.
pub(super) fn find(log: &RawLog, resolved: &Resolved) -> Option<PoseColumns> {
    let free = |i: usize| !resolved.inputs.iter().any(|s| s.column == i);
    let headings: Vec<(usize, Unit)> = (0..log.columns.len())
        .filter(|&i| free(i) && is_heading(&log.columns[i]))
        .filter_map(|i| Some((i, angle(&log.columns[i])?)))
        .collect();
    let [(column, unit)] = headings.as_slice() else { return None };
    let parts = parts(&log.columns[*column]);
    let has = |names: &[&str]| parts.iter().any(|part| names.contains(&part.as_str()));
    let pairs = position_pairs(log, free);
    let north_east = matches!(pairs.as_slice(), [(_, _, true)]);
    let position = axes(log, &pairs);
    Some(PoseColumns {
        heading: Source::of(*column, &log.columns[*column].name, unit),
        position,
        compass: has(&["heading", "hdg", "compass"]),
        psi: has(&["psi"]),
        north_east,
    })
}

/// The only position of a log.
pub(super) fn position(log: &RawLog, resolved: &Resolved) -> Option<[Source; 2]> {
    let channels = || resolved.outputs.iter().chain(&resolved.inputs);
    axes(log, &position_pairs(log, |i| !channels().any(|source| source.column == i)))
}

/// The axes of the only pair of columns that are a position \[m\]; degrees are those from the middle of a log.
fn axes(log: &RawLog, pairs: &[(usize, usize, bool)]) -> Option<[Source; 2]> {
    let [(x, y, _)] = pairs else { return None };
    let (first, second) = (&log.columns[*x], &log.columns[*y]);
    let name = |column: &RawColumn| column.name.clone();
    let in_metres = length(first).zip(length(second)).filter(|_| !is_geographic(first));
    if let Some((x_unit, y_unit)) = in_metres {
        return Some([Source::of(*x, &name(first), &x_unit), Source::of(*y, &name(second), &y_unit)]);
    }
    let (latitude, longitude) = degrees(first).zip(degrees(second))?;
    if first.values.iter().any(|x| latitude.factor * x.abs() > FRAC_PI_2) {
        return None;
    }
    // Rows before the first fix are often zero.
    let mean = |column: &RawColumn| {
        median(column.values.iter().copied().filter(|x| x.is_finite()).collect()).unwrap_or(f64::NAN)
    };
    let (middle, across) = (mean(first), mean(second));
    let [north, east] = metres_per_radian(latitude.factor * middle);
    (middle.is_finite() && across.is_finite()).then(|| {
        let source =
            |column, of: &RawColumn, factor, offset| Source::metres(column, &of.name, factor, offset);
        let [north, east] = [north * latitude.factor, east * longitude.factor];
        [source(*x, first, north, middle), source(*y, second, east, across)]
    })
}

/// Columns that are headings or axes of a position by their names.
pub(super) fn candidates(log: &RawLog) -> impl Iterator<Item = usize> {
    let headings = (0..log.columns.len()).filter(|&i| is_heading(&log.columns[i]));
    let axes = position_pairs(log, |_| true).into_iter().flat_map(|(x, y, _)| [x, y]);
    headings.chain(axes)
}

/// The parts of a column's name without its unit, in lower case.
fn parts(column: &RawColumn) -> Vec<String> {
    let stem = match &column.unit {
        Some(_) => &column.name,
        None => units::from_name(&column.name, false).map_or(column.name.as_str(), |(stem, _)| stem),
    };
    let separated = |c: char| !c.is_alphanumeric();
    stem.split(separated).filter(|p| !p.is_empty()).map(str::to_lowercase).collect()
}

fn stated(column: &RawColumn) -> Option<&str> {
    column.unit.as_deref().or_else(|| units::from_name(&column.name, false).map(|(_, unit)| unit))
}

fn of_quantity(text: &str, quantity: Quantity) -> Option<Unit> {
    Unit::parse(text).ok().filter(|unit| unit.quantity == Some(quantity))
}

fn is_heading(column: &RawColumn) -> bool {
    let parts = parts(column);
    let named = |names: &[&str]| parts.iter().any(|part| names.contains(&part.as_str()));
    named(&["psi", "heading", "yaw", "hdg", "compass"]) && !named(NOT_MEASURED)
}

/// The unit of a heading. Without a stated unit, the jumps of the heading show it, where it wraps around.
fn angle(column: &RawColumn) -> Option<Unit> {
    if let Some(text) = stated(column) {
        return of_quantity(text, Quantity::Angle);
    }
    let values = || column.values.iter().copied().filter(|x| !x.is_nan());
    let largest = values().fold(0.0, |most: f64, x| most.max(x.abs()));
    let jump = values().zip(values().skip(1)).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max);
    // A heading that wraps jumps by nearly a turn and stays within one.
    let wraps = |turn: f64| jump > 0.75 * turn && jump <= turn && largest <= 1.01 * turn;
    let text = if wraps(360.0) {
        "deg"
    } else if wraps(TAU) && largest > 0.9 * PI {
        "rad"
    } else {
        return None;
    };
    Unit::parse(text).ok()
}

/// The unit of a position; without a stated one, metres.
fn length(column: &RawColumn) -> Option<Unit> {
    of_quantity(stated(column).unwrap_or("m"), Quantity::Length)
}

/// The unit of a latitude or a longitude; without a stated one, degrees.
fn degrees(column: &RawColumn) -> Option<Unit> {
    let plausible = column.values.iter().all(|x| x.is_nan() || x.abs() <= 360.0);
    of_quantity(stated(column).unwrap_or("deg"), Quantity::Angle).filter(|_| plausible)
}

/// Whether a column is a latitude by its name.
fn is_geographic(column: &RawColumn) -> bool {
    parts(column).iter().any(|part| GLOBE.iter().any(|(latitude, ..)| part == latitude))
}

/// Axes of positions by their names, and whether these are north and east.
const PLANE: &[(&str, &str, bool)] =
    &[("x", "y", false), ("north", "east", true), ("northing", "easting", true)];
const GLOBE: &[(&str, &str, bool)] =
    &[("lat", "lon", true), ("lat", "lng", true), ("lat", "long", true), ("latitude", "longitude", true)];

/// Pairs of columns whose names differ in `x` and `y`, or in `north` and `east`; without any, in `lat` and `lon`.
fn position_pairs(log: &RawLog, free: impl Fn(usize) -> bool) -> Vec<(usize, usize, bool)> {
    let found = pairs(log, &free, PLANE, length);
    if found.is_empty() { pairs(log, &free, GLOBE, degrees) } else { found }
}

fn pairs(
    log: &RawLog,
    free: &impl Fn(usize) -> bool,
    axes: &[(&str, &str, bool)],
    unit: fn(&RawColumn) -> Option<Unit>,
) -> Vec<(usize, usize, bool)> {
    let parts: Vec<Vec<String>> = log.columns.iter().map(parts).collect();
    let fits = |i: usize| {
        let usual = parts[i].iter().all(|part| {
            POSITION.contains(&part.as_str()) || axes.iter().any(|(x, y, _)| [x, y].contains(&&part.as_str()))
        });
        let measured = !parts[i].iter().any(|part| NOT_MEASURED.contains(&part.as_str()));
        let column = &log.columns[i];
        free(i) && measured && unit(column).is_some() && (usual || stated(column).is_some())
    };
    let mut found = Vec::new();
    for (i, own) in parts.iter().enumerate().filter(|(i, _)| fits(*i)) {
        for (x, y, north_east) in axes {
            let Some(at) = own.iter().position(|part| part == x) else { continue };
            let mut other = own.clone();
            (*y).clone_into(&mut other[at]);
            if let Some(j) = (0..parts.len()).find(|&j| parts[j] == other && fits(j)) {
                found.push((i, j, *north_east));
            }
        }
    }
    found
}
