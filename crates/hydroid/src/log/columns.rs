//! The selected columns of one log in SI units, checked cell by cell.

use std::borrow::Cow;
use std::f64::consts::TAU;

use super::clock;
use super::csv::{BadCell, RawColumn, RawLog};
use super::error::LogError;
use super::lines::Lines;
use super::note::{Note, count};
use super::resolve::{self, Resolved, Source, Time};
use super::selection::Selection;
use super::sentinel;
use super::stamp;
use super::trajectory::Channel;
use crate::key::key;

/// Where the values of [`Columns`] come from.
pub(crate) enum Origin<'a, 'b> {
    /// A log that is used further: only converted columns are copied.
    Borrowed(&'a RawLog),
    /// A log whose selected columns are moved out of it.
    Taken(&'b mut RawLog),
}

impl Origin<'_, '_> {
    fn log(&self) -> &RawLog {
        match self {
            Self::Borrowed(log) => log,
            Self::Taken(log) => log,
        }
    }
}

/// Rows of a log that have a time stamp, column by column, in SI units.
#[derive(Clone, Debug)]
pub(crate) struct Columns<'a> {
    pub(crate) path: String,
    /// Time \[s\] of each row, finite.
    pub(crate) t: Cow<'a, [f64]>,
    /// Name of the time column if its unit is not stated.
    pub(crate) unstated: Option<String>,
    pub(crate) lines: Lines,
    pub(crate) output_channels: Vec<Channel>,
    pub(crate) input_channels: Vec<Channel>,
    /// One vector per output; NaN is missing.
    pub(crate) outputs: Vec<Cow<'a, [f64]>>,
    /// Standard deviation of each output, where `deviation_u`, `deviation_v` or `deviation_r` states it.
    pub(crate) deviations: Vec<Option<f64>>,
    /// One vector per input; NaN is missing.
    pub(crate) inputs: Vec<Cow<'a, [f64]>>,
    pub(crate) truth: Option<Vec<Cow<'a, [f64]>>>,
    pub(crate) heading: Option<Cow<'a, [f64]>>,
    pub(crate) position: Option<[Cow<'a, [f64]>; 2]>,
}

/// Largest plausible time \[s\]: seconds since 1970 are 1.7e9, milliseconds are 1.7e12, and nanoseconds end at 9.2e9 s.
pub(crate) const LONGEST_TIME_S: f64 = 9e9;

/// Seconds from which on a time counts from 1970: 2001-09-09.
pub(crate) const SINCE_1970_S: f64 = 1e9;

/// Columns of a log, from which some rows are dropped.
struct Taker<'a, 'b> {
    origin: Origin<'a, 'b>,
    /// Uses of each column that are still to come; the last one moves its values.
    uses: Vec<usize>,
    /// Rows that are dropped, ascending.
    dropped: Vec<usize>,
}

impl<'a> Taker<'a, '_> {
    /// The SI values of a source.
    fn take(&mut self, source: &Source) -> Result<Cow<'a, [f64]>, LogError> {
        checked(self.origin.log(), source)?;
        let si = |x: f64| source.si(x);
        Ok(self.convert(source.column, (!source.is_identity()).then_some(si)))
    }

    fn take_all(&mut self, sources: &[Source]) -> Result<Vec<Cow<'a, [f64]>>, LogError> {
        sources.iter().map(|source| self.take(source)).collect()
    }

    fn convert(&mut self, column: usize, si: Option<impl Fn(f64) -> f64>) -> Cow<'a, [f64]> {
        self.uses[column] = self.uses[column].saturating_sub(1);
        let mut values = match &mut self.origin {
            Origin::Borrowed(log) => Cow::Borrowed(&log.columns[column].values[..]),
            Origin::Taken(log) if self.uses[column] == 0 => {
                Cow::Owned(std::mem::take(&mut log.columns[column].values))
            }
            Origin::Taken(log) => Cow::Owned(log.columns[column].values.clone()),
        };
        if let Some(si) = si {
            values.to_mut().iter_mut().for_each(|x| *x = si(*x));
        }
        drop_rows(&mut values, &self.dropped);
        values
    }

    /// Releases the columns that are not selected.
    fn release(&mut self) {
        if let Origin::Taken(log) = &mut self.origin {
            log.columns.iter_mut().for_each(|column| column.values = Vec::new());
        }
    }
}

fn drop_rows(values: &mut Cow<[f64]>, dropped: &[usize]) {
    if dropped.is_empty() {
        return;
    }
    let (mut row, mut next) = (0, 0);
    values.to_mut().retain(|_| {
        let drop = dropped.get(next) == Some(&row);
        next += usize::from(drop);
        row += 1;
        !drop
    });
}

impl<'a> Columns<'a> {
    pub(crate) fn new(
        origin: Origin<'a, '_>,
        resolved: &Resolved,
        notes: &mut Vec<Note>,
    ) -> Result<Self, LogError> {
        let log = origin.log();
        let path = log.path.clone();
        check_times(log, &resolved.time, notes)?;
        let mut uses = vec![0; log.columns.len()];
        resolved.sources().for_each(|source| uses[source.column] += 1);
        let mut taker = Taker { origin, uses, dropped: Vec::new() };
        let mut t = times(&mut taker, &resolved.time);
        taker.dropped = unusable_rows(taker.origin.log(), &resolved.time, &t, notes);
        drop_rows(&mut t, &taker.dropped);
        let mut dropped = taker.dropped.iter().peekable();
        let all = taker.origin.log().lines.iter().enumerate();
        let lines: Lines =
            all.filter(|(k, _)| dropped.next_if(|d| *d == k).is_none()).map(|(_, line)| line).collect();
        clock::follow_on(&mut t, &lines, &path, notes);
        if let Some(k) = t.iter().position(|t| t.abs() > LONGEST_TIME_S) {
            return Err(LogError::AbsurdTime { path, line: lines.get(k), time: t[k] });
        }
        let mut outputs = taker.take_all(&resolved.outputs)?;
        let mut inputs = taker.take_all(&resolved.inputs)?;
        for (sources, columns, kind) in [
            (&resolved.outputs, &mut outputs, sentinel::Kind::Measured),
            (&resolved.inputs, &mut inputs, sentinel::Kind::Command),
        ] {
            for (source, values) in sources.iter().zip(columns) {
                notes.extend(blank(&path, source, kind, values));
            }
        }
        let names = |source: &Source| taker.origin.log().columns[source.column].name.clone();
        for (source, values) in
            resolved.outputs.iter().chain(&resolved.inputs).zip(outputs.iter().chain(&inputs))
        {
            if values.iter().all(|x| x.is_nan()) {
                return Err(LogError::AllMissing { path, column: names(source) });
            }
        }
        if let Some([speed, direction]) = &resolved.wind {
            let (speeds, directions) = (taker.take(speed)?, taker.take(direction)?);
            let names = |source: &Source| taker.origin.log().columns[source.column].name.clone();
            check_direction(&path, &names(direction), direction, &lines, &directions)?;
            let part = |f: fn(f64) -> f64| -> Vec<f64> {
                speeds.iter().zip(directions.iter()).map(|(s, d)| s * s * f(*d)).collect()
            };
            let (x, y) = (part(f64::cos), part(f64::sin));
            if x.iter().all(|x| x.is_nan()) {
                let source = if speeds.iter().all(|x| x.is_nan()) { speed } else { direction };
                return Err(LogError::AllMissing { path, column: names(source) });
            }
            inputs.extend([x.into(), y.into()]);
        }
        let truth = match &resolved.truth {
            // An inspection has no use for the true values, and leaves them out.
            Some(sources) if sources.iter().any(|s| taker.origin.log().columns[s.column].is_left_out()) => {
                sources.iter().try_for_each(|source| checked(taker.origin.log(), source).map(|_| ()))?;
                None
            }
            Some(sources) => Some(taker.take_all(sources)?),
            None => None,
        };
        // A column that was only guessed to be the heading need not be one.
        let heading = match &resolved.heading {
            Some((source, true)) => Some(taker.take(source)?),
            Some((source, false)) => taker.take(source).ok(),
            None => None,
        };
        let position = match &resolved.position {
            Some([x, y]) => taker.take(x).ok().zip(taker.take(y).ok()).map(<[_; 2]>::from),
            None => None,
        };
        let deviations =
            resolved.outputs.iter().map(|source| deviation(taker.origin.log(), source)).collect();
        taker.release();
        Ok(Self {
            path,
            t,
            unstated: match &resolved.time {
                Time::Column { source, stated: false } => {
                    Some(taker.origin.log().columns[source.column].name.clone())
                }
                _ => None,
            },
            lines,
            output_channels: resolved.output_channels(),
            input_channels: resolved.input_channels(),
            outputs,
            deviations,
            inputs,
            truth,
            heading,
            position,
        })
    }

    pub(crate) fn rows(&self) -> usize {
        self.t.len()
    }

    /// Leaves some rows.
    pub(crate) fn keep(&mut self, rows: &[bool]) {
        let values = self.outputs.iter_mut().chain(&mut self.inputs).chain(self.truth.iter_mut().flatten());
        let position = self.position.iter_mut().flatten();
        for values in values.chain(&mut self.heading).chain(position).chain([&mut self.t]) {
            let mut used = rows.iter();
            values.to_mut().retain(|_| used.next() == Some(&true));
        }
        self.lines = self.lines.of(rows);
    }
}

/// Share of the rows with the largest deviations that does not count: the beginning of a run is less certain.
const LEAST_CERTAIN: f64 = 0.05;

/// Standard deviation of a velocity that another column of the table states, RMS over the log without the least certain rows \[SI\].
fn deviation(log: &RawLog, source: &Source) -> Option<f64> {
    let own = &log.columns[source.column];
    if !["u", "v", "r"].contains(&own.name.as_str()) {
        return None;
    }
    let name = format!("deviation_{}", own.name);
    let stated = log.columns.iter().find(|column| column.name == name && column.unit == own.unit)?;
    let si = |x: &f64| source.si(*x) - source.si(0.0);
    let mut sizes: Vec<f64> = stated.values.iter().map(si).filter(|x| x.is_finite() && *x >= 0.0).collect();
    sizes.sort_by(f64::total_cmp);
    // A share of a length.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    sizes.truncate(((1.0 - LEAST_CERTAIN) * sizes.len() as f64).ceil() as usize);
    let mean = sizes.iter().map(|x| x * x).sum::<f64>() / sizes.len() as f64;
    (!sizes.is_empty()).then(|| mean.sqrt())
}

/// Blanks the values of a column that stand for a missing one.
fn blank(path: &str, source: &Source, kind: sentinel::Kind, values: &mut Cow<[f64]>) -> Option<Note> {
    let raw = |x: f64| source.raw(x);
    let found = sentinel::find(values.iter().copied(), kind, TAU, raw);
    if !found.is_empty() {
        let is_none = |x: f64| found.iter().any(|(of, _)| *of == x);
        values.to_mut().iter_mut().filter(|x| is_none(**x)).for_each(|x| *x = f64::NAN);
    }
    sentinel::note(path, &source.channel.name, &found, raw)
}

/// Rejects a time column without times, and adds a note on stamps.
fn check_times(log: &RawLog, time: &Time, notes: &mut Vec<Note>) -> Result<(), LogError> {
    let Time::Column { source, .. } = time else { return Ok(()) };
    let column = &log.columns[source.column];
    if let Some(bad) = &column.bad {
        return Err(not_a_number(log, column, bad));
    }
    if !column.has_values() {
        return Err(LogError::AllMissing { path: log.path.clone(), column: column.name.clone() });
    }
    if let Some(k) = resolve::only_value(column) {
        let value = match &column.stamps {
            Some(first) => first.text.clone(),
            None => column.values[k].to_string(),
        };
        let (path, line, column) = (log.path.clone(), log.lines.get(k), column.name.clone());
        return Err(LogError::OneTime { path, line, column, value });
    }
    if let Some(first) = &column.stamps {
        let zone = match (first.dated, first.zoned) {
            (true, false) => " (no zone is given: taken as UTC)",
            (true, true) => "",
            (false, _) => " (a time of day)",
        };
        notes.push(Note::info(format!("{}: times are seconds since {}{zone}", log.path, first.text)));
    }
    Ok(())
}

/// Time \[s\] of every row, NaN where it is missing; stamps are relative to the first one.
fn times<'a>(taker: &mut Taker<'a, '_>, time: &Time) -> Cow<'a, [f64]> {
    let source = match time {
        Time::Even(dt) => return (0..taker.origin.log().rows()).map(|k| k as f64 * dt).collect(),
        Time::Column { source, .. } => source,
    };
    let column = &taker.origin.log().columns[source.column];
    if column.stamps.is_none() {
        return taker.convert(source.column, (!source.is_identity()).then_some(|x: f64| source.si(x)));
    }
    let start = column.values.iter().copied().find(|x| !x.is_nan()).unwrap_or(0.0);
    // Seconds since 1970 resolve a quarter of a microsecond: rounding restores whole microseconds.
    taker.convert(source.column, Some(|x: f64| ((x - start) * 1e6).round() / 1e6))
}

/// Time \[s\] of every row, NaN where it is missing, and the seconds since 1970 at its zero, if they are known.
pub(super) fn row_times(log: &RawLog, time: &Time) -> (Vec<f64>, Option<f64>) {
    let source = match time {
        Time::Even(dt) => return ((0..log.rows()).map(|k| k as f64 * dt).collect(), None),
        Time::Column { source, .. } => source,
    };
    let column = &log.columns[source.column];
    let first = column.values.iter().copied().find(|x| !x.is_nan()).unwrap_or(0.0);
    if column.stamps.is_some() {
        let dated = column.stamps.as_ref().is_some_and(|stamp| stamp.dated);
        return (
            column.values.iter().map(|x| ((x - first) * 1e6).round() / 1e6).collect(),
            dated.then_some(first),
        );
    }
    let t = column.values.iter().map(|x| source.si(*x)).collect();
    (t, (source.si(first) >= SINCE_1970_S).then_some(0.0))
}

/// Rows without a time, and rows that repeat the row before in every column.
fn unusable_rows(log: &RawLog, time: &Time, times: &[f64], notes: &mut Vec<Note>) -> Vec<usize> {
    let mut dropped: Vec<usize> = (0..log.rows()).filter(|&k| times[k].is_nan()).collect();
    if !dropped.is_empty() {
        let rows = count(dropped.len(), "row");
        notes.push(Note::warning(format!("{}: {rows} without a time stamp dropped", log.path)));
    }
    let Time::Column { source, .. } = time else { return dropped };
    let same = |x: f64, y: f64| x == y || x.is_nan() && y.is_nan();
    let others = log.columns.iter().enumerate().filter(|(i, c)| *i != source.column && !c.is_left_out());
    let columns: Vec<&[f64]> = others.map(|(_, column)| &column.values[..]).collect();
    let mut repeated = Vec::new();
    let mut before: Option<usize> = None;
    for k in (0..log.rows()).filter(|&k| !times[k].is_nan()) {
        let repeats = before.is_some_and(|before| {
            times[before] == times[k]
                && columns.iter().all(|values| same(values[before], values[k]))
                && log.rest.repeats.get(before + 1..=k).is_none_or(|rows| rows.iter().all(|same| *same))
        });
        if repeats {
            repeated.push(k);
        } else {
            before = Some(k);
        }
    }
    if let Some(&first) = repeated.first() {
        let (rows, line) = (count(repeated.len(), "row"), log.lines.get(first));
        notes.push(Note::warning(format!(
            "{}: {rows} dropped that repeat the row before with its time and all its values (the first in line {line})",
            log.path
        )));
        dropped.extend(repeated);
        dropped.sort_unstable();
    }
    dropped
}

/// The selected columns row by row in SI units: time \[s\], outputs, inputs. For tables that are not runs.
///
/// # Errors
/// If a column is missing or holds text.
pub fn rows(log: &RawLog, selection: &Selection) -> Result<Vec<(f64, Vec<f64>)>, LogError> {
    let resolved = Resolved::new(log, selection, None, &mut Vec::new())?;
    let columns = Columns::new(Origin::Borrowed(log), &resolved, &mut Vec::new())?;
    let row = |k: usize| columns.outputs.iter().chain(&columns.inputs).map(|values| values[k]).collect();
    Ok((0..columns.rows()).map(|k| (columns.t[k], row(k))).collect())
}

/// Rejects a wind direction in degrees without a unit: it would be taken as radians.
fn check_direction(
    path: &str,
    name: &str,
    source: &Source,
    lines: &Lines,
    directions: &[f64],
) -> Result<(), LogError> {
    let turn = TAU + 0.01;
    match directions.iter().position(|x| x.abs() > turn) {
        Some(k) if source.channel.unit.is_empty() => Err(LogError::Absurd {
            path: path.to_owned(),
            line: lines.get(k),
            column: name.to_owned(),
            value: format!(
                "a wind direction of {} without a unit is more than a turn in radians and looks like degrees: write `{name} [deg]`",
                directions[k]
            ),
            remedy: format!(
                "in the header or in {}; if it counts radians over several turns, write [rad]",
                key("wind").is("SPEED,DIRECTION")
            ),
        }),
        _ => Ok(()),
    }
}

/// The column of a source, if all its cells are numbers or blank.
pub(crate) fn checked<'a>(log: &'a RawLog, source: &Source) -> Result<&'a RawColumn, LogError> {
    checked_column(log, source.column)
}

/// A column, if all its cells are numbers or blank.
pub(super) fn checked_column(log: &RawLog, column: usize) -> Result<&RawColumn, LogError> {
    let column = &log.columns[column];
    match (&column.bad, &column.stamps) {
        (bad, Some(stamp)) if bad.as_ref().is_none_or(|bad| bad.line > stamp.line) => {
            Err(LogError::TextInNumbers {
                path: log.path.clone(),
                line: stamp.line,
                column: column.name.clone(),
                text: stamp.text.clone(),
                remedy: "only the time column may hold dates and times of day: choose another one",
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
    if stamp && column.has_values() || column.stamps.is_some() && is_number(&text) {
        return LogError::MixedTime { path, line, column: name, text };
    }
    let dated = text.bytes().filter(|&b| b == b':' || b == b'-' || b == b'/').count() >= 2;
    let remedy = if stamp::looks_like(&text) {
        "a time stamp is a date and a time of day that exist, as in 2020-08-03T11:04:37.125Z"
    } else if dated {
        "write the time as 2020-08-03T11:04:37.125Z, or as seconds since the start of the recording"
    } else if column.bad_cells == log.rows() {
        "the column holds text in every row: choose another one"
    } else if log.lines.iter().next() == Some(line) {
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
