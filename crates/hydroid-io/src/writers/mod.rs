//! Writers of files.

mod mcap;

pub use mcap::{McapChannel, McapWriter};
