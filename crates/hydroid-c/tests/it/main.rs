//! Integration tests of the C library.
#![expect(unsafe_code, reason = "calls of the C interface")]

mod allocations;
mod along;
mod calls;
mod damage;
mod example;
mod header;
#[path = "../../../hydroid-export/tests/it/models.rs"]
mod models;
#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
mod panics;
mod program;
mod run;
mod simulate;
