//! The selected columns of one log as SI numbers, checked cell by cell.

use super::csv::{RawColumn, RawLog};
use super::error::LogError;
use super::note::{Note, count};
use super::resolve::{Resolved, Source};
use super::selection::Selection;
use super::trajectory::Channel;

/// Rows of a log that have a time stamp, column by column, in SI units.
#[derive(Clone, Debug)]
pub(crate) struct Columns {
    /// File, for messages.
    pub(crate) path: String,
    /// Time \[s\] of each row, finite.
    pub(crate) t: Vec<f64>,
    /// Line of each row.
    pub(crate) lines: Vec<u64>,
    pub(crate) output_channels: Vec<Channel>,
    pub(crate) input_channels: Vec<Channel>,
    /// One vector per output; NaN is missing.
    pub(crate) outputs: Vec<Vec<f64>>,
    /// One vector per input; NaN is missing.
    pub(crate) inputs: Vec<Vec<f64>>,
    /// One vector per output.
    pub(crate) truth: Option<Vec<Vec<f64>>>,
}

/// Largest plausible time \[s\]: seconds since 1970 are 1.7e9, milliseconds are 1.7e12.
const LONGEST_TIME_S: f64 = 1e12;

impl Columns {
    /// Takes the selected columns out of a log.
    pub(crate) fn new(log: &RawLog, resolved: &Resolved, notes: &mut Vec<Note>) -> Result<Self, LogError> {
        let time = checked(log, &resolved.time)?;
        let rows: Vec<usize> = (0..log.rows()).filter(|&k| !time.values[k].is_nan()).collect();
        let all = rows.len() == log.rows();
        if rows.is_empty() {
            return Err(missing(log, time));
        }
        if !all {
            let note = format!(
                "{}: {} without a time stamp dropped",
                log.path,
                count(log.rows() - rows.len(), "row")
            );
            notes.push(Note::warning(note));
        }
        let take = |source: &Source| -> Result<Vec<f64>, LogError> {
            let raw = checked(log, source)?;
            Ok(if all {
                raw.values.iter().map(|x| x * source.factor).collect()
            } else {
                rows.iter().map(|&k| raw.values[k] * source.factor).collect()
            })
        };
        let take_all = |sources: &[Source]| sources.iter().map(take).collect::<Result<Vec<_>, _>>();
        let t = take(&resolved.time)?;
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
        Ok(Self {
            path: log.path.clone(),
            t,
            lines,
            output_channels: resolved.output_channels(),
            input_channels: resolved.input_channels(),
            outputs,
            inputs,
            truth,
        })
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.t.len()
    }
}

/// The selected columns row by row as they stand, in SI units: time \[s\], then outputs and inputs. For files
/// that are no runs, such as a list of commands.
///
/// # Errors
/// If a column is missing or holds text.
pub fn rows(log: &RawLog, selection: &Selection) -> Result<Vec<(f64, Vec<f64>)>, LogError> {
    let resolved = Resolved::new(log, selection, &mut Vec::new())?;
    let columns = Columns::new(log, &resolved, &mut Vec::new())?;
    let row = |k: usize| columns.outputs.iter().chain(&columns.inputs).map(|values| values[k]).collect();
    Ok((0..columns.rows()).map(|k| (columns.t[k], row(k))).collect())
}

/// Refuses a wind direction in degrees that does not say so: taken as radians it would be a random number.
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
    let Some(bad) = &column.bad else {
        return Ok(column);
    };
    let (path, line, name, text) = (log.path.clone(), bad.line, column.name.clone(), bad.text.clone());
    if bad.infinite {
        return Err(LogError::Infinite { path, line, column: name, text });
    }
    let dated = text.bytes().filter(|&b| b == b':' || b == b'-' || b == b'/').count() >= 2;
    let remedy = if dated {
        "write the time as seconds, for example since the start of the recording"
    } else if column.bad_cells == column.values.len() {
        "the column holds text in every row: choose another one"
    } else if log.lines.first() == Some(&line) {
        "if the line holds units, move them into the header, as `name [unit]`, and delete the line"
    } else if text.contains(',') {
        "write decimals with a point"
    } else {
        "correct it, or leave the cell blank if nothing was measured"
    };
    Err(LogError::TextInNumbers { path, line, column: name, text, remedy })
}
