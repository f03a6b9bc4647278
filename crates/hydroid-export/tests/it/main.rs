//! Tests of the exported formats.

mod adapter;
mod c;
mod casadi;
mod coefficients;
mod filter;
mod learning;
mod models;
#[path = "../../../hydroid-core/tests/it/module_order.rs"]
mod module_order;
mod names;
mod onnx;
mod run;
mod state_space;
