//! Application of a selection to a log: positions, units and factors of the columns.

use std::borrow::Cow;
use std::path::Path;

use super::csv::{RawColumn, RawLog};
use super::error::LogError;
use super::note::Note;
use super::same;
use super::selection::{ChannelSpec, Selection, Wind};
use super::trajectory::Channel;
use super::units::{self, Quantity, Unit, UnitError};
use crate::key::key;

/// A column of a log as a channel.
#[derive(Clone, Debug)]
pub struct Source {
    /// Position of the column.
    pub column: usize,
    /// SI value = (value in the log - offset) times this.
    factor: f64,
    /// Value in the log at which the channel is zero.
    offset: f64,
    /// Factor given by the user.
    scale: f64,
    /// Name and SI unit.
    pub channel: Channel,
}

impl Source {
    /// A column in a unit, as a channel with the name of the column.
    pub(crate) fn of(column: usize, name: &str, unit: &Unit) -> Self {
        let channel = Channel::new(name, unit.si.clone());
        Self { column, factor: unit.factor, offset: 0.0, scale: 1.0, channel }
    }

    /// A column as a length \[m\]: a factor times the difference from a value.
    pub(crate) fn metres(column: usize, name: &str, factor: f64, offset: f64) -> Self {
        Self { column, factor, offset, scale: 1.0, channel: Channel::new(name, "m") }
    }

    /// The SI value of a value in the log.
    pub fn si(&self, value: f64) -> f64 {
        (value - self.offset) * self.factor
    }

    /// The value in the log of an SI value.
    pub fn raw(&self, si: f64) -> f64 {
        si / self.factor + self.offset
    }

    /// Whether the values of the log are the SI values.
    pub(crate) fn is_identity(&self) -> bool {
        self.factor == 1.0 && self.offset == 0.0
    }

    /// Whether the channel is zero at another value of the log than 0.
    pub(crate) fn has_offset(&self) -> bool {
        self.offset != 0.0
    }

    /// SI value of the unit of the column, 1 without a unit.
    pub(crate) fn unit_factor(&self) -> f64 {
        self.factor / self.scale
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Time,
    Output,
    Input,
}

/// Source of the times of a log.
#[derive(Clone, Debug)]
pub enum Time {
    /// A column, and whether its unit is stated.
    Column {
        /// The column.
        source: Source,
        /// Whether its unit is stated.
        stated: bool,
    },
    /// No column: rows a step \[s\] apart.
    Even(f64),
}

/// A selection applied to one log.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// Origin of the times.
    pub time: Time,
    /// The outputs.
    pub outputs: Vec<Source>,
    /// The inputs without the wind.
    pub inputs: Vec<Source>,
    /// Speed and direction.
    pub wind: Option<[Source; 2]>,
    /// For every output its column `<source>_true`, where all of them exist.
    pub truth: Option<Vec<Source>>,
    /// The heading, if there is one, and whether the selection names it.
    pub heading: Option<(Source, bool)>,
    /// Two axes of the only position of the log beside the channels.
    pub position: Option<[Source; 2]>,
}

impl Resolved {
    /// Applies a selection to a log, with notes on guesses and conversions. `dt` is the step of a log without time.
    ///
    /// # Errors
    /// If a channel, a unit or the clock cannot be resolved.
    pub fn new(
        log: &RawLog,
        selection: &Selection,
        dt: Option<f64>,
        notes: &mut Vec<Note>,
    ) -> Result<Self, LogError> {
        let time = time(log, selection, dt, notes)?;
        let outputs = sources(log, &outputs_or_default(log, selection)?, Role::Output, notes)?;
        let wind = selection.wind.as_ref().map(|w| wind_sources(log, w, notes)).transpose()?;
        let inputs = match inputs_or_default(log, selection, &outputs) {
            Ok(specs) => sources(log, &specs, Role::Input, notes)?,
            Err(_) if wind.is_some() => Vec::new(),
            Err(e) => return Err(e),
        };
        let truth = truth(log, &outputs)?;
        let mut resolved = Self { time, outputs, inputs, wind, truth, heading: None, position: None };
        resolved.position = super::inspect::position(log, &resolved);
        resolved.heading = heading(log, selection, &resolved, notes)?;
        if selection.inputs.is_empty() {
            notes.extend(unused(log, &resolved));
        }
        let mut names: Vec<String> = resolved.output_channels().into_iter().map(|c| c.name).collect();
        names.extend(resolved.input_channels().into_iter().map(|c| c.name));
        for (i, name) in names.iter().enumerate() {
            if names[..i].contains(name) {
                return Err(LogError::RepeatedChannel { name: name.clone() });
            }
        }
        Ok(resolved)
    }

    /// The sources of all values, with that of the time.
    pub(crate) fn sources(&self) -> impl Iterator<Item = &Source> {
        let time = match &self.time {
            Time::Column { source, .. } => Some(source),
            Time::Even(_) => None,
        };
        let channels = self.outputs.iter().chain(&self.inputs).chain(self.wind.iter().flatten());
        let heading = self.heading.iter().map(|(source, _)| source);
        let pose = heading.chain(self.position.iter().flatten());
        time.into_iter().chain(channels).chain(self.truth.iter().flatten()).chain(pose)
    }

    /// The outputs.
    pub fn output_channels(&self) -> Vec<Channel> {
        self.outputs.iter().map(|s| s.channel.clone()).collect()
    }

    /// The inputs, wind last.
    pub fn input_channels(&self) -> Vec<Channel> {
        let wind = ["wind_x", "wind_y"].map(|n| Channel::new(n, "m^2/s^2"));
        let wind = if self.wind.is_some() { &wind[..] } else { &[] };
        self.inputs.iter().map(|s| s.channel.clone()).chain(wind.iter().cloned()).collect()
    }

    /// Checks that another log has the same channels in the same units.
    pub(crate) fn agrees(&self, first: &RawLog, other: &Self, second: &RawLog) -> Result<(), LogError> {
        let here = self.outputs.iter().chain(&self.inputs);
        for (a, b) in here.zip(other.outputs.iter().chain(&other.inputs)) {
            if a.channel.unit != b.channel.unit {
                let unit = |u: &str| if u.is_empty() { "no stated unit".to_owned() } else { u.to_owned() };
                return Err(LogError::DifferentUnits {
                    column: first.columns[a.column].name.clone(),
                    first: first.path.clone(),
                    second: second.path.clone(),
                    units: format!("{} and {}", unit(&a.channel.unit), unit(&b.channel.unit)),
                });
            }
        }
        Ok(())
    }
}

/// Selected outputs, or `u`, `v`, `r` as far as they exist.
pub(crate) fn outputs_or_default(log: &RawLog, selection: &Selection) -> Result<Vec<ChannelSpec>, LogError> {
    if !selection.outputs.is_empty() {
        return Ok(selection.outputs.clone());
    }
    let found: Vec<ChannelSpec> = ["u", "v", "r"]
        .into_iter()
        .filter(|name| find(log, name).is_some())
        .map(ChannelSpec::named)
        .collect();
    if found.is_empty() {
        return Err(LogError::NoOutputs { path: log.path.clone(), columns: all_names(log) });
    }
    Ok(found)
}

/// Selected inputs, or all columns with names of commands.
fn inputs_or_default(
    log: &RawLog,
    selection: &Selection,
    outputs: &[Source],
) -> Result<Vec<ChannelSpec>, LogError> {
    if selection.has_no_inputs(log) {
        return Ok(Vec::new());
    }
    if !selection.inputs.is_empty() {
        return Ok(selection.inputs.clone());
    }
    let found: Vec<ChannelSpec> = log
        .columns
        .iter()
        .enumerate()
        .filter(|(i, c)| is_command_name(&c.name) && !outputs.iter().any(|o| o.column == *i))
        .map(|(_, c)| ChannelSpec::named(&c.name))
        .collect();
    if found.is_empty() {
        return Err(LogError::NoInputs { path: log.path.clone(), columns: all_names(log) });
    }
    Ok(found)
}

/// The columns that are not read, where the inputs are guessed by their names: a command of another name may be among
/// them. Constant columns, texts, a pose, and true values of a simulation are none.
fn unused(log: &RawLog, resolved: &Resolved) -> Option<Note> {
    let heading = resolved.heading.iter().map(|(source, _)| source);
    let sources = resolved.outputs.iter().chain(&resolved.inputs).chain(resolved.wind.iter().flatten());
    let used: Vec<usize> = sources.chain(heading).map(|source| source.column).collect();
    let time = match &resolved.time {
        Time::Column { source, .. } => Some(source.column),
        Time::Even(_) => None,
    };
    let pose: Vec<usize> = ["x", "y", "psi"].iter().filter_map(|name| find(log, name)).collect();
    let unused = log.columns.iter().enumerate().filter(|(i, column)| {
        let varies = column.bad.is_none() && only_value(column).is_none();
        !used.contains(i) && time != Some(*i) && varies && !pose.contains(i) && !column.name.contains("_true")
    });
    let names: Vec<&str> = unused.map(|(_, column)| column.name.as_str()).collect();
    let inputs: Vec<&str> = resolved.inputs.iter().map(|source| source.channel.name.as_str()).collect();
    (!names.is_empty()).then(|| {
        let message = format!(
            "{}: the inputs are {}, by their names; not used: {}",
            log.path,
            inputs.join(", "),
            names.join(", ")
        );
        Note::info(message)
            .with_remedy(format!("if one of them is a command, name all inputs with {}", key("inputs")))
    })
}

/// Names of a column of time that is not named by the selection, also with a unit as a suffix.
const TIME_NAMES: [&str; 6] = ["t", "time", "timestamp", "datetime", "date_time", "zeit"];

/// Place of a name among those of a column of time.
pub(crate) fn time_name(name: &str) -> Option<usize> {
    let stem = units::from_name(name, true).filter(|(_, unit)| unit.ends_with('s') && !unit.contains('/'));
    let stem = stem.map_or(name, |(stem, _)| stem);
    TIME_NAMES.iter().position(|known| stem.eq_ignore_ascii_case(known))
}

pub(crate) fn is_command_name(name: &str) -> bool {
    name.ends_with("_cmd") || name.ends_with("_ang")
}

pub(crate) fn time(
    log: &RawLog,
    selection: &Selection,
    dt: Option<f64>,
    notes: &mut Vec<Note>,
) -> Result<Time, LogError> {
    if log.short.count > 0 {
        notes.push(
            Note::warning(format!(
                "{}: {} rows end before the last column, the first in line {}; the cells that they lack are missing",
                log.path, log.short.count, log.short.first
            ))
            .with_remedy("if a line is damaged, delete it"),
        );
    }
    // Tables that are computed from sensors have times of their own; the named column is that of the sensors.
    let named = selection.time.as_ref().filter(|_| selection.sensors.is_none());
    let spec = if let Some(text) = named {
        text.parse::<ChannelSpec>()?
    } else {
        // A column of text is the time only if there is no other one.
        let is_text = |column: &RawColumn| column.bad.is_some() && !column.has_values();
        let called = |text: bool| {
            let named = log.columns.iter().filter(|column| is_text(column) == text);
            let ranked = named.filter_map(|column| Some((time_name(&column.name)?, column)));
            ranked.min_by_key(|(rank, _)| *rank).map(|(_, column)| column)
        };
        let mut stamps = log.columns.iter().filter(|column| column.is_mostly_stamps());
        let only = stamps.next().filter(|_| dt.is_none() && stamps.next().is_none());
        let guessed = called(false).or(only).or_else(|| called(true));
        match (guessed, dt) {
            // A guessed column with a single value is not the time if the step is given.
            (Some(column), Some(dt)) if only_value(column).is_some() => return Ok(even(log, dt, notes)),
            (Some(column), _) => ChannelSpec::named(&column.name),
            (None, Some(dt)) => return Ok(even(log, dt, notes)),
            (None, None) => {
                return Err(LogError::NoTime { path: log.path.clone(), columns: all_names(log) });
            }
        }
    };
    // Stamps are in seconds, whatever unit the header gives.
    let column = locate(log, &spec).map(|(column, _)| column);
    if let Some(column) = column.filter(|&i| log.columns[i].stamps.is_some()) {
        let channel = Channel::new(&spec.name, "s");
        return Ok(Time::Column {
            source: Source { column, factor: 1.0, offset: 0.0, scale: 1.0, channel },
            stated: true,
        });
    }
    let source = source(log, &spec, Role::Time, notes)?;
    let unit = &source.channel.unit;
    let stated = !unit.is_empty() || spec.scale != 1.0;
    if unit.is_empty() {
        notes.push(
            Note::info(format!(
                "{}: the time in `{}` states no unit and is taken as seconds",
                log.path, spec.column
            ))
            .with_remedy(format!(
                "if it is not in seconds, state the unit: {}",
                key("time").is(format_args!("{} [ms]", spec.column))
            )),
        );
    } else if unit != "s" {
        let error = UnitError::Incompatible { from: unit.clone(), to: "s".to_owned() };
        return Err(LogError::Unit { column: spec.column, source: error });
    }
    Ok(Time::Column { source, stated })
}

fn even(log: &RawLog, dt: f64, notes: &mut Vec<Note>) -> Time {
    notes.push(
        Note::warning(format!("{}: no time column; the rows are taken as {dt} s apart", log.path))
            .with_remedy(format!("if a column holds the time, name it with {}", key("time").is("COLUMN"))),
    );
    Time::Even(dt)
}

/// Position of the first value of a constant column.
pub(crate) fn only_value(column: &RawColumn) -> Option<usize> {
    if let Some(summary) = &column.left_out {
        let several = summary.counts().0 > 1;
        return summary.first.filter(|_| several && column.bad.is_none() && summary.is_constant());
    }
    let first = column.values.iter().position(|x| !x.is_nan())?;
    let value = column.values[first];
    let several = column.values.len() > 1;
    (several && column.bad.is_none() && column.values.iter().all(|x| x.is_nan() || *x == value))
        .then_some(first)
}

fn wind_sources(log: &RawLog, wind: &Wind, notes: &mut Vec<Note>) -> Result<[Source; 2], LogError> {
    let check = |spec: &ChannelSpec, to: &str, notes: &mut Vec<Note>| {
        let s = source(log, spec, Role::Input, notes)?;
        if s.channel.unit == to || s.channel.unit.is_empty() {
            return Ok(s);
        }
        let error = UnitError::Incompatible { from: s.channel.unit, to: to.to_owned() };
        Err(LogError::Unit { column: spec.column.clone(), source: error })
    };
    Ok([check(&wind.speed, "m/s", notes)?, check(&wind.direction, "rad", notes)?])
}

/// The column of the heading: the one that is named, else the only one of the log that is an angle and looks like it.
fn heading(
    log: &RawLog,
    selection: &Selection,
    resolved: &Resolved,
    notes: &mut Vec<Note>,
) -> Result<Option<(Source, bool)>, LogError> {
    let Some(spec) = &selection.heading else {
        return Ok(super::inspect::heading(log, resolved).map(|source| (source, false)));
    };
    let source = source(log, spec, Role::Input, notes)?;
    if source.channel.unit == "rad" || source.channel.unit.is_empty() {
        return Ok(Some((source, true)));
    }
    let error = UnitError::Incompatible { from: source.channel.unit, to: "rad".to_owned() };
    Err(LogError::Unit { column: spec.column.clone(), source: error })
}

/// Columns `<source>_true` of all outputs; their default unit and scale are those of the output.
fn truth(log: &RawLog, outputs: &[Source]) -> Result<Option<Vec<Source>>, LogError> {
    let mut truth = Vec::with_capacity(outputs.len());
    for output in outputs {
        let name = format!("{}_true", log.columns[output.column].name);
        let Some(column) = log.position(&name) else {
            return Ok(None);
        };
        let mut factor = output.factor;
        if let Some(text) = &log.columns[column].unit {
            let unit = Unit::parse(text).map_err(|source| LogError::Unit { column: name.clone(), source })?;
            if unit.si != output.channel.unit && !output.channel.unit.is_empty() {
                let error = UnitError::Incompatible { from: unit.text, to: output.channel.unit.clone() };
                return Err(LogError::Unit { column: name, source: error });
            }
            factor = unit.factor * output.scale;
        }
        truth.push(Source { column, factor, ..output.clone() });
    }
    Ok(Some(truth))
}

fn sources(
    log: &RawLog,
    specs: &[ChannelSpec],
    role: Role,
    notes: &mut Vec<Note>,
) -> Result<Vec<Source>, LogError> {
    specs.iter().map(|spec| source(log, spec, role, notes)).collect()
}

/// The column that a specification names, as a channel.
pub(crate) fn channel(log: &RawLog, spec: &ChannelSpec, notes: &mut Vec<Note>) -> Result<Source, LogError> {
    source(log, spec, Role::Output, notes)
}

fn source(log: &RawLog, spec: &ChannelSpec, role: Role, notes: &mut Vec<Note>) -> Result<Source, LogError> {
    let (column, spec) = locate(log, spec).ok_or_else(|| unknown(log, &spec.column))?;
    let spec = spec.as_ref();
    let raw = &log.columns[column];
    if raw.name != spec.column {
        notes.push(Note::info(format!(
            "{}: `{}` is read from the column `{}`",
            log.path, spec.column, raw.name
        )));
    }
    let failed = |source| LogError::Unit { column: raw.name.clone(), source };
    let stated = spec.unit.as_deref().map(|text| Unit::parse(text).map_err(failed)).transpose()?;
    let as_number = |offset, factor| {
        let channel = Channel::new(&spec.name, "1");
        Source { column, factor, offset, scale: factor, channel }
    };
    // A log of model inputs, as a simulated one: the formula is that of raw values.
    if spec.is_number
        && raw.unit.as_deref() == Some("1")
        && stated.as_ref().is_some_and(|unit| unit.si != "1")
    {
        notes.push(Note::info(format!(
            "{}: `{}` is a pure number by its header, and is taken as the input of the model",
            log.path, raw.name
        )));
        return Ok(as_number(0.0, 1.0));
    }
    let header = match &raw.unit {
        // The user's unit replaces that of the header, which may then be invalid.
        Some(text) => match Unit::parse(text) {
            Err(_) if stated.is_some() => None,
            parsed => Some(parsed.map_err(failed)?),
        },
        None => units::from_name(&raw.name, role == Role::Time)
            .map(|(_, text)| Unit::parse(text).map_err(failed))
            .transpose()?,
    };
    if let (Some(header), None) = (header.as_ref().filter(|_| raw.unit.is_some()), &stated)
        && let Some((_, text)) = units::from_name(&raw.name, role == Role::Time)
        && let Ok(named) = Unit::parse(text)
        && header.to(&named).is_ok_and(|same| (same - 1.0).abs() > 1e-9)
    {
        notes.push(
            Note::warning(format!(
                "{}: the name of `{}` says {} and its header {}: {} is used",
                log.path, raw.name, named.text, header.text, header.text
            ))
            .with_remedy(format!("state the right one: {}=\"{} [{}]\"", spec.name, raw.name, named.text)),
        );
    }
    let vague = |h: &Unit| h.is_doubtful() || !h.is_known();
    let header = header.filter(|h| !(vague(h) && stated.as_ref().is_some_and(Unit::is_known)));
    // The formula is of values in its unit.
    if spec.is_number {
        let same = match (&header, &stated) {
            (Some(header), Some(stated)) => header.to(stated).map_err(failed)?,
            _ => 1.0,
        };
        return Ok(as_number(spec.offset / same, spec.scale * same));
    }
    let unit = match (header, stated) {
        (Some(header), Some(stated)) => {
            let same = header.to(&stated).map_err(failed)?;
            if same != 1.0 {
                notes.push(Note::warning(format!(
                    "{}: the unit of `{}` is {} in the header and {} in the selection: {} is used",
                    log.path, raw.name, header.text, stated.text, stated.text
                )));
            }
            Some(stated)
        }
        (header, stated) => stated.or(header),
    };
    let Some(unit) = unit else {
        let channel = Channel::new(&spec.name, "");
        return Ok(Source { column, factor: spec.scale, offset: spec.offset, scale: spec.scale, channel });
    };
    // A pulse width is a code of an actuator: with a scale it is a number.
    if unit.si == "us" && role != Role::Time && spec.scale != 1.0 {
        return Ok(as_number(spec.offset, spec.scale));
    }
    note_unit(log, &raw.name, &unit, role, notes);
    let (factor, si) = match (role, Unit::parse("s")) {
        // Microseconds of another column are pulse widths, and stay as they are.
        (Role::Time, Ok(second)) => (unit.to(&second).map_err(failed)?, second.si),
        _ => (unit.factor, unit.si),
    };
    let (factor, channel) = (spec.scale * factor, Channel::new(&spec.name, si));
    Ok(Source { column, factor, offset: spec.offset, scale: spec.scale, channel })
}

/// Adds a note on the conversion of a unit.
fn note_unit(log: &RawLog, column: &str, unit: &Unit, role: Role, notes: &mut Vec<Note>) {
    let path = &log.path;
    if unit.is_doubtful() {
        notes.push(
            Note::warning(format!("{path}: the unit {} of `{column}` is taken as knots", unit.text))
                .with_remedy(format!("if it is in kilonewtons, write `{column} [kN]`; knots are `[kn]`")),
        );
    } else if !unit.is_known() && role == Role::Output {
        notes.push(
            Note::warning(format!(
                "{path}: the unit {} of `{column}` is not known: its numbers are taken as they are, and SI units are assumed",
                unit.text
            ))
            .with_remedy(format!(
                "state a unit that is known, as in `{column} [deg/s]`, or a scale, as in `{column} * 0.01`"
            )),
        );
    } else if !unit.is_known() {
        notes.push(Note::info(format!("{path}: the unit {} of `{column}` is kept as it is", unit.text)));
    } else if unit.factor != 1.0 && unit.quantity != Some(Quantity::Time) {
        notes.push(Note::info(format!("{path}: `{column}` is converted from {} to {}", unit.text, unit.si)));
    }
}

/// Column of a specification, and the specification with its name: that of a column that looks like an expression, or of one that
/// has the meaning of another.
pub fn locate<'a>(log: &RawLog, spec: &'a ChannelSpec) -> Option<(usize, Cow<'a, ChannelSpec>)> {
    spec.as_names()
        .find_map(|named| Some((log.position(&named.column)?, Cow::Owned(named))))
        .or_else(|| Some((find(log, &spec.column)?, Cow::Borrowed(spec))))
        .or_else(|| {
            let column = same::on_link(&spec.column)?;
            Some((log.position(&column)?, Cow::Owned(ChannelSpec { column, ..spec.clone() })))
        })
}

/// Column of this name: exact, else without case, else without a unit suffix (`u` for `u_mps`), if only one fits.
pub(super) fn find(log: &RawLog, name: &str) -> Option<usize> {
    let only = |fits: &dyn Fn(&str) -> bool| {
        let mut found = log.columns.iter().enumerate().filter(|(_, c)| fits(&c.name)).map(|(i, _)| i);
        match (found.next(), found.next()) {
            (Some(i), None) => Some(i),
            _ => None,
        }
    };
    log.position(name)
        // Not for single letters: `V` is a voltage, `v` is sway.
        .or_else(|| only(&|c| name.chars().nth(1).is_some() && c.eq_ignore_ascii_case(name)))
        .or_else(|| only(&|c| units::from_name(c, true).is_some_and(|(stem, _)| stem == name)))
}

/// The error for a name that no column has, with the nearest names.
pub fn unknown(log: &RawLog, name: &str) -> LogError {
    let mut ranked: Vec<(f64, &str)> = log
        .columns
        .iter()
        .map(|c| {
            let (a, b) = (c.name.to_lowercase(), name.to_lowercase());
            let contained = if a.contains(&b) || b.contains(&a) { 0.3 } else { 0.0 };
            (strsim::jaro_winkler(&a, &b) + contained, c.name.as_str())
        })
        .filter(|(score, _)| *score > 0.7)
        .collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let nearest: Vec<String> = ranked.iter().take(3).map(|(_, n)| format!("`{n}`")).collect();
    let nearest = match with_blanks(log, name) {
        Some(expression) => format!("; an offset or a scale needs blanks: write `{expression}`"),
        None if nearest.is_empty() => String::new(),
        None => format!("; did you mean {}?", nearest.join(" or ")),
    };
    LogError::UnknownColumn {
        path: log.path.clone(),
        name: name.to_owned(),
        nearest,
        columns: all_names(log),
    }
}

/// The expression that a name like `pwm-1511` or `pwm/400` was meant to be, if there is such a column.
fn with_blanks(log: &RawLog, name: &str) -> Option<String> {
    let at = name.rfind(['+', '-', '/'])?;
    let (column, number) = (name[..at].trim(), name[at + 1..].trim());
    let fits = number.parse::<f64>().is_ok() && find(log, column).is_some();
    fits.then(|| format!("{column} {} {number}", &name[at..=at]))
}

/// Names of all columns in the form of a selection; of many columns some, and how to see the others.
pub(crate) fn all_names(log: &RawLog) -> String {
    const MANY: usize = 30;
    const SHOWN: usize = 10;
    let names: Vec<&str> = log.columns.iter().map(|c| c.name.as_str()).collect();
    if names.len() <= MANY {
        return names.join(", ");
    }
    let more = names.len() - SHOWN;
    // Columns in memory have no file.
    let all = if Path::new(&log.path).exists() {
        format!("; `hydroid inspect {}` lists all", log.path)
    } else {
        String::new()
    };
    format!("{} and {more} more{all}", names[..SHOWN].join(", "))
}
