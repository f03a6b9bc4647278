//! A reader for each format: `scan(input, sink)` reads the file once.

mod columns;
pub(crate) mod dataflash;
pub(crate) mod foreign;
pub(crate) mod mcap;
pub(crate) mod message;
pub(crate) mod nmea;
mod number;
pub(crate) mod parquet;
mod record;
pub(crate) mod ros1_bag;
pub(crate) mod ros2_sqlite;
mod sqlite;
mod stream;
mod time;
pub(crate) mod ulog;
mod unpack;
pub(crate) mod xlsx;
