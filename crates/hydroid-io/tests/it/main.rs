//! Integration tests.

mod dataflash;
mod nmea;
mod recorder;
mod mcap;
mod ros;
mod ros1_bag;
mod ros2_sqlite;
mod sample;
mod ulog;

#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
