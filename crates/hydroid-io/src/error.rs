//! Errors of reading: place, cause and remedy.

use std::io;

/// Error of a file. A damaged part of a file is not an error but a [`Loss`](crate::Loss).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// The operating system refuses.
    #[error("{path} cannot be read: {source}")]
    Read {
        /// File as it was named.
        path: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file has no content.
    #[error("{path} is empty; was the recording stopped before anything was written?")]
    Empty {
        /// File.
        path: String,
    },
    /// The content is of none of the known formats.
    #[error(
        "{path} has none of the known formats (MCAP, ROS 1 bag, SQLite bag of ROS 2, ArduPilot DataFlash, PX4 ULog, NMEA 0183, Parquet, XLSX); convert it to one of them or to CSV"
    )]
    Unknown {
        /// File.
        path: String,
    },
    /// The file has the format, but nothing of it can be read.
    #[error("{path}, byte {offset}: {reason}; {remedy}")]
    Damaged {
        /// File.
        path: String,
        /// Place of the damage.
        offset: u64,
        /// What is wrong.
        reason: String,
        /// What can be done.
        remedy: String,
    },
    /// The caller stopped the reading.
    #[error("interrupted")]
    Interrupted,
}
