//! Topics at different rates as one table.

use std::f64::consts::TAU;

use hydroid_io::Clock;

use super::open::{Recording, Times, names};
use crate::log::line::{Resolved, Time};
use crate::log::parts::{Kept, Parts};
use crate::log::{
    self, ChannelSpec, LogError, Note, RawColumn, RawLog, SINCE_1970_S, Selection, all_names, checked, parts,
    unknown_column,
};

/// Longest time \[s\] over which a measurement of another topic is interpolated, in its usual steps.
pub(super) const STEPS: f64 = 5.0;

impl Recording {
    /// The column that a specification names.
    pub(super) fn position(&self, spec: &ChannelSpec) -> Result<usize, LogError> {
        let found = names(spec).find_map(|name| self.log.position(&name));
        found.ok_or_else(|| unknown_column(&self.log, &spec.column))
    }

    /// Stamps and values of a column.
    pub(super) fn series(&self, column: usize) -> (&[f64], &[f64]) {
        (&self.topics[self.topic_of[column]].t, &self.log.columns[column].values)
    }

    /// Mean over each step of a command that is held until it changes; NaN before its first value.
    pub(super) fn held(&self, column: usize, t: &[f64]) -> Vec<f64> {
        let (stamps, values) = self.series(column);
        let events: Vec<(f64, f64)> =
            stamps.iter().copied().zip(values.iter().copied()).filter(|e| !e.1.is_nan()).collect();
        let last_step = if t.len() > 1 { t[t.len() - 1] - t[t.len() - 2] } else { 0.0 };
        let mut next = 0;
        let mut means = Vec::with_capacity(t.len());
        for (k, &from) in t.iter().enumerate() {
            let to = t.get(k + 1).copied().unwrap_or(from + last_step);
            // A stamp that differs from that of the row by rounding is at the row.
            let at = from + 1e-6;
            while next < events.len() && events[next].0 <= at {
                next += 1;
            }
            let Some(&(_, held)) = next.checked_sub(1).and_then(|i| events.get(i)) else {
                means.push(f64::NAN);
                continue;
            };
            means.push(if to > from { log::mean(&events[next..], held, from, to) } else { held });
        }
        means
    }

    /// Values of a column at other times, interpolated over short gaps; those of an angle over the shorter way.
    pub(super) fn interpolated(&self, column: usize, t: &[f64], period: Option<f64>) -> Vec<f64> {
        let (stamps, values) = self.series(column);
        let valid: Vec<(f64, f64)> =
            stamps.iter().copied().zip(values.iter().copied()).filter(|e| !e.1.is_nan()).collect();
        let times: Vec<f64> = valid.iter().map(|(t, _)| *t).collect();
        let usual = log::Clock::usual_step(&times).unwrap_or(0.0);
        let mut next = 0;
        t.iter()
            .map(|&t| {
                while next < valid.len() && valid[next].0 <= t {
                    next += 1;
                }
                let before = next.checked_sub(1).map(|i| valid[i]);
                match (before, valid.get(next)) {
                    (Some((at, value)), _) if at == t => value,
                    (Some((ta, a)), Some(&(tb, b))) if tb - ta <= STEPS * usual => {
                        let mut difference = b - a;
                        if let Some(period) = period {
                            difference -= period * (difference / period).round();
                        }
                        a + difference * (t - ta) / (tb - ta)
                    }
                    _ => f64::NAN,
                }
            })
            .collect()
    }

    /// The parts of the recording that are used, on its clock; those of a table that begins at `zero` count from there.
    pub(super) fn parts(&self, selection: &Selection, zero: f64) -> Result<Kept, LogError> {
        let Parts { condition, .. } = &selection.parts;
        let mut changes = None;
        if let Some(condition) = condition {
            let specs = selection.parts.columns();
            let columns = specs.iter().map(|spec| self.position(spec)).collect::<Result<Vec<_>, _>>()?;
            let names: Vec<String> = specs.into_iter().map(|spec| spec.column).collect();
            let mut events: Vec<(f64, usize, f64)> = Vec::new();
            for (i, column) in columns.into_iter().enumerate() {
                let (t, values) = self.series(column);
                events.extend(t.iter().zip(values).filter(|(_, x)| !x.is_nan()).map(|(t, x)| (*t, i, *x)));
            }
            events.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut held = vec![f64::NAN; names.len()];
            let at_once = events.chunk_by(|a, b| a.0 == b.0);
            changes = Some(
                at_once
                    .map(|events| {
                        for &(_, i, x) in events {
                            held[i] = x;
                        }
                        (events[0].0, condition.holds(&names, &held))
                    })
                    .collect(),
            );
        }
        let date = (zero >= SINCE_1970_S).then_some(zero);
        selection.parts.of(&self.log.path, zero, date, changes)
    }

    /// Which of the rows at these times, on the clock of the recording, are used; none if all are.
    fn used(&self, t: &[f64], selection: &Selection) -> Result<Option<Vec<bool>>, LogError> {
        if selection.parts.is_all() {
            return Ok(None);
        }
        let kept = self.parts(selection, t.first().copied().unwrap_or(0.0))?;
        Ok(Some(t.iter().map(|t| kept.has(*t)).collect()))
    }

    /// A column of a table with the name and unit of one of the recording.
    pub(super) fn column(&self, column: usize, values: Vec<f64>) -> RawColumn {
        let RawColumn { name, unit, .. } = &self.log.columns[column];
        RawColumn::of(name, unit.as_deref(), values)
    }

    /// The period of a column that is an angle, in its unit. `direction` is whether a column without a unit is one.
    pub(super) fn period(&self, spec: &ChannelSpec, direction: bool) -> Result<Option<f64>, LogError> {
        let source = log::channel(&self.log, spec, &mut Vec::new())?;
        let unit = &source.channel.unit;
        let angle = unit == "rad" || (direction && unit.is_empty());
        Ok(angle.then(|| TAU / source.unit_factor()))
    }
}

/// A table on the stamps of the topic of the first output. Other outputs are interpolated, inputs are the mean over each
/// step of the held command. A recording of one topic is a table as it is.
pub(super) fn of_outputs(
    recording: Recording,
    selection: &Selection,
    notes: &mut Vec<Note>,
) -> Result<RawLog, LogError> {
    let path = recording.log.path.clone();
    let finish = |columns: Vec<RawColumn>, used: Option<Vec<bool>>, t: &[f64], notes: &mut Vec<Note>| {
        let mut log = RawLog::from_columns(&path, columns)?;
        if let Some(used) = used {
            parts::keep_rows(&mut log, &used, t, &selection.parts, notes)?;
        }
        Ok(log)
    };
    if let [Times { clock, t }] = &recording.topics[..] {
        if recording.log.columns.is_empty() {
            return Err(LogError::Unusable {
                path,
                reason: "its only topic holds no numbers".to_owned(),
                remedy: "name a recording with numbers; `hydroid inspect` lists topics and fields".to_owned(),
            });
        }
        let used = recording.used(t, selection)?;
        let has_time = *clock != Clock::None;
        // A column `t` of the file is the same time, or none.
        let chosen = |c: &RawColumn| c.values.len() == t.len() && !(has_time && c.name == "t");
        let mut columns = recording.log.columns;
        columns.retain(chosen);
        if has_time {
            columns.insert(0, time(t));
        }
        return finish(columns, used, t, notes);
    }
    let Some(first) = selection.outputs.first() else {
        return Err(LogError::Unusable {
            reason: format!("it has {} topics, and no output is named", recording.topics.len()),
            remedy: format!(
                "name outputs, or sensors in the section [log.sensors]; `hydroid inspect {path}` proposes them, or says what the recording lacks. Its columns are: {}",
                all_names(&recording.log)
            ),
            path: path.clone(),
        });
    };
    let base = recording.topic_of[recording.position(first)?];
    let t = &recording.topics[base].t;
    if t.is_empty() {
        return Err(LogError::HeaderOnly { path });
    }
    let mut columns = vec![time(t)];
    let mut add = |spec: &ChannelSpec, held: bool, direction: bool| -> Result<(), LogError> {
        let at = recording.position(spec)?;
        let name = &recording.log.columns[at].name;
        if columns.iter().any(|c| c.name == *name) {
            return Ok(());
        }
        let values = if recording.topic_of[at] == base {
            recording.series(at).1.to_vec()
        } else if held {
            recording.held(at, t)
        } else {
            recording.interpolated(at, t, recording.period(spec, direction)?)
        };
        columns.push(recording.column(at, values));
        Ok(())
    };
    for spec in &selection.outputs {
        add(spec, false, false)?;
    }
    for spec in &selection.inputs {
        if spec.column != "none" {
            add(spec, true, false)?;
        }
    }
    if let Some(wind) = &selection.wind {
        add(&wind.speed, false, false)?;
        add(&wind.direction, false, true)?;
    }
    if let Some(heading) = &selection.heading {
        add(heading, false, true)?;
    }
    notes.push(start(&path, t[0]));
    finish(columns, recording.used(t, selection)?, t, notes)
}

/// The column of the time \[s\] from the first row.
pub(super) fn time(t: &[f64]) -> RawColumn {
    time_from(t.first().copied().unwrap_or(0.0), t)
}

/// The column of the time \[s\] from a start.
pub(super) fn time_from(start: f64, t: &[f64]) -> RawColumn {
    // Stamps since 1970 have a resolution of 0.2 microseconds.
    let values = t.iter().map(|t| ((t - start) * 1e6).round() / 1e6).collect();
    RawColumn::of("t", Some("s"), values)
}

/// A time as text: UTC if it counts from 1970.
#[doc(hidden)]
pub fn time_text(t: f64) -> String {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let microseconds = (t * 1e6) as i64;
    match jiff::Timestamp::from_microsecond(microseconds) {
        Ok(stamp) if t >= SINCE_1970_S => format!("{stamp:.3}"),
        _ => format!("{t:.3} s on the clock of the file"),
    }
}

/// A note on the first time of a table.
pub(super) fn start(path: &str, t: f64) -> Note {
    Note::info(format!("{path}: t = 0 is {}", time_text(t)))
}

/// A table with the channels of a selection under their names in SI units, and with the other columns that are computed
/// from sensors. Every command reads it with the names of the channels.
///
/// # Errors
/// If a channel cannot be resolved.
pub fn converted(log: &RawLog, selection: &Selection, notes: &mut Vec<Note>) -> Result<RawLog, LogError> {
    let resolved = Resolved::new(log, selection, None, notes)?;
    let mut columns = Vec::new();
    let time = match &resolved.time {
        Time::Column { source, .. } => Some((source, "t")),
        Time::Even(_) => None,
    };
    let channels = resolved.outputs.iter().chain(&resolved.inputs).chain(resolved.wind.iter().flatten());
    let channels = channels.map(|source| (source, source.channel.name.as_str()));
    // An output may be the heading itself.
    let is_output = resolved.outputs.iter().any(|source| source.channel.name == "psi");
    let heading = resolved.heading.iter().filter(|_| !is_output).map(|(source, _)| (source, "psi"));
    for (source, name) in time.into_iter().chain(channels).chain(heading) {
        let unit = Some(source.channel.unit.as_str()).filter(|unit| !unit.is_empty());
        let values = if name == "t" && log.columns[source.column].stamps.is_some() {
            log.columns[source.column].values.clone()
        } else {
            checked(log, source)?.values.iter().map(|x| source.si(*x)).collect()
        };
        columns.push(RawColumn::of(name, unit, values));
    }
    if selection.sensors.is_some() {
        let computed = ["x", "y", "deviation_u", "deviation_v", "deviation_r"];
        columns.extend(log.columns.iter().filter(|c| computed.contains(&c.name.as_str())).cloned());
    }
    RawLog::from_columns(&log.path, columns)
}
