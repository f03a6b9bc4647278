//! Integration tests.

mod dataflash;
mod nmea;
mod recorder;
mod sample;
mod ulog;

#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
