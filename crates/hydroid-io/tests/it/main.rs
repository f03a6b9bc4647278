//! Integration tests.

mod mcap;
mod ros;
mod ros1_bag;
mod ros2_sqlite;
mod sample;

#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
