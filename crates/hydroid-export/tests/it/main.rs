//! Tests of the exported formats.

mod c;
mod casadi;
mod coefficients;
mod models;
mod names;
mod onnx;
mod run;
mod state_space;
