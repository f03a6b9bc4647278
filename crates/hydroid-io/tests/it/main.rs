//! Integration tests.

mod mcap;
mod ros;
mod sample;

#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
