//! The targets.

pub mod blackbox;
pub mod checkpoint;
pub mod config;
pub mod csv_log;
pub mod expression;
pub mod model_file;
pub mod recording;
pub mod stream;
pub mod stream_state;
pub mod vessel_file;
pub mod waypoints;
