//! Integration tests.

mod parquet;
mod sample;
mod tables;
mod xlsx;

#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
