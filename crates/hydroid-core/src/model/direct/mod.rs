//! The direct predictor: a feed-forward network from the past of a run and the commands to come to all outputs of a
//! horizon at once; one window at a time in a [`DirectSession`], many side by side in a [`Batch`].

pub(crate) mod batch;
mod batch_rollout;
mod below;
mod check;
mod forward;
mod model;
mod perceptron;
mod session;
pub(crate) mod through;
mod window;

pub use batch::Batch;
pub use check::DirectError;
pub use model::Direct;
pub use perceptron::Perceptron;
pub use session::DirectSession;
pub(crate) use through::Through;
pub(crate) use window::{Window, push};
