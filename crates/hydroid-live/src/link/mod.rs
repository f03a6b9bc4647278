//! Links to a vessel: what its autopilot reports, as rows of topics, and the state of the autopilot.
//!
//! A link names topics and fields as a recording does ([`hydroid::recording`]): the sensors and commands that a
//! configuration selects from a recording are selected from a link in the same way.

pub mod mavlink;

use std::io;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

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
    pub fields: &'static [Field],
    /// Its messages, if a recording has them instead of the fields.
    pub messages: Option<Definition>,
}

/// A type of messages of ROS 2 in the encoding CDR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Definition {
    /// Name, for example `nav_msgs/msg/Odometry`.
    pub name: &'static str,
    /// Its definition and those of its parts, as `ros2msg` of MCAP.
    pub text: &'static str,
}

/// A field of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    pub name: &'static str,
    /// Unit of the values; empty for pure numbers.
    pub unit: &'static str,
}

/// What a link reports.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A row of a topic.
    Row(Row),
    /// The message of the row before, for the recording.
    Message {
        /// Index of the topic.
        topic: usize,
        /// Time of the sender, in nanoseconds since 1970 on the clock of this computer.
        sent_ns: i64,
        /// Time of reception.
        received_ns: i64,
        /// CDR with its encapsulation.
        bytes: Vec<u8>,
    },
    /// The autopilot was found: its name for people.
    Found(String),
    /// Mode and arming of the autopilot have changed.
    State(State),
    /// The autopilot says something.
    Text {
        /// Whether it is a warning or an error.
        warning: bool,
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

/// What the helm of a link has done.
#[derive(Clone, Debug, PartialEq)]
pub enum HelmEvent {
    /// A command was sent, as a row of a topic.
    Sent(Row),
    /// Commands have ended, for this reason. They begin again by [`Link::begin`] only.
    HandsOff(String),
}

/// An input of the model as a command: topic and field where its values go, which are those of the field.
pub type Axis = crate::Axis<[usize; 2]>;

/// Clock of the sender against that of this computer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClockState {
    /// Drift since the first exchange \[s\].
    pub offset_s: Option<f64>,
    /// Time of an exchange there and back \[ns\].
    pub round_trip_ns: Option<i64>,
}

/// The vessel at the other end, as a protocol without input, output or clock: it takes messages with their times, and gives
/// events and messages to be sent.
///
/// Its helm sends commands between [`begin`](Self::begin) and [`release`](Self::release), while its conditions hold. What is
/// decided is sent by the next [`tick_helm`](Self::tick_helm), which is due 20 times per second.
pub trait Link {
    /// What is received and sent.
    type Message;

    fn topics(&self) -> &[Topic];

    /// Limits of a field as a command, where none are stated.
    ///
    /// # Errors
    /// If the field cannot be commanded: the reason, and what to select instead.
    fn limits(&self, place: [usize; 2]) -> Result<Option<[f64; 2]>, String>;

    /// States what is used: topics, and inputs as commands, or why there can be none. It is called once, at the start.
    fn prepare(&mut self, topics: &[usize], axes: Result<Vec<Axis>, String>);

    /// The clock of the sender.
    fn clock(&self) -> ClockState;

    fn receive(
        &mut self,
        message: &Self::Message,
        received_ns: i64,
        now_ns: i64,
        tell: &mut dyn FnMut(Event),
    );

    /// Sends what the protocol needs, and tells what no message tells, such as the loss of the link.
    fn tick(&mut self, now_ns: i64, send: &mut dyn FnMut(Self::Message), tell: &mut dyn FnMut(Event));

    /// Sends the commands that are due, or their release.
    fn tick_helm(&mut self, now_ns: i64, send: &mut dyn FnMut(Self::Message));

    /// Name of the mode in which inputs are commands; `None` if they always are.
    fn required_mode(&self) -> Option<&str>;

    /// Why there can be no commands with these settings.
    fn impossible(&self) -> Option<&str>;

    /// Why commands cannot begin now; none if they can.
    fn refusals(&self, now_ns: i64) -> Vec<String>;

    /// Whether commands are sent.
    fn is_commanding(&self) -> bool;

    /// Begins with the neutral command.
    ///
    /// # Errors
    /// If there are [`refusals`](Self::refusals).
    fn begin(&mut self, now_ns: i64) -> Result<(), Vec<String>>;

    /// Takes a command: a value for each axis.
    fn command(&mut self, values: &[f64], now_ns: i64);

    fn release(&mut self, now_ns: i64, reason: &str);

    /// The next event of the helm. Take all of them.
    fn take_event(&mut self) -> Option<HelmEvent>;
}

/// Where the messages of a link come from and go to.
pub trait Port {
    /// What is received and sent.
    type Message;

    /// The next message with the time of its reception, or none within a time.
    fn next(&mut self, within: Duration) -> io::Result<Option<(Self::Message, i64)>>;

    /// Sends a message.
    fn send(&mut self, message: &Self::Message) -> io::Result<()>;

    /// Accepts another address from now on, after the loss of the link.
    fn forget_peer(&self) {}

    /// Numbers of messages that could not be understood, and that were left out because they were not taken in time.
    fn losses(&self) -> [u64; 2];
}
