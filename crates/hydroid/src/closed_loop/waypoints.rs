//! Way-points from files.

use std::path::Path;

use geographiclib_rs::{Geodesic, InverseGeodesic as _};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use thiserror::Error;

use super::missions::{Positions, Purpose, has_area, json, wpl};
use crate::key::key;
use crate::log::units::{Unit, UnitError};
use crate::log::{LogError, RawColumn, RawLog, bytes, read_from};

/// Way-points in the north-east frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Waypoints {
    /// North and east of each \[m\].
    pub points: Vec<[f64; 2]>,
    /// Latitude and longitude of the origin \[deg\], if the file has latitudes and longitudes.
    pub origin_deg: Option<[f64; 2]>,
}

/// Error of a file of way-points.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum WaypointsError {
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(
        "{path}: no columns of way-points among {columns}: name them north [m] and east [m], or lat [deg] and lon [deg]"
    )]
    Columns { path: String, columns: String },
    #[error("{path}: the column '{column}': {source}")]
    Unit { path: String, column: String, source: UnitError },
    #[error("{path}: {place}: the position of the way-point is not two numbers: correct or remove it")]
    NotANumber {
        path: String,
        /// Line, or element.
        place: String,
    },
    #[error(
        "{path}: {place}: latitude {latitude}, longitude {longitude}: latitudes are between -90 and 90 degrees, longitudes between -180 and 360; check the order of the two"
    )]
    Range {
        path: String,
        /// Line, or element.
        place: String,
        /// Latitude \[deg\].
        latitude: f64,
        /// Longitude \[deg\].
        longitude: f64,
    },
    #[error("{path}: byte {position}: {source}: export the route again as GPX")]
    Xml {
        path: String,
        /// Place of the error in bytes.
        position: u64,
        source: quick_xml::Error,
    },
    #[error(
        "{path}: no {what}: a GPX file needs a route (rtept), a track (trkpt) or way-points (wpt), GeoJSON a line, a polygon or points, a mission items with latitude and longitude"
    )]
    Empty { path: String, what: &'static str },
    #[error("{path}: {source}: export the plan or GeoJSON again")]
    Json { path: String, source: serde_json::Error },
    #[error(
        "{path}: more than one {what}, or a hole or circle beside it: keep one in each file, and holes and circles as polygons to keep out of"
    )]
    Polygons { path: String, what: &'static str },
    #[error(
        "{path}: {place}: {what}, is not followed: remove it from the mission, or replace it by way-points; {} states the speed",
        key("speed")
    )]
    NotFollowed { path: String, place: String, what: String },
    #[error("{path}: the {what} is a circle: draw it as a polygon")]
    Circle { path: String, what: &'static str },
}

/// Names of a column, without case.
const NORTH: [&str; 5] = ["north", "northing", "n", "x", "x_north"];
const EAST: [&str; 5] = ["east", "easting", "e", "y", "y_east"];
const LATITUDE: [&str; 3] = ["lat", "latitude", "lat_deg"];
const LONGITUDE: [&str; 6] = ["lon", "long", "longitude", "lng", "lon_deg", "lng_deg"];

/// Elements of GPX with positions, the most specific first.
const ELEMENTS: [&str; 3] = ["rtept", "trkpt", "wpt"];

impl Waypoints {
    /// Way-points of a CSV, GPX or GeoJSON file, or of the mission of an autopilot (`.plan` of QGroundControl, `.waypoints`).
    ///
    /// A CSV file has the columns `north [m]` and `east [m]` (or `x`, `y`), or `lat [deg]` and `lon [deg]`. Of a GPX file
    /// the points of its routes are taken; without routes those of its tracks; without tracks its way-points. Of GeoJSON the
    /// first line or polygon is taken, or else its points; of a mission the way-points.
    ///
    /// Latitudes and longitudes (WGS 84) become distance and azimuth from the first way-point, along the geodesic: the
    /// azimuthal equidistant projection. Distances elsewhere are too long by `(d / R)^2 / 6` at most, 4e-5 at
    /// `d` = 100 km (Snyder 1987, Map Projections: A Working Manual, section 25).
    ///
    /// # Errors
    /// If the file cannot be read, has no positions, or a position that is not valid.
    pub fn read(path: &Path) -> Result<Self, WaypointsError> {
        Self::read_about(path, None, Purpose::Route)
    }

    /// The same with distance and azimuth from an origin, latitude and longitude \[deg\]; without one from the first way-point.
    /// The geofence of a mission is one inclusion or exclusion polygon.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_about(
        path: &Path,
        origin_deg: Option<[f64; 2]>,
        purpose: Purpose,
    ) -> Result<Self, WaypointsError> {
        Self::parse(&bytes(path)?, &path.display().to_string(), origin_deg, purpose)
    }

    /// Whether a file is a plan with areas that the vessel must keep out of.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn has_keep_out(path: &Path) -> Result<bool, WaypointsError> {
        Ok(has_area(&String::from_utf8_lossy(without_mark(&bytes(path)?)), Purpose::KeepOut))
    }

    /// Way-points of the bytes of a file; `name` is its name in messages.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(
        bytes: &[u8],
        name: &str,
        origin_deg: Option<[f64; 2]>,
        purpose: Purpose,
    ) -> Result<Self, WaypointsError> {
        let text = without_mark(bytes);
        let reader = match text {
            [b'<', ..] => Some(gpx as fn(&str, &str, Purpose) -> Result<Positions, WaypointsError>),
            [b'{', ..] => Some(json as _),
            text if text.starts_with(b"QGC WPL") => Some(wpl as _),
            _ => None,
        };
        if let Some(reader) = reader {
            let positions = reader(&String::from_utf8_lossy(text), name, purpose)?;
            return Self::of_positions(&positions, name, origin_deg, purpose);
        }
        let table = read_from(bytes, name)?;
        let find = |names: &[&str]| {
            let known = |column: &&RawColumn| names.contains(&column.name.to_lowercase().as_str());
            table.columns.iter().find(known)
        };
        let points = |first, second, unit| columns(&table, [first, second], unit);
        if let (Some(latitude), Some(longitude)) = (find(&LATITUDE), find(&LONGITUDE)) {
            return Self::of_positions(&points(latitude, longitude, "deg")?, name, origin_deg, purpose);
        }
        let (Some(north), Some(east)) = (find(&NORTH), find(&EAST)) else {
            let columns: Vec<_> = table.columns.iter().map(|column| column.name.as_str()).collect();
            return Err(WaypointsError::Columns { path: name.to_owned(), columns: columns.join(", ") });
        };
        let points = points(north, east, "m")?.into_iter().map(|(_, point)| point).collect();
        Ok(Self { points, origin_deg: None })
    }

    fn of_positions(
        positions: &[(String, [f64; 2])],
        name: &str,
        origin_deg: Option<[f64; 2]>,
        purpose: Purpose,
    ) -> Result<Self, WaypointsError> {
        let path = || name.to_owned();
        let Some(&(_, first)) = positions.first() else {
            return Err(WaypointsError::Empty { path: path(), what: purpose.name() });
        };
        let origin = origin_deg.unwrap_or(first);
        let project = |(place, position): &(String, [f64; 2])| {
            let [latitude, longitude] = *position;
            local_position(origin, *position).ok_or_else(|| WaypointsError::Range {
                path: path(),
                place: place.clone(),
                latitude,
                longitude,
            })
        };
        let points = positions.iter().map(project).collect::<Result<_, _>>()?;
        Ok(Self { points, origin_deg: Some(origin) })
    }
}

/// A text without a byte order mark and leading white space.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start()
}

/// North and east \[m\] of a position about an origin, both latitude and longitude \[deg\], by distance and azimuth of the
/// geodesic on the ellipsoid WGS 84. `None` outside -90 to 90 and -180 to 360 degrees.
pub fn local_position(origin: [f64; 2], [latitude, longitude]: [f64; 2]) -> Option<[f64; 2]> {
    if !(latitude.abs() <= 90.0 && (-180.0..=360.0).contains(&longitude)) {
        return None;
    }
    let (distance, azimuth_deg, _, _): (f64, f64, f64, f64) =
        Geodesic::wgs84().inverse(origin[0], origin[1], latitude, longitude);
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    // A sum with 0 has no negative zero.
    Some([distance * cos + 0.0, distance * sin + 0.0])
}

/// Rows of two columns, in a unit, with their places.
fn columns(
    table: &RawLog,
    pair: [&RawColumn; 2],
    unit: &str,
) -> Result<Vec<(String, [f64; 2])>, WaypointsError> {
    let factor = |column: &RawColumn| {
        let own = column.unit.as_deref().unwrap_or(unit);
        let factor = Unit::parse(own).and_then(|own| own.to(&Unit::parse(unit)?));
        let (path, column) = (table.path.clone(), column.name.clone());
        factor.map_err(|source| WaypointsError::Unit { path, column, source })
    };
    let factors = [factor(pair[0])?, factor(pair[1])?];
    let row = |k: usize| {
        let place = format!("line {}", table.lines.get(k));
        let point = [0, 1].map(|i| factors[i] * pair[i].values[k]);
        if point.iter().all(|number| number.is_finite()) {
            Ok((place, point))
        } else {
            Err(WaypointsError::NotANumber { path: table.path.clone(), place })
        }
    };
    (0..table.rows()).map(row).collect()
}

/// Latitudes and longitudes of a GPX file, with their places.
fn gpx(text: &str, path: &str, _: Purpose) -> Result<Positions, WaypointsError> {
    let mut found: [Positions; 3] = Default::default();
    let mut reader = Reader::from_str(text);
    loop {
        let event = reader.read_event().map_err(|source| WaypointsError::Xml {
            path: path.to_owned(),
            position: reader.error_position(),
            source,
        })?;
        match event {
            Event::Start(element) | Event::Empty(element) => {
                let kind = ELEMENTS.iter().position(|name| element.local_name().as_ref() == *name);
                let Some(kind) = kind else { continue };
                let place = format!("{} {}", ELEMENTS[kind], found[kind].len() + 1);
                match (number(&element, "lat"), number(&element, "lon")) {
                    (Some(latitude), Some(longitude)) => found[kind].push((place, [latitude, longitude])),
                    _ => return Err(WaypointsError::NotANumber { path: path.to_owned(), place }),
                }
            }
            Event::Eof => break,
            _ => {}
        }
    }
    Ok(found.into_iter().find(|points| !points.is_empty()).unwrap_or_default())
}

fn number(element: &BytesStart<'_>, name: &str) -> Option<f64> {
    let attribute = element.try_get_attribute(name).ok()??;
    let number: f64 = attribute.value.trim().parse().ok()?;
    number.is_finite().then_some(number)
}
