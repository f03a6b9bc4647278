//! Errors of reading: place, cause and remedy.

use std::io;

/// Error of a file. A damaged part of a file is not an error but a [`Loss`](crate::Loss).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say what the variants and fields are")]
pub enum IoError {
    #[error("{path} cannot be read: {source}")]
    Read {
        /// File as it was named.
        path: String,
        source: io::Error,
    },
    #[error("{path} is empty; was the recording stopped before anything was written?")]
    Empty { path: String },
    #[error(
        "{path} has none of the known formats (MCAP, ROS 1 bag, SQLite bag of ROS 2, ArduPilot DataFlash, PX4 ULog, NMEA 0183, Parquet, XLSX); convert it to one of them or to CSV"
    )]
    Unknown { path: String },
    #[error("{path} is {what}, which hydroid does not read; {remedy}")]
    NotRead { path: String, what: &'static str, remedy: &'static str },
    /// The file has the format, but nothing of it can be read.
    #[error("{path}, byte {offset}: {reason}; {remedy}")]
    Damaged {
        path: String,
        /// Place of the damage.
        offset: u64,
        reason: String,
        remedy: String,
    },
    #[error("interrupted")]
    Interrupted,
}
