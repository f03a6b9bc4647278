//! What a reader gives: topics, rows, and a summary.

use std::collections::BTreeMap;

/// Clock of the stamps of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Nanoseconds since 1970-01-01 UTC, without leap seconds.
    Utc,
    /// Nanoseconds on a clock of the device, mostly since its start; [`Summary::utc_offset_ns`] converts them where it is
    /// known.
    Boot,
    /// Nanoseconds on a clock of unknown origin: rows without a time are numbered.
    None,
}

/// A topic. A reader states it before its first row, and again whenever fields have been added at the end.
#[derive(Clone, Debug, PartialEq)]
pub struct Topic {
    /// Name, for example `/odom`, `GPS`, `GPS[1]`, `vehicle_attitude`.
    pub name: String,
    /// Type of its messages as the file names it; empty if it has none.
    pub type_name: String,
    /// Clock of its rows.
    pub clock: Clock,
    /// Its fields.
    pub fields: Vec<Field>,
    /// First values of the fields that are texts, with their names.
    pub texts: Vec<(String, String)>,
}

/// A field of a topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Path in the message, for example `pose.pose.position.x`.
    pub name: String,
    /// Unit of the values that the reader gives, as the file writes it.
    pub unit: Option<String>,
}

/// Receiver of the rows of a file.
pub trait Sink {
    /// A topic, or more fields of one. Topics are numbered from 0 in the order of their first statement. The answer is
    /// whether its rows are wanted: a reader skips the others as cheaply as its format allows.
    fn topic(&mut self, id: usize, topic: &Topic) -> bool;

    /// A row: its stamp, that of its reception if the file has both, and a value for each field; NaN where the message
    /// has none. `stamp_ns` is that of the sender (`header.stamp`) where there is one.
    fn row(&mut self, id: usize, stamp_ns: i64, received_ns: Option<i64>, values: &[f64]);

    /// Called after each MB, where a format has larger parts after each of them. Reading stops with [`IoError::Interrupted`](crate::IoError) if the answer is false.
    fn proceed(&mut self, _done: u64, _total: u64) -> bool {
        true
    }
}

/// A part of a file that could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loss {
    /// First byte of the part, in the file.
    pub offset: u64,
    /// Its length; 0 where it is unknown.
    pub bytes: u64,
    /// What is wrong, for example "the chunk ends behind the end of the file".
    pub reason: String,
}

/// What is known after reading.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Parts that could not be read, at most [`Summary::LISTED`] of them, in the order of reading.
    pub losses: Vec<Loss>,
    /// Number of all losses.
    pub lost_parts: u64,
    /// Bytes of all losses.
    pub lost_bytes: u64,
    /// UTC minus time since the start of the device \[ns\], for topics with [`Clock::Boot`].
    pub utc_offset_ns: Option<i64>,
    /// Parameters of the device, such as `SERVO1_FUNCTION`.
    pub parameters: BTreeMap<String, f64>,
    /// What a user should know: topics that cannot be decoded and why, fields that are left out.
    pub notes: Vec<String>,
}

impl Summary {
    /// Losses that are listed.
    pub const LISTED: usize = 100;

    /// Adds a loss. A part that follows the one before with the same reason extends it.
    pub fn lose(&mut self, offset: u64, bytes: u64, reason: &str) {
        self.lost_bytes = self.lost_bytes.saturating_add(bytes);
        let all_listed = self.lost_parts == self.losses.len() as u64;
        if let Some(last) = self.losses.last_mut()
            && all_listed
            && last.reason == reason
            && last.offset.saturating_add(last.bytes) == offset
        {
            last.bytes = last.bytes.saturating_add(bytes);
            return;
        }
        self.lost_parts += 1;
        if self.losses.len() < Self::LISTED {
            self.losses.push(Loss { offset, bytes, reason: reason.to_owned() });
        }
    }

    /// Adds a note once.
    pub fn note(&mut self, note: impl Into<String>) {
        let note = note.into();
        if self.notes.len() < Self::LISTED && !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }
}
