//! Conversion of a line to SI units. Lines are untrusted: the result is numbers or an error, never a panic.

use std::borrow::Cow;

use serde_json::{Map, Value};

use super::layout::{Format, Layout, PoseColumns};
use hydroid::closed_loop::local_position;
use hydroid::key::key;
use hydroid::log::LogError;
use hydroid::log::line::check_value;
use hydroid::log::line::{Cell, number};
use hydroid::log::line::{Source, Time};

/// Farthest vessel from its way-points \[km\]: positions are in one plane.
const FARTHEST_KM: f64 = 100.0;

/// Largest plausible time \[s\]: seconds since 1970 are 1.7e9, milliseconds are 1.7e12.
const LONGEST_TIME_S: f64 = 1e12;

const PLAN: &str = "commands";

#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sample {
    pub(crate) t: f64,
    /// Outputs; NaN is missing.
    pub(crate) outputs: Vec<f64>,
    /// Heading \[rad\], for a model that names its column; NaN is missing.
    pub(crate) heading: f64,
    /// Pose `[x, y, psi]` in m and rad, for a stream that is steered; NaN is missing.
    pub(crate) pose: [f64; 3],
    /// Inputs, wind last; NaN is missing.
    pub(crate) inputs: Vec<f64>,
    /// Planned commands, row by row like `inputs`; NaN for the last command.
    pub(crate) plan: Vec<f64>,
}

enum Item<'a> {
    Text(Cow<'a, str>),
    Number(f64),
    Missing,
}

struct Place<'a> {
    layout: &'a Layout,
    line: u64,
}

impl Layout {
    /// Reads line `line` of the stream, data row `row`.
    pub(super) fn read(&self, text: &str, line: u64, row: u64, sample: &mut Sample) -> Result<(), LogError> {
        let place = Place { layout: self, line };
        sample.plan.clear();
        match &self.format {
            Format::Csv { delimiter, needed, most } => {
                let cells = cells(text, *delimiter);
                let extra = cells.iter().skip(*most).any(|cell| !cell.trim().is_empty());
                if cells.len() < *needed || extra {
                    let (path, found) = (self.name.clone(), cells.len());
                    return Err(LogError::Ragged { path, line, found, expected: *needed });
                }
                let comma = *delimiter != b',';
                let item = |column: usize| match cells.get(column) {
                    Some(cell) => Ok(Item::Text(Cow::Borrowed(cell.trim()))),
                    None => Ok(Item::Missing),
                };
                place.fill(item, comma, row, sample)
            }
            Format::Json { keys } => {
                let object = place.object(text)?;
                let item = |column: usize| place.item(object.get(&keys[column]), &self.names[column]);
                place.fill(item, false, row, sample)?;
                // A column of this name has precedence.
                match object.get(PLAN).filter(|_| !keys.iter().any(|key| key == PLAN)) {
                    Some(plan) => place.plan(plan, &mut sample.plan),
                    None => Ok(()),
                }
            }
        }
    }
}

impl Place<'_> {
    fn bad(&self, reason: String) -> LogError {
        LogError::BadLine { path: self.layout.name.clone(), line: self.line, reason }
    }

    fn object(&self, text: &str) -> Result<Map<String, Value>, LogError> {
        parsed(text).map_err(|error| {
            self.bad(format!(
                "not a JSON object ({error}); write one object in each line, as in the first one"
            ))
        })
    }

    fn item<'a>(&self, value: Option<&'a Value>, column: &str) -> Result<Item<'a>, LogError> {
        match value {
            None | Some(Value::Null) => Ok(Item::Missing),
            // Numbers beyond the range of f64 are read as infinite.
            Some(Value::Number(x)) => Ok(Item::Number(x.as_f64().unwrap_or(f64::INFINITY))),
            Some(Value::String(text)) => Ok(Item::Text(Cow::Borrowed(text.trim()))),
            Some(Value::Bool(_) | Value::Array(_) | Value::Object(_)) => Err(self.bad(format!(
                "column `{column}`: neither a number nor null; write null if nothing was measured"
            ))),
        }
    }

    fn fill<'a>(
        &self,
        item: impl Fn(usize) -> Result<Item<'a>, LogError>,
        comma: bool,
        row: u64,
        sample: &mut Sample,
    ) -> Result<(), LogError> {
        let columns = &self.layout.columns;
        sample.t = match &columns.time {
            Time::Even(dt) => row as f64 * dt,
            Time::Column { source, .. } => self.time(&item(source.column)?, source, comma)?,
        };
        sample.outputs.clear();
        for source in &columns.outputs {
            let value = self.value(&item(source.column)?, source, comma)?;
            check_value(&source.channel, value, &self.layout.name, self.line)?;
            sample.outputs.push(value);
        }
        sample.heading = match &columns.heading {
            Some((source, _)) => self.value(&item(source.column)?, source, comma)?,
            None => f64::NAN,
        };
        if let Some(pose) = &self.layout.pose {
            let read = |source: &Source| self.value(&item(source.column)?, source, comma);
            let [x, y, psi] = [read(&pose.sources[0])?, read(&pose.sources[1])?, read(&pose.sources[2])?];
            let [x, y] = self.local(pose, [x, y])?;
            let column = &self.layout.names[pose.sources[2].column];
            // A heading that counts its turns stays below this for hours.
            let most =
                if pose.sources[2].channel.unit.is_empty() { 2.0 * std::f64::consts::TAU } else { 100.0 };
            if psi.abs() > most {
                return Err(self.bad(format!(
                    "column `{column}`: a heading of {psi} rad is too large: if it counts degrees, name the column `{column} [deg]`"
                )));
            }
            sample.pose = [x, y, psi];
            sample.heading = psi;
        }
        sample.inputs.clear();
        for source in &columns.inputs {
            sample.inputs.push(self.value(&item(source.column)?, source, comma)?);
        }
        if let Some([speed, direction]) = &columns.wind {
            let square = self.value(&item(speed.column)?, speed, comma)?.powi(2);
            let angle = self.value(&item(direction.column)?, direction, comma)?;
            if direction.channel.unit.is_empty() && angle.abs() > std::f64::consts::TAU + 0.01 {
                let name = &self.layout.names[direction.column];
                return Err(self.bad(format!(
                    "column `{name}`: a wind direction of {angle} without a unit is more than a turn in radians: if it counts degrees, write `{name} [deg]` in the header or in {}",
                    key("wind")
                )));
            }
            sample.inputs.extend([square * angle.cos(), square * angle.sin()]);
        }
        Ok(())
    }

    /// North and east of a position \[m\].
    fn local(&self, pose: &PoseColumns, position: [f64; 2]) -> Result<[f64; 2], LogError> {
        let Some(origin) = pose.origin_deg else { return Ok(position) };
        if position.iter().any(|x| x.is_nan()) {
            return Ok([f64::NAN; 2]);
        }
        let degrees: [f64; 2] = std::array::from_fn(|i| {
            if pose.sources[i].channel.unit.is_empty() { position[i] } else { position[i].to_degrees() }
        });
        let [latitude, longitude] = degrees;
        let place = local_position(origin, degrees).ok_or_else(|| {
            self.bad(format!(
                "latitude {latitude}, longitude {longitude}: latitudes are between -90 and 90 degrees and longitudes between -180 and 360"
            ))
        })?;
        let distance_km = place[0].hypot(place[1]) / 1000.0;
        if distance_km > FARTHEST_KM {
            return Err(self.bad(format!(
                "latitude {latitude}, longitude {longitude} is {distance_km:.0} km from the first way-point: check whether latitude and longitude are exchanged, here or in the way-points"
            )));
        }
        Ok(place)
    }

    fn time(&self, item: &Item<'_>, source: &Source, comma: bool) -> Result<f64, LogError> {
        let column = &self.layout.names[source.column];
        let t = match item {
            Item::Number(t) => source.si(*t),
            Item::Missing => f64::NAN,
            Item::Text(text) => match number(text, comma) {
                // Seconds since 1970 resolve a quarter of a microsecond.
                Cell::Stamp(stamp) => (stamp.seconds * 1e6).round() / 1e6,
                Cell::Number(t) => source.si(t),
                Cell::Missing => f64::NAN,
                Cell::Bad { infinite } => return Err(self.not_a_number(column, text, infinite)),
            },
        };
        if t.is_nan() {
            return Err(self.bad(format!(
                "column `{column}`: the time is missing; every line needs the time at which it was measured"
            )));
        }
        if t.abs() > LONGEST_TIME_S {
            return Err(LogError::AbsurdTime { path: self.layout.name.clone(), line: self.line, time: t });
        }
        Ok(t)
    }

    fn value(&self, item: &Item<'_>, source: &Source, comma: bool) -> Result<f64, LogError> {
        let column = &self.layout.names[source.column];
        let value = match item {
            Item::Missing => return Ok(f64::NAN),
            Item::Number(x) => *x,
            Item::Text(text) => match number(text, comma) {
                Cell::Number(x) => x,
                Cell::Missing => return Ok(f64::NAN),
                Cell::Bad { infinite } => return Err(self.not_a_number(column, text, infinite)),
                Cell::Stamp(_) => return Err(self.not_a_number(column, text, false)),
            },
        };
        let value = source.si(value);
        if value.is_finite() { Ok(value) } else { Err(self.not_a_number(column, "a number too large", true)) }
    }

    fn not_a_number(&self, column: &str, text: &str, infinite: bool) -> LogError {
        let (path, line, column) = (self.layout.name.clone(), self.line, column.to_owned());
        let text: String = text.chars().take(40).collect();
        if infinite {
            return LogError::Infinite { path, line, column, text };
        }
        let remedy = "correct it, or leave the cell blank (null in JSON) if nothing was measured";
        LogError::TextInNumbers { path, line, column, text, remedy }
    }

    fn plan(&self, plan: &Value, into: &mut Vec<f64>) -> Result<(), LogError> {
        let sources = self.layout.commands();
        let width = sources.len();
        let wrong = || {
            let names: Vec<&str> = sources.iter().map(|source| source.channel.name.as_str()).collect();
            self.bad(format!(
                "column `{PLAN}`: planned commands are rows of {width} finite numbers ({}), as in [[{}]]",
                names.join(", "),
                vec!["0"; width].join(",")
            ))
        };
        if plan.is_null() {
            return Ok(());
        }
        for row in plan.as_array().ok_or_else(wrong)? {
            let row = row.as_array().filter(|row| row.len() == width).ok_or_else(wrong)?;
            for (value, source) in row.iter().zip(sources) {
                let value = match value {
                    Value::Null => f64::NAN,
                    value => {
                        value.as_f64().map(|x| source.si(x)).filter(|x| x.is_finite()).ok_or_else(wrong)?
                    }
                };
                into.push(value);
            }
            if self.layout.columns.wind.is_some() {
                into.extend([f64::NAN; 2]);
            }
        }
        Ok(())
    }
}

/// Cells of a line; an open quote ends with the line.
pub(super) fn cells(line: &str, delimiter: u8) -> Vec<Cow<'_, str>> {
    if !line.contains('"') {
        return line.split(char::from(delimiter)).map(Cow::Borrowed).collect();
    }
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .has_headers(false)
        .flexible(true)
        .from_reader(line.as_bytes());
    let mut record = csv::StringRecord::new();
    match reader.read_record(&mut record) {
        Ok(true) => record.iter().map(|cell| Cow::Owned(cell.to_owned())).collect(),
        _ => Vec::new(),
    }
}

/// An object of JSON, in which `NaN`, as many programs write a missing value, is `null`.
fn parsed(text: &str) -> Result<Map<String, Value>, serde_json::Error> {
    serde_json::from_str(text).or_else(|error| {
        // Every other part is in quotes.
        let parts = text
            .split('"')
            .enumerate()
            .map(|(i, part)| if i.is_multiple_of(2) { part.replace("NaN", "null") } else { part.to_owned() });
        let with_null = parts.collect::<Vec<_>>().join("\"");
        if with_null == text { Err(error) } else { serde_json::from_str(&with_null) }
    })
}

/// Keys of the first object, without planned commands.
pub(super) fn keys(line: &str, name: &str) -> Result<Vec<String>, LogError> {
    let object = parsed(line).map_err(|error| LogError::BadLine {
        path: name.to_owned(),
        line: 1,
        reason: format!(
            "it starts like a JSON object but is none ({error}); write one object in each line, or a CSV header first"
        ),
    })?;
    Ok(object
        .into_iter()
        .filter(|(key, value)| key != PLAN || !value.is_array())
        .map(|(key, _)| key)
        .collect())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn not_a_number_is_null_outside_of_texts() {
        let read = |text: &str| parsed(text).map(Value::from);
        assert_eq!(
            read(r#"{"t": 0, "u": NaN, "NaN": "NaN"}"#).unwrap(),
            json!({"t": 0, "u": null, "NaN": "NaN"})
        );
        assert!(read(r#"{"u": nan}"#).is_err() && read(r#"{"NaN": }"#).is_err());
    }
}
