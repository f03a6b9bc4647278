//! Recordings: files with topics at different rates, as autopilots, ROS and instruments write them, and folders of CSV
//! files with a topic each.
//!
//! [`read_logs`] reads recordings and CSV logs as tables, with the columns that a [`Selection`]
//! names. If the selection names [`Sensors`](crate::log::Sensors), the table contains pose and velocities that are
//! computed from them. [`survey`] states the content of a recording, and [`Survey::proposal`] which of its fields look
//! like sensors and commands.
//!
//! A column of a recording has the name `TOPIC.FIELD` (`GPS.Lat`, `/odom.twist.twist.linear.x`), or `FIELD` alone if the
//! recording has one topic. The yaw angle of a quaternion `Q` (fields `Q.x` to `Q.w`, or `Q[0]` to `Q[3]` with the scalar
//! first) is the column `Q.yaw`.

mod actuators;
mod clock;
mod commands;
mod instruments;
mod known;
mod live;
mod motion;
mod open;
mod propose;
mod survey;
mod table;
mod words;

use hydroid_io::LogFile;

use crate::log::{self, LogError, Note, PrepareOptions, RawLog, Selection};
use crate::progress::{self, Progress};

pub use live::{LiveColumn, LiveInputs, LiveMotion, LiveTopics, SensorHealth};
pub use open::is_recording;
pub use propose::Proposal;
pub use survey::{FieldSurvey, Survey, TopicSurvey, survey};
pub use table::{converted, time_text};

/// Whether the name of a column says that it is a speed, which has no sign.
pub(crate) fn is_speed(column: &str) -> bool {
    words::Name::of(column).motion() == Some(words::Quantity::Speed)
}

/// Share of the files in the time of a computation from sensors, for the progress.
const FILES: f64 = 0.05;

/// Reads logs of any format as tables. The time of a table from a recording is in seconds from its first row. The
/// step of tables that are computed from sensors is that of the options; default: that of the heading, else of the position.
/// Their rows end where measurements are missing for longer than the gap limit of the options, or than the smoother can
/// bridge. What is estimated of the sensors is filled in the selection ([`Sensors::known`](crate::log::Sensors::known)), so that further recordings of
/// the vessel are read in the same way, and faster.
///
/// # Errors
/// If a file cannot be read, a column of the selection does not exist, or the callback cancels.
pub fn read_logs<'a, S>(
    logs: &'a [S],
    selection: &mut Selection,
    options: &PrepareOptions,
    progress: Progress<'_>,
) -> Result<(Vec<RawLog>, Vec<Note>), LogError>
where
    LogFile: From<&'a S>,
{
    let sources: Vec<LogFile> = logs.iter().map(LogFile::from).collect();
    let mut notes = Vec::new();
    selection.parts.check_names(&sources.iter().map(LogFile::name).collect::<Vec<_>>())?;
    if selection.sensors.is_some() {
        let mut recordings = Vec::with_capacity(sources.len());
        for (i, source) in sources.iter().enumerate() {
            let mut part = |done| progress(FILES * (i as f64 + done) / sources.len() as f64);
            recordings.push(open::read(source, selection, &mut notes, &mut part)?);
        }
        let mut rest = |done| progress(FILES + (1.0 - FILES) * done);
        return Ok((motion::tables(&recordings, selection, options, &mut notes, &mut rest)?, notes));
    }
    let mut tables = Vec::with_capacity(sources.len());
    for (i, source) in sources.iter().enumerate() {
        let mut part = |done| progress((i as f64 + done) / sources.len() as f64);
        progress::report(&mut part, 0.0)?;
        tables.push(if is_recording(source)? {
            table::of_outputs(open::read(source, selection, &mut notes, &mut part)?, selection, &mut notes)?
        } else {
            let mut log = log::read(source)?;
            log::keep_parts(&mut log, selection, options.dt, &mut notes)?;
            log
        });
    }
    Ok((tables, notes))
}
