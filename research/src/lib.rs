//! What the programs of `src/bin` share.

pub mod guard;
pub mod sets;
