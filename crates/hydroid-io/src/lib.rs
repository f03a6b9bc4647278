//! Readers of logs: files of any format as topics of numbers with time stamps; writers of tables
//! ([`write_parquet`]) and of recordings ([`McapWriter`]); types of messages of ROS 2 ([`RosType`]).
//!
//! [`scan`] reads a [`LogFile`], on disk or in memory, once and gives each row to a [`Sink`]. A file is recognised by its
//! content. Damaged parts are left out and stated in [`Summary::losses`].
//!
//! A topic is a kind of message (`/odom`, `GPS`, `vehicle_attitude`, a sheet). Its fields are numbers; nested fields are
//! joined with dots, elements of arrays have brackets: `pose.pose.position.x`, `pwm_us[0]`. Truth values are 0 and 1.
//! Values are those of the file times the scale that the file states; the unit is that of the scaled value.
//!
//! Limits: 1 GB of memory whatever a file claims; [`LONGEST_ARRAY`] elements of an array; longer arrays (images, point
//! clouds) are left out. A part of a file is unpacked by itself, up to 256 MiB. All parts together may unpack to 256
//! MiB and 1,000 bytes for each byte of the file, so the time is bounded by its length; what is beyond is stated as
//! lost. The sheets of a workbook are read as a stream; all of them together are limited to 16 MiB and 100 bytes for
//! each byte of the file, and a workbook with more is an error.
//!
//! Order of the modules, each of which imports only modules before it: `log_file`, `error`, `sink`, `input`, `formats`, `open`.

mod error;
mod formats;
mod input;
mod log_file;
mod open;
mod sink;

pub use error::IoError;
pub use formats::mcap::{McapChannel, McapWriter};
pub use formats::message::schema::RosNumber;
pub use formats::message::shape::{RosShape, RosType};
pub use formats::parquet::write_parquet;
pub use log_file::{LogFile, Stream};
pub use open::{Format, detect, scan};
pub use sink::{Clock, Field, Loss, Sink, Summary, Topic};

/// Elements of an array that become fields; a longer array is left out.
pub const LONGEST_ARRAY: usize = 64;
