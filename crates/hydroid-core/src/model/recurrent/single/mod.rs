//! One sequence at a time, as on board: a step of the network, and its derivatives.

mod gru;
mod lstm;
mod packed;
mod vanilla;

pub use packed::Packed;
