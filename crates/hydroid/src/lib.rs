//! hydroid on shore: reads logs, learns models from them and judges them.
//!
//! The folders are the order of dependence: [`log`] knows nothing of the others.

pub mod atomic;
pub mod evaluate;
pub mod log;
pub mod model;
pub mod progress;
pub mod sindy;
