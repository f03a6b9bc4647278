//! The direct predictor: a feed-forward network from the past of a run and the future commands to all outputs of a
//! horizon at once; a [`DirectSession`] computes one window at a time, a [`Batch`] many side by side.

mod base_rollout;
pub(crate) mod batch;
mod batch_rollout;
mod check;
pub(crate) mod forward_pass;
mod model;
mod perceptron;
mod rollout;
mod session;
mod window;

pub use batch::Batch;
pub use check::DirectError;
pub(crate) use forward_pass::ForwardPass;
pub use model::Direct;
pub use perceptron::Perceptron;
pub use session::DirectSession;
pub(crate) use window::{Window, push};
