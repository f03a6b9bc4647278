//! Errors of a log: place, cause and remedy.

use std::io;

use crate::progress::Cancelled;

/// Error of a log. A message names the file, the line if any (from 1, header included), the column and a remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// No log was given.
    #[error("no log was given; name at least one CSV file")]
    NoFiles,
    /// The file does not exist.
    #[error("{path}: there is no such file; check the spelling and the folder")]
    NotFound {
        /// File as it was named.
        path: String,
    },
    /// The path is a folder.
    #[error("{path} is a folder, not a log; name the CSV files in it, for example {path}/*.csv")]
    IsDirectory {
        /// Path as it was named.
        path: String,
    },
    /// The file exists but cannot be read.
    #[error("{path} cannot be read: {source}")]
    Read {
        /// File as it was named.
        path: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A recording that cannot be read.
    #[error(transparent)]
    Recording(#[from] hydroid_io::IoError),
    /// A recording without what is needed from it.
    #[error("{path}: {reason}; {remedy}")]
    Unusable {
        /// File.
        path: String,
        /// What is missing.
        reason: String,
        /// Remedy.
        remedy: String,
    },
    /// The caller stopped the reading.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The file has no content.
    #[error("{path} is empty; was the recording stopped before anything was written?")]
    Empty {
        /// File.
        path: String,
    },
    /// A header without a row below it.
    #[error("{path} holds a header and no samples; was the recording stopped before anything was written?")]
    HeaderOnly {
        /// File.
        path: String,
    },
    /// Columns in memory with different lengths.
    #[error(
        "{path}: column '{column}' has {found} values and column '{first}' has {expected}; give each one value for each row"
    )]
    DifferentLengths {
        /// The log.
        path: String,
        /// The first column.
        first: String,
        /// Its length.
        expected: usize,
        /// The other column.
        column: String,
        /// Its length.
        found: usize,
    },
    /// The first row holds numbers only.
    #[error(
        "{path}: the first row holds numbers ({first_row}), not column names; add a first line that names the columns, such as `t [s],u [m/s],v [m/s],r [rad/s]`"
    )]
    NoHeader {
        /// File.
        path: String,
        /// Beginning of the first row.
        first_row: String,
    },
    /// The bytes are not UTF-8.
    #[error("{path}, line {line}: not UTF-8 text; {remedy}")]
    NotUtf8 {
        /// File.
        path: String,
        /// Line of the first byte that is not UTF-8.
        line: u64,
        /// Remedy.
        remedy: &'static str,
    },
    /// Two columns share a name.
    #[error(
        "{path}: columns {first} and {second} are both called `{name}`; rename one of them, so that it is clear which one is meant"
    )]
    DuplicateColumn {
        /// File.
        path: String,
        /// The name.
        name: String,
        /// Position of the first, from 1.
        first: usize,
        /// Position of the second, from 1.
        second: usize,
    },
    /// A line with another number of cells than the header.
    #[error(
        "{path}, line {line}: {found} cells where the header names {expected} columns; correct or delete the line (a comma inside a cell needs quotes)"
    )]
    Ragged {
        /// File.
        path: String,
        /// Line.
        line: u64,
        /// Cells found.
        found: usize,
        /// Columns in the header.
        expected: usize,
    },
    /// The last line stops early.
    #[error(
        "{path}, line {line}: the file ends in the middle of a line ({found} of {expected} cells); delete this last line, or copy the file again if the copy was cut short"
    )]
    Truncated {
        /// File.
        path: String,
        /// Line.
        line: u64,
        /// Cells found.
        found: usize,
        /// Columns in the header.
        expected: usize,
    },
    /// A channel specification that cannot be understood.
    #[error(
        "`{text}` does not name a channel: {reason}; write NAME, NAME=COLUMN or `NAME=COLUMN [unit] * 0.01`"
    )]
    BadSpec {
        /// The specification.
        text: String,
        /// Cause.
        reason: String,
    },
    /// The same channel name was given twice.
    #[error(
        "the channel `{name}` is selected twice; give each output and input a name of its own (NAME=COLUMN)"
    )]
    RepeatedChannel {
        /// The name.
        name: String,
    },
    /// The log has no column of this name.
    #[error("{path} has no column `{name}`{nearest}; its columns are: {columns}")]
    UnknownColumn {
        /// File.
        path: String,
        /// Requested name.
        name: String,
        /// The nearest names as a phrase, or nothing.
        nearest: String,
        /// All names.
        columns: String,
    },
    /// A column that the first log has is missing in another.
    #[error(
        "{second} has no column `{column}`, which {first} has; all logs of one model need the same columns: rename it, or leave the file out"
    )]
    DifferentColumns {
        /// The log that has it.
        first: String,
        /// The log without it.
        second: String,
        /// The column.
        column: String,
    },
    /// The same column in different units.
    #[error(
        "column `{column}` is in {units} in {first} and {second}; state the unit in both headers, as `{column} [unit]`"
    )]
    DifferentUnits {
        /// The column.
        column: String,
        /// First log.
        first: String,
        /// Second log.
        second: String,
        /// Unit in the first and unit in the second.
        units: String,
    },
    /// No column looks like the time.
    #[error(
        "{path}: no time column, as none is called t, time, t_s, time_s or timestamp: name it with --time COLUMN, or give the step of equally spaced rows with --dt SECONDS. Its columns are: {columns}"
    )]
    NoTime {
        /// File.
        path: String,
        /// All names.
        columns: String,
    },
    /// No column looks like an output.
    #[error(
        "{path}: no columns u, v, r to take as outputs; name the measured columns, for example --outputs u=SPEED,r=YAWRATE. Its columns are: {columns}"
    )]
    NoOutputs {
        /// File.
        path: String,
        /// All names.
        columns: String,
    },
    /// No column looks like a command.
    #[error(
        "{path}: no column ends in _cmd or _ang to take as a command; name the commands, for example --inputs n=RPM,delta=RUDDER, or write --inputs none if there are no commands. Its columns are: {columns}"
    )]
    NoInputs {
        /// File.
        path: String,
        /// All names.
        columns: String,
    },
    /// A unit that cannot be used.
    #[error("column `{column}`: {source}")]
    Unit {
        /// The column.
        column: String,
        /// Cause.
        source: super::units::UnitError,
    },
    /// Text where a number was expected.
    #[error("{path}, line {line}, column `{column}`: `{text}` is not a number; {remedy}")]
    TextInNumbers {
        /// File.
        path: String,
        /// Line.
        line: u64,
        /// Column.
        column: String,
        /// The cell.
        text: String,
        /// Remedy.
        remedy: &'static str,
    },
    /// An infinite number.
    #[error(
        "{path}, line {line}, column `{column}`: `{text}` is infinite; leave the cell blank if nothing was measured"
    )]
    Infinite {
        /// File.
        path: String,
        /// Line.
        line: u64,
        /// Column.
        column: String,
        /// The cell.
        text: String,
    },
    /// A column without a single value.
    #[error("{path}: column `{column}` holds no value in any row; choose another column, or leave it out")]
    AllMissing {
        /// File.
        path: String,
        /// Column.
        column: String,
    },
    /// An implausible value.
    #[error("{path}, line {line}, column `{column}`: {value}; {remedy}")]
    Absurd {
        /// File.
        path: String,
        /// Line.
        line: u64,
        /// Column.
        column: String,
        /// The value in SI units and its limit.
        value: String,
        /// Remedy.
        remedy: &'static str,
    },
    /// All outputs are constant.
    #[error("{path}: no output ever changes; was the right column chosen, and was the vessel moving?")]
    NothingMoves {
        /// File, or files.
        path: String,
    },
    /// Two rows at the same time.
    #[error(
        "{path}, line {line}: two identical time stamps ({time} s, as in line {before}); delete one of the rows, or write the time with more digits"
    )]
    SameTime {
        /// File.
        path: String,
        /// Line of the second.
        line: u64,
        /// Line of the first.
        before: u64,
        /// The time.
        time: f64,
    },
    /// Time running backwards.
    #[error("{path}, line {line}: time runs backwards, from {from} s to {to} s; {remedy}")]
    Backwards {
        /// File.
        path: String,
        /// Line.
        line: u64,
        /// Time before.
        from: f64,
        /// Time after.
        to: f64,
        /// Remedy.
        remedy: &'static str,
    },
    /// A time column with a single value.
    #[error(
        "{path}, line {line}, column `{column}`: {value} is the only time in the whole column; name another one with --time COLUMN, or, if the rows are equally spaced, leave --time out and give their step with --dt SECONDS"
    )]
    OneTime {
        /// File.
        path: String,
        /// Line of the first cell that is not blank.
        line: u64,
        /// Column.
        column: String,
        /// The value.
        value: String,
    },
    /// Numbers and time stamps in one column.
    #[error(
        "{path}, line {line}, column `{column}`: `{text}` is a time of another kind than the others; write all as dates (2020-08-03T11:04:37.125Z) or all as numbers"
    )]
    MixedTime {
        /// File.
        path: String,
        /// Line.
        line: u64,
        /// Column.
        column: String,
        /// The cell.
        text: String,
    },
    /// Steps too long for seconds, in a column that does not say its unit.
    #[error(
        "{path}, column `{column}`: the usual step is {step}, too long for a moving vessel if it counts seconds, and no unit is stated; state it: --time \"{column} [ms]\" for milliseconds, --time \"{column} [s]\" for seconds"
    )]
    SlowClock {
        /// File.
        path: String,
        /// Column.
        column: String,
        /// The usual step in the unit of the file.
        step: f64,
    },
    /// A time that cannot be seconds.
    #[error(
        "{path}, line {line}: a time of {time:e} s is not plausible; if it counts milliseconds or nanoseconds, state the unit, for example --time 'timestamp [ms]'"
    )]
    AbsurdTime {
        /// File.
        path: String,
        /// Line.
        line: u64,
        /// The time.
        time: f64,
    },
    /// Not enough samples.
    #[error("{path}: {found} usable samples are left, at least {needed} are needed; {remedy}")]
    TooShort {
        /// File, or files.
        path: String,
        /// Samples left.
        found: usize,
        /// Samples needed.
        needed: usize,
        /// Remedy.
        remedy: String,
    },
    /// Validation runs without test runs.
    #[error(
        "there are logs to validate on, but none to test on: name some with --test, or name neither and let the runs be split"
    )]
    NoTest,
    /// A line of a stream that cannot be read.
    #[error("{path}, line {line}: {reason}")]
    BadLine {
        /// Where the stream comes from.
        path: String,
        /// Line.
        line: u64,
        /// Column, cause and remedy.
        reason: String,
    },
    /// An invalid step, gap limit or delay.
    #[error("{what} of {value} cannot be used: {reason}")]
    BadOption {
        /// Name of the option.
        what: &'static str,
        /// Its value.
        value: String,
        /// Reason.
        reason: String,
    },
}
