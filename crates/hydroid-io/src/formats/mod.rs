//! A reader for each format: `scan(input, sink)` reads the file once.

pub(crate) mod dataflash;
pub(crate) mod mcap;
pub(crate) mod nmea;
pub(crate) mod parquet;
pub(crate) mod ros1_bag;
pub(crate) mod ros2_sqlite;
mod time;
pub(crate) mod ulog;
pub(crate) mod xlsx;
