//! Integration tests of the node.

#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;

mod commander;
mod names;
mod values;
