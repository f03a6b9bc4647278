//! Recurrent networks: vanilla, GRU and LSTM cells with a linear read-out; walked in batches by [`Tape`] (forward and back
//! through time) and [`Rollout`] (forward only).

mod batch;
mod gru;
mod lstm;
mod model;
mod network;
mod vanilla;

pub use batch::{LANES, Rollout, Tape};
pub use model::{Base, Recurrent, Scaling};
pub use network::{Cell, Network, NetworkError, Tensor};
