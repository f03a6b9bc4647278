//! Preparation of logs: conversion to runs on a regular clock.
//!
//! For each file: select columns, convert units, reject impossible values, remove towed ends, estimate the clock, split
//! at jumps in time, resample parts with an irregular clock, hold and shift the commands, and cut where an output is
//! missing for longer than the gap limit. A [`Note`] reports each change.

use super::align::{CommandTiming, InputDelay};
use super::clock::{self, Clock};
use super::columns::Columns;
use super::csv::RawLog;
use super::error::LogError;
use super::gaps;
use super::grid::Grid;
use super::heading;
use super::note::{Note, count};
use super::resample::Resampling;
use super::resolve::{self, Resolved};
use super::sanity;
use super::selection::Selection;
use super::towed;
use super::trajectory::{Channel, Table, Trajectory};

pub(crate) const FEWEST_SAMPLES: usize = 3;

/// Longest usual step \[s\] of a clock without a unit.
const LONGEST_UNSTATED_S: f64 = 30.0;

/// A step below this share of the step of the log causes a warning.
const FINER: f64 = 0.99;
/// A step below this share of the step of the log (one half, with a margin for rounding) is an error.
const FINEST: f64 = 0.4999;

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
    /// Whether to keep towed ends: all commands are zero for 20 s or longer while the speed of the vessel grows.
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
pub fn prepare(
    logs: &[RawLog],
    selection: &Selection,
    options: &PrepareOptions,
) -> Result<Prepared, LogError> {
    check(options)?;
    let first = logs.first().ok_or(LogError::NoFiles)?;
    let mut notes = Vec::new();
    let (resolved, selection) = resolve_all(logs, selection, options.dt, &mut notes)?;
    let mut files = Vec::with_capacity(logs.len());
    for (log, resolved) in logs.iter().zip(&resolved) {
        let mut columns = Columns::new(log, resolved, &mut notes)?;
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
    for (i, file) in files.iter().enumerate() {
        let name = logs[i].file_name();
        let unique = logs.iter().filter(|l| l.file_name() == name).count() == 1;
        let name = if unique { name } else { logs[i].path.clone() };
        for run in file.runs(&name, dt, options, &mut notes)? {
            runs.push(run);
            sources.push(i);
        }
    }
    let selection = Selection {
        heading: heading::choose(&selection, &resolved[0], logs, &mut runs, &mut notes),
        ..selection
    };
    let path = if logs.len() == 1 { first.path.clone() } else { format!("the {} logs", logs.len()) };
    if runs.is_empty() {
        let found = files.iter().map(|f| f.columns.rows()).max().unwrap_or(0).min(FEWEST_SAMPLES - 1);
        let remedy = "list the gaps with `hydroid inspect`; a longer gap limit (--max-gap) or a shorter input delay keeps more samples";
        return Err(LogError::TooShort { path, found, needed: FEWEST_SAMPLES, remedy: remedy.to_owned() });
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
    logs: &[RawLog],
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
        let selected = concrete.outputs.iter().chain(&concrete.inputs);
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

struct File {
    columns: Columns,
    clock: Clock,
    max_gap_s: f64,
}

impl File {
    fn new(columns: Columns, options: &PrepareOptions, notes: &mut Vec<Note>) -> Result<Self, LogError> {
        let too_short = |columns: &Columns| LogError::TooShort {
            path: columns.path.clone(),
            found: columns.rows(),
            needed: FEWEST_SAMPLES,
            remedy: "record for longer".to_owned(),
        };
        if columns.rows() < FEWEST_SAMPLES {
            return Err(too_short(&columns));
        }
        let usual = Clock::usual_step(&columns.t).ok_or_else(|| too_short(&columns))?;
        if let Some(column) = columns.unstated.clone().filter(|_| usual > LONGEST_UNSTATED_S) {
            return Err(LogError::SlowClock { path: columns.path.clone(), column, step: usual });
        }
        let default_s = gaps::default_limit(&columns, usual, options.dt, notes);
        let max_gap_s = options.max_gap_s.unwrap_or(default_s);
        let clock = Clock::of(&columns.t, max_gap_s).ok_or_else(|| too_short(&columns))?;
        check_step(&columns, &clock, options)?;
        Ok(Self { columns, clock, max_gap_s })
    }

    /// The usable parts between jumps in time, with step `dt`.
    fn runs(
        &self,
        name: &str,
        dt: f64,
        options: &PrepareOptions,
        notes: &mut Vec<Note>,
    ) -> Result<Vec<Trajectory>, LogError> {
        let path = &self.columns.path;
        let native = self.clock.regular && (dt - self.clock.step_s).abs() <= 1e-3 * dt;
        let resampling = Resampling {
            dt,
            step: self.clock.step_s,
            max_gap_s: self.max_gap_s,
            timing: options.command_timing,
            delay: options.input_delay,
        };
        self.note_resampling(native, dt, notes);
        self.note_finer(dt, notes);
        let parts = self.parts(notes);
        let mut found: Vec<(Grid, Vec<(usize, usize)>)> = Vec::new();
        let mut held = vec![0; self.columns.inputs.len()];
        let (mut front, mut back, mut absent, mut short) = (0, 0, 0, 0);
        for part in parts {
            if part.1 - part.0 < FEWEST_SAMPLES {
                short += part.1 - part.0;
                continue;
            }
            let mut grid = if native {
                Grid::native(&self.columns, part, dt, options.command_timing, options.input_delay)?
            } else {
                resampling.run(&self.columns, part)?
            };
            for (sum, n) in held.iter_mut().zip(&grid.held) {
                *sum += n;
            }
            absent += grid.absent;
            let dropped = grid.drop_without_command();
            front += dropped.0;
            back += dropped.1;
            let mut usable = gaps::usable(&grid.outputs, grid.rows, dt, self.max_gap_s);
            let before: usize = usable.iter().map(|p| p.1 - p.0).sum();
            usable.retain(|p| p.1 - p.0 >= FEWEST_SAMPLES);
            short += before - usable.iter().map(|p| p.1 - p.0).sum::<usize>();
            note_cuts(path, &grid, &usable, notes);
            found.push((grid, usable));
        }
        for (channel, n) in self.columns.input_channels.iter().zip(&held) {
            if *n > 0 {
                let cells = count(*n, "blank cell");
                notes.push(Note::info(format!(
                    "{path}: {cells} of the command `{}` hold the previous value",
                    channel.name
                )));
            }
        }
        let mut add_note = |n: usize, what: &str| {
            if n > 0 {
                notes.push(Note::info(format!("{path}: {} {what}", count(n, "sample"))));
            }
        };
        add_note(absent, "without a row in the log count as missing measurements");
        add_note(front, "dropped at the beginning, before the first command is known");
        add_note(back, "dropped at the end, where the shifted command is unknown");
        add_note(short, "dropped in pieces of fewer than 3 samples");
        let single = found.len() == 1 && found[0].1.len() == 1;
        let runs: Vec<Trajectory> = found
            .iter()
            .flat_map(|(grid, usable)| usable.iter().map(|part| self.run(name, grid, *part, single)))
            .collect();
        self.note_missing(&runs, notes);
        Ok(runs)
    }

    fn run(&self, name: &str, grid: &Grid, (from, to): (usize, usize), single: bool) -> Trajectory {
        let t0 = grid.t0 + from as f64 * grid.dt;
        let name = if single {
            name.to_owned()
        } else {
            format!("{name} ({t0:.1} s to {:.1} s)", t0 + (to - from - 1) as f64 * grid.dt)
        };
        let table = |channels: &[Channel], values: &[Vec<f64>]| {
            let mut flat = vec![0.0; (to - from) * values.len()];
            for (c, column) in values.iter().enumerate() {
                for (cell, x) in flat[c..].iter_mut().step_by(values.len()).zip(&column[from..to]) {
                    *cell = *x;
                }
            }
            Table::new(channels.to_vec(), flat)
        };
        Trajectory {
            name,
            t0,
            dt: grid.dt,
            outputs: table(&self.columns.output_channels, &grid.outputs),
            inputs: table(&self.columns.input_channels, &grid.inputs),
            truth: grid.truth.as_ref().map(|t| table(&self.columns.output_channels, t)),
            heading: grid.heading.as_ref().map(|heading| heading[from..to].to_vec()),
        }
    }

    /// Splits rows at jumps in time longer than the gap limit.
    fn parts(&self, notes: &mut Vec<Note>) -> Vec<(usize, usize)> {
        let t = &self.columns.t;
        let jumps: Vec<usize> = (1..t.len()).filter(|&k| t[k] - t[k - 1] > self.max_gap_s).collect();
        if let Some(&k) = jumps.first() {
            let longest = jumps.iter().map(|&k| t[k] - t[k - 1]).fold(0.0, f64::max);
            notes.push(Note::warning(format!(
                "{}: split at {} in time longer than {:.3} s (the first before line {}, the longest {longest:.3} s)",
                self.columns.path,
                count(jumps.len(), "jump"),
                self.max_gap_s,
                self.columns.lines[k],
            )));
        }
        let starts = std::iter::once(0).chain(jumps.iter().copied());
        starts.zip(jumps.iter().copied().chain([t.len()])).collect()
    }

    fn note_resampling(&self, native: bool, dt: f64, notes: &mut Vec<Note>) {
        let Clock { step_s, shortest_s, longest_s, regular } = self.clock;
        let path = &self.columns.path;
        if !regular {
            notes.push(
                Note::warning(format!(
                    "{path}: the clock is irregular (steps of {shortest_s:.4} s to {longest_s:.4} s, usually {step_s:.4} s); \
                     resampled to {dt:.4} s with interpolated measurements"
                ))
                .with_remedy("record the time of each measurement; set the step with --dt"),
            );
        } else if !native {
            notes.push(Note::info(format!("{path}: resampled from {step_s} s to {dt} s")));
        }
    }

    /// Warns of a step below the step of the log: interpolated samples depend on later measurements.
    fn note_finer(&self, dt: f64, notes: &mut Vec<Note>) {
        let (path, step) = (&self.columns.path, self.clock.step_s);
        if dt < FINER * step {
            notes.push(
                Note::warning(format!(
                    "{path}: the step of {dt} s is shorter than the step of the log ({step} s): values between samples are interpolated with the next measurement, \
                     and errors of predictions over less than {step} s are underestimated"
                ))
                .with_remedy(format!("set --dt to {step} or more, or evaluate only horizons of {step} s or longer")),
            );
        }
    }

    fn note_missing(&self, runs: &[Trajectory], notes: &mut Vec<Note>) {
        for (i, channel) in self.columns.output_channels.iter().enumerate() {
            let missing: usize =
                runs.iter().map(|r| r.outputs.column(i).filter(|x| x.is_nan()).count()).sum();
            if missing > 0 {
                let all: usize = runs.iter().map(Trajectory::len).sum();
                notes.push(Note::info(format!(
                    "{}: `{}` is missing in {missing} of {all} samples; missing values are not filled in",
                    self.columns.path, channel.name
                )));
            }
        }
    }
}

/// Rejects a step for which most samples would be interpolated.
fn check_step(columns: &Columns, clock: &Clock, options: &PrepareOptions) -> Result<(), LogError> {
    let step = clock.step_s;
    match options.dt {
        Some(dt) if dt < FINEST * step => Err(LogError::BadOption {
            what: "a step",
            value: format!("{dt} s"),
            reason: format!(
                "{} has a sample every {step} s, and most of the samples would only be interpolated between measurements; \
                 leave --dt out or give {} at least",
                columns.path,
                0.5 * step
            ),
        }),
        _ => Ok(()),
    }
}

/// Number of cuts of one part with a note of their own.
const SHOWN_CUTS: usize = 5;

/// Adds notes on the cuts between and around the usable parts.
fn note_cuts(path: &str, grid: &Grid, usable: &[(usize, usize)], notes: &mut Vec<Note>) {
    let time = |k: usize| grid.t0 + k as f64 * grid.dt;
    let mut note_cut = |from: usize, to: usize, place: &str| {
        if from < to {
            notes.push(Note::warning(format!(
                "{path}: {} {place} cut out, {:.2} s to {:.2} s: an output is missing there",
                count(to - from, "sample"),
                time(from),
                time(to - 1),
            )));
        }
    };
    let (Some(first), Some(last)) = (usable.first(), usable.last()) else {
        note_cut(0, grid.rows, "");
        return;
    };
    note_cut(0, first.0, "at the beginning");
    for pair in usable.windows(2).take(SHOWN_CUTS) {
        note_cut(pair[0].1, pair[1].0, "in the middle");
    }
    if usable.len() > SHOWN_CUTS + 1 {
        let (from, to) = (usable[SHOWN_CUTS].1, last.0);
        note_cut(from, to, &format!("in further cuts ({} in total)", count(usable.len() - 1, "cut")));
    }
    note_cut(last.1, grid.rows, "at the end");
}

/// The common step of all runs: the given step, else the longest step of the logs.
fn common_step(files: &[File], options: &PrepareOptions, notes: &mut Vec<Note>) -> f64 {
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
            .with_remedy("set the step with --dt"),
        );
    }
    longest
}

/// Adds notes on constant channels. An error if all outputs are constant.
fn note_constants(path: &str, runs: &[Trajectory], notes: &mut Vec<Note>) -> Result<(), LogError> {
    let constant = |table: fn(&Trajectory) -> &Table, i: usize| {
        let mut values = runs.iter().flat_map(|r| table(r).column(i)).filter(|x| !x.is_nan());
        let first = values.next();
        values.all(|x| Some(x) == first)
    };
    let mut constant_outputs = 0;
    for (i, channel) in runs[0].outputs.channels().iter().enumerate() {
        if constant(|r| &r.outputs, i) {
            constant_outputs += 1;
            notes.push(Note::warning(format!("the output `{}` is constant", channel.name)).with_remedy(
                "a constant output cannot be identified: remove it from --outputs or check the sensor",
            ));
        }
    }
    if constant_outputs == runs[0].outputs.width() {
        return Err(LogError::NothingMoves { path: path.to_owned() });
    }
    for (i, channel) in runs[0].inputs.channels().iter().enumerate() {
        if constant(|r| &r.inputs, i) {
            notes.push(Note::warning(format!("the input `{}` is constant", channel.name)).with_remedy(
                "its effect cannot be identified from these logs: remove it from --inputs or record a log in which it varies",
            ));
        }
    }
    Ok(())
}
