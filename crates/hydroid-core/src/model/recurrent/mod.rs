//! Recurrent networks: vanilla, GRU and LSTM cells with a linear read-out.

mod batch;
mod check;
mod gru;
mod layout;
mod lstm;
mod model;
mod network;
mod session;
mod single;
mod vanilla;

pub use batch::{LANES, Rollout, Tape};
pub use check::{Part, RecurrentError};
pub use layout::{GateRow, LayerLayout, Layout};
pub use model::{Base, Recurrent, Scaling, StateFilter};
pub use network::{Cell, Network, NetworkError, Tensor};
pub use session::RecurrentSession;
pub use single::Packed;
