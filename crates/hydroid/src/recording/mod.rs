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

mod instruments;
mod motion;
mod open;
mod propose;
mod survey;
mod table;

use std::path::Path;

use crate::log::{self, LogError, Note, RawLog, Selection};

pub use open::is_recording;
pub use propose::Proposal;
pub use survey::{FieldSurvey, Survey, TopicSurvey, survey};
pub use table::{converted, time_text};

/// Reads logs of any format as tables. The time of a table from a recording is in seconds from its first row. `dt` is the
/// step of tables that are computed from sensors; default: that of the heading, else of the position.
///
/// # Errors
/// If a file cannot be read, or a column of the selection does not exist.
pub fn read_logs<P: AsRef<Path>>(
    paths: &[P],
    selection: &Selection,
    dt: Option<f64>,
) -> Result<(Vec<RawLog>, Vec<Note>), LogError> {
    let mut notes = Vec::new();
    if let Some(sensors) = &selection.sensors {
        let recordings = paths
            .iter()
            .map(|path| open::read(path.as_ref(), selection, &mut notes))
            .collect::<Result<Vec<_>, _>>()?;
        return Ok((motion::tables(&recordings, sensors, selection, dt, &mut notes)?, notes));
    }
    let each = |path: &P| {
        let path = path.as_ref();
        if is_recording(path)? {
            table::of_outputs(&open::read(path, selection, &mut notes)?, selection, &mut notes)
        } else {
            log::read(path)
        }
    };
    Ok((paths.iter().map(each).collect::<Result<_, _>>()?, notes))
}
