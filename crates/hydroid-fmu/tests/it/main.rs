//! Integration tests of the library of FMUs.
#![expect(unsafe_code, reason = "calls of the C interfaces")]

mod archive;
mod calls;
mod co_simulation;
mod exchange;
mod golden;
mod host;
mod models;
#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
mod states;
