//! Positions in missions of autopilots and in GeoJSON.

use serde_json::Value;

use super::waypoints::WaypointsError;

/// What the positions of a file are for. Missions tell them apart; other files hold one kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// A path.
    Route,
    /// Corners of an area in which the vessel must stay.
    KeepIn,
    /// Corners of an area that the vessel must keep out of.
    KeepOut,
}

impl Purpose {
    /// The command of MAVLink: way-point, and corner of an inclusion or exclusion polygon.
    const fn command(self) -> u64 {
        match self {
            Self::Route => 16,
            Self::KeepIn => 5001,
            Self::KeepOut => 5002,
        }
    }

    /// Name in messages.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Route => "way-points",
            Self::KeepIn => "inclusion polygon",
            Self::KeepOut => "exclusion polygon",
        }
    }
}

/// Refuses an item of a mission that moves the vessel otherwise than through a way-point with latitude and longitude: commands of
/// navigation (below 96) and conditions (112 to 159), jumps (177, 601), changes of speed and direction (178, 192 to 194), a time to hold,
/// and other frames.
fn follow(
    path: &str,
    place: &str,
    command: u64,
    (hold_s, is_global): (f64, bool),
) -> Result<(), WaypointsError> {
    let what = match command {
        16 if hold_s > 0.0 => format!("a time of {hold_s} s to hold"),
        16 if !is_global => String::from("a way-point in a frame without latitude and longitude"),
        17..=95 | 112..=159 | 177 | 178 | 192..=194 | 601 => {
            format!("the command {command} of MAVLink, which moves the vessel otherwise than to a way-point")
        }
        _ => return Ok(()),
    };
    Err(WaypointsError::NotFollowed { path: path.to_owned(), place: place.to_owned(), what })
}

/// Areas of a text of way-points that are circles: inclusion and exclusion.
const CIRCLES: [u64; 2] = [5003, 5004];

/// Frames of MAVLink with latitudes and longitudes.
const GLOBAL: [u64; 6] = [0, 3, 5, 6, 10, 11];

/// Latitudes and longitudes with their places.
pub(super) type Positions = Vec<(String, [f64; 2])>;

/// Way-points or corners of a text of way-points of an autopilot (`QGC WPL`). Its first item is the home position.
pub(super) fn wpl(text: &str, path: &str, purpose: Purpose) -> Result<Positions, WaypointsError> {
    let mut found = Vec::new();
    // Each corner of a polygon states their number.
    let mut corners = 0.0;
    for (number, line) in text.lines().enumerate().skip(1) {
        let cells: Vec<&str> = line.split_whitespace().collect();
        if cells.is_empty() {
            continue;
        }
        let place = format!("line {}", number + 1);
        let integer = |i: usize| cells.get(i).and_then(|cell| cell.parse::<u64>().ok());
        let number = |i: usize| cells.get(i).and_then(|cell| cell.parse::<f64>().ok());
        let item = integer(0).zip(integer(2)).zip(integer(3)).zip(number(8)).zip(number(9));
        let Some(((((index, frame), command), latitude), longitude)) = item else {
            return Err(WaypointsError::NotANumber { path: path.to_owned(), place });
        };
        let is_home = index == 0 && purpose == Purpose::Route;
        if purpose == Purpose::Route && !is_home {
            follow(path, &place, command, (number(4).unwrap_or(0.0), GLOBAL.contains(&frame)))?;
        }
        if purpose != Purpose::Route && command == CIRCLES[usize::from(purpose == Purpose::KeepOut)] {
            return Err(WaypointsError::Circle { path: path.to_owned(), what: purpose.name() });
        }
        if command == purpose.command() && GLOBAL.contains(&frame) && !is_home {
            found.push((place, [latitude, longitude]));
            corners = number(4).unwrap_or(f64::NAN);
        }
    }
    if purpose != Purpose::Route && !found.is_empty() && corners != found.len() as f64 {
        return Err(WaypointsError::Polygons { path: path.to_owned(), what: purpose.name() });
    }
    Ok(found)
}

/// Way-points or corners of a plan of QGroundControl, or the positions of a GeoJSON document.
pub(super) fn json(text: &str, path: &str, purpose: Purpose) -> Result<Positions, WaypointsError> {
    let document: Value = serde_json::from_str(text)
        .map_err(|source| WaypointsError::Json { path: path.to_owned(), source })?;
    let several = || Err(WaypointsError::Polygons { path: path.to_owned(), what: purpose.name() });
    if document["fileType"] != "Plan" {
        if purpose != Purpose::Route && rings(&document) > 1 {
            return several();
        }
        return Ok(geometry(&document).unwrap_or_default());
    }
    let mut found = Vec::new();
    if purpose == Purpose::Route {
        let mut number = 0;
        items(&document["mission"]["items"], path, &mut number, &mut found)?;
        return Ok(found);
    }
    let areas = |kind: &str| {
        let all = document["geoFence"][kind].as_array().into_iter().flatten();
        let is_wanted = |area: &&Value| area["inclusion"].as_bool() == Some(purpose == Purpose::KeepIn);
        all.filter(is_wanted).collect::<Vec<_>>()
    };
    let (polygons, circles) = (areas("polygons"), areas("circles"));
    let Some(polygon) = polygons.first().map(|area| &area["polygon"]) else {
        let circle = WaypointsError::Circle { path: path.to_owned(), what: purpose.name() };
        return if circles.is_empty() { Ok(found) } else { Err(circle) };
    };
    if polygons.len() + circles.len() > 1 {
        return several();
    }
    for corner in polygon.as_array().into_iter().flatten() {
        found.push((format!("corner {}", found.len() + 1), pair(corner)));
    }
    Ok(found)
}

/// Two numbers; not a number where there is none.
fn pair(of: &Value) -> [f64; 2] {
    [0, 1].map(|i| of[i].as_f64().unwrap_or(f64::NAN))
}

/// Way-points among the items of a mission, those of surveys included.
fn items(of: &Value, path: &str, number: &mut usize, found: &mut Positions) -> Result<(), WaypointsError> {
    match of {
        Value::Array(all) => all.iter().try_for_each(|one| items(one, path, number, found))?,
        Value::Object(item) => {
            let is_global = item.get("frame").and_then(Value::as_u64).is_some_and(|f| GLOBAL.contains(&f));
            let command = item.get("command").and_then(Value::as_u64);
            *number += usize::from(command.is_some());
            let place = format!("item {number}");
            if let Some(command) = command {
                follow(path, &place, command, (of["params"][0].as_f64().unwrap_or(0.0), is_global))?;
            }
            if command == Some(Purpose::Route.command()) && is_global {
                let parameter = |i: usize| of["params"][i].as_f64().unwrap_or(f64::NAN);
                found.push((place, [parameter(4), parameter(5)]));
            }
            for name in ["TransectStyleComplexItem", "Items"] {
                if let Some(inner) = item.get(name) {
                    items(inner, path, number, found)?;
                }
            }
        }
        _ => {}
    }
    Ok(())
}

/// Whether a mission has an area of a purpose.
pub(super) fn has_area(text: &str, purpose: Purpose) -> bool {
    if text.starts_with("QGC WPL") {
        let circle = CIRCLES[usize::from(purpose == Purpose::KeepOut)];
        let commands = text.lines().filter_map(|line| line.split_whitespace().nth(3)?.parse::<u64>().ok());
        return commands.into_iter().any(|command| command == purpose.command() || command == circle);
    }
    let Ok(document) = serde_json::from_str::<Value>(text) else { return false };
    ["polygons", "circles"].iter().any(|kind| {
        let all = document["geoFence"][*kind].as_array().into_iter().flatten();
        all.filter_map(|area| area["inclusion"].as_bool())
            .any(|inside| inside == (purpose == Purpose::KeepIn))
    })
}

/// Number of the rings of all polygons of a GeoJSON document; a hole is a ring.
fn rings(document: &Value) -> usize {
    let parts = |name: &str| document[name].as_array().map_or(&[][..], Vec::as_slice);
    match document["type"].as_str() {
        Some("Polygon") => parts("coordinates").len(),
        Some("MultiPolygon") => {
            parts("coordinates").iter().map(|polygon| polygon.as_array().map_or(0, Vec::len)).sum()
        }
        Some("Feature") => rings(&document["geometry"]),
        _ => parts("features").iter().chain(parts("geometries")).map(rings).sum(),
    }
}

/// Positions of the first line or polygon of a GeoJSON document; without one those of its points. Its positions are longitude
/// and latitude (RFC 7946, section 3.1.1), and the last corner of a polygon is the first one.
fn geometry(document: &Value) -> Option<Positions> {
    let of = |positions: &[Value]| -> Positions {
        let swapped = |(i, position): (usize, &Value)| {
            let [longitude, latitude] = pair(position);
            (format!("position {}", i + 1), [latitude, longitude])
        };
        positions.iter().enumerate().map(swapped).collect()
    };
    let coordinates = &document["coordinates"];
    match document["type"].as_str()? {
        "LineString" | "MultiPoint" => Some(of(coordinates.as_array()?)),
        "Polygon" => {
            let ring = coordinates[0].as_array()?;
            Some(of(&ring[..ring.len().saturating_sub(1)]))
        }
        "Point" => Some(of(std::slice::from_ref(coordinates))),
        "Feature" => geometry(&document["geometry"]),
        kind => {
            let parts = if kind == "FeatureCollection" { "features" } else { "geometries" };
            let parts: Vec<Positions> = document[parts].as_array()?.iter().filter_map(geometry).collect();
            match parts.iter().find(|part| part.len() > 1) {
                Some(part) => Some(part.clone()),
                None => Some(
                    parts
                        .concat()
                        .into_iter()
                        .enumerate()
                        .map(|(i, (_, position))| (format!("point {}", i + 1), position))
                        .collect(),
                ),
            }
        }
    }
}
