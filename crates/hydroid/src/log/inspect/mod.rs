//! Inspection of a log: content and defects, as data.
//!
//! The inspection does not modify the log and prints nothing. [`Inspection::notes`] lists defects with remedies.

mod delay;
mod excitation;
mod lags;
mod neutral;
mod noise;
mod plausible;
mod pose;
mod stats;

pub use delay::{Confidence, DelayEstimate};
pub use excitation::InputReport;
pub use noise::{NoiseReport, noise_level};
pub(super) use pose::{heading, position};
pub use stats::{ColumnReport, Disagreement};

use std::borrow::Cow;

use hydroid_io::LogFile;

use rayon::prelude::*;

use super::clock::Clock;
use super::columns::{Columns, Origin};
use super::csv::{self, Plan, RawLog};
use super::error::LogError;
use super::note::Note;
use super::prepare::{PrepareOptions, prepare_logs};
use super::resolve::{self, Resolved};
use super::selection::{ChannelSpec, Selection};
use super::trajectory::Trajectory;
use crate::key::key;

/// Share of repeated samples above which a note is added.
const MANY_REPEATS: f64 = 0.15;

/// Result of the inspection of a log.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Inspection {
    /// The file.
    pub path: String,
    /// Rows below the header.
    pub rows: usize,
    /// Time from the first row to the last \[s\], where there is a time column.
    pub duration_s: Option<f64>,
    /// The clock, if time increases.
    pub clock: Option<Clock>,
    /// Jumps in time longer than the gap limit: time \[s\] before each, and its length \[s\].
    pub jumps: Vec<(f64, f64)>,
    /// All columns of the file.
    pub columns: Vec<ColumnReport>,
    /// Outputs and their noise.
    pub outputs: Vec<NoiseReport>,
    /// Inputs and their excitation.
    pub inputs: Vec<InputReport>,
    /// Share of rows that repeat the previous row in all outputs with repetitions.
    pub repeated_rows: f64,
    /// Common delay of the commands that remains after the shift by the options.
    pub input_delay: Option<DelayEstimate>,
    /// Pairs of columns that should agree and do not.
    pub disagreements: Vec<Disagreement>,
    /// Notes of the preparation and defects of the log, with remedies.
    pub notes: Vec<Note>,
}

/// Inspects a log prepared with these options. Defects that the options correct (command timing, input delay, a slow
/// sensor) are not reported, and delays are the remaining ones. If outputs or inputs are neither selected nor
/// recognized by name, the report omits them with a note. If the preparation fails, the report is partial and contains
/// the error.
///
/// # Errors
/// If the selection names a column that does not exist or has an invalid specification.
pub fn inspect(
    log: &RawLog,
    selection: &Selection,
    options: &PrepareOptions,
) -> Result<Inspection, LogError> {
    Ok(inspect_log(Cow::Borrowed(log), selection, options)?.0)
}

/// Reads and inspects a log as [`inspect()`], in less memory: of columns that are not selected, only statistics are
/// kept. The runs of the log are the second result, without true values; there are none if the preparation fails.
///
/// # Errors
/// As [`read`](super::read) and [`inspect()`].
pub fn inspect_file(
    source: impl Into<LogFile>,
    selection: &Selection,
    options: &PrepareOptions,
) -> Result<(Inspection, Vec<Trajectory>), LogError> {
    let source = source.into();
    if selection.parts.is_all() {
        let log = csv::read_planned(&source, |header| plan(header, selection, options))?;
        return inspect_log(Cow::Owned(log), selection, options);
    }
    let mut log = csv::read(source)?;
    let mut notes = Vec::new();
    super::keep_parts(&mut log, selection, options.dt, &mut notes)?;
    let (mut inspection, runs) = inspect_log(Cow::Owned(log), selection, options)?;
    inspection.notes.splice(0..0, notes);
    Ok((inspection, runs))
}

/// Inspects a log as [`inspect_file`].
///
/// # Errors
/// As [`inspect()`].
pub fn inspect_owned(
    log: RawLog,
    selection: &Selection,
    options: &PrepareOptions,
) -> Result<(Inspection, Vec<Trajectory>), LogError> {
    inspect_log(Cow::Owned(log), selection, options)
}

/// The columns whose values an inspection needs. They are known by their names: all columns are kept if the selection
/// cannot be applied to the header alone.
fn plan(header: &RawLog, selection: &Selection, options: &PrepareOptions) -> Option<Plan> {
    let mut unused = Vec::new();
    let resolved = match Resolved::new(header, selection, options.dt, &mut unused) {
        Err(LogError::NoInputs { .. }) => {
            let inputs = vec![stand_in(header, selection).ok()?];
            let selection = Selection { inputs, ..selection.clone() };
            Resolved::new(header, &selection, options.dt, &mut unused).ok()?
        }
        resolved => resolved.ok()?,
    };
    let mut keep = vec![false; header.columns.len()];
    let needed = Resolved { truth: None, ..resolved };
    needed.sources().for_each(|source| keep[source.column] = true);
    pose::candidates(header).for_each(|column| keep[column] = true);
    // A guess of the time may be replaced after all.
    for (column, keep) in header.columns.iter().zip(&mut keep) {
        *keep |= resolve::time_name(&column.name).is_some();
    }
    Some(Plan { keep, pairs: stats::comparable(header) })
}

/// An output in place of an input, so that the clock and the outputs of a log without inputs can be inspected.
fn stand_in(log: &RawLog, selection: &Selection) -> Result<ChannelSpec, LogError> {
    let mut stand_in = resolve::outputs_or_default(log, selection)?.swap_remove(0);
    stand_in.name.push_str(" (no input)");
    Ok(stand_in)
}

fn inspect_log(
    log: Cow<'_, RawLog>,
    selection: &Selection,
    options: &PrepareOptions,
) -> Result<(Inspection, Vec<Trajectory>), LogError> {
    let mut inspection = Inspection {
        path: log.path.clone(),
        rows: log.rows(),
        duration_s: None,
        clock: None,
        jumps: Vec::new(),
        columns: log.columns.par_iter().map(ColumnReport::of).collect(),
        outputs: Vec::new(),
        inputs: Vec::new(),
        repeated_rows: 0.0,
        input_delay: None,
        disagreements: stats::disagreements(&log),
        notes: Vec::new(),
    };
    let mut guessed = Vec::new();
    let mut selection = selection.clone();
    if let Err(e) = resolve::outputs_or_default(&log, &selection) {
        inspection.notes.push(Note::warning(e.to_string()));
        if let Err(e @ LogError::NoTime { .. }) = resolve::time(&log, &selection, options.dt, &mut Vec::new())
        {
            inspection.notes.push(Note::warning(e.to_string()));
        }
        disagree(&mut inspection);
        return Ok((inspection, Vec::new()));
    }
    let mut resolved = Resolved::new(&log, &selection, options.dt, &mut guessed);
    let mut without_inputs = false;
    if let Err(e @ LogError::NoInputs { .. }) = &resolved {
        inspection.notes.push(Note::warning(e.to_string()));
        without_inputs = true;
        selection.inputs = vec![stand_in(&log, &selection)?];
        guessed.clear();
        resolved = Resolved::new(&log, &selection, options.dt, &mut guessed);
    }
    let resolved = match resolved {
        Ok(resolved) => resolved,
        Err(e @ LogError::NoTime { .. }) => {
            inspection.notes.push(Note::warning(e.to_string()));
            disagree(&mut inspection);
            return Ok((inspection, Vec::new()));
        }
        Err(e) => return Err(e),
    };
    let mut runs = inspect_runs(&mut inspection, log, &selection, options, &resolved);
    if without_inputs {
        let own = |n: &Note| !n.message.contains("(no input)");
        inspection.notes.retain(own);
        inspection.inputs.clear();
        inspection.input_delay = None;
        runs.clear();
    }
    disagree(&mut inspection);
    Ok((inspection, runs))
}

/// The part of the report that requires time, outputs and inputs.
fn inspect_runs(
    inspection: &mut Inspection,
    log: Cow<'_, RawLog>,
    selection: &Selection,
    options: &PrepareOptions,
    resolved: &Resolved,
) -> Vec<Trajectory> {
    // Everything that needs the log comes before the preparation, which may consume it.
    let path = log.path.clone();
    let (mut of_pose, mut of_neutral) = (Vec::new(), Vec::new());
    let of_time = || {
        // Without the true values and the heading, which are not needed here.
        let channels = Resolved { truth: None, heading: None, position: None, ..resolved.clone() };
        if let Ok(columns) = Columns::new(Origin::Borrowed(&log), &channels, &mut Vec::new()) {
            clock_report(inspection, &columns, options);
            repeats(inspection, &columns);
        }
    };
    let of_channels = || {
        neutral::check(&log, resolved, selection, &mut of_neutral);
        pose::check(&log, resolved, selection, options, &mut of_pose)
    };
    let ((), compared) = rayon::join(of_time, of_channels);
    let prepared = match prepare_logs(vec![log], selection, options) {
        Ok(prepared) => prepared,
        Err(error) => {
            inspection.notes.push(Note::warning(error.to_string()));
            // A wrong unit may be the reason.
            inspection.notes.extend(of_pose);
            return Vec::new();
        }
    };
    inspection.notes.extend(prepared.notes);
    inspection.notes.extend(of_pose);
    plausible::check(&path, &prepared.runs, compared, &mut inspection.notes);
    let repeated = inspection.repeated_rows;
    let mut of_noise = Vec::new();
    inspection.outputs = noise::reports(&prepared.runs, repeated, &mut of_noise);
    // Velocities that are computed from sensors are smooth.
    if selection.sensors.is_none() {
        inspection.notes.extend(of_noise);
    }
    inspection.inputs = excitation::reports(&prepared.runs, &mut inspection.notes);
    inspection.notes.extend(of_neutral);
    let noisy = inspection.outputs.iter().any(|o| o.mostly_noise) || repeated > MANY_REPEATS;
    let delays = delay::estimate(&prepared.runs, noisy);
    for (report, own) in inspection.inputs.iter_mut().zip(delays.per_input) {
        // The delay of an input that hardly moves cannot be estimated.
        report.delay = own.filter(|_| report.moves_per_minute >= excitation::FEW_MOVES);
    }
    inspection.input_delay = delays.common;
    if let Some(d) = &inspection.input_delay {
        let own: Vec<_> =
            inspection.inputs.iter().filter_map(|i| Some((i.name.as_str(), i.delay.as_ref()?))).collect();
        let step_s = inspection.clock.map_or(prepared.runs[0].dt, |c| c.step_s);
        inspection.notes.extend(d.note(&path, &own, &delay::Applied { options, step_s }));
    }
    prepared.runs
}

fn clock_report(inspection: &mut Inspection, columns: &Columns<'_>, options: &PrepareOptions) {
    let t = &columns.t;
    if let (Some(first), Some(last)) = (t.first(), t.last()) {
        inspection.duration_s = Some(last - first);
    }
    if super::clock::check_order(columns).is_err() {
        return;
    }
    let Some(step) = Clock::usual_step(t) else { return };
    let default_s = super::gaps::default_limit(columns, step, None, &mut Vec::new());
    let limit = options.max_gap_s.unwrap_or(default_s);
    inspection.clock = Some(Clock::with_usual_step(t, step, limit));
    inspection.jumps = t.windows(2).filter(|p| p[1] - p[0] > limit).map(|p| (p[0], p[1] - p[0])).collect();
}

/// First and last row of the longest part in which a condition holds of each row but the first.
fn longest_block(rows: usize, holds: impl Fn(usize) -> bool) -> Option<[usize; 2]> {
    let (mut longest, mut from) = (None, 0);
    for k in 1..=rows {
        if k < rows && holds(k) {
            continue;
        }
        if longest.is_none_or(|[a, b]: [usize; 2]| k - 1 - from > b - a) && k - 1 > from {
            longest = Some([from, k - 1]);
        }
        from = k;
    }
    longest
}

/// A sensor slower than the log repeats its samples: the output is constant between steps, all along the log. Repeats of which more
/// than half are in one part are those of a sensor that is stuck.
fn repeats(inspection: &mut Inspection, columns: &Columns<'_>) {
    let repeating: Vec<&[f64]> = columns
        .outputs
        .iter()
        .map(|values| &values[..])
        .filter(|values| {
            let repeated = values.windows(2).filter(|p| p[0] == p[1]).count();
            repeated as f64 > 0.02 * values.len() as f64
        })
        .collect();
    let rows = columns.rows();
    if repeating.is_empty() || rows < 2 {
        return;
    }
    let repeats = |k: usize| repeating.iter().all(|v| v[k] == v[k - 1]);
    let repeated = (1..rows).filter(|&k| repeats(k)).count();
    let share = repeated as f64 / (rows - 1) as f64;
    inspection.repeated_rows = share;
    // A vessel at rest repeats zeros.
    let is_stuck = |[from, to]: &[usize; 2]| {
        2 * (to - from) > repeated && share > MANY_REPEATS && repeating.iter().any(|v| v[*from] != 0.0)
    };
    if let Some([from, to]) = longest_block(rows, repeats).filter(is_stuck) {
        let [from_s, to_s] = [from, to].map(|k| columns.t[k] - columns.t[0]);
        inspection.notes.push(
            Note::warning(format!(
                "{}: the rows from {from_s:.1} to {to_s:.1} s repeat one measurement: a sensor is stuck",
                columns.path
            ))
            .with_remedy(format!(
                "leave them out with {}",
                key("exclude").is(format_args!("{from_s:.1}:{to_s:.1}"))
            )),
        );
        return;
    }
    if share > MANY_REPEATS && share < 0.98 {
        let step = inspection.clock.map_or(1.0, |c| c.step_s) / (1.0 - share);
        inspection.notes.push(
            Note::warning(format!(
                "{}: {:.0} % of the rows repeat the measurement of the previous row: the sensor is slower than the log",
                columns.path,
                100.0 * share
            ))
            .with_remedy(format!(
                "resample to the sensor's rate, about {}, or blank the repeated cells",
                key("dt").is(format_args!("{step:.2}"))
            )),
        );
    }
}

fn disagree(inspection: &mut Inspection) {
    for d in &inspection.disagreements {
        let (what, correlation) = (d.quantity, d.correlation);
        inspection.notes.push(
            Note::warning(format!(
                "{}: `{}` and `{}` should both show the {what}, but their correlation is {correlation:.2}: the {what} is unreliable",
                inspection.path, d.first, d.second
            ))
            .with_remedy(format!("do not identify the {what} from this log: remove it from {}", key("outputs"))),
        );
    }
}
