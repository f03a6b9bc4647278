//! Recording of a live session as MCAP: what the link reports, estimates, predictions, commands and events.
//!
//! A thread of its own writes, so that a slow disk delays nothing. Chunks are written and given to the disk once a second:
//! after a kill, at most the last second is missing. Messages are CDR with `ros2msg` definitions of `float64` fields, which
//! other programs decode, and which [`hydroid::recording`] reads back with the same names and units.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use hydroid_io::{McapChannel, McapWriter};

use crate::link::Topic;

/// Messages that wait for the disk; more are left out, and counted.
const WAITING: usize = 10_000;

/// Time between writes.
const FLUSH: Duration = Duration::from_secs(1);

/// What the recorder has to say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Messages that were left out, because the disk was full or too slow.
    pub lost: u64,
    /// The present trouble, for people; empty if there is none.
    pub trouble: String,
}

/// A number of a channel of the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channel(u16);

enum Item {
    Numbers { channel: Channel, logged_ns: i64, sent_ns: i64, values: Vec<f64> },
    Message { channel: Channel, logged_ns: i64, sent_ns: i64, bytes: Vec<u8> },
    Text { logged_ns: i64, text: String },
    End,
}

/// A recording that is being written.
pub struct Recorder {
    path: PathBuf,
    sender: SyncSender<Item>,
    health: Arc<Mutex<Health>>,
    thread: Option<JoinHandle<io::Result<()>>>,
}

/// Name of a message in the form of ROS: `GpsRawInt` of `GPS_RAW_INT`.
fn camel(name: &str) -> String {
    let capital = |part: &str| {
        let mut letters = part.chars();
        let first = letters.next().map(|c| c.to_ascii_uppercase());
        first.into_iter().chain(letters.map(|c| c.to_ascii_lowercase())).collect::<String>()
    };
    name.split(|c: char| !c.is_ascii_alphanumeric()).map(capital).collect()
}

impl Recorder {
    /// Creates a file with the topics of a link and others; the channels have their order. Events are texts of the topic
    /// `/events`.
    ///
    /// # Errors
    /// If the file exists or cannot be written.
    pub fn create(path: &Path, topics: &[Topic]) -> io::Result<(Self, Vec<Channel>)> {
        let mut writer = McapWriter::create(path, concat!("hydroid ", env!("CARGO_PKG_VERSION")))?;
        let mut channels = Vec::with_capacity(topics.len());
        for topic in topics {
            let line = |field: &crate::link::Field| match field.unit {
                "" => format!("float64 {}", field.name),
                unit => format!("float64 {} # {unit}", field.name),
            };
            let definition = topic.fields.iter().map(line).collect::<Vec<_>>().join("\n");
            let units: Vec<(&str, &str)> = topic
                .fields
                .iter()
                .filter(|field| !field.unit.is_empty())
                .map(|f| (f.name, f.unit))
                .collect();
            let (name, definition) = match &topic.messages {
                Some(message) => (message.name.to_owned(), message.text.to_owned()),
                None => (format!("hydroid_msgs/msg/{}", camel(topic.name)), definition),
            };
            channels.push(Channel(writer.channel(&McapChannel {
                topic: topic.name,
                encoding: "cdr",
                schema: &name,
                schema_encoding: "ros2msg",
                definition: &definition,
                units: if topic.messages.is_some() { &[] } else { &units },
            })?));
        }
        let events = writer.channel(&McapChannel {
            topic: "/events",
            encoding: "cdr",
            schema: "std_msgs/msg/String",
            schema_encoding: "ros2msg",
            definition: "string data",
            units: &[],
        })?;
        writer.flush()?;
        let (sender, receiver) = sync_channel(WAITING);
        let health = Arc::new(Mutex::new(Health::default()));
        let told = Arc::clone(&health);
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || write(writer, events, &receiver, &told))?;
        Ok((Self { path: path.to_owned(), sender, health, thread: Some(thread) }, channels))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Losses and trouble so far.
    pub fn health(&self) -> Health {
        self.health.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub fn numbers(&self, channel: Channel, logged_ns: i64, sent_ns: i64, values: Vec<f64>) {
        self.send(Item::Numbers { channel, logged_ns, sent_ns, values });
    }

    /// Records a message: CDR with its encapsulation.
    pub fn message(&self, channel: Channel, logged_ns: i64, sent_ns: i64, bytes: Vec<u8>) {
        self.send(Item::Message { channel, logged_ns, sent_ns, bytes });
    }

    pub fn text(&self, logged_ns: i64, text: &str) {
        self.send(Item::Text { logged_ns, text: text.to_owned() });
    }

    fn send(&self, item: Item) {
        if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) = self.sender.try_send(item) {
            self.health.lock().unwrap_or_else(PoisonError::into_inner).lost += 1;
        }
    }

    /// Closes the file.
    ///
    /// # Errors
    /// If its end cannot be written; it can be read all the same.
    pub fn finish(mut self) -> io::Result<()> {
        // The disk may be slow, and the queue full: its end waits.
        let _ = self.sender.send(Item::End);
        let Some(thread) = self.thread.take() else { return Ok(()) };
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the recorder has failed")))
    }
}

/// CDR in little endian, with the encapsulation in front.
const HEAD: [u8; 4] = [0, 1, 0, 0];

fn write(
    mut writer: McapWriter,
    events: u16,
    items: &Receiver<Item>,
    health: &Mutex<Health>,
) -> io::Result<()> {
    let mut data = Vec::new();
    let mut due = Instant::now() + FLUSH;
    let mut unwritten = 0;
    loop {
        let item = items.recv_timeout(due.saturating_duration_since(Instant::now()));
        let nanoseconds = |ns: i64| u64::try_from(ns).unwrap_or(0);
        data.clear();
        data.extend(HEAD);
        let written = match item {
            Ok(Item::Numbers { channel: Channel(channel), logged_ns, sent_ns, values }) => {
                for value in &values {
                    data.extend(value.to_le_bytes());
                }
                unwritten += 1;
                writer.message(channel, nanoseconds(logged_ns), nanoseconds(sent_ns), &data)
            }
            Ok(Item::Message { channel: Channel(channel), logged_ns, sent_ns, bytes }) => {
                unwritten += 1;
                writer.message(channel, nanoseconds(logged_ns), nanoseconds(sent_ns), &bytes)
            }
            Ok(Item::Text { logged_ns, text }) => {
                // The length contains the zero at the end.
                data.extend((u32::try_from(text.len()).unwrap_or(u32::MAX - 1) + 1).to_le_bytes());
                data.extend(text.bytes());
                data.push(0);
                unwritten += 1;
                writer.message(events, nanoseconds(logged_ns), nanoseconds(logged_ns), &data)
            }
            Ok(Item::End) | Err(RecvTimeoutError::Disconnected) => return writer.finish(),
            Err(RecvTimeoutError::Timeout) => Ok(()),
        };
        let flushed = if Instant::now() >= due {
            due = Instant::now() + FLUSH;
            writer.flush().and_then(|()| writer.sync()).map(|()| true)
        } else {
            Ok(false)
        };
        let mut health = health.lock().unwrap_or_else(PoisonError::into_inner);
        match written.and(flushed) {
            Err(error) => {
                health.lost += std::mem::take(&mut unwritten);
                health.trouble = error.to_string();
            }
            Ok(true) => {
                unwritten = 0;
                health.trouble.clear();
            }
            Ok(false) => {}
        }
    }
}
