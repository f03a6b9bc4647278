//! How logs are read.
// Help texts come from the comments of the options; backticks would be printed, and brackets are units.
#![expect(clippy::doc_markdown, rustdoc::broken_intra_doc_links, reason = "the comments are help texts, too")]

use serde::{Deserialize, Serialize};

use crate::boat::{Boat, BoatError};
use crate::log::{
    ChannelSpec, CommandTiming, Condition, InputDelay, Parts, PrepareOptions, Selection, Sensors, Stretch,
    Wind,
};
use crate::model::Reading;
use crate::written;

#[cfg(feature = "arguments")]
const READING: &str = "Reading logs";

/// Options of reading logs, of the command, of the section `[log]` of a file, and of Python.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[cfg_attr(feature = "arguments", derive(clap::Args))]
pub struct Log {
    /// Time column: seconds, ISO 8601, or with a unit: 'timestamp [ms]' (default: t, time, t_s, timestamp, time_s)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "COLUMN", help_heading = READING))]
    pub time: Option<String>,
    /// Outputs: NAME or NAME=COLUMN, with [unit], offset and scale: u=SOG_kn[kn], r=(gyro - 0.02) * -1 (default: u,v,r)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "LIST", value_delimiter = ',', help_heading = READING))]
    #[serde(deserialize_with = "written::list", skip_serializing_if = "Vec::is_empty")]
    pub outputs: Vec<ChannelSpec>,
    /// Inputs, in the same form: n=rpm[rpm], L=thr_left - 1511, L=(thr_left - 1500) / 400; none: no inputs (default: columns
    /// that end in _cmd or _ang)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "LIST", value_delimiter = ',', help_heading = READING))]
    #[serde(deserialize_with = "written::list", skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<ChannelSpec>,
    /// Columns of wind speed and direction; the inputs are U^2 cos and U^2 sin
    #[cfg_attr(feature = "arguments", arg(long, value_name = "SPEED,DIRECTION", help_heading = READING))]
    #[serde(deserialize_with = "written::optional")]
    pub wind: Option<Wind>,
    /// Column of the heading, clockwise from north: psi, 'yaw [deg]', 'yaw * -1' (default: the only column that is named like
    /// a heading and changes with the yaw rate r)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "COLUMN", help_heading = READING))]
    pub heading: Option<ChannelSpec>,
    /// Sensors from which velocities are computed.
    #[cfg_attr(feature = "arguments", arg(skip))]
    pub sensors: Option<Sensors>,
    /// before: the command of row k acts from row k to k+1 (default); after: from row k-1 to k
    #[cfg_attr(feature = "arguments", arg(long, value_enum, value_name = "before|after", hide_possible_values = true, help_heading = READING))]
    pub command_timing: Option<CommandTiming>,
    /// Delay between the log entry of a command and its action: samples (3) or seconds (0.3s); may be negative
    #[cfg_attr(feature = "arguments", arg(long, value_name = "DELAY", allow_hyphen_values = true, help_heading = READING))]
    pub input_delay: Option<InputDelay>,
    /// Longest gap of an output [s]; a run is cut at longer gaps
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true, help_heading = READING))]
    #[serde(alias = "max_gap_s")]
    pub max_gap: Option<f64>,
    /// Keep towed and carried parts of a log: commands zero for at least 20 s while the speed increases (default: removed)
    #[cfg_attr(feature = "arguments", arg(long, help_heading = READING))]
    #[serde(skip_serializing_if = "written::is_off")]
    pub keep_towed: bool,
    /// Parts of the logs to use: START:END in seconds (120:480, 600:), stamps (2024-05-01T10:00:00Z/2024-05-01T10:20:00Z), with
    /// the name of one log day1.csv=120:480 (default: all)
    #[cfg_attr(feature = "arguments", arg(long, value_name = "LIST", value_delimiter = ',', allow_hyphen_values = true, help_heading = READING))]
    #[serde(deserialize_with = "written::list", skip_serializing_if = "Vec::is_empty")]
    pub between: Vec<Stretch>,
    /// Parts not to use, in the same form: on a trailer, lifted out, towed, adrift
    #[cfg_attr(feature = "arguments", arg(long, value_name = "LIST", value_delimiter = ',', allow_hyphen_values = true, help_heading = READING))]
    #[serde(deserialize_with = "written::list", skip_serializing_if = "Vec::is_empty")]
    pub exclude: Vec<Stretch>,
    /// Use the rows for which a condition on columns of the log holds: 'MODE.Mode == 10 && (armed || speed > 0.5)'
    #[cfg_attr(feature = "arguments", arg(id = "where", long = "where", value_name = "CONDITION", help_heading = READING))]
    #[serde(rename = "where")]
    pub condition: Option<Condition>,
    /// Sample time to resample to [s] (default: that of the log), or of a log without a time column
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S", allow_negative_numbers = true, help_heading = READING))]
    pub dt: Option<f64>,
}

impl Log {
    /// These options, and those of `base` where they are not given. The given inputs are raw values of `boat`.
    ///
    /// # Errors
    /// If an input contradicts the boat.
    pub fn over(mut self, base: Reading, boat: &Boat) -> Result<Reading, BoatError> {
        boat.read(&mut self.inputs)?;
        let Reading { selection, options } = base;
        let or =
            |given: Vec<ChannelSpec>, base: Vec<ChannelSpec>| if given.is_empty() { base } else { given };
        // Velocities of the log replace those that would be computed, and so do its heading and its time.
        let replaced = selection.sensors.is_some() && !self.outputs.is_empty();
        let sensors = selection.sensors.filter(|_| !replaced);
        let heading = selection.heading.filter(|_| !replaced);
        let time = selection.time.filter(|_| !replaced);
        let parts = selection.parts;
        Ok(Reading {
            selection: Selection {
                time: self.time.or(time),
                outputs: or(self.outputs, selection.outputs),
                inputs: or(self.inputs, selection.inputs),
                wind: self.wind.or(selection.wind),
                heading: self.heading.or(heading),
                sensors: self.sensors.or(sensors),
                parts: Parts {
                    between: if self.between.is_empty() { parts.between } else { self.between },
                    exclude: if self.exclude.is_empty() { parts.exclude } else { self.exclude },
                    condition: self.condition.or(parts.condition),
                },
            },
            options: PrepareOptions {
                dt: self.dt.or(options.dt),
                max_gap_s: self.max_gap.or(options.max_gap_s),
                command_timing: self.command_timing.unwrap_or(options.command_timing),
                input_delay: self.input_delay.unwrap_or(options.input_delay),
                keep_towed: self.keep_towed || options.keep_towed,
            },
        })
    }
}
