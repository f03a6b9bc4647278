//! Preparation of logs: conversion to runs on a regular clock.
//!
//! For each file: select columns, convert units, reject impossible values, remove towed parts, estimate the clock, split
//! at jumps in time, resample parts with an irregular clock, hold and shift the commands, and cut where an output is
//! missing for longer than the gap limit. A [`Note`] reports each change.

use std::borrow::Cow;

use super::align::{CommandTiming, InputDelay};
use super::clock;
use super::columns::{Columns, Origin};
use super::csv::RawLog;
use super::error::LogError;
use super::file::File;
use super::heading;
use super::note::Note;
use super::parts::Parts;
use super::resolve::{self, Resolved};
use super::sanity;
use super::selection::Selection;
use super::towed;
use super::trajectory::{Table, Trajectory};
use crate::key::key;

pub(crate) const FEWEST_SAMPLES: usize = 3;

/// Options of the preparation.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PrepareOptions {
    /// Step \[s\] after resampling; default the step of the log, least half of it. Without time: the step of rows.
    pub dt: Option<f64>,
    /// Longest time \[s\] without a value of an output; default the longer of 1 s and 10 samples of the slowest.
    pub max_gap_s: Option<f64>,
    /// Interval in which the command of a row acts.
    pub command_timing: CommandTiming,
    /// Delay between the logging and the effect of a command.
    pub input_delay: InputDelay,
    /// Whether to keep towed parts: all commands are zero for 20 s or longer while the speed of the vessel grows.
    pub keep_towed: bool,
}

/// Runs with a common step, and notes on their preparation.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepared {
    /// The runs, in the order of the logs; all share channels and step.
    pub runs: Vec<Trajectory>,
    /// Index of the log of each run.
    pub sources: Vec<usize>,
    /// The complete selection, including the columns chosen by name. It applies to other logs.
    pub selection: Selection,
    /// Notes on conversions, cuts, dropped samples, resampling and defects.
    pub notes: Vec<Note>,
}

/// Converts logs to runs.
///
/// # Errors
/// If a log cannot be prepared with these options; the message names file, line, column and remedy.
pub fn prepare<'a>(
    logs: impl IntoIterator<Item = &'a RawLog>,
    selection: &Selection,
    options: &PrepareOptions,
) -> Result<Prepared, LogError> {
    prepare_logs(logs.into_iter().map(Cow::Borrowed).collect(), selection, options)
}

/// Converts logs to runs; the values of logs that are given away are moved.
pub(super) fn prepare_logs(
    mut logs: Vec<Cow<'_, RawLog>>,
    selection: &Selection,
    options: &PrepareOptions,
) -> Result<Prepared, LogError> {
    check(options)?;
    if logs.is_empty() {
        return Err(LogError::NoFiles);
    }
    let mut notes = Vec::new();
    let (resolved, selection) = resolve_all(&logs, selection, options.dt, &mut notes)?;
    let mut files = Vec::with_capacity(logs.len());
    for (log, resolved) in logs.iter_mut().zip(&resolved) {
        let origin = match log {
            Cow::Borrowed(log) => Origin::Borrowed(log),
            Cow::Owned(log) => Origin::Taken(log),
        };
        let mut columns = Columns::new(origin, resolved, &mut notes)?;
        clock::check_order(&columns)?;
        sanity::check(&columns)?;
        if !options.keep_towed {
            towed::cut(&mut columns, resolved.inputs.len(), &mut notes);
        }
        files.push(File::new(columns, options, &mut notes)?);
    }
    let dt = common_step(&files, options, &mut notes);
    let mut runs = Vec::new();
    let mut sources = Vec::new();
    for (i, file) in files.iter_mut().enumerate() {
        let name = logs[i].file_name();
        let unique = logs.iter().filter(|l| l.file_name() == name).count() == 1;
        let name = if unique { name } else { logs[i].path.clone() };
        for run in file.runs(&name, dt, options, &mut notes)? {
            runs.push(run);
            sources.push(i);
        }
    }
    let selection = Selection {
        heading: heading::choose(&selection, &resolved[0], &logs[0], &mut runs, &mut notes),
        parts: Parts::default(),
        ..selection
    };
    let path = if logs.len() == 1 { logs[0].path.clone() } else { format!("the {} logs", logs.len()) };
    if runs.is_empty() {
        let found = files.iter().map(|f| f.columns.rows()).max().unwrap_or(0).min(FEWEST_SAMPLES - 1);
        let remedy = format!(
            "list the gaps with `hydroid inspect`; a longer gap limit ({}) or a shorter input delay keeps more samples",
            key("max_gap")
        );
        return Err(LogError::TooShort { path, found, needed: FEWEST_SAMPLES, remedy });
    }
    note_constants(&path, &runs, &mut notes)?;
    Ok(Prepared { runs, sources, selection, notes })
}

fn check(options: &PrepareOptions) -> Result<(), LogError> {
    for (what, value) in [("a step", options.dt), ("a gap limit", options.max_gap_s)] {
        if let Some(value) = value
            && !(value > 0.0 && value.is_finite())
        {
            let reason = "it must be a positive number of seconds".to_owned();
            return Err(LogError::BadOption { what, value: value.to_string(), reason });
        }
    }
    options.input_delay.check()
}

/// Applies the selection to all logs, with the channels of the first log.
fn resolve_all(
    logs: &[Cow<'_, RawLog>],
    selection: &Selection,
    dt: Option<f64>,
    notes: &mut Vec<Note>,
) -> Result<(Vec<Resolved>, Selection), LogError> {
    let first = Resolved::new(&logs[0], selection, dt, notes)?;
    let column = |s: &resolve::Source| logs[0].columns[s.column].name.clone();
    let mut concrete = selection.clone();
    if concrete.outputs.is_empty() {
        concrete.outputs = first.outputs.iter().map(|s| respec(s, column(s))).collect();
    }
    if concrete.inputs.is_empty() {
        concrete.inputs = first.inputs.iter().map(|s| respec(s, column(s))).collect();
    }
    let mut all = vec![first];
    for log in &logs[1..] {
        let selected = concrete.outputs.iter().chain(concrete.named_inputs(log));
        let wind = concrete.wind.iter().flat_map(|w| [&w.speed, &w.direction]);
        for spec in selected.chain(wind) {
            if resolve::locate(log, spec).is_none() {
                return Err(LogError::DifferentColumns {
                    first: logs[0].path.clone(),
                    second: log.path.clone(),
                    column: spec.column.clone(),
                });
            }
        }
        let other = Resolved::new(log, &concrete, dt, notes)?;
        all[0].agrees(&logs[0], &other, log)?;
        all.push(other);
    }
    if all.iter().any(|r| r.heading.is_none()) {
        for r in &mut all {
            r.heading = None;
        }
    }
    let with_truth = all.iter().filter(|r| r.truth.is_some()).count();
    if with_truth > 0 && with_truth < all.len() {
        notes.push(Note::info(
            "only some of the logs have true values beside the measured ones; they are left out",
        ));
        for r in &mut all {
            r.truth = None;
        }
    }
    Ok((all, concrete))
}

fn respec(source: &resolve::Source, column: String) -> super::selection::ChannelSpec {
    super::selection::ChannelSpec::renamed(source.channel.name.clone(), column)
}

/// The common step of all runs: the given step, else the longest step of the logs.
fn common_step(files: &[File<'_>], options: &PrepareOptions, notes: &mut Vec<Note>) -> f64 {
    if let Some(dt) = options.dt {
        return dt;
    }
    let steps = || files.iter().map(|f| f.clock.step_s);
    let longest = steps().fold(0.0, f64::max);
    let shortest = steps().fold(f64::INFINITY, f64::min);
    if longest - shortest > 1e-3 * longest {
        notes.push(
            Note::warning(format!(
                "the logs have different steps, from {shortest:.4} s to {longest:.4} s; all are resampled to {longest:.4} s"
            ))
            .with_remedy(format!("set the step with {}", key("dt"))),
        );
    }
    longest
}

/// Whether a column has one value in all tables.
pub(crate) fn is_constant<'a>(tables: impl Iterator<Item = &'a Table>, column: usize) -> bool {
    let mut values = tables.flat_map(|table| table.column(column)).filter(|x| !x.is_nan());
    let first = values.next();
    values.all(|x| Some(x) == first)
}

/// Adds notes on constant channels. An error if all outputs are constant.
fn note_constants(path: &str, runs: &[Trajectory], notes: &mut Vec<Note>) -> Result<(), LogError> {
    let constant = |table: fn(&Trajectory) -> &Table, i: usize| is_constant(runs.iter().map(table), i);
    let mut constant_outputs = 0;
    for (i, channel) in runs[0].outputs.channels().iter().enumerate() {
        if constant(|r| &r.outputs, i) {
            constant_outputs += 1;
            notes.push(Note::warning(format!("the output `{}` is constant", channel.name)).with_remedy(
                format!(
                    "a constant output cannot be identified: remove it from {} or check the sensor",
                    key("outputs")
                ),
            ));
        }
    }
    if constant_outputs == runs[0].outputs.width() {
        return Err(LogError::NothingMoves { path: path.to_owned() });
    }
    for (i, channel) in runs[0].inputs.channels().iter().enumerate() {
        if constant(|r| &r.inputs, i) {
            notes.push(Note::warning(format!("the input `{}` is constant", channel.name)).with_remedy(format!(
                "its effect cannot be identified from these logs: remove it from {} or record a log in which it varies",
                key("inputs")
            )));
        }
    }
    Ok(())
}
