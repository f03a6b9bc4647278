//! The selected columns of one log in SI units, checked cell by cell.

use super::csv::{BadCell, RawColumn, RawLog};
use super::error::LogError;
use super::note::{Note, count};
use super::resolve::{self, Resolved, Source, Time};
use super::selection::Selection;
use super::stamp;
use super::trajectory::Channel;

/// Rows of a log that have a time stamp, column by column, in SI units.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    pub(crate) path: String,
    /// Time \[s\] of each row, finite.
    pub(crate) t: Vec<f64>,
    /// Name of the time column if its unit is not stated.
    pub(crate) unstated: Option<String>,
    pub(crate) lines: Vec<u64>,
    pub(crate) output_channels: Vec<Channel>,
    pub(crate) input_channels: Vec<Channel>,
    /// One vector per output; NaN is missing.
    pub(crate) outputs: Vec<Vec<f64>>,
    /// One vector per input; NaN is missing.
    pub(crate) inputs: Vec<Vec<f64>>,
    pub(crate) truth: Option<Vec<Vec<f64>>>,
    pub(crate) heading: Option<Vec<f64>>,
}

/// Largest plausible time \[s\]: seconds since 1970 are 1.7e9, milliseconds are 1.7e12.
const LONGEST_TIME_S: f64 = 1e12;

impl Columns {
    pub(crate) fn new(log: &RawLog, resolved: &Resolved, notes: &mut Vec<Note>) -> Result<Self, LogError> {
        let times = times(log, &resolved.time, notes)?;
        let rows = usable_rows(log, &times, matches!(resolved.time, Time::Column { .. }), notes);
        let all = rows.len() == log.rows();
        let take = |source: &Source| -> Result<Vec<f64>, LogError> {
            let raw = checked(log, source)?;
            Ok(if all {
                raw.values.iter().map(|x| source.si(*x)).collect()
            } else {
                rows.iter().map(|&k| source.si(raw.values[k])).collect()
            })
        };
        let take_all = |sources: &[Source]| sources.iter().map(take).collect::<Result<Vec<_>, _>>();
        let t: Vec<f64> = rows.iter().map(|&k| times[k]).collect();
        let lines: Vec<u64> = rows.iter().map(|&k| log.lines[k]).collect();
        if let Some(k) = t.iter().position(|t| t.abs() > LONGEST_TIME_S) {
            return Err(LogError::AbsurdTime { path: log.path.clone(), line: lines[k], time: t[k] });
        }
        let outputs = take_all(&resolved.outputs)?;
        let mut inputs = take_all(&resolved.inputs)?;
        for (source, values) in
            resolved.outputs.iter().chain(&resolved.inputs).zip(outputs.iter().chain(&inputs))
        {
            if values.iter().all(|x| x.is_nan()) {
                return Err(missing(log, &log.columns[source.column]));
            }
        }
        if let Some([speed, direction]) = &resolved.wind {
            let (speeds, directions) = (take(speed)?, take(direction)?);
            check_direction(log, direction, &lines, &directions)?;
            let part = |f: fn(f64) -> f64| -> Vec<f64> {
                speeds.iter().zip(&directions).map(|(s, d)| s * s * f(*d)).collect()
            };
            let (x, y) = (part(f64::cos), part(f64::sin));
            if x.iter().all(|x| x.is_nan()) {
                let source = if speeds.iter().all(|x| x.is_nan()) { speed } else { direction };
                return Err(missing(log, &log.columns[source.column]));
            }
            inputs.extend([x, y]);
        }
        let truth = resolved.truth.as_ref().map(|t| take_all(t)).transpose()?;
        // A column that was only guessed to be the heading need not be one.
        let heading = match &resolved.heading {
            Some((source, true)) => Some(take(source)?),
            Some((source, false)) => take(source).ok(),
            None => None,
        };
        Ok(Self {
            path: log.path.clone(),
            t,
            unstated: match &resolved.time {
                Time::Column { source, stated: false } => Some(log.columns[source.column].name.clone()),
                _ => None,
            },
            lines,
            output_channels: resolved.output_channels(),
            input_channels: resolved.input_channels(),
            outputs,
            inputs,
            truth,
            heading,
        })
    }

    pub(crate) fn rows(&self) -> usize {
        self.t.len()
    }

    pub(crate) fn keep(&mut self, rows: std::ops::Range<usize>) {
        let values = self.outputs.iter_mut().chain(&mut self.inputs).chain(self.truth.iter_mut().flatten());
        for values in values.chain(&mut self.heading).chain([&mut self.t]) {
            values.truncate(rows.end);
            values.drain(..rows.start);
        }
        self.lines.truncate(rows.end);
        self.lines.drain(..rows.start);
    }
}

/// Time \[s\] of every row, NaN where it is missing; stamps are relative to the first one.
fn times(log: &RawLog, time: &Time, notes: &mut Vec<Note>) -> Result<Vec<f64>, LogError> {
    let source = match time {
        Time::Even(dt) => return Ok((0..log.rows()).map(|k| k as f64 * dt).collect()),
        Time::Column { source, .. } => source,
    };
    let column = &log.columns[source.column];
    if let Some(bad) = &column.bad {
        return Err(not_a_number(log, column, bad));
    }
    if column.values.iter().all(|x| x.is_nan()) {
        return Err(missing(log, column));
    }
    if let Some(k) = resolve::only_value(column) {
        let value = match &column.stamps {
            Some(first) => first.text.clone(),
            None => column.values[k].to_string(),
        };
        let (path, line, column) = (log.path.clone(), log.lines[k], column.name.clone());
        return Err(LogError::OneTime { path, line, column, value });
    }
    let Some(first) = &column.stamps else {
        return Ok(column.values.iter().map(|x| source.si(*x)).collect());
    };
    let zone = if first.zoned { "" } else { " (no zone is given: taken as UTC)" };
    notes.push(Note::info(format!("{}: times are seconds since {}{zone}", log.path, first.text)));
    let start = column.values.iter().copied().find(|x| !x.is_nan()).unwrap_or(0.0);
    // Seconds since 1970 resolve a quarter of a microsecond: rounding restores whole microseconds.
    Ok(column.values.iter().map(|x| ((x - start) * 1e6).round() / 1e6).collect())
}

/// Rows with a time, without those that repeat the row before in every column.
fn usable_rows(log: &RawLog, times: &[f64], stamped: bool, notes: &mut Vec<Note>) -> Vec<usize> {
    let mut rows: Vec<usize> = (0..log.rows()).filter(|&k| !times[k].is_nan()).collect();
    if rows.len() < log.rows() {
        let dropped = count(log.rows() - rows.len(), "row");
        notes.push(Note::warning(format!("{}: {dropped} without a time stamp dropped", log.path)));
    }
    if !stamped {
        return rows;
    }
    let before = rows.len();
    let mut first = None;
    rows.dedup_by(|b, a| {
        let same = times[*a] == times[*b]
            && log.columns.iter().all(|c| {
                let (x, y) = (c.values[*a], c.values[*b]);
                x == y || x.is_nan() && y.is_nan()
            });
        if same {
            first.get_or_insert(log.lines[*b]);
        }
        same
    });
    if let Some(line) = first {
        let dropped = count(before - rows.len(), "row");
        notes.push(Note::warning(format!(
            "{}: {dropped} dropped that repeat the row before with its time and all its values (the first in line {line})",
            log.path
        )));
    }
    rows
}

/// The selected columns row by row in SI units: time \[s\], outputs, inputs. For tables that are not runs.
///
/// # Errors
/// If a column is missing or holds text.
pub fn rows(log: &RawLog, selection: &Selection) -> Result<Vec<(f64, Vec<f64>)>, LogError> {
    let resolved = Resolved::new(log, selection, None, &mut Vec::new())?;
    let columns = Columns::new(log, &resolved, &mut Vec::new())?;
    let row = |k: usize| columns.outputs.iter().chain(&columns.inputs).map(|values| values[k]).collect();
    Ok((0..columns.rows()).map(|k| (columns.t[k], row(k))).collect())
}

/// Rejects a wind direction in degrees without a unit: it would be taken as radians.
fn check_direction(log: &RawLog, source: &Source, lines: &[u64], directions: &[f64]) -> Result<(), LogError> {
    let name = &log.columns[source.column].name;
    let turn = std::f64::consts::TAU + 0.01;
    match directions.iter().position(|x| x.abs() > turn) {
        Some(k) if source.channel.unit.is_empty() => Err(LogError::Absurd {
            path: log.path.clone(),
            line: lines[k],
            column: name.clone(),
            value: format!(
                "a wind direction of {} without a unit is more than a turn in radians and looks like degrees: write `{name} [deg]`",
                directions[k]
            ),
            remedy: "in the header or in --wind SPEED,DIRECTION; if it counts radians over several turns, write [rad]",
        }),
        _ => Ok(()),
    }
}

fn missing(log: &RawLog, column: &RawColumn) -> LogError {
    LogError::AllMissing { path: log.path.clone(), column: column.name.clone() }
}

/// The column of a source, if all its cells are numbers or blank.
fn checked<'a>(log: &'a RawLog, source: &Source) -> Result<&'a RawColumn, LogError> {
    let column = &log.columns[source.column];
    match (&column.bad, &column.stamps) {
        (bad, Some(stamp)) if bad.as_ref().is_none_or(|bad| bad.line > stamp.line) => {
            Err(LogError::TextInNumbers {
                path: log.path.clone(),
                line: stamp.line,
                column: column.name.clone(),
                text: stamp.text.clone(),
                remedy: "only the time column may hold dates: choose another one",
            })
        }
        (Some(bad), _) => Err(not_a_number(log, column, bad)),
        _ => Ok(column),
    }
}

fn not_a_number(log: &RawLog, column: &RawColumn, bad: &BadCell) -> LogError {
    let (path, line, name, text) = (log.path.clone(), bad.line, column.name.clone(), bad.text.clone());
    if bad.infinite {
        return LogError::Infinite { path, line, column: name, text };
    }
    // A column holds either stamps or numbers.
    let stamp = stamp::parse(&text).is_some();
    if stamp && column.values.iter().any(|x| !x.is_nan()) || column.stamps.is_some() && is_number(&text) {
        return LogError::MixedTime { path, line, column: name, text };
    }
    let dated = text.bytes().filter(|&b| b == b':' || b == b'-' || b == b'/').count() >= 2;
    let remedy = if stamp::looks_like(&text) {
        "a time stamp is a date and a time of day that exist, as in 2020-08-03T11:04:37.125Z"
    } else if dated {
        "write the time as 2020-08-03T11:04:37.125Z, or as seconds since the start of the recording"
    } else if column.bad_cells == column.values.len() {
        "the column holds text in every row: choose another one"
    } else if log.lines.first() == Some(&line) {
        "if the line holds units, move them into the header, as `name [unit]`, and delete the line"
    } else if text.contains(',') {
        "write decimals with a point"
    } else {
        "correct it, or leave the cell blank if nothing was measured"
    };
    LogError::TextInNumbers { path, line, column: name, text, remedy }
}

fn is_number(text: &str) -> bool {
    text.replacen(',', ".", 1).parse::<f64>().is_ok()
}
