//! Recognition of a format by its content.

use crate::error::IoError;
use crate::formats;
use crate::input::Input;
use crate::log_file::LogFile;
use crate::sink::{Sink, Summary};

/// Format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// MCAP.
    Mcap,
    /// ROS 1 bag, version 2.0.
    Ros1Bag,
    /// SQLite file of a ROS 2 bag.
    Ros2Sqlite,
    /// ArduPilot DataFlash log.
    DataFlash,
    /// PX4 ULog.
    ULog,
    /// NMEA 0183.
    Nmea,
    /// Parquet.
    Parquet,
    /// Excel workbook.
    Xlsx,
}

impl Format {
    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mcap => "MCAP",
            Self::Ros1Bag => "ROS 1 bag",
            Self::Ros2Sqlite => "ROS 2 bag (SQLite)",
            Self::DataFlash => "ArduPilot DataFlash",
            Self::ULog => "PX4 ULog",
            Self::Nmea => "NMEA 0183",
            Self::Parquet => "Parquet",
            Self::Xlsx => "XLSX",
        }
    }
}

/// Format of a file by its content; `None` if it has none of the formats.
///
/// # Errors
/// If the file is empty or cannot be read.
pub fn detect(source: impl Into<LogFile>) -> Result<Option<Format>, IoError> {
    recognise(&mut Input::open(source.into())?)
}

fn recognise(input: &mut Input) -> Result<Option<Format>, IoError> {
    let path = input.path().to_owned();
    let head = input.window(64 << 10)?;
    if head.is_empty() {
        return Err(IoError::Empty { path });
    }
    let begins = |magic: &[u8]| head.starts_with(magic);
    Ok(if begins(b"\x89MCAP0\r\n") {
        Some(Format::Mcap)
    } else if begins(b"#ROSBAG V2.0") {
        Some(Format::Ros1Bag)
    } else if begins(b"SQLite format 3\0") {
        Some(Format::Ros2Sqlite)
    } else if begins(b"ULog\x01\x12\x35") {
        Some(Format::ULog)
    } else if begins(b"PAR1") {
        Some(Format::Parquet)
    } else if begins(b"PK\x03\x04") {
        Some(Format::Xlsx)
    } else if formats::dataflash::begins(head) {
        Some(Format::DataFlash)
    } else if formats::nmea::begins(head) {
        Some(Format::Nmea)
    } else if let Some((what, remedy)) = formats::foreign::named(head) {
        return Err(IoError::NotRead { path, what, remedy });
    } else {
        None
    })
}

/// Reads a file once and gives its rows to a sink.
///
/// # Errors
/// If nothing of the file can be read, its format is unknown, or the sink stops the reading. Damaged parts are in the
/// summary.
pub fn scan(source: impl Into<LogFile>, sink: &mut dyn Sink) -> Result<Summary, IoError> {
    let mut input = Input::open(source.into())?;
    let Some(format) = recognise(&mut input)? else {
        return Err(IoError::Unknown { path: input.path().to_owned() });
    };
    let read = match format {
        Format::Mcap => formats::mcap::scan,
        Format::Ros1Bag => formats::ros1_bag::scan,
        Format::Ros2Sqlite => formats::ros2_sqlite::scan,
        Format::DataFlash => formats::dataflash::scan,
        Format::ULog => formats::ulog::scan,
        Format::Nmea => formats::nmea::scan,
        Format::Parquet => formats::parquet::scan,
        Format::Xlsx => formats::xlsx::scan,
    };
    read(&mut input, sink)
}
