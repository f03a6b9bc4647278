//! Recurrent networks: vanilla, GRU and LSTM cells with a linear read-out, in batches or one sequence at a time.

pub(crate) mod batch;
mod batch_rollout;
mod check;
mod gru;
mod layout;
mod lstm;
mod model;
mod network;
mod session;
pub(crate) mod single;
mod vanilla;

pub use batch::{LANES, Rollout, Tape};
pub use check::{Part, RecurrentError};
pub use layout::{GateRow, LayerLayout, Layout};
pub use model::{BaseModel, Recurrent, Scaling};
pub use network::{Cell, Network, NetworkError, Tensor};
pub use session::RecurrentSession;
pub use single::{Blocks, Change, Gradient, LayerPartials, Linearization, Packed};
