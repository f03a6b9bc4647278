//! Logs of a vessel: measurements and commands on a regular clock.
//!
//! [`read`] reads the columns of a CSV file ([`RawLog`]), a [`Selection`] names time, outputs, inputs and wind,
//! [`prepare()`] converts logs to runs ([`Trajectory`]), and [`split_runs`] divides runs into training, validation and
//! test. Every change is reported in a [`Note`]; implausible data is a [`LogError`] with file, line, column and remedy.
//! [`inspect()`] reports the content and the defects of a log.

mod align;
mod clock;
mod columns;
mod condition;
mod csv;
mod error;
mod fastest;
mod file;
mod gaps;
mod geodesy;
mod grid;
mod heading;
pub mod inspect;
mod lines;
mod note;
pub(crate) mod parts;
mod prepare;
pub(crate) mod pulses;
mod resample;
mod resolve;
pub(crate) mod same;
mod sanity;
mod selection;
mod sensors;
pub(crate) mod sentinel;
mod split;
#[doc(hidden)]
pub mod stamp;
mod summary;
mod table_file;
mod towed;
mod trajectory;
#[doc(hidden)]
pub mod units;

pub use align::{CommandTiming, InputDelay};
pub(crate) use clock::median;
pub(crate) use columns::{LONGEST_TIME_S, SINCE_1970_S, checked};
pub use condition::Condition;
pub use csv::{RawColumn, RawLog, ShortRows, read, read_from};
pub(crate) use csv::{Rows, Shortest, bytes};
pub use error::LogError;
pub(crate) use fastest::shortest_change;
pub(crate) use geodesy::metres_per_radian;
pub(crate) use heading::turn_ratio;
pub use inspect::{Inspection, inspect, inspect_file, inspect_owned};
pub(crate) use note::count;
pub use note::{Note, Severity};
pub use parts::{Parts, Stretch, keep_parts};
pub(crate) use prepare::is_constant;
pub use prepare::{PrepareOptions, Prepared, prepare};
pub use pulses::{Neutral, NeutralBy};
pub(crate) use resample::mean;
pub(crate) use resolve::{all_names, channel, time, unknown as unknown_column};
pub(crate) use sanity::{FASTEST_M_S, FASTEST_RAD_S};
pub use selection::{ChannelSpec, Selection, Wind};
pub use sensors::{KnownSensors, Sensors};
pub(crate) use split::validation_run;
pub use split::{Split, beginning, split_named, split_runs};
pub use table_file::TableFormat;
pub use trajectory::{Channel, Table, Trajectory};
#[doc(hidden)]
pub use {
    clock::Clock,
    columns::rows,
    csv::{BadCell, FirstStamp},
    inspect::noise_level,
};

/// Parts of reading that a stream, which is read line by line, shares with a file.
#[doc(hidden)]
pub mod line {
    pub use super::csv::{Cell, delimiter, header_columns, name_the_nameless, number};
    pub use super::resolve::{Resolved, Source, Time, locate, unknown};
    pub use super::sanity::check_value;
    pub use super::stamp::Stamp;
}
