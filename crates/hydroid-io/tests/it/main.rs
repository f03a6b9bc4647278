//! Integration tests.

mod dataflash;
mod foreign;
mod golden;
mod hostile;
mod mcap;
mod mcap_writer;
mod nmea;
mod parquet;
mod parquet_write;
mod recorder;
mod ros;
mod ros1_bag;
mod ros2_sqlite;
mod sample;
mod ulog;
mod xlsx;

#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
