//! Links to a vessel: what its autopilot reports, as rows of topics, and the state of the autopilot.
//!
//! A link names topics and fields as a recording does ([`hydroid::recording`]): the sensors and commands that a
//! configuration selects from a recording are selected from a link in the same way.

pub mod mavlink;

use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// Time in nanoseconds since 1970. It never goes back: after its start it follows the monotonic clock, so that a clock of
/// the computer that is set does not matter.
#[derive(Clone, Copy, Debug)]
pub struct UtcClock {
    start: Instant,
    start_ns: i64,
    scale: f64,
}

impl UtcClock {
    /// Starts now, and advances by `scale` seconds in each second: 1, or more for a simulation that is faster.
    pub fn start(scale: f64) -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { start: Instant::now(), start_ns: i64::try_from(since.as_nanos()).unwrap_or(0), scale }
    }

    /// The present time.
    pub fn now_ns(&self) -> i64 {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let elapsed = (self.start.elapsed().as_nanos() as f64 * self.scale) as i64;
        self.start_ns.saturating_add(elapsed)
    }
}

/// A topic of a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Name, for example `GPS_RAW_INT`.
    pub name: &'static str,
    /// Its fields.
    pub fields: &'static [Field],
}

/// A field of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name.
    pub name: &'static str,
    /// Unit of the values; empty for pure numbers.
    pub unit: &'static str,
}

/// What a link reports.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A row of a topic.
    Row(Row),
    /// The autopilot was found: its name for people.
    Found(String),
    /// Mode and arming of the autopilot have changed.
    State(State),
    /// The autopilot says something.
    Text {
        /// Whether it is a warning or an error.
        warning: bool,
        /// What it says.
        text: String,
    },
    /// Nothing was received for a while \[s\].
    Lost(f64),
    /// Messages arrive again.
    Back,
    /// The autopilot has started again.
    Restarted,
}

/// A row of a topic.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Index of the topic.
    pub topic: usize,
    /// Time of the sender, in nanoseconds since 1970 on the clock of this computer.
    pub sent_ns: i64,
    /// Time of reception.
    pub received_ns: i64,
    /// A value for each field; NaN where the message has none.
    pub values: Vec<f64>,
}

/// State of an autopilot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    /// Name of the mode, for example `GUIDED`.
    pub mode: String,
    /// Whether its actuators are armed.
    pub armed: bool,
}
