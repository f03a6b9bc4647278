//! hydroid on shore: reads logs, learns models from them and judges them.
//!
//! The folders are the order of dependence: [`log`] knows nothing of the others,
//! [`excitation`] makes commands, [`simulate`] turns them into logs.

pub mod excitation;
pub mod log;
pub mod simulate;
