//! Logs of a vessel: what was measured and commanded, on a regular clock.

mod trajectory;

pub use trajectory::{Channel, Table, Trajectory};
