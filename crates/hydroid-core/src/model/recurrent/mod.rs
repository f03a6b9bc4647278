//! Recurrent networks: vanilla, GRU and LSTM cells with a linear read-out.

mod model;
mod network;

pub use model::{Base, Recurrent, Scaling};
pub use network::{Cell, Network, NetworkError, Tensor};
