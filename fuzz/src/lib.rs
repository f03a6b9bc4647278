//! Fuzz targets: one function for each format that is read from outside.
//!
//! A target repairs the sums and sizes of its container, so that changed content reaches the reader, and then uses what
//! was read: samples, rollouts, an evaluation, the written form. It panics on a finding.
//!
//! | module | content |
//! | --- | --- |
//! | `targets` | the targets |
//! | [`live`] | streams of these models, and the properties of their answers |
//! | [`models`] | small models of every kind, which streams and recordings refer to by name |
//! | [`repair`] | sums and sizes of containers |
//! | [`mutate`] | changes of values inside a format |
//! | `exercise` | use of a model |

mod exercise;
pub mod live;
pub mod models;
pub mod mutate;
pub mod repair;
mod scratch;
pub mod targets;

pub use targets::blackbox::blackbox;
pub use targets::checkpoint::checkpoint;
pub use targets::config::config;
pub use targets::csv_log::csv_log;
pub use targets::expression::expression;
pub use targets::model_file::model_file;
pub use targets::recording::recording;
pub use targets::stream::stream;
pub use targets::stream_state::stream_state;
pub use targets::vessel_file::vessel_file;
pub use targets::waypoints::waypoints;

/// A target.
pub type Target = fn(&[u8]);

/// All targets by name.
pub const TARGETS: [(&str, Target); 11] = [
    ("blackbox", blackbox),
    ("checkpoint", checkpoint),
    ("config", config),
    ("csv_log", csv_log),
    ("expression", expression),
    ("model_file", model_file),
    ("recording", recording),
    ("stream", stream),
    ("stream_state", stream_state),
    ("vessel_file", vessel_file),
    ("waypoints", waypoints),
];
