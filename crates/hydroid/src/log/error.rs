//! Errors of a log: place, cause and remedy.

use std::io;

use crate::key::key;
use crate::progress::Cancelled;

/// Error of a log. A message names the file, the line if any (from 1, header included), the column and a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum LogError {
    #[error("no log was given; name at least one CSV file")]
    NoFiles,
    #[error("{path}: there is no such file; check the spelling and the folder")]
    NotFound {
        /// File as it was named.
        path: String,
    },
    #[error("{path} is a folder, not a log; name the CSV files in it, for example {path}/*.csv")]
    IsDirectory {
        /// Path as it was named.
        path: String,
    },
    #[error("{path} cannot be read: {source}")]
    Read {
        /// File as it was named.
        path: String,
        source: io::Error,
    },
    #[error(transparent)]
    Recording(#[from] hydroid_io::IoError),
    /// A recording without what is needed from it.
    #[error("{path}: {reason}; {remedy}")]
    Unusable { path: String, reason: String, remedy: String },
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    #[error("{path} is empty; was the recording stopped before anything was written?")]
    Empty { path: String },
    #[error("{path} holds a header and no samples; was the recording stopped before anything was written?")]
    HeaderOnly { path: String },
    #[error(
        "{path}: column '{column}' has {found} values and column '{first}' has {expected}; give each one value for each row"
    )]
    DifferentLengths { path: String, first: String, expected: usize, column: String, found: usize },
    #[error(
        "{path}: the first row holds numbers ({first_row}), not column names; add a first line that names the columns, such as `t [s],u [m/s],v [m/s],r [rad/s]`"
    )]
    NoHeader { path: String, first_row: String },
    #[error(
        "{path}, line {line}: no cell of the file is a number (`{text}`), so it is no table of numbers; give a table with a header, one row for each sample, or a recording in one of the formats of `hydroid inspect`"
    )]
    NoNumbers { path: String, line: u64, text: String },
    #[error("{path}, line {line}: not UTF-8 text; {remedy}")]
    NotUtf8 {
        path: String,
        /// Line of the first byte that is not UTF-8.
        line: u64,
        remedy: &'static str,
    },
    #[error(
        "{path}: columns {first} and {second} are both called `{name}`; rename one of them, so that it is clear which one is meant"
    )]
    DuplicateColumn {
        path: String,
        name: String,
        /// Position of the first, from 1.
        first: usize,
        /// Position of the second, from 1.
        second: usize,
    },
    #[error(
        "{path}, line {line}: {found} cells where the header names {expected} columns; correct or delete the line (a comma inside a cell needs quotes)"
    )]
    Ragged { path: String, line: u64, found: usize, expected: usize },
    #[error(
        "{path}, line {line}: the file ends in the middle of a line ({found} of {expected} cells); delete this last line, or copy the file again if the copy was cut short"
    )]
    Truncated { path: String, line: u64, found: usize, expected: usize },
    #[error(
        "`{text}` does not name a channel: {reason}; write NAME, NAME=COLUMN or `NAME=COLUMN [unit] * 0.01`"
    )]
    BadSpec { text: String, reason: String },
    #[error(
        "the channel `{name}` is selected twice; give each output and input a name of its own (NAME=COLUMN)"
    )]
    RepeatedChannel { name: String },
    #[error("{path} has no column `{name}`{nearest}; its columns are: {columns}")]
    UnknownColumn {
        path: String,
        name: String,
        /// The nearest names as a phrase, or nothing.
        nearest: String,
        columns: String,
    },
    #[error(
        "{second} has no column `{column}`, which {first} has; all logs of one model need the same columns: rename it, or leave the file out"
    )]
    DifferentColumns { first: String, second: String, column: String },
    #[error(
        "column `{column}` is in {units} in {first} and {second}; state the unit in both headers, as `{column} [unit]`"
    )]
    DifferentUnits { column: String, first: String, second: String, units: String },
    #[error(
        "{path}: no time column, as none is called t, time, t_s, time_s or timestamp, or is the only one of stamps: name it with {}, or give the step of equally spaced rows with {} in seconds. Its columns are: {columns}",
        key("time").is("COLUMN"),
        key("dt")
    )]
    NoTime { path: String, columns: String },
    #[error(
        "{path}: no columns u, v, r to take as outputs; name the measured columns, for example {}, or, if it has positions and headings, the sensors from which they are computed (`hydroid inspect` proposes them). Its columns are: {columns}",
        key("outputs").is("u=SURGE,r=YAWRATE")
    )]
    NoOutputs { path: String, columns: String },
    #[error(
        "{path}: no column ends in _cmd or _ang to take as a command; name the commands, for example {}, or write {} if there are no commands. Its columns are: {columns}",
        key("inputs").is("n=RPM,delta=RUDDER"),
        key("inputs").is("none")
    )]
    NoInputs { path: String, columns: String },
    /// A unit that cannot be used.
    #[error("column `{column}`: {source}")]
    Unit { column: String, source: super::units::UnitError },
    #[error("{path}, line {line}, column `{column}`: `{text}` is not a number; {remedy}")]
    TextInNumbers { path: String, line: u64, column: String, text: String, remedy: &'static str },
    #[error(
        "{path}, line {line}, column `{column}`: `{text}` is infinite; leave the cell blank if nothing was measured"
    )]
    Infinite { path: String, line: u64, column: String, text: String },
    #[error("{path}: column `{column}` holds no value in any row; choose another column, or leave it out")]
    AllMissing { path: String, column: String },
    #[error("{path}, line {line}, column `{column}`: {value}; {remedy}")]
    Absurd {
        path: String,
        line: u64,
        column: String,
        /// The value in SI units and its limit.
        value: String,
        remedy: String,
    },
    #[error("{path}: no output ever changes; was the right column chosen, and was the vessel moving?")]
    NothingMoves { path: String },
    #[error(
        "{path}, line {line}: two identical time stamps ({time} s, as in line {before}); delete one of the rows, or write the time with more digits"
    )]
    SameTime { path: String, line: u64, before: u64, time: f64 },
    #[error("{path}, line {line}: time runs backwards, from {from} s to {to} s; {remedy}")]
    Backwards { path: String, line: u64, from: f64, to: f64, remedy: &'static str },
    #[error(
        "{path}, line {line}, column `{column}`: {value} is the only time in the whole column; name another one with {}, or, if the rows are equally spaced, leave {} out and give their step with {} in seconds",
        key("time").is("COLUMN"),
        key("time"),
        key("dt")
    )]
    OneTime {
        path: String,
        /// Line of the first cell that is not blank.
        line: u64,
        column: String,
        value: String,
    },
    #[error(
        "{path}, line {line}, column `{column}`: `{text}` is a time of another kind than the others; write all as dates (2020-08-03T11:04:37.125Z) or all as numbers"
    )]
    MixedTime { path: String, line: u64, column: String, text: String },
    #[error(
        "{path}, column `{column}`: the usual step is {step}, not that of a log of a vessel if it counts seconds, and no unit is stated; state it: {} for milliseconds, {} for days, {} for seconds",
        key("time").is(format_args!("{column} [ms]")),
        key("time").is(format_args!("{column} [d]")),
        key("time").is(format_args!("{column} [s]"))
    )]
    SlowClock {
        path: String,
        column: String,
        /// The usual step in the unit of the file.
        step: f64,
    },
    #[error(
        "{path}, line {line}: a time of {time:e} s is not plausible; if it counts milliseconds or nanoseconds, state the unit, for example {}",
        key("time").is("timestamp [ms]")
    )]
    AbsurdTime { path: String, line: u64, time: f64 },
    #[error("{path}: {found} usable samples are left, at least {needed} are needed; {remedy}")]
    TooShort { path: String, found: usize, needed: usize, remedy: String },
    #[error(
        "there are logs to validate on, but none to test on: name some with {}, or name neither and let the runs be split",
        key("test")
    )]
    NoTest,
    /// A line of a stream that cannot be read.
    #[error("{path}, line {line}: {reason}")]
    BadLine {
        /// Where the stream comes from.
        path: String,
        line: u64,
        /// Column, cause and remedy.
        reason: String,
    },
    #[error("{what} of {value} cannot be used: {reason}")]
    BadOption { what: &'static str, value: String, reason: String },
}
