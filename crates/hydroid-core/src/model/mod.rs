//! Models: discrete steps `state+ = f(state, c)`, `y = g(state)`. Weights are part of the model, the state is not.

pub mod affine;
pub mod committee;
mod craft;
pub mod direct;
mod persistence;
pub mod recurrent;
pub mod sparse;

pub use craft::{CraftModel, CraftModelError, CraftSession};
pub use persistence::Persistence;
